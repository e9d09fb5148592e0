//! How many updates per second does each gradient backend make, and what is their ratio?
//!
//! Both backends take turns in one process, and the order changes every round, so a change of the
//! machine's load meets both. Run it on an idle machine:
//!
//! ```sh
//! cargo bench --profile release --workspace --bench backends -- --rounds 15
//! ```
//!
//! Without `--bench`, as in `cargo test --benches`, it makes one short round.

#![allow(clippy::disallowed_methods, reason = "a bench is a command: it reads its arguments and the clock")]

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use sharp_rl::{Batch, EnvironmentSpec, GradientBackend, Sac, SacSettings, SacState, Stream};

/// The lengths of an option's vectors in the guide's frame.
const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 51, action_len: 2 };
/// Width of both hidden layers, batch, and updates of one backend in one round (about half a second).
const SIZES: [(usize, usize, u32); 2] = [(256, 256, 100), (64, 128, 1_000)];
const BACKENDS: [GradientBackend; 2] = [GradientBackend::Fused, GradientBackend::Burn];
const ROUNDS: usize = 15;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut pairs = arguments.windows(2).filter(|pair| pair[0] == "--rounds");
    let rounds = pairs.next().map_or(ROUNDS, |pair| pair[1].parse().expect("--rounds takes a number"));
    let is_bench = arguments.iter().any(|argument| argument == "--bench");
    println!(
        "| hidden | batch | by hand, updates/s | burn, updates/s | ratio of medians | ratios of rounds |"
    );
    println!("|---|---|---|---|---|---|");
    for (width, batch, updates) in SIZES {
        if is_bench {
            compare(width, batch, updates, rounds);
        } else {
            compare(width, batch, 2, 1);
        }
    }
}

/// Prints one line of the table.
fn compare(width: usize, batch: usize, updates: u32, rounds: usize) {
    let mut runs = BACKENDS.map(|backend| Updates::new(backend, width, batch));
    let mut rates = [Vec::new(), Vec::new()];
    for run in &mut runs {
        run.rate(updates.div_ceil(10)); // Warms up caches and allocations.
    }
    for round in 0..rounds {
        for turn in 0..2 {
            let index = (round + turn) % 2;
            rates[index].push(runs[index].rate(updates));
        }
    }
    let mut ratios: Vec<f64> = rates[0].iter().zip(&rates[1]).map(|(hand, burn)| hand / burn).collect();
    let [hand, burn] = rates.each_mut().map(|rates| median(rates));
    median(&mut ratios);
    let (low, high) = (ratios[0], ratios[ratios.len() - 1]);
    println!("| 2x{width} | {batch} | {hand:.0} | {burn:.0} | {:.2} | {low:.2} to {high:.2} |", hand / burn);
}

/// Sorts `values` and returns the middle one.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// One backend with networks and batches of its own, equal for both.
struct Updates {
    sac: Sac,
    state: SacState,
    batches: Vec<Batch>,
}

impl Updates {
    fn new(backend: GradientBackend, width: usize, batch: usize) -> Self {
        let mut settings = SacSettings::default();
        (settings.hidden, settings.batch) = (vec![width, width], batch);
        let mut rng = Stream::seed_from_u64(1);
        let state = SacState::new(SPEC, &settings, &mut rng);
        let batches = (0..8).map(|_| random_batch(batch, &mut rng)).collect();
        Self { sac: Sac::new(SPEC, &settings, backend), state, batches }
    }

    /// Makes `updates` updates; returns updates per second.
    fn rate(&mut self, updates: u32) -> f64 {
        let begun = Instant::now();
        for index in 0..updates as usize {
            self.sac.update(&mut self.state, &self.batches[index % self.batches.len()]);
        }
        let rate = f64::from(updates) / begun.elapsed().as_secs_f64();
        assert!(self.state.is_finite(), "weights after the updates");
        rate
    }
}

fn random_batch(len: usize, rng: &mut Stream) -> Batch {
    let mut batch = Batch::new(SPEC, len);
    for values in [
        &mut batch.observations,
        &mut batch.next_observations,
        &mut batch.rewards,
        &mut batch.noise,
        &mut batch.next_noise,
    ] {
        values.fill_with(|| rng.sample(StandardNormal));
    }
    batch.actions.fill_with(|| rng.random_range(-1.0..1.0));
    batch.discounts.fill_with(|| if rng.random_bool(0.05) { 0.0 } else { 0.99 });
    batch
}

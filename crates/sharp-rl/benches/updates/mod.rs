//! What the benches of updates share.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use sharp_rl::{Batch, EnvironmentSpec, GradientBackend, Sac, SacSettings, SacState, Stream};

/// How many rounds are wanted, `usual` without `--rounds N`; `None` where this is no bench but a test.
pub(crate) fn rounds(usual: usize) -> Option<usize> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut pairs = arguments.windows(2).filter(|pair| pair[0] == "--rounds");
    let rounds = pairs.next().map_or(usual, |pair| pair[1].parse().expect("--rounds takes a number"));
    arguments.iter().any(|argument| argument == "--bench").then_some(rounds)
}

/// Sorts `values` and returns the middle one.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// One backend with networks and batches of its own, equal for all.
pub(crate) struct Updates {
    sac: Sac,
    state: SacState,
    batches: Vec<Batch>,
}

impl Updates {
    pub(crate) fn new(
        backend: GradientBackend,
        spec: EnvironmentSpec,
        (width, batch): (usize, usize),
    ) -> Self {
        let mut settings = SacSettings::default();
        (settings.hidden, settings.batch) = (vec![width, width], batch);
        let mut rng = Stream::seed_from_u64(1);
        let state = SacState::new(spec, &settings, &mut rng);
        let batches = (0..8).map(|_| random_batch(spec, batch, &mut rng)).collect();
        Self { sac: Sac::new(spec, &settings, backend), state, batches }
    }

    /// Makes `updates` updates; returns updates per second.
    pub(crate) fn rate(&mut self, updates: u32) -> f64 {
        let begun = Instant::now();
        for index in 0..updates as usize {
            self.sac.update(&mut self.state, &self.batches[index % self.batches.len()]);
        }
        let rate = f64::from(updates) / begun.elapsed().as_secs_f64();
        assert!(self.state.is_finite(), "weights after the updates");
        rate
    }
}

fn random_batch(spec: EnvironmentSpec, len: usize, rng: &mut Stream) -> Batch {
    let mut batch = Batch::new(spec, len);
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

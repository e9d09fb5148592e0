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

mod updates;

use sharp_rl::{EnvironmentSpec, GradientBackend};

use updates::{Updates, median, rounds};

/// The lengths of an option's vectors in the guide's frame.
const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 51, action_len: 2 };
/// Width of both hidden layers, batch, and updates of one backend in one round (about half a second).
const SIZES: [(usize, usize, u32); 2] = [(256, 256, 100), (64, 128, 1_000)];
const BACKENDS: [GradientBackend; 2] = [GradientBackend::Fused, GradientBackend::Burn];
const ROUNDS: usize = 15;

fn main() {
    let rounds = rounds(ROUNDS);
    println!(
        "| hidden | batch | by hand, updates/s | burn, updates/s | ratio of medians | ratios of rounds |"
    );
    println!("|---|---|---|---|---|---|");
    for (width, batch, updates) in SIZES {
        match rounds {
            Some(rounds) => compare(width, batch, updates, rounds),
            None => compare(width, batch, 2, 1),
        }
    }
}

/// Prints one line of the table.
fn compare(width: usize, batch: usize, updates: u32, rounds: usize) {
    let mut runs = BACKENDS.map(|backend| Updates::new(backend, SPEC, (width, batch)));
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

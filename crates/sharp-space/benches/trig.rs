//! Is our trigonometry faster than `libm`'s and the system's?
//!
//! `cargo bench -p sharp-space` prints nanoseconds per call in a loop, each the least of rounds that take turns.

#![allow(clippy::disallowed_methods, reason = "a measurement reads the clock and calls what is compared")]

use std::hint::black_box;
use std::time::Instant;

use sharp_space::trig;

const ROUNDS: usize = 201;
const CALLS: usize = 1 << 12;

fn sum((sin, cos): (f64, f64)) -> f64 {
    sin + cos
}

fn main() {
    // Angles and coordinates from -4 to 4, in no order that a processor could foresee.
    let numbers: Vec<f64> =
        (0..=CALLS).map(|i| 8.0 * (i as f64 * 0.618_033_988_749_895).fract() - 4.0).collect();
    let compare = Compare { numbers };
    compare.run(
        "sin_cos",
        |x, _| sum(trig::sin_cos(x)),
        |x, _| sum(libm::sincos(x)),
        |x, _| sum(x.sin_cos()),
    );
    compare.run("tan", |x, _| trig::tan(x), |x, _| libm::tan(x), |x, _| x.tan());
    compare.run("atan2", trig::atan2, libm::atan2, f64::atan2);
}

/// The numbers that all functions are called with.
struct Compare {
    numbers: Vec<f64>,
}

impl Compare {
    /// Times three functions in turns. Each gets two numbers, of which it may ignore one.
    fn run(
        &self,
        name: &str,
        ours: impl Fn(f64, f64) -> f64,
        libm: impl Fn(f64, f64) -> f64,
        system: impl Fn(f64, f64) -> f64,
    ) {
        let mut times_ns = [const { Vec::new() }; 3];
        for _ in 0..ROUNDS {
            times_ns[0].push(self.time_ns(&ours));
            times_ns[1].push(self.time_ns(&libm));
            times_ns[2].push(self.time_ns(&system));
        }
        let [ours, libm, system] = times_ns.map(least);
        println!("{name:8} ours {ours:5.1} ns, libm {libm:5.1} ns, system {system:5.1} ns");
    }

    fn time_ns(&self, function: &impl Fn(f64, f64) -> f64) -> f64 {
        let begun = Instant::now();
        let total: f64 = self.numbers.windows(2).map(|pair| function(pair[0], pair[1])).sum();
        black_box(total);
        begun.elapsed().as_nanos() as f64 / CALLS as f64
    }
}

/// The least time: whatever else the machine does can only add to it.
fn least(times_ns: Vec<f64>) -> f64 {
    times_ns.into_iter().fold(f64::INFINITY, f64::min)
}

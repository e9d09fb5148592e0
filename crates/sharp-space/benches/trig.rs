//! Is our trigonometry faster than `libm`'s and the system's?
//!
//! `cargo bench -p sharp-space` prints nanoseconds per call, each the median of rounds that take turns.

#![allow(clippy::disallowed_methods, reason = "a measurement reads the clock and calls what is compared")]

use std::hint::black_box;
use std::time::Instant;

use sharp_space::trig;

const ROUNDS: usize = 41;
const CALLS: usize = 1 << 16;

type Function = fn(f64, f64) -> f64;

/// Name, ours, `libm`, the system's library; each gets two numbers of which it may ignore one.
const FUNCTIONS: [(&str, [Function; 3]); 5] = [
    ("sin_cos", [|x, _| sum(trig::sin_cos(x)), |x, _| sum(libm::sincos(x)), |x, _| sum(x.sin_cos())]),
    ("tan", [|x, _| trig::tan(x), |x, _| libm::tan(x), |x, _| x.tan()]),
    ("atan2", [trig::atan2, libm::atan2, f64::atan2]),
    ("acos", [|x, _| trig::acos(x / 4.0), |x, _| libm::acos(x / 4.0), |x, _| (x / 4.0).acos()]),
    ("sin", [|x, _| trig::sin(x), |x, _| libm::sin(x), |x, _| x.sin()]),
];

fn sum((sin, cos): (f64, f64)) -> f64 {
    sin + cos
}

fn main() {
    // Angles and coordinates from -4 to 4, in no order that a processor could foresee.
    let numbers: Vec<f64> =
        (0..=CALLS).map(|i| 8.0 * (i as f64 * 0.618_033_988_749_895).fract() - 4.0).collect();
    for (name, functions) in FUNCTIONS {
        let mut times_ns = [const { Vec::new() }; 3];
        for _ in 0..ROUNDS {
            for (times_ns, function) in times_ns.iter_mut().zip(functions) {
                times_ns.push(time_ns(function, &numbers));
            }
        }
        let [ours, libm, system] = times_ns.map(median);
        println!("{name:8} ours {ours:5.1} ns, libm {libm:5.1} ns, system {system:5.1} ns");
    }
}

fn time_ns(function: Function, numbers: &[f64]) -> f64 {
    let function = black_box(function);
    let begun = Instant::now();
    let total: f64 = numbers.windows(2).map(|pair| function(pair[0], pair[1])).sum();
    black_box(total);
    begun.elapsed().as_nanos() as f64 / CALLS as f64
}

fn median(mut times_ns: Vec<f64>) -> f64 {
    times_ns.sort_by(f64::total_cmp);
    times_ns[times_ns.len() / 2]
}

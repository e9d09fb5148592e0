//! `cargo xtask baselines`: every baseline on every problem under every noise, through `sharp eval`.

use crate::eval;

/// What is measured unless the arguments say otherwise.
const USUAL: [(&str, &str); 3] = [
    ("--methods", "rrt,rrt-contact,track,mppi"),
    ("--noise", "none,nominal,harsh,biased"),
    ("--out", "out/baselines"),
];

/// Runs the suite `quick` with baselines only; goes on where it was and leaves `report/methods.md`.
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    eval::run(&eval::with_usual(args, &[&[("--profile", "quick")][..], &USUAL].concat()))
}

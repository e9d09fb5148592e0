//! Promises held against many cases. `cargo test` tries a few of each; `cargo xtask soak` tries as many as
//! `docs/testing.md` says and prints what came of it.

#![allow(
    clippy::disallowed_methods,
    reason = "a variable says how much to try, and the clock how long it took"
)]

#[path = "../common/checker.rs"]
mod checker;

mod bounds;
mod endurance;
mod mutations;
mod plans;
mod suite;
mod unsolvable;
mod worlds;

use std::time::Instant;

/// How many cases to try: `few`, or the share of `many` that the variable `SHARP_SOAK` says, as in 1 or 0.1.
fn cases(few: u64, many: u64) -> u64 {
    let share = std::env::var("SHARP_SOAK").ok().and_then(|share| share.parse::<f64>().ok());
    share.map_or(few, |share| few.max((many as f64 * share) as u64))
}

/// Says what a promise was held against; `cargo xtask soak` shows it.
fn told(promise: &str, count: u64, found: &str, since: Instant) {
    println!("soak: {promise}: {count} cases, {found}, {:.0} s", since.elapsed().as_secs_f64());
}

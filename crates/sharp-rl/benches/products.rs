//! How near is an update of the paper's networks to what this machine can multiply?
//!
//! Counts the floating-point operations of the matrix products in an update, and times updates, and plain products of the same
//! shapes (256 x 256 by 256 x 256, in the three ways that passes need them), by turns, on one thread and on two at once. Run it on an idle machine:
//!
//! ```sh
//! cargo bench --profile release --workspace --bench products -- --rounds 9
//! ```
//!
//! Without `--bench`, as in `cargo test --benches`, it makes one short round.

#![allow(clippy::disallowed_methods, reason = "a bench is a command: it reads its arguments and the clock")]

mod updates;

use std::time::Instant;

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use sharp_rl::{EnvironmentSpec, GradientBackend, Stream};

use updates::{Updates, median, rounds};

/// The lengths of an option's vectors in the paper's form.
const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 5, action_len: 2 };
const ROUNDS: usize = 9;
/// Width of the hidden layers and batch of the paper.
const SIDE: usize = 256;

fn main() {
    let (rounds, repeats) = rounds(ROUNDS).map_or((1, 1), |rounds| (rounds, 60));
    println!("{:.3} GFLOP in the products of an update", 1e-9 * update_flop());
    println!("| threads | updates/s | GFLOP/s of updates | of plain products | share |");
    println!("|---|---|---|---|---|");
    for threads in [1, 2] {
        let (mut updates, mut products) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            updates.push(at_once(threads, || update_rate(repeats)));
            products.push(at_once(threads, || product_rate(20 * repeats)));
        }
        let (updates, products) = (median(&mut updates), median(&mut products));
        let [update, product] =
            [updates * update_flop(), products * product_flop()].map(|flops| 1e-9 * flops);
        println!("| {threads} | {updates:.0} | {update:.0} | {product:.0} | {:.2} |", update / product);
    }
}

/// The sum of what `rate` says on so many threads.
fn at_once(threads: usize, rate: impl Fn() -> f64 + Sync) -> f64 {
    std::thread::scope(|scope| {
        let running: Vec<_> = (0..threads).map(|_| scope.spawn(&rate)).collect();
        running.into_iter().map(|one| one.join().expect("no panic")).sum()
    })
}

/// Floating-point operations of one product of two square matrices.
fn product_flop() -> f64 {
    2.0 * (SIDE * SIDE * SIDE) as f64
}

/// Those of the products of one update, a multiplication and an addition for each weight and row.
fn update_flop() -> f64 {
    let (observation, action) = (SPEC.observation_len as f64, SPEC.action_len as f64);
    let (side, pair) = (SIDE as f64, 2.0 * SIDE as f64);
    let hidden = side * side;
    let (actor_in, actor_out) = (observation * side, side * 2.0 * action);
    let (critic_in, critic_out) = ((observation + action) * side, side);
    let actor = actor_in + hidden + actor_out;
    let critic = critic_in + hidden + critic_out;
    // Weights of all layers, and what goes back through all but the first.
    let back = |whole: f64, first: f64| whole + (whole - first);
    let targets = actor + 2.0 * critic;
    let critics = 2.0 * (critic + back(critic, critic_in));
    // Each row goes back through one of the critics only, and of its inputs to the action only.
    let through_critic = hidden + critic_out + action * side;
    let policy = actor + 2.0 * critic + through_critic + back(actor, actor_in);
    pair * (targets + critics + policy)
}

/// Updates a second.
fn update_rate(count: u32) -> f64 {
    let mut updates = Updates::new(GradientBackend::Fused, SPEC, (SIDE, SIDE));
    updates.rate(1);
    updates.rate(count)
}

/// Products a second: of two matrices, and with the one or the other transposed, in turn.
fn product_rate(count: u32) -> f64 {
    let mut rng = Stream::seed_from_u64(2);
    let mut matrix = || DMatrix::<f32>::from_fn(SIDE, SIDE, |_, _| rng.random_range(-1.0..1.0));
    let (a, b) = (matrix(), matrix());
    let mut c = matrix();
    let (rows_of_a, rows_of_b) = (a.transpose(), b.transpose());
    let row_major = |m: &DMatrix<f32>| {
        nalgebra::DMatrixView::from_slice_with_strides(m.as_slice(), SIDE, SIDE, SIDE, 1).clone_owned()
    };
    assert!((row_major(&rows_of_a) - &a).norm() < 1e-6, "the same matrix");
    let begun = Instant::now();
    for index in 0..count {
        let strided = |m| nalgebra::DMatrixView::from_slice_with_strides(m, SIDE, SIDE, SIDE, 1);
        match index % 3 {
            0 => c.gemm(1.0, &a, &b, 0.0),
            1 => c.gemm(1.0, &strided(rows_of_a.as_slice()), &b, 0.0),
            _ => c.gemm(1.0, &a, &strided(rows_of_b.as_slice()), 0.0),
        }
    }
    let rate = f64::from(count) / begun.elapsed().as_secs_f64();
    assert!(c.iter().all(|value| value.is_finite()), "a product of finite numbers");
    rate
}

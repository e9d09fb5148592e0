//! Our side of `cargo xtask bench peers learning`, as one JSON object on stdout.
//!
//! `peer_learning updates SECONDS` times gradient steps on a filled buffer, for one learner alone and
//! for two at once, each on one thread. `peer_learning curve SEED` learns the point mass and prints
//! the mean return of every evaluation.

#![allow(
    clippy::disallowed_methods,
    reason = "an example is a command: it reads its arguments and the clock"
)]

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};
use sharp_rl::toy::PointMass;
use sharp_rl::{
    Batch, EnvironmentSpec, Exploration, GradientBackend, ReplayBuffer, ReplayTransition, Sac, SacSettings,
    SacState, SampleSettings, StopRule, Stream, TrainSettings, train,
};

/// The lengths of an option's vectors in the guide's frame.
const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 51, action_len: 2 };
/// Width of both hidden layers, and batch.
const SIZES: [(usize, usize); 2] = [(256, 256), (64, 128)];
const BUFFER: usize = 10_000;
/// Gradient steps between two readings of the clock.
const CHUNK: u32 = 10;

fn main() {
    let usage = "usage: peer_learning updates SECONDS | curve SEED";
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let report = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["updates", seconds] => updates(Duration::from_secs_f64(seconds.parse().expect(usage))),
        ["curve", seed] => curve(seed.parse().expect(usage)),
        _ => panic!("{usage}"),
    };
    println!("{report}");
}

/// Gradient steps per second of all learners together, by sizes and number of learners.
fn updates(time: Duration) -> Value {
    let mut report = json!({ "name": "sharp" });
    for (width, batch) in SIZES {
        for learners in [1, 2] {
            let rate: f64 = std::thread::scope(|scope| {
                let threads: Vec<_> =
                    (0..learners).map(|seed| scope.spawn(move || rate(width, batch, seed, time))).collect();
                threads.into_iter().map(|thread| thread.join().expect("a learner ends")).sum()
            });
            report[format!("{width}x{width}.b{batch}.{learners}")] = json!(rate);
        }
    }
    report
}

/// Gradient steps per second of one learner, drawing the batch included.
fn rate(width: usize, batch: usize, seed: u64, time: Duration) -> f64 {
    let mut settings = SacSettings::default();
    (settings.hidden, settings.batch) = (vec![width, width], batch);
    let mut rng = Stream::seed_from_u64(seed);
    let buffer = filled_buffer(&mut rng);
    let mut state = SacState::new(SPEC, &settings, &mut rng);
    let normaliser = state.actor.normaliser().clone();
    let how = SampleSettings { gamma: settings.gamma, reward_scale: 1.0, normaliser: &normaliser };
    let (mut batch, mut sac) =
        (Batch::new(SPEC, settings.batch), Sac::new(SPEC, &settings, GradientBackend::Fused));
    let mut chunk = || {
        for _ in 0..CHUNK {
            buffer.sample(&how, &mut rng, &mut batch);
            sac.update(&mut state, &batch);
        }
    };
    chunk();
    let (mut count, begun) = (0, Instant::now());
    while count == 0 || begun.elapsed() < time {
        chunk();
        count += CHUNK;
    }
    let rate = f64::from(count) / begun.elapsed().as_secs_f64();
    assert!(state.is_finite(), "weights after the updates");
    rate
}

fn filled_buffer(rng: &mut Stream) -> ReplayBuffer {
    let mut buffer = ReplayBuffer::new(SPEC, BUFFER);
    for _ in 0..BUFFER {
        let mut draw = |len: usize| -> Vec<f32> { (0..len).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (observation, next_observation) = (draw(SPEC.observation_len), draw(SPEC.observation_len));
        let action = draw(SPEC.action_len);
        buffer.push(ReplayTransition {
            observation: &observation,
            action: &action,
            reward: observation[0] + action[1],
            steps: 1,
            next_observation: &next_observation,
            terminated: observation[1] > 0.9,
            truncated: false,
        });
    }
    buffer
}

/// Learns the point mass: mean returns of 30 episodes every 250 steps, and the time it took.
fn curve(seed: u64) -> Value {
    let mut settings = TrainSettings::default();
    settings.sac.hidden = vec![64, 64];
    settings.sac.gamma = 0.97;
    settings.sac.tau = 0.01;
    settings.sac.learning_rate = 1e-3;
    settings.sac.batch = 128;
    settings.sac.buffer_capacity = BUFFER;
    settings.sac.initial_alpha = 0.05;
    settings.sac.target_entropy = Some(-2.0);
    settings.sac.warmup_steps = 500;
    settings.sac.exploration = Exploration::Uniform;
    settings.max_env_steps = 1_500;
    settings.evaluate_every = 250;
    settings.evaluation_episodes = 30;
    settings.stop = StopRule::Never;
    let (mut steps, mut returns) = (Vec::new(), Vec::new());
    let mut rng = Stream::seed_from_u64(seed);
    let begun = Instant::now();
    train(&mut [PointMass::default()], &settings, &mut rng, &mut |progress| {
        if let Some(evaluation) = progress.evaluation {
            steps.push(evaluation.env_steps);
            returns.push(evaluation.mean_return);
        }
        ControlFlow::Continue(())
    })
    .expect("the point mass can be learnt");
    let rate = settings.max_env_steps as f64 / begun.elapsed().as_secs_f64();
    json!({ "name": "sharp", "steps": steps, "returns": returns, "rate": rate })
}

//! A batch of environments of one's own, learnt by proximal policy optimisation: running on ice.

use std::ops::{ControlFlow, Range};

use rand::{RngExt, SeedableRng};
use sharp_rl::conformance::check_batch;
use sharp_rl::{
    ActorScratch, BatchEnvironment, BatchSpec, BatchStep, EnvironmentSpec, FailurePrice, PpoSettings,
    Schedule, SeenBatch, Stream, train_ppo,
};

/// Ten steps over ice. Speed pays, and more speed than the ice allows may end in a fall.
struct Ice(Vec<(Stream, u32)>);

impl BatchEnvironment for Ice {
    fn spec(&self) -> BatchSpec {
        let lengths = EnvironmentSpec { observation_len: 1, action_len: 1 };
        BatchSpec { slots: self.0.len(), lengths, privileged_len: 0 }
    }

    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch) {
        self.0[slot] = (Stream::from_rng(rng), 0);
        seen.observations[slot] = self.0[slot].0.random_range(-1.0..1.0);
    }

    fn step(&mut self, slots: Range<usize>, actions: &[f32], seen: &mut SeenBatch, steps: &mut [BatchStep]) {
        for (slot, (speed, step)) in slots.zip(actions.iter().zip(steps)) {
            let (rng, count) = &mut self.0[slot];
            let failed = rng.random_range(0.0..2.0) < speed - seen.observations[slot];
            *count += 1;
            let terminated = failed || *count == 10;
            *step = BatchStep { reward: *speed, failed, terminated, ..BatchStep::default() };
            seen.observations[slot] = rng.random_range(-1.0..1.0);
        }
    }
}

fn main() {
    let ice = || Ice((0..16).map(|seed| (Stream::seed_from_u64(seed), 0)).collect());
    let mut rng = Stream::seed_from_u64(1);
    assert_eq!(check_batch((&mut ice(), &mut ice()), &mut rng), Ok(()));

    let settings = PpoSettings::default().with(|ppo| {
        ppo.failure_price = FailurePrice { least: 50.0, most: Schedule::constant(50.0) };
        (ppo.max_env_steps, ppo.minibatch, ppo.learning_rate) = (60_000, 256, 1e-3);
    });
    let quiet = &mut |_: &sharp_rl::Progress<'_>| ControlFlow::Continue(());
    let (state, _) = train_ppo(&mut ice(), &settings, &mut rng, quiet).expect("a sound batch");
    for grip in [-0.8, 0.0, 0.8] {
        let mut speed = [0.0];
        state.actor.act_mean(&[grip], &mut ActorScratch::default(), &mut speed);
        assert!((speed[0] - grip).abs() < 0.4, "a speed of {} on ice that allows {grip}", speed[0]);
    }
}

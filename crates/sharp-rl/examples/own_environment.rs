//! An environment of one's own: a cart that must stop at the end of its track, learnt by SAC.

use std::ops::ControlFlow;

use rand::{RngExt, SeedableRng};
use sharp_rl::conformance::check_environment;
use sharp_rl::{Environment, EnvironmentSpec, Learner, SacLearner, Step, StopRule, Stream, TrainSettings};

/// The cart begins anywhere on the track and must come to rest at 0.
#[derive(Clone, Debug, Default)]
struct Cart {
    position_m: f32,
    speed_mps: f32,
    steps: u32,
}

impl Cart {
    const STEP_S: f32 = 0.2;
    const STEPS_MAX: u32 = 40;
}

impl Environment for Cart {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: 2, action_len: 1 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        *self = Self { position_m: rng.random_range(-1.0..1.0), ..Self::default() };
        observation.copy_from_slice(&[self.position_m, self.speed_mps]);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        self.speed_mps += Self::STEP_S * action[0];
        self.position_m += Self::STEP_S * self.speed_mps;
        self.steps += 1;
        observation.copy_from_slice(&[self.position_m, self.speed_mps]);
        let success = self.position_m.abs() < 0.1 && self.speed_mps.abs() < 0.1;
        let truncated = !success && self.steps == Self::STEPS_MAX;
        let reward = if success { 1.0 } else { -0.05 * (self.position_m.abs() + self.speed_mps.abs()) };
        Step { reward, terminated: success, truncated, success }
    }
}

fn main() {
    let mut rng = Stream::seed_from_u64(1);
    assert_eq!(check_environment(&mut Cart::default(), &mut rng), Ok(()));

    let mut settings = TrainSettings::fast();
    settings.sac.hidden = vec![32, 32];
    settings.stop = StopRule::Success { rate: 0.95, episodes: 200 };
    let mut environments: Vec<Box<dyn Environment>> = vec![Box::new(Cart::default())];
    let trained = SacLearner::new(settings)
        .learn(&mut environments, &mut rng, &mut |_| ControlFlow::Continue(()))
        .expect("a sound environment");
    let rate = trained.evaluation.success_rate();
    assert!(rate >= 0.95, "only {rate} after {} steps", trained.env_steps);
}

//! How long does one SAC update take, and how long one decision?
//!
//! The bench `backends` compares the two gradient backends.

use criterion::{Criterion, criterion_group, criterion_main};
use rand::SeedableRng;
use sharp_rl::{
    Actor, ActorScratch, Batch, EnvironmentSpec, GradientBackend, ReplayBuffer, ReplayTransition, Sac,
    SacSettings, SacState, SampleSettings, Stream,
};

/// Lengths like those of an option.
const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 31, action_len: 2 };

fn filled_buffer(rng: &mut Stream) -> ReplayBuffer {
    use rand::RngExt;
    let mut buffer = ReplayBuffer::new(SPEC, 10_000);
    for _ in 0..10_000 {
        let mut draw = |len: usize| -> Vec<f32> { (0..len).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (observation, next_observation, action) = (draw(31), draw(31), draw(2));
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

fn sac_update(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sac_update");
    for width in [64, 256] {
        let mut settings = SacSettings::fast();
        settings.hidden = vec![width, width];
        let mut rng = Stream::seed_from_u64(1);
        let buffer = filled_buffer(&mut rng);
        let mut state = SacState::new(SPEC, &settings, &mut rng);
        let normaliser = state.actor.normaliser().clone();
        let how = SampleSettings { gamma: 0.97, reward_scale: 1.0, normaliser: &normaliser };
        let mut batch = Batch::new(SPEC, settings.batch);
        let mut sac = Sac::new(SPEC, &settings, GradientBackend::Fused);
        group.bench_function(format!("fused/2x{width}/batch_256"), |bencher| {
            bencher.iter(|| {
                buffer.sample(&how, &mut rng, &mut batch);
                sac.update(&mut state, &batch)
            });
        });
        assert!(state.is_finite(), "weights after the bench");
    }
    group.finish();
}

fn actor_decision(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("actor_decision");
    for width in [64, 128, 256] {
        let actor = Actor::new(SPEC, &[width, width], &mut Stream::seed_from_u64(1));
        let (mut scratch, mut action) = (ActorScratch::default(), [0.0; 2]);
        group.bench_function(format!("2x{width}"), |bencher| {
            bencher.iter(|| {
                actor.act_mean(&[0.1; 31], &mut scratch, &mut action);
                action[0]
            });
        });
    }
    group.finish();
}

criterion_group!(benches, sac_update, actor_decision);
criterion_main!(benches);

//! Soft actor-critic (Haarnoja et al. 2018), the algorithm of Sec. 4.3.
//!
//! [`Sac::update`] is one update, in the order of the paper. It takes losses and gradients from a
//! [`GradientBackend`]. Everything that lasts is plain data in [`SacState`], so one backend can
//! continue what the other began.

use serde::{Deserialize, Serialize};

use crate::buffer::Batch;
#[cfg(any(feature = "burn", test))]
use crate::burn_sac::BurnSac;
use crate::environment::EnvironmentSpec;
use crate::fused::FusedSac;
use crate::gradients::{GradientBackend, SacGradients};
use crate::sac_state::SacState;
use crate::settings::SacSettings;

/// Numbers of one update, for learning curves and to detect divergence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct UpdateReport {
    /// Sum of both critics' losses.
    pub critic_loss: f32,
    /// The actor's loss.
    pub actor_loss: f32,
    /// Mean of Q₁ over the batch, in scaled rewards.
    pub mean_q: f32,
    /// Entropy of the policy, nats.
    pub entropy: f32,
    /// The temperature after the update.
    pub alpha: f32,
    /// The temperature's loss.
    pub alpha_loss: f32,
}

impl UpdateReport {
    /// The name of the first number that is NaN or infinite.
    #[must_use]
    pub fn first_not_finite(&self) -> Option<&'static str> {
        let named = [
            ("critic loss", self.critic_loss),
            ("actor loss", self.actor_loss),
            ("entropy", self.entropy),
            ("temperature", self.alpha),
        ];
        named.into_iter().find(|(_, value)| !value.is_finite()).map(|(name, _)| name)
    }
}

/// The update of soft actor-critic with the buffers that it reuses.
#[allow(missing_debug_implementations, reason = "it holds buffers only; the state is in `SacState`")]
pub struct Sac {
    tau: f32,
    learning_rate: f32,
    target_entropy: f32,
    gradients: Box<dyn SacGradients>,
    targets: Vec<f32>,
    critic_gradients: [Vec<f32>; 2],
    actor_gradient: Vec<f32>,
}

impl Sac {
    /// Buffers for updates of networks as `settings` describe them.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, settings: &SacSettings, backend: GradientBackend) -> Self {
        let gradients: Box<dyn SacGradients> = match backend {
            GradientBackend::Fused => Box::new(FusedSac::new(spec, settings)),
            #[cfg(any(feature = "burn", test))]
            GradientBackend::Burn => Box::new(BurnSac::new()),
        };
        Self {
            tau: settings.tau,
            learning_rate: settings.learning_rate,
            target_entropy: settings.target_entropy.unwrap_or(-(spec.action_len as f32)),
            gradients,
            targets: vec![0.0; settings.batch],
            critic_gradients: [Vec::new(), Vec::new()],
            actor_gradient: Vec::new(),
        }
    }

    /// One gradient step of critics, actor and temperature, in this order (Haarnoja et al. 2018).
    ///
    /// # Panics
    /// If the batch or the networks have other sizes than the settings.
    pub fn update(&mut self, state: &mut SacState, batch: &Batch) -> UpdateReport {
        self.fit_gradients(state);
        // All losses below use the temperature from before this update.

        // y = r + γⁿ (1 - end) (min Q̄(s', a') - α log π(a'|s'))
        self.gradients.targets(state, batch, &mut self.targets);

        // J(Q) = ½ mean (Q(s, a) - y)²
        let critic = self.gradients.critic_gradients(state, batch, &self.targets, &mut self.critic_gradients);
        for (index, gradient) in self.critic_gradients.iter().enumerate() {
            let parameters = state.critics[index].parameters_mut();
            state.critic_adams[index].step(self.learning_rate, parameters, gradient);
        }

        // J(π) = mean (α log π(a|s) - min Q(s, a)), through the critics just updated
        let actor = self.gradients.actor_gradient(state, batch, &mut self.actor_gradient);
        let parameters = state.actor.network_mut().parameters_mut();
        state.actor_adam.step(self.learning_rate, parameters, &self.actor_gradient);

        // J(α) = -log α (mean log π + H̄): α grows while the entropy is below its target H̄.
        let alpha_gradient = -(actor.mean_log_probability + self.target_entropy);
        let alpha_loss = state.log_alpha * alpha_gradient;
        let log_alpha = std::slice::from_mut(&mut state.log_alpha);
        state.alpha_adam.step(self.learning_rate, log_alpha, &[alpha_gradient]);

        // Q̄ ← Q̄ + τ (Q - Q̄)
        for (target, critic) in state.targets.iter_mut().zip(&state.critics) {
            target.move_towards(critic, self.tau);
        }

        UpdateReport {
            critic_loss: critic.loss,
            actor_loss: actor.loss,
            mean_q: critic.mean_q,
            entropy: -actor.mean_log_probability,
            alpha: state.alpha(),
            alpha_loss,
        }
    }

    /// Gives the gradients their lengths. It allocates the first time only.
    fn fit_gradients(&mut self, state: &SacState) {
        self.actor_gradient.resize(state.actor.network().parameters().len(), 0.0);
        for (gradient, critic) in self.critic_gradients.iter_mut().zip(&state.critics) {
            gradient.resize(critic.parameters().len(), 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::environment::Stream;
    use crate::network::Mlp;

    const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 7, action_len: 2 };

    fn settings() -> SacSettings {
        SacSettings { hidden: vec![24, 16], batch: 48, ..SacSettings::fast() }
    }

    fn random_batch(rng: &mut Stream) -> Batch {
        let mut batch = Batch::new(SPEC, settings().batch);
        let normal = [
            &mut batch.observations,
            &mut batch.next_observations,
            &mut batch.rewards,
            &mut batch.noise,
            &mut batch.next_noise,
        ];
        for values in normal {
            values.fill_with(|| rng.sample(StandardNormal));
        }
        batch.actions.fill_with(|| rng.random_range(-1.0..1.0));
        batch.discounts.fill_with(|| if rng.random_bool(0.2) { 0.0 } else { 0.97 });
        batch
    }

    fn fresh(seed: u64) -> (SacState, Batch) {
        let mut rng = Stream::seed_from_u64(seed);
        let mut state = SacState::new(SPEC, &settings(), &mut rng);
        // Targets that differ from their critics show which of the two a pass reads.
        state.targets[0] = Mlp::new(state.critics[0].sizes(), &mut rng);
        (state, random_batch(&mut rng))
    }

    /// The norm of the difference over the norm of `expected`.
    fn relative_error(found: &[f32], expected: &[f32]) -> f64 {
        assert_eq!(found.len(), expected.len(), "lengths");
        let norm =
            |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>().sqrt();
        norm(&mut found.iter().zip(expected).map(|(a, b)| a - b)) / norm(&mut expected.iter().copied())
    }

    fn gradients_of(backend: &mut dyn SacGradients, state: &SacState, batch: &Batch) -> [Vec<f32>; 4] {
        let mut targets = vec![0.0; batch.len];
        backend.targets(state, batch, &mut targets);
        let critic = vec![0.0; state.critics[0].parameters().len()];
        let mut critics = [critic.clone(), critic];
        backend.critic_gradients(state, batch, &targets, &mut critics);
        let mut actor = vec![0.0; state.actor.network().parameters().len()];
        backend.actor_gradient(state, batch, &mut actor);
        let [first, second] = critics;
        [targets, first, second, actor]
    }

    #[test]
    fn hand_written_gradients_agree_with_autodiff() {
        for seed in 0..5 {
            let (state, batch) = fresh(seed);
            let by_hand = gradients_of(&mut FusedSac::new(SPEC, &settings()), &state, &batch);
            let by_burn = gradients_of(&mut BurnSac::new(), &state, &batch);
            for (name, (hand, burn)) in
                ["targets", "critic 1", "critic 2", "actor"].iter().zip(by_hand.iter().zip(&by_burn))
            {
                let error = relative_error(hand, burn);
                assert!(error < 1e-4, "seed {seed}, {name}: relative error {error:e}");
            }
        }
    }

    #[test]
    fn the_actors_gradient_agrees_with_finite_differences() {
        let (mut state, batch) = fresh(9);
        let mut backend = FusedSac::new(SPEC, &settings());
        let mut gradient = vec![0.0; state.actor.network().parameters().len()];
        let mut unused = gradient.clone();
        backend.actor_gradient(&state, &batch, &mut gradient);
        for index in (0..gradient.len()).step_by(11) {
            let mut shifted = |by: f32| {
                state.actor.network_mut().parameters_mut()[index] += by;
                f64::from(backend.actor_gradient(&state, &batch, &mut unused).loss)
            };
            let (high, low) = (shifted(4e-3), shifted(-8e-3));
            shifted(4e-3);
            let numeric = (high - low) / 8e-3;
            let error = (f64::from(gradient[index]) - numeric).abs();
            assert!(error < 5e-3, "parameter {index}: {} by hand, {numeric} by differences", gradient[index]);
        }
    }

    #[test]
    fn fifty_updates_agree_between_both_backends() {
        let run = |backend| {
            let mut rng = Stream::seed_from_u64(3);
            let mut state = SacState::new(SPEC, &settings(), &mut rng);
            let mut sac = Sac::new(SPEC, &settings(), backend);
            for _ in 0..50 {
                sac.update(&mut state, &random_batch(&mut rng));
            }
            state
        };
        let (hand, burn) = (run(GradientBackend::Fused), run(GradientBackend::Burn));
        let pairs = [
            ("actor", hand.actor.network(), burn.actor.network()),
            ("critic", &hand.critics[0], &burn.critics[0]),
            ("target", &hand.targets[1], &burn.targets[1]),
        ];
        for (name, hand, burn) in pairs {
            let error = relative_error(hand.parameters(), burn.parameters());
            assert!(error < 1e-3, "{name}: relative error {error:e}");
        }
        assert!((hand.log_alpha - burn.log_alpha).abs() < 1e-4, "temperature");
    }

    #[test]
    fn targets_bootstrap_unless_the_discount_is_zero() {
        let (state, mut batch) = fresh(4);
        let mut backend = FusedSac::new(SPEC, &settings());
        let (mut whole, mut half, mut ended) = (vec![0.0; 48], vec![0.0; 48], vec![0.0; 48]);
        for (discount, targets) in [(1.0, &mut whole), (0.5, &mut half), (0.0, &mut ended)] {
            batch.discounts.fill(discount);
            backend.targets(&state, &batch, targets);
        }
        assert_eq!(ended, batch.rewards, "no value after a termination");
        for row in 0..48 {
            let (full, part) = (whole[row] - ended[row], half[row] - ended[row]);
            assert!((full - 2.0 * part).abs() < 1e-5, "row {row}: {full} whole, {part} at half");
        }
    }

    #[test]
    fn the_temperature_follows_the_target_entropy() {
        let alpha_after = |target_entropy| {
            let settings = SacSettings { target_entropy: Some(target_entropy), ..settings() };
            let mut rng = Stream::seed_from_u64(5);
            let mut state = SacState::new(SPEC, &settings, &mut rng);
            let mut sac = Sac::new(SPEC, &settings, GradientBackend::Fused);
            for _ in 0..20 {
                sac.update(&mut state, &random_batch(&mut rng));
            }
            state.alpha()
        };
        assert!(alpha_after(5.0) > 0.0505, "more entropy than two bounded actions can have");
        assert!(alpha_after(-30.0) < 0.0495, "less entropy than the policy has");
    }

    #[test]
    fn a_nan_anywhere_in_a_batch_is_reported() {
        let (state, batch) = fresh(6);
        let spoil: [fn(&mut Batch); 3] = [
            |batch| batch.rewards[3] = f32::NAN,
            |batch| batch.observations[20] = f32::NAN,
            |batch| batch.next_observations[20] = f32::NAN,
        ];
        for (case, spoil) in spoil.into_iter().enumerate() {
            let (mut state, mut batch) = (state.clone(), batch.clone());
            batch.discounts.fill(0.97);
            spoil(&mut batch);
            let mut sac = Sac::new(SPEC, &settings(), GradientBackend::Fused);
            let report = sac.update(&mut state, &batch);
            assert!(report.first_not_finite().is_some(), "case {case}: {report:?}");
        }
    }

    #[test]
    fn a_residual_policy_begins_at_zero() {
        let settings = SacSettings { zero_last_actor_layer: true, ..settings() };
        let state = SacState::new(SPEC, &settings, &mut Stream::seed_from_u64(8));
        let mut action = [9.0; 2];
        state.actor.act_mean(&[0.5; 7], &mut crate::ActorScratch::default(), &mut action);
        assert_eq!(action, [0.0; 2]);
    }
}

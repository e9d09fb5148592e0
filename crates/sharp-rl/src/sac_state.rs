//! The networks and optimisers of soft actor-critic as plain data.

use crate::actor::{Actor, layer_sizes};
use crate::adam::Adam;
use crate::environment::{EnvironmentSpec, Stream};
use crate::network::Mlp;
use crate::settings::SacSettings;

/// All that learning changes: networks, target networks, temperature and optimiser moments.
#[derive(Clone, Debug, PartialEq)]
pub struct SacState {
    /// The policy π.
    pub actor: Actor,
    /// Twin critics Q₁, Q₂. Their input is the observation followed by the action.
    pub critics: [Mlp; 2],
    /// Target critics Q̄₁, Q̄₂, which follow the critics slowly.
    pub targets: [Mlp; 2],
    /// Logarithm of the temperature α.
    pub log_alpha: f32,
    /// Optimiser of the actor.
    pub actor_adam: Adam,
    /// Optimisers of the critics.
    pub critic_adams: [Adam; 2],
    /// Optimiser of the temperature.
    pub alpha_adam: Adam,
}

impl SacState {
    /// Fresh networks.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, settings: &SacSettings, rng: &mut Stream) -> Self {
        let mut actor = Actor::new(spec, &settings.hidden, rng);
        if settings.zero_last_actor_layer {
            actor.network_mut().zero_last_layer();
        }
        Self::with_actor(actor, settings, rng)
    }

    /// Fresh critics beside `actor`, which comes from another algorithm.
    #[must_use]
    pub fn with_actor(actor: Actor, settings: &SacSettings, rng: &mut Stream) -> Self {
        let EnvironmentSpec { observation_len, action_len } = actor.spec();
        let sizes = layer_sizes(observation_len + action_len, &settings.hidden, 1);
        let critics = [Mlp::new(&sizes, rng), Mlp::new(&sizes, rng)];
        let targets = critics.clone();
        Self::assemble(actor, critics, targets, settings.initial_alpha.ln())
    }

    /// The same networks with fresh optimisers and temperature: the start of fine-tuning.
    #[must_use]
    pub fn restarted(&self, settings: &SacSettings) -> Self {
        let (critics, targets) = (self.critics.clone(), self.targets.clone());
        Self::assemble(self.actor.clone(), critics, targets, settings.initial_alpha.ln())
    }

    fn assemble(actor: Actor, critics: [Mlp; 2], targets: [Mlp; 2], log_alpha: f32) -> Self {
        let actor_adam = Adam::new(actor.network().parameters().len());
        let critic_adams = [0, 1].map(|i: usize| Adam::new(critics[i].parameters().len()));
        Self { actor, critics, targets, log_alpha, actor_adam, critic_adams, alpha_adam: Adam::new(1) }
    }

    /// The temperature α.
    #[must_use]
    pub fn alpha(&self) -> f32 {
        self.log_alpha.exp()
    }

    /// Returns true if all weights and the temperature are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let networks = [self.actor.network()].into_iter().chain(&self.critics).chain(&self.targets);
        networks.flat_map(Mlp::parameters).all(|value| value.is_finite()) && self.log_alpha.is_finite()
    }
}

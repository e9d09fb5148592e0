//! How the shipped priors are trained, as data.

use std::ops::Range;

use sharp_rl::{FailurePrice, PpoSettings, Schedule};

/// The stages of a training, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorRecipe {
    /// The stages, at least one. Each begins with the actor of the one before and a fresh critic.
    pub stages: Vec<PriorStage>,
}

/// One stage.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorStage {
    /// Generated maps; each stage has its own.
    pub map_count: u32,
    /// Strengths of the noises, as shares of the built-in ones.
    pub strengths: Range<f64>,
    /// Episodes side by side.
    pub slots: usize,
    /// Hyperparameters and budget.
    pub ppo: PpoSettings,
}

/// Price of a failure at no caution, seconds.
const PRICE_LEAST_S: f32 = 30.0;

impl PriorRecipe {
    /// The recipe of the shipped priors: it learns to drive with much noise in its actions, and then to be exact.
    #[must_use]
    pub fn shipped() -> Self {
        let learn = PriorStage {
            map_count: 240,
            strengths: 0.5..1.15,
            slots: 256,
            ppo: settings().with(|ppo| ppo.max_env_steps = 12_000_000),
        };
        let refine = PriorStage {
            map_count: 400,
            strengths: 0.5..1.2,
            slots: 256,
            ppo: settings().with(|ppo| {
                ppo.max_env_steps = 20_000_000;
                ppo.deviation = Schedule::between(0.18, 0.06);
                ppo.failure_price.most = Schedule::constant(2000.0);
                ppo.learning_rate_factor = Schedule { first: 1.0, last: 0.1, begin: 0.7, end: 1.0 };
                ppo.actor_waits = 15;
            }),
        };
        Self { stages: vec![learn, refine] }
    }

    /// About a minute of one core: drives, and not well.
    #[must_use]
    pub fn tiny() -> Self {
        let ppo = settings().with(|ppo| {
            ppo.max_env_steps = 1_200_000;
            ppo.rollout_steps = Schedule::constant(48.0);
            ppo.failure_price.most = Schedule { first: 40.0, last: 300.0, begin: 0.0, end: 0.4 };
        });
        Self { stages: vec![PriorStage { map_count: 36, strengths: 0.5..1.15, slots: 128, ppo }] }
    }

    /// The recipe called `name`, one of `default` and `tiny`.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "default" => Some(Self::shipped()),
            "tiny" => Some(Self::tiny()),
            _ => None,
        }
    }

    /// Steps of all stages together.
    #[must_use]
    pub fn env_steps(&self) -> u64 {
        self.stages.iter().map(|stage| stage.ppo.max_env_steps).sum()
    }
}

/// What all stages share.
fn settings() -> PpoSettings {
    PpoSettings::default().with(|ppo| {
        ppo.hidden = vec![128, 128];
        ppo.rollout_steps = Schedule::between(64.0, 256.0);
        ppo.epochs = 3;
        ppo.minibatch = 4096;
        ppo.gamma = 0.99;
        ppo.lambda = 0.9;
        ppo.clip = 0.2;
        ppo.learning_rate = 5e-4;
        ppo.target_kl = 0.012;
        ppo.gradient_norm = 1.0;
        ppo.deviation = Schedule::between(0.35, 0.12);
        let most = Schedule { first: 40.0, last: 1000.0, begin: 0.0, end: 0.4 };
        ppo.failure_price = FailurePrice { least: PRICE_LEAST_S, most };
        ppo.caution_bins = 4;
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_recipe_has_valid_settings() {
        for name in ["default", "tiny"] {
            let recipe = PriorRecipe::by_name(name).expect("a name of ours");
            assert!(recipe.env_steps() > 0, "{name}");
            for stage in recipe.stages {
                assert_eq!(stage.ppo.validate(), Ok(()), "{name}");
            }
        }
        assert!(PriorRecipe::by_name("huge").is_none());
    }
}

//! What an option costs: before it was driven, and with what was measured since.

use sharp_drive::{
    CostModel, GuideEnds, GuideView, PredictedCost, Prior, ProfiledFollower, SpeedProfile, SuccessEstimate,
    World,
};
use sharp_guide::{GuidePath, LegId, Role};
use sharp_sim::NoiseModel;

use crate::method::{PriceRule, SearchSettings};

/// Time of a learnt policy as a share of the tuned speed profile's: 0.69 for 115 options of the Husky and 0.74 for 79
/// of the Limo, in the plans of `a` to `d`.
const PACE: f64 = 0.72;
/// Success below which costs do not rise further, as in [`SuccessEstimate::cost_s`].
const SUCCESS_MIN: f64 = 1e-3;

/// Prices options in a world under a noise.
#[derive(Clone, Debug)]
pub(crate) struct Pricer<'a> {
    world: &'a World,
    noise: NoiseModel,
    settings: SearchSettings,
    failure_cost_s: f64,
    /// How fast a robot of this kind drives under the noise.
    profile: SpeedProfile,
}

/// What an option is taken to cost before it was driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Price {
    /// Mean time of a success, seconds.
    time_s: f64,
    /// The chance to succeed.
    success: f64,
}

impl<'a> Pricer<'a> {
    pub(crate) fn new(
        world: &'a World,
        noise: &NoiseModel,
        settings: SearchSettings,
        failure_cost_s: f64,
    ) -> Self {
        let profile = ProfiledFollower::tuned(&world.robot, noise).speed;
        Self { world, noise: noise.clone(), settings, failure_cost_s, profile }
    }

    /// The price of the leg called `id` with `guide`, and the `next` one after it where that is known.
    pub(crate) fn price(&self, id: LegId, guide: &GuidePath, next: Option<&GuidePath>) -> Price {
        let time_s = match self.settings.price {
            PriceRule::Length => {
                guide.length_m() / (self.settings.nominal_speed * self.world.robot.max_speed_mps)
            }
            PriceRule::Profile => PACE * self.profile.time_s(self.world, guide),
            PriceRule::Model => return self.of_model(id, GuideView { current: guide, next }),
        };
        Price { time_s, success: 1.0 }
    }

    fn of_model(&self, id: LegId, guide: GuideView<'_>) -> Price {
        let ends = guide_ends(id);
        let model = CostModel::shipped(&self.world.robot);
        let costs = model.predict(self.world, (&guide, ends), &self.noise, &Prior::CAUTIONS);
        let cost_s = |cost: &PredictedCost| cost.cost_s(self.failure_cost_s);
        let least = costs.into_iter().min_by(|a, b| cost_s(a).total_cmp(&cost_s(b)));
        let least = least.expect("there are cautions");
        Price { time_s: least.time_s, success: least.success() }
    }

    /// The cost of a leg in seconds where `measured` is known of it beside its `price`.
    ///
    /// The price counts as so many episodes more: it knows little of rare failures, and so do a hundred episodes.
    pub(crate) fn cost_s(&self, price: &Price, measured: Option<&SuccessEstimate>) -> f64 {
        let Price { time_s, success } = *price;
        let Some(SuccessEstimate { count, mean_time_s }) = measured else {
            return self.cost_of(time_s, success);
        };
        let weight = match self.settings.price {
            PriceRule::Model => self.settings.price_episodes,
            PriceRule::Length | PriceRule::Profile => 0.0,
        };
        let episodes = weight + f64::from(count.episodes);
        let successes = weight * success + f64::from(count.successes);
        let time_s = if mean_time_s.is_finite() || weight == 0.0 { *mean_time_s } else { time_s };
        self.cost_of(time_s, if episodes > 0.0 { successes / episodes } else { 0.0 })
    }

    fn cost_of(&self, time_s: f64, success: f64) -> f64 {
        let success = success.max(SUCCESS_MIN);
        time_s / success + self.failure_cost_s * (1.0 - success)
    }
}

/// Where the leg called `id` begins and ends.
pub(crate) fn guide_ends(id: LegId) -> GuideEnds {
    GuideEnds { from_rest: id.role() == Role::First, to_goal: matches!(id, LegId::Direct | LegId::Last(..)) }
}

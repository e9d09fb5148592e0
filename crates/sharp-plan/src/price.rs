//! What an option costs: before it was driven, and with what was measured since.

use sharp_drive::{
    CAREFUL_MPS, CostModel, GuideEnds, GuideView, OptionPolicy, Prior, ProfiledFollower, SpeedProfile,
    SuccessEstimate, World, expected_cost_s,
};
use sharp_guide::{Departure, GuidePath, GuidedOption, LegId, Role};
use sharp_sim::NoiseModel;

use crate::method::{PriceRule, SearchSettings};

/// Time of a learnt policy as a share of the tuned speed profile's: 0.69 for 115 options of the Husky and 0.74 for 79
/// of the Limo, in the plans of `a` to `d`.
const PACE: f64 = 0.72;

/// Seconds that leaving a tight place costs beside the way: stopping and starting.
const DEPARTURE_S: f64 = 1.0;
/// What is assumed of leaving a tight place before it is measured.
const DEPARTURE_SUCCESS: f64 = 0.99;

/// Prices options in a world under a noise.
#[derive(Clone, Debug)]
pub(crate) struct Pricer<'a> {
    world: &'a World,
    noise: NoiseModel,
    settings: SearchSettings,
    pub(crate) failure_cost_s: f64,
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

impl Price {
    /// Mean time of a success, seconds, and the chance of it.
    pub(crate) const fn parts(&self) -> (f64, f64) {
        (self.time_s, self.success)
    }
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

    /// The policies at hand for a leg: the prior, whose drives the model prices, and the follower that stands in for it.
    pub(crate) fn policies(&self) -> [OptionPolicy; 2] {
        let robot = &self.world.robot;
        let caution = Prior::caution(robot, self.failure_cost_s);
        let follower = ProfiledFollower::tuned(robot, &self.noise);
        [self.world.prior().at(caution, robot, &self.noise), OptionPolicy::Profiled(follower)]
    }

    /// The price of `option`, and the `next` guide after it where that is known.
    pub(crate) fn price(&self, option: &GuidedOption, next: Option<&GuidePath>) -> Price {
        let Departure { back_off_m, careful_m } = option.departure;
        if option.departure.is_none() {
            return self.of_guide(option.id, &option.guide, next);
        }
        // The model knows the prior, which drives after that.
        let rest = option.guide.from_arc(careful_m);
        let Price { time_s, success } =
            self.of_guide(option.id, rest.as_ref().unwrap_or(&option.guide), next);
        let leaving_s = back_off_m / self.world.robot.back_off_mps() + careful_m / CAREFUL_MPS + DEPARTURE_S;
        Price { time_s: time_s + leaving_s, success: success * DEPARTURE_SUCCESS }
    }

    /// The price of the leg called `id` with `guide`, and the `next` one after it where that is known.
    pub(crate) fn of_guide(&self, id: LegId, guide: &GuidePath, next: Option<&GuidePath>) -> Price {
        let at = |time_s| Price { time_s, success: 1.0 };
        let price = match self.settings.price {
            PriceRule::Length => {
                at(guide.length_m() / (self.settings.nominal_speed * self.world.robot.max_speed_mps))
            }
            PriceRule::Profile => at(PACE * self.profile.time_s(self.world, guide)),
            PriceRule::Model => self.of_model(id, GuideView { current: guide, next }),
        };
        let Some(limits) = &self.world.speed_limits else { return price };
        // None of the rules knows of speed limits: they count from the mean speed on.
        let delay_s = limits.delay_s(guide, guide.length_m() / price.time_s);
        if delay_s.is_finite() { Price { time_s: price.time_s + delay_s, ..price } } else { price }
    }

    fn of_model(&self, id: LegId, guide: GuideView<'_>) -> Price {
        let ends = guide_ends(id);
        let model = CostModel::shipped(&self.world.robot);
        let caution = Prior::caution(&self.world.robot, self.failure_cost_s);
        let cost = model.predict(self.world, (&guide, ends), &self.noise, caution);
        Price { time_s: cost.time_s, success: cost.success() }
    }

    /// The cost of a leg in seconds where `measured` is known of it beside its `price`.
    ///
    /// The price counts as so many episodes more: it knows little of rare failures, and so do a hundred episodes.
    pub(crate) fn cost_s(&self, price: &Price, measured: Option<&SuccessEstimate>) -> f64 {
        let Price { time_s, success } = *price;
        let Some(SuccessEstimate { count, mean_time_s }) = measured else {
            return expected_cost_s(time_s, success, self.failure_cost_s);
        };
        let weight = match self.settings.price {
            PriceRule::Model => self.settings.price_episodes,
            PriceRule::Length | PriceRule::Profile => 0.0,
        };
        let episodes = weight + f64::from(count.episodes);
        let successes = weight * success + f64::from(count.successes);
        let time_s = if mean_time_s.is_finite() || weight == 0.0 { *mean_time_s } else { time_s };
        let success = if episodes > 0.0 { successes / episodes } else { 0.0 };
        expected_cost_s(time_s, success, self.failure_cost_s)
    }
}

/// Where the leg called `id` begins and ends.
pub(crate) fn guide_ends(id: LegId) -> GuideEnds {
    GuideEnds { from_rest: id.role() == Role::First, to_goal: matches!(id, LegId::Direct | LegId::Last(..)) }
}

#[cfg(test)]
mod tests {
    use sharp_drive::SuccessCount;
    use sharp_options::OptionKind;

    use super::*;
    use crate::method::Method;
    use crate::test_worlds::straight;
    use crate::test_worlds::{HALL, along, options, world};
    use sharp_drive::SpeedLimits;
    use sharp_rbvd::StateId;
    use sharp_sim::RobotModel;

    fn cost_s(rule: PriceRule, measured: Option<SuccessEstimate>) -> f64 {
        let (world, _) = world(HALL, OptionKind::Centroid);
        let settings = SearchSettings { price: rule, ..SearchSettings::default() };
        let pricer = Pricer::new(&world, &NoiseModel::nominal(), settings, Method::fast().failure_cost_s);
        pricer.cost_s(&Price { time_s: 10.0, success: 0.99 }, measured.as_ref())
    }

    fn measured(episodes: u32, successes: u32) -> Option<SuccessEstimate> {
        Some(SuccessEstimate { count: SuccessCount { episodes, successes }, mean_time_s: 8.0 })
    }

    #[test]
    fn a_price_of_the_model_outweighs_few_episodes_and_not_many() {
        let costs =
            [None, measured(100, 100), measured(100_000, 100_000)].map(|m| cost_s(PriceRule::Model, m));
        assert!((costs[0] - 20.1).abs() < 0.1, "{costs:?}");
        assert!((costs[1] - 13.0).abs() < 0.1, "half of the failures: {costs:?}");
        assert!((costs[2] - 8.0).abs() < 0.1, "what was measured: {costs:?}");
        let failed = SuccessEstimate { mean_time_s: f64::INFINITY, ..measured(100, 0).expect("some") };
        assert!((500.0..600.0).contains(&cost_s(PriceRule::Model, Some(failed))), "half of them fail");
    }

    #[test]
    fn the_other_rules_take_what_was_measured() {
        assert_eq!(cost_s(PriceRule::Length, measured(10, 10)), 8.0);
        assert_eq!(cost_s(PriceRule::Profile, measured(10, 5)), 16.0 + 500.0);
    }

    #[test]
    fn every_rule_prices_a_guide() {
        let (world, abstraction) = world(HALL, OptionKind::Centroid);
        let option = &options(&world, &abstraction, along())[1];
        for rule in [PriceRule::Length, PriceRule::Profile, PriceRule::Model] {
            let settings = SearchSettings { price: rule, ..SearchSettings::default() };
            let pricer = Pricer::new(&world, &NoiseModel::nominal(), settings, 1000.0);
            let cost_s = pricer.cost_s(&pricer.price(option, None), None);
            let at_top_s = option.guide.length_m() / world.robot.max_speed_mps;
            assert!((0.7 * at_top_s..6.0 * at_top_s + 10.0).contains(&cost_s), "{rule:?}: {cost_s} s");
        }
    }

    fn by_rule(world: &World, rule: PriceRule) -> Pricer<'_> {
        let settings = SearchSettings { price: rule, ..SearchSettings::default() };
        Pricer::new(world, &NoiseModel::nominal(), settings, 1000.0)
    }

    #[test]
    fn leaving_a_tight_place_takes_time_and_may_fail() {
        let (world, abstraction) = world(HALL, OptionKind::Centroid);
        let pricer = by_rule(&world, PriceRule::Length);
        let first = (*options(&world, &abstraction, along())[0]).clone();
        let option = GuidedOption { guide: straight((1.0, 2.2), (5.0, 2.2)), ..first };
        for (back_off_m, careful_m, wanted, what) in [
            (0.0, 0.0, (8.0, 1.0), "4 m at 0.5 m/s"),
            (0.6, 0.0, (11.0, 0.99), "2 s backwards, and 1 s to stop and start"),
            (0.6, 1.0, (19.0, 0.99), "of the 4 m one takes 10 s"),
        ] {
            let leaving = option.clone().with_departure(Departure { back_off_m, careful_m });
            let (time_s, success) = pricer.price(&leaving, None).parts();
            assert!((time_s - wanted.0).abs() < 1e-6, "{what}: {time_s} s, not {} s", wanted.0);
            assert_eq!(success, wanted.1, "{what}");
        }
    }

    #[test]
    fn lengths_profiles_and_speed_limits_become_seconds() {
        let (husky, _) = world(HALL, OptionKind::Centroid);
        let free =
            World::new((*husky.grid).clone(), RobotModel { max_speed_mps: 0.8, ..RobotModel::husky() });
        let frame = *free.grid.frame();
        let limited = |limit_mps: f32| {
            let limits = SpeedLimits::new(frame, vec![limit_mps; frame.len()]).expect("sound limits");
            free.clone().with_speed_limits(limits)
        };
        let guide = straight((1.0, 2.2), (9.0, 2.2));
        let time_s =
            |world: &World, rule| by_rule(world, rule).of_guide(LegId::Direct, &guide, None).parts().0;
        let at_limits = [&free, &limited(0.25), &limited(1.0)].map(|world| time_s(world, PriceRule::Length));
        for (found_s, wanted_s) in at_limits.into_iter().zip([20.0, 32.0, 20.0]) {
            assert!(
                (found_s - wanted_s).abs() < 1e-6,
                "8 m without a limit, at 0.25 and at 1 m/s: {at_limits:?}"
            );
        }
        let tuned = ProfiledFollower::tuned(&free.robot, &NoiseModel::nominal()).speed;
        let (priced_s, profile_s) = (time_s(&free, PriceRule::Profile), tuned.time_s(&free, &guide));
        assert!(
            (priced_s / profile_s - 0.72).abs() < 1e-9,
            "{priced_s} s where the profile takes {profile_s} s"
        );
    }

    #[test]
    fn a_first_leg_begins_at_rest_and_a_last_one_ends_at_the_goal() {
        let ends = |id: LegId| {
            let GuideEnds { from_rest, to_goal } = guide_ends(id);
            (from_rest, to_goal)
        };
        assert_eq!(ends(LegId::First(0)), (true, false), "from the start to an endpoint");
        assert_eq!(ends(LegId::Direct), (true, true), "from the start to the goal");
        assert_eq!(ends(LegId::Last(0, StateId(0))), (false, true), "from an endpoint to the goal");
        assert_eq!(
            ends(LegId::Option("c:0-1".parse().expect("a name"))),
            (false, false),
            "between endpoints"
        );
    }
}

//! What a prior is trained on: a few options in a row, of many plans in many maps.
//!
//! An episode begins somewhere in a plan and runs on over the hand-overs: what counts is not to finish an option
//! but to arrive so that the next can be driven as well. The guides are joined as in plans.

use std::ops::Range;
use std::sync::Arc;

use rand::RngExt;
use sharp_drive::{
    CostModel, DriveRow, Driver, GuideEnds, InitialStates, Link, MonteCarlo, OptionPolicy, PolicyContext,
    PolicyInterface, PredictedCost, Prior, Scenario, ScenarioSource, SuccessEstimate, World, drive_rows,
    prior_interface,
};
use sharp_guide::{GuidedOption, ProgressReward, join_guides};
use sharp_sim::{ActionSettings, NoiseModel, SimulatorKind};
use sharp_space::{Seed, Stream};

use crate::abstraction::Abstraction;
use crate::method::{Method, PriceRule, SearchSettings};
use crate::query::Query;
use crate::search::Search;

/// Options that an episode runs through at most.
const OPTIONS_MAX: usize = 5;
/// Initial states kept of each option.
const STATE_POOL: usize = 48;
/// Share of an option's horizon within which it must be done: who takes longer has lost anyway.
const HORIZON_SHARE: f64 = 0.4;
/// Speed along the guide at which progress and time outweigh each other, as a share of the top speed. A robot that
/// drives faster gains by every metre, and one that fails loses next to nothing of what it would have gained.
const EVEN_SPEED: f64 = 0.7;

/// A plan in a map: options that follow one another, and where each may begin.
#[derive(Clone, Debug)]
pub struct TrainingRoute {
    world: World,
    options: Vec<Arc<GuidedOption>>,
    states: Vec<InitialStates>,
}

impl TrainingRoute {
    /// Number of options.
    #[must_use]
    pub fn len(&self) -> usize {
        self.options.len()
    }

    /// Returns true if it has no options; no planned route is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.options.is_empty()
    }

    /// Map and robot.
    #[must_use]
    pub const fn world(&self) -> &World {
        &self.world
    }

    /// Its options in order, each with where it may begin.
    pub fn options(&self) -> impl Iterator<Item = (&Arc<GuidedOption>, &InitialStates)> {
        self.options.iter().zip(&self.states)
    }

    /// How often `policy` succeeds on each option under `noise`.
    #[must_use]
    pub fn estimate(
        &self,
        policy: &OptionPolicy,
        noise: &NoiseModel,
        episodes: u32,
        seed: Seed,
    ) -> Vec<SuccessEstimate> {
        let simulator = self.world.simulator(SimulatorKind::Kinematic);
        let trial = MonteCarlo::new(&self.world, &*simulator, noise).with_episodes(episodes).with_seed(seed);
        let options = self.options.iter().zip(&self.states).enumerate();
        let of = |(index, (option, states)): (usize, (&Arc<GuidedOption>, &InitialStates))| {
            trial.estimate(&[Driver::new(option, policy, self.options.get(index + 1))], states)
        };
        options.map(of).collect()
    }

    /// Drives from option number `first` to the end of the route with `prior`, told this `caution`, so many times under
    /// `noise`, and appends what its places showed to `rows`.
    ///
    /// # Panics
    /// If there is no such option.
    pub fn drive_rows(
        &self,
        (prior, first, caution): (&Prior, usize, f32),
        noise: &NoiseModel,
        (episodes, seed): (u32, Seed),
        rows: &mut Vec<DriveRow>,
    ) {
        let Self { world, options, states } = self;
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let (policy, context) = (prior.at(caution, &world.robot, noise), PolicyContext::new(noise, caution));
        let links = Link::chain(&options[first..]);
        drive_rows(
            (world, &*simulator, noise),
            (&links, &policy, context),
            (&states[first], first == 0),
            (episodes, seed),
            rows,
        );
    }

    /// What `model` says of each option where the prior is told this `caution`.
    #[must_use]
    pub fn predict(&self, model: &CostModel, noise: &NoiseModel, caution: f32) -> Vec<PredictedCost> {
        let links = Link::chain(&self.options);
        let of = |(index, link): (usize, &Link)| {
            let ends = GuideEnds { from_rest: index == 0, to_goal: link.next.is_none() };
            model.predict(&self.world, (&link.guide(), ends), noise, caution)
        };
        links.iter().enumerate().map(of).collect()
    }
}

/// The plans for `queries` in one map. Queries without a plan are left out.
#[must_use]
pub fn training_routes(
    world: &World,
    abstraction: &Abstraction,
    queries: &[Query],
    seed: Seed,
) -> Vec<TrainingRoute> {
    // What a prior is trained on does not follow the search's prices.
    let search = SearchSettings {
        price: PriceRule::Length,
        untrained_surcharge_s: 8.0,
        bypasses: false,
        direct: false,
        ..SearchSettings::default()
    };
    let method = Method { search, ..Method::default() };
    let route = |query: &Query| {
        let mut search =
            Search::new(world, abstraction, &method, &NoiseModel::nominal(), *query, [], seed).ok()?;
        let (_, options) = search.plan(&|_| None, &())?;
        let options = join_guides(options, query.start, &world.guide_robot(), &method.search.guide);
        let states = options
            .iter()
            .map(|option| InitialStates::of_option(world, option, query.start, STATE_POOL, seed))
            .collect();
        Some(TrainingRoute { world: world.clone(), options, states })
    };
    queries.iter().filter_map(route).collect()
}

/// Parts of routes under noises of many strengths, at every degree of caution.
#[derive(Clone, Debug)]
pub struct RouteScenarios {
    routes: Arc<Vec<TrainingRoute>>,
    noises: Arc<Vec<NoiseModel>>,
    strengths: Range<f64>,
    simulator: SimulatorKind,
}

impl RouteScenarios {
    /// Parts of `routes` under `noises`, in the kinematic simulator. Each noise is scaled by a factor from
    /// `strengths`.
    ///
    /// # Panics
    /// If there are no routes, no noises or no strengths.
    #[must_use]
    pub fn new(routes: Arc<Vec<TrainingRoute>>, noises: Arc<Vec<NoiseModel>>, strengths: Range<f64>) -> Self {
        let is_empty = routes.is_empty() || noises.is_empty() || strengths.is_empty();
        assert!(!is_empty, "training needs routes, noises and strengths");
        Self { routes, noises, strengths, simulator: SimulatorKind::Kinematic }
    }

    /// The same in another simulator.
    #[must_use]
    pub fn with_simulator(self, simulator: SimulatorKind) -> Self {
        Self { simulator, ..self }
    }
}

impl ScenarioSource for RouteScenarios {
    fn draw(&self, rng: &mut Stream) -> Scenario {
        let route = &self.routes[rng.random_range(0..self.routes.len())];
        let TrainingRoute { world, options, states } = route;
        let first = rng.random_range(0..options.len());
        let last = (first + OPTIONS_MAX).min(options.len()) - 1;
        let noise = &self.noises[rng.random_range(0..self.noises.len())];
        let noise = noise.scaled(rng.random_range(self.strengths.clone()));
        let caution: f32 = rng.random();
        let reward = ProgressReward {
            progress_per_m: 1.0 / (EVEN_SPEED * world.robot.max_speed_mps),
            step: -ActionSettings::default().action_s,
            deviation_per_m: 0.0,
            success: 0.0,
            contact: 0.0,
            stray: 0.0,
        };
        let link = |index: usize| Link::new(Arc::clone(&options[index]), options.get(index + 1).cloned());
        Scenario {
            simulator: world.simulator(self.simulator),
            interface: interface(world, PolicyContext::new(&noise, caution)),
            noise,
            links: (first..=last).map(link).collect(),
            reward: Arc::new(reward),
            horizon_share: HORIZON_SHARE,
            ends_at_standstill: false,
            start: states[first].draw(rng),
            world: world.clone(),
        }
    }

    fn observation_len(&self) -> usize {
        interface(&self.routes[0].world, PolicyContext::default()).observation_len()
    }
}

fn interface(world: &World, context: PolicyContext) -> PolicyInterface {
    prior_interface(&world.robot, context)
}

#[cfg(test)]
mod tests {
    use sharp_drive::OptionTask;
    use sharp_options::OptionKind;
    use sharp_rl::conformance::check_environment;
    use sharp_rl::{Actor, Environment, evaluate};

    use super::*;
    use crate::test_worlds::{HALL, along, world};

    /// The plan along the hall.
    fn along_the_hall() -> Vec<TrainingRoute> {
        let (world, abstraction) = world(HALL, OptionKind::Interface);
        training_routes(&world, &abstraction, &[along()], Seed(1))
    }

    #[test]
    fn every_degree_of_caution_drives_through_a_hall() {
        let (route, noise) = (&along_the_hall()[0], NoiseModel::nominal());
        assert!(!route.is_empty() && route.len() == 3, "{} options", route.len());
        let policies = Prior::shipped(&route.world.robot).candidates(&route.world.robot, &noise);
        for policy in policies {
            for estimate in route.estimate(&policy, &noise, 100, Seed(2)) {
                assert!(estimate.count.rate() > 0.9, "{policy:?}: {estimate:?}");
            }
        }
    }

    #[test]
    fn an_episode_runs_on_over_its_hand_overs() {
        let source =
            RouteScenarios::new(Arc::new(along_the_hall()), Arc::new(vec![NoiseModel::none()]), 0.5..1.0);
        let mut task = OptionTask::new(Arc::new(source), Seed(1));
        let checked = check_environment(&mut task, &mut Seed(1).stream("check", 0));
        assert_eq!(checked, Ok(()));
        let mut rng = Seed(1).stream("networks", 0);
        let mut actor = Actor::new(task.spec(), &[8], &mut rng);
        actor.network_mut().zero_last_layer();
        let all = evaluate(std::slice::from_mut(&mut task), &actor, 20, &mut rng).expect("a sound task");
        assert_eq!(all.successes, 20, "without noise the base follower runs through: {all:?}");
        assert!(all.mean_steps > 12.0, "more than an option at a time: {all:?}");
    }
}

//! Where an option begins: the distribution of robot states that training and estimates draw from.

use rand::RngExt;
use rand_distr::{Distribution, Normal};
use sharp_guide::{GuidedOption, LegId};
use sharp_sim::{NoiseModel, RobotState, SimulatorKind};
use sharp_space::{Heading, Point, Pose, Seed, Stream, Vector, trig};

use crate::chain::{Chain, Driver};
use crate::episode::{Episode, EpisodeEnd, EpisodeRules};
use crate::follower::Follower;
use crate::policy::OptionPolicy;
use crate::world::World;

/// How long a slow follower must survive for a state to be worth beginning in, seconds: six actions.
const PROBE_S: f64 = 2.9;
/// Draws for each state that is wanted. Half of the draws are good in ordinary doors.
const DRAWS_PER_STATE: usize = 20;

/// How far initial states spread around the centre of an initiation set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpread {
    /// Radius of the disc of positions, metres.
    pub radius_m: f64,
    /// Standard deviation of the heading around the guide's first direction, radians.
    pub heading_sd_rad: f64,
    /// Largest speed, metres per second; no robot begins faster than it drives.
    pub speed_max_mps: f64,
}

impl Default for StateSpread {
    fn default() -> Self {
        Self { radius_m: 0.3, heading_sd_rad: 0.3, speed_max_mps: 0.6 }
    }
}

/// The initial-state distribution of an option.
#[derive(Clone, Debug)]
pub struct InitialStates {
    spread: Vec<RobotState>,
    arrivals: Vec<RobotState>,
}

impl InitialStates {
    /// The single state `state`: an option from the initial configuration.
    #[must_use]
    pub fn exactly(state: RobotState) -> Self {
        Self { spread: vec![state], arrivals: vec![] }
    }

    /// Where `option` begins in a plan from `start`: there, or at `count` states spread over its initiation set.
    #[must_use]
    pub fn of_option(world: &World, option: &GuidedOption, start: Pose, count: usize, seed: Seed) -> Self {
        match option.id {
            LegId::First(_) | LegId::Direct => Self::exactly(RobotState::at_rest(start)),
            LegId::Option(_) | LegId::Last(..) => {
                Self::spread(world, option, &StateSpread::default(), count, seed)
            }
        }
    }

    /// `count` states spread over the initiation set of `option`, in each of which a slow follower without noise
    /// survives the first actions: states that are lost from the first moment teach nothing.
    #[must_use]
    pub fn spread(
        world: &World,
        option: &GuidedOption,
        spread: &StateSpread,
        count: usize,
        seed: Seed,
    ) -> Self {
        let mut rng = seed.stream("starts", 0);
        let mut probe = SurvivalProbe::new(world, option, seed);
        let mut states = Vec::with_capacity(count);
        for _ in 0..DRAWS_PER_STATE * count {
            let state = draw_state(world, option, spread, &mut rng);
            if probe.survives(state) {
                states.push(state);
            }
            if states.len() == count {
                break;
            }
        }
        if states.is_empty() {
            states.push(RobotState::at_rest(option.guide.start()));
        }
        Self { spread: states, arrivals: vec![] }
    }

    /// The same, drawing half of the time from `arrivals` of the option before.
    #[must_use]
    pub fn with_arrivals(mut self, arrivals: Vec<RobotState>) -> Self {
        self.arrivals = arrivals;
        self
    }

    /// One state.
    #[must_use]
    pub fn draw(&self, rng: &mut Stream) -> RobotState {
        let pool =
            if self.arrivals.is_empty() || rng.random::<bool>() { &self.spread } else { &self.arrivals };
        pool[rng.random_range(0..pool.len())]
    }
}

fn draw_state(world: &World, option: &GuidedOption, spread: &StateSpread, rng: &mut Stream) -> RobotState {
    let start = option.guide.start();
    let (radius, angle) =
        (spread.radius_m * rng.random::<f64>().sqrt(), std::f64::consts::TAU * rng.random::<f64>());
    let (sin, cos) = trig::sin_cos(angle);
    let position: Point = start.position + Vector::new(cos, sin) * radius;
    let turn = Normal::new(0.0, spread.heading_sd_rad).map_or(0.0, |normal| normal.sample(rng));
    let pose = Pose::at(position, Heading::new(start.heading.radians() + turn));
    let least = world.robot.min_speed_mps;
    let most = spread.speed_max_mps.min(world.robot.max_speed_mps);
    let speed = least + (most - least).max(0.0) * rng.random::<f64>();
    RobotState::rolling(pose, speed)
}

/// Drives a slow follower for a few noise-free actions.
struct SurvivalProbe<'a> {
    world: &'a World,
    chain: Chain,
    episode: Episode,
    seed: Seed,
}

impl<'a> SurvivalProbe<'a> {
    fn new(world: &'a World, option: &GuidedOption, seed: Seed) -> Self {
        let slow = OptionPolicy::Follower(Follower::cautious(&world.robot));
        let chain = Chain::new(&[Driver::new(&option.clone().into(), &slow, None)]);
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let vehicle = world.vehicle(&*simulator, &NoiseModel::none(), true);
        let episode = Episode::new(vehicle, EpisodeRules::default().with_time_limit_s(PROBE_S));
        Self { world, chain, episode, seed }
    }

    fn survives(&mut self, state: RobotState) -> bool {
        self.world.geometry.is_free(state.pose)
            && self.chain.run(self.world, &mut self.episode, state, (self.seed, 0)).end
                != EpisodeEnd::Collided
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{hall, hall_options};

    fn spread(count: usize) -> (World, Pose, InitialStates) {
        let (world, options) = (hall(), hall_options());
        let states = InitialStates::spread(&world, &options[1], &StateSpread::default(), count, Seed(3));
        (world, options[1].guide.start(), states)
    }

    #[test]
    fn spread_states_lie_around_the_guides_start_and_are_free() {
        let (world, center, states) = spread(200);
        assert_eq!(states.spread.len(), 200, "an open hall has enough");
        for state in &states.spread {
            assert!(world.geometry.is_free(state.pose), "{state:?} touches a wall");
            assert!(state.pose.distance_m(&center) <= 0.3, "{state:?} lies too far out");
            assert!((0.0..=0.6).contains(&state.speed_mps()), "{state:?} is too fast");
        }
        let turned = states.spread.iter().filter(|state| state.pose.heading.radians().abs() > 0.1).count();
        assert!(turned > 50, "only {turned} of 200 headings differ from the guide's");
        assert_eq!(spread(200).2.spread, states.spread, "equal seeds");
    }

    #[test]
    fn half_of_the_draws_are_arrivals() {
        let arrival = RobotState::at_rest(Pose::new(9.0, 1.0, 1.0));
        let start = RobotState::at_rest(Pose::new(1.0, 2.2, 0.0));
        let states = InitialStates::exactly(start).with_arrivals(vec![arrival]);
        let mut rng = Seed(1).stream("draw", 0);
        let arrivals = (0..1000).filter(|_| states.draw(&mut rng) == arrival).count();
        assert!((420..580).contains(&arrivals), "{arrivals} of 1000");
    }

    #[test]
    fn an_option_from_the_start_begins_there() {
        let state = RobotState::at_rest(Pose::new(1.0, 2.2, 0.0));
        let mut rng = Seed(1).stream("draw", 0);
        assert!((0..10).all(|_| InitialStates::exactly(state).draw(&mut rng) == state), "nowhere else");
    }
}

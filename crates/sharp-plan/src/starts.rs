//! Where a leg begins: the distribution of robot states that training and certification draw from.

use rand::RngExt;
use rand_distr::{Distribution, Normal};
use sharp_sim::{KinematicSim, NoiseModel, RobotState, Vehicle};
use sharp_space::{CollisionChecker, Heading, Point, Pose, Seed, Stream, Vector};

use crate::leg::Leg;
use crate::percept::Workspace;
use crate::policy::{DecisionScratch, Follower, OptionPolicy};
use crate::rollout::{Driver, LegOutcome};

/// How far the broad prior spreads around the centre of an initiation set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSpread {
    /// Radius of the disc of positions, metres.
    pub radius_m: f64,
    /// Standard deviation of the heading around the guide's first direction, radians.
    pub heading_sd_rad: f64,
    /// Largest speed, metres per second.
    pub speed_max_mps: f64,
}

impl Default for StartSpread {
    fn default() -> Self {
        Self { radius_m: 0.3, heading_sd_rad: 0.3, speed_max_mps: 0.6 }
    }
}

/// States that a leg is known to begin in.
#[derive(Clone, Debug)]
pub struct Starts {
    broad: Vec<RobotState>,
    arrivals: Vec<RobotState>,
}

impl Starts {
    /// The single state `state`: a leg from the initial configuration.
    #[must_use]
    pub fn exactly(state: RobotState) -> Self {
        Self { broad: vec![state], arrivals: vec![] }
    }

    /// `count` states spread over the initiation set of `leg`, each of which a slow follower without
    /// noise survives: states that are lost from the first moment teach nothing.
    #[must_use]
    pub fn spread(workspace: &Workspace, leg: &Leg, spread: &StartSpread, count: usize, seed: Seed) -> Self {
        let mut rng = seed.stream("starts", 0);
        let mut probe = ViabilityProbe::new(workspace, leg, seed);
        let mut broad = Vec::with_capacity(count);
        // Half of the draws are viable in ordinary doors; a leg with none keeps its centre.
        for _ in 0..20 * count {
            let state = draw_state(workspace, leg, spread, &mut rng);
            if probe.is_viable(state) {
                broad.push(state);
            }
            if broad.len() == count {
                break;
            }
        }
        if broad.is_empty() {
            broad.push(RobotState::at_rest(leg.guide.start()));
        }
        Self { broad, arrivals: vec![] }
    }

    /// The same, drawing half of the time from `arrivals` of the leg before.
    #[must_use]
    pub fn with_arrivals(mut self, arrivals: Vec<RobotState>) -> Self {
        self.arrivals = arrivals;
        self
    }

    /// One state.
    #[must_use]
    pub fn draw(&self, rng: &mut Stream) -> RobotState {
        let pool =
            if self.arrivals.is_empty() || rng.random::<bool>() { &self.broad } else { &self.arrivals };
        pool[rng.random_range(0..pool.len())]
    }
}

fn draw_state(workspace: &Workspace, leg: &Leg, spread: &StartSpread, rng: &mut Stream) -> RobotState {
    let start = leg.guide.start();
    let (radius, angle) =
        (spread.radius_m * rng.random::<f64>().sqrt(), std::f64::consts::TAU * rng.random::<f64>());
    let position: Point = start.position + Vector::new(angle.cos(), angle.sin()) * radius;
    let turn = Normal::new(0.0, spread.heading_sd_rad).map_or(0.0, |normal| normal.sample(rng));
    let pose = Pose::at(position, Heading::new(start.heading.radians() + turn));
    let least = workspace.robot.min_speed_mps;
    let speed = least + (spread.speed_max_mps - least).max(0.0) * rng.random::<f64>();
    RobotState::rolling(pose, speed)
}

/// Drives a slow follower for a few noise-free actions.
struct ViabilityProbe<'a> {
    workspace: &'a Workspace,
    leg: &'a Leg,
    policy: OptionPolicy,
    vehicle: Vehicle<KinematicSim>,
    seed: Seed,
    scratch: DecisionScratch,
}

impl<'a> ViabilityProbe<'a> {
    fn new(workspace: &'a Workspace, leg: &'a Leg, seed: Seed) -> Self {
        let slow = Follower::cautious(&workspace.robot);
        let vehicle = crate::learn::kinematic_vehicle(workspace, &NoiseModel::none(), true);
        Self {
            workspace,
            leg,
            policy: OptionPolicy::Follower(slow),
            vehicle,
            seed,
            scratch: DecisionScratch::default(),
        }
    }

    fn is_viable(&mut self, state: RobotState) -> bool {
        if !self.workspace.checker.is_free(state.pose) {
            return false;
        }
        self.vehicle.reset(state, self.seed, 0);
        let driver = Driver::new(self.leg, &self.policy, None);
        let percept = crate::percept::Percept::first(state, self.vehicle.noise());
        driver.drive(self.workspace, &mut self.vehicle, percept, 5, &mut self.scratch).outcome
            != LegOutcome::Contact
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, along, legs, world};

    fn spread(count: usize) -> (Workspace, Pose, Starts) {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let starts = Starts::spread(&workspace, leg, &StartSpread::default(), count, Seed(3));
        (workspace, leg.guide.start(), starts)
    }

    #[test]
    fn spread_states_lie_around_the_guides_start_and_are_free() {
        let (workspace, center, starts) = spread(200);
        assert_eq!(starts.broad.len(), 200, "an open hall has enough");
        for state in &starts.broad {
            assert!(workspace.checker.is_free(state.pose), "{state:?} touches a wall");
            assert!(state.pose.distance_m(&center) <= 0.3, "{state:?} lies too far out");
            assert!((0.0..=0.6).contains(&state.speed_mps()), "{state:?} is too fast");
        }
        let turned = starts.broad.iter().filter(|state| state.pose.heading.radians().abs() > 0.1).count();
        assert!(turned > 50, "only {turned} of 200 headings differ from the guide's");
        assert_eq!(spread(200).2.broad, starts.broad, "equal seeds");
    }

    #[test]
    fn half_of_the_draws_are_arrivals() {
        let arrival = RobotState::at_rest(Pose::new(9.0, 1.0, 1.0));
        let starts = Starts::exactly(RobotState::at_rest(along().start)).with_arrivals(vec![arrival]);
        let mut rng = Seed(1).stream("draw", 0);
        let arrivals = (0..1000).filter(|_| starts.draw(&mut rng) == arrival).count();
        assert!((420..580).contains(&arrivals), "{arrivals} of 1000");
    }

    #[test]
    fn a_leg_from_the_start_begins_there() {
        let state = RobotState::at_rest(along().start);
        let mut rng = Seed(1).stream("draw", 0);
        assert!((0..10).all(|_| Starts::exactly(state).draw(&mut rng) == state), "nowhere else");
    }
}

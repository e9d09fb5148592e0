//! The prior: one policy per kind of robot, learnt once on many generated maps, guides and noises.
//!
//! An option then begins with a policy that already drives: it is evaluated as it is, with the caution that the cost of a
//! failure asks for ([`Prior::caution`]), and trained further only where that falls short (`docs/algorithms/prior.md`). The network corrects a
//! follower in the guide's own frame ([`PolicyInterface::Guide`]), so that what it learnt does not depend on the map.
//! It is told which noise to expect and how much a contact matters ([`PolicyContext`]).

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use sharp_rl::{Actor, DeployedActor, StoreError};
use sharp_sim::{NoiseModel, RobotModel};

use crate::estimate::FAILURE_COST_S;
use crate::follower::{Follower, SteeringRule};
use crate::network::{Correction, NetworkPolicy, PolicyContext, PolicyInterface};
use crate::policy::OptionPolicy;

/// Degrees of caution that are compared when a prior is scored, the least first.
const CAUTIONS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Price of a failure at which no caution is right, seconds.
const NO_CAUTION_S: f64 = 30.0;
/// Price of a failure at which full caution is right for a robot that turns in place, and for a car, seconds: in plans a car with
/// half caution costs as much as with full caution at 1,000 s a failure, and drives faster (`docs/algorithms/prior.md`).
const FULL_CAUTION_S: [f64; 2] = [FAILURE_COST_S, 33.0 * FAILURE_COST_S];

/// The note in a prior's file that says what its inputs mean, and the only value that is read.
const FORMAT_NOTE: (&str, &str) = ("prior-format", "2");

/// A learnt policy for every option of a kind of robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Shared by all policies that are made of it.
    actor: Arc<Actor>,
    deployed: Arc<DeployedActor>,
}

impl Prior {
    /// The prior that `actor` was trained to be.
    ///
    /// # Errors
    /// If the actor has not a prior's observation and action.
    pub fn new(actor: Actor) -> Result<Self, StoreError> {
        let spec = actor.spec();
        let expected = crate::features::GUIDE_FEATURES;
        if spec.observation_len != expected || spec.action_len != PolicyInterface::ACTION_LEN {
            return Err(StoreError::Header(format!("a network of {spec:?}, a prior has {expected} and 2")));
        }
        let deployed = Arc::new(DeployedActor::new(&actor));
        Ok(Self { actor: Arc::new(actor), deployed })
    }

    /// Reads a prior from the bytes of a safetensors file.
    ///
    /// # Errors
    /// If the bytes are no actor, or not of a prior's observation and action.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (actor, notes) = Actor::from_bytes(bytes)?;
        let (name, expected) = FORMAT_NOTE;
        match notes.get(name).map(String::as_str) {
            Some(found) if found == expected => Self::new(actor),
            found => Err(StoreError::Header(format!("{name} is {found:?}, expected {expected:?}"))),
        }
    }

    /// The prior as bytes of a safetensors file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let (name, format) = FORMAT_NOTE;
        self.actor.to_bytes(&BTreeMap::from([(name.to_owned(), format.to_owned())]))
    }

    /// The shipped prior for robots that move as `robot` does.
    #[must_use]
    pub fn shipped(robot: &RobotModel) -> &'static Self {
        let [turning, steering] = &*SHIPPED;
        if robot.can_turn_in_place() { turning } else { steering }
    }

    /// Its network, from which an option's own training begins.
    #[must_use]
    pub fn actor(&self) -> &Actor {
        &self.actor
    }

    /// Its policies for `robot` under `noise`, the least cautious first.
    #[must_use]
    pub fn candidates(&self, robot: &RobotModel, noise: &NoiseModel) -> Vec<OptionPolicy> {
        CAUTIONS.into_iter().map(|caution| self.at(caution, robot, noise)).collect()
    }

    /// How careful the shipped prior of `robot` is to be where a failure costs `failure_cost_s`, 0 to 1; in training each step
    /// of caution multiplies the price by the same factor.
    #[must_use]
    pub fn caution(robot: &RobotModel, failure_cost_s: f64) -> f32 {
        let [turning_s, steering_s] = FULL_CAUTION_S;
        let most_s = if robot.can_turn_in_place() { turning_s } else { steering_s };
        let factor = failure_cost_s.max(NO_CAUTION_S) / NO_CAUTION_S;
        (libm::log(factor) / libm::log(most_s / NO_CAUTION_S)).min(1.0) as f32
    }

    /// Its policy for `robot` under `noise` at full caution.
    #[must_use]
    pub fn policy(&self, robot: &RobotModel, noise: &NoiseModel) -> OptionPolicy {
        self.at(1.0, robot, noise)
    }

    /// Its policy for `robot` under `noise` at this degree of `caution`, 0 to 1.
    #[must_use]
    pub fn at(&self, caution: f32, robot: &RobotModel, noise: &NoiseModel) -> OptionPolicy {
        let interface = prior_interface(robot, PolicyContext::new(noise, caution));
        let (actor, deployed) = (Arc::clone(&self.actor), Arc::clone(&self.deployed));
        OptionPolicy::Network(NetworkPolicy::shared(interface, actor, deployed))
    }
}

/// For robots that turn in place, and for cars.
static SHIPPED: LazyLock<[Prior; 2]> = LazyLock::new(|| {
    let read = |bytes| Prior::from_bytes(bytes).expect("a test reads every shipped prior");
    [
        read(include_bytes!("../assets/prior-husky.safetensors")),
        read(include_bytes!("../assets/prior-limo.safetensors")),
    ]
});

/// What a prior of `robot` sees and what its action means.
#[must_use]
pub fn prior_interface(robot: &RobotModel, context: PolicyContext) -> PolicyInterface {
    let top_mps = robot.max_speed_mps;
    let (rule, bearing_rad) = if robot.can_turn_in_place() {
        (SteeringRule::Pursuit { look_ahead_m: 0.5 }, 1.0)
    } else {
        (SteeringRule::Field { look_ahead_m: 0.4, softness_m: 0.5 }, 1.0)
    };
    // The action spans all speeds.
    let base = Follower { rule, speed_mps: 0.5 * top_mps };
    let correction = Correction { speed_mps: 0.5 * top_mps, bearing_rad };
    PolicyInterface::Guide { base, correction, context }
}

#[cfg(test)]
mod tests {
    use sharp_rl::EnvironmentSpec;
    use sharp_space::Seed;

    use super::*;

    #[test]
    fn every_shipped_prior_can_be_read_and_written() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let prior = Prior::shipped(&robot);
            assert_eq!(prior.candidates(&robot, &NoiseModel::nominal()).len(), CAUTIONS.len());
            let again = Prior::from_bytes(&prior.to_bytes()).expect("own bytes");
            assert_eq!(&again, prior, "written and read");
        }
    }

    #[test]
    fn caution_follows_the_price_of_a_failure() {
        for (robot, half_s, full_s) in
            [(RobotModel::husky(), 173.0, 1000.0), (RobotModel::limo(), 995.0, 33_000.0)]
        {
            let cautions = [0.0, 30.0, half_s, full_s, 1e6].map(|cost_s| Prior::caution(&robot, cost_s));
            assert!((cautions[2] - 0.5).abs() < 0.01, "{cautions:?}");
            assert_eq!([cautions[0], cautions[1], cautions[3], cautions[4]], [0.0, 0.0, 1.0, 1.0]);
        }
    }

    #[test]
    fn networks_of_another_shape_are_no_prior() {
        let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let mut rng = Seed(1).stream("networks", 0);
        let actor = Actor::new(spec, &[8], &mut rng);
        let bytes = actor.to_bytes(&BTreeMap::new());
        let error = Prior::from_bytes(&bytes).expect_err("it does not say what it sees").to_string();
        assert!(error.contains("prior-format is None"), "{error}");
        let error = Prior::new(actor).expect_err("three numbers are not enough").to_string();
        assert!(error.contains("observation_len: 3"), "{error}");
        assert!(Prior::from_bytes(b"nothing").is_err(), "not even networks");
    }
}

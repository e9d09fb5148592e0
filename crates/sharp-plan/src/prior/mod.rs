//! The prior: one policy per kind of robot, learnt once on many generated maps, guides and noises.
//!
//! An option then begins with a policy that already drives: it is certified as it is, at several
//! degrees of caution, and trained further only where that falls short. The network corrects a
//! follower in the guide's own frame ([`Form::Guide`]), so that what it learnt does not depend on
//! the map; it is told which noise to expect and how much a contact matters ([`Expectation`]).

mod course;

use std::sync::LazyLock;

use sharp_rl::{SacState, StopRule, StoreError, TrainSettings};
use sharp_sim::{NoiseModel, RobotModel};

use crate::percept::Expectation;
use crate::policy::{Correction, Follower, Form, OptionPolicy, Rule};

pub use course::{Course, CourseTask, courses};

/// Degrees of caution at which the prior is offered, the least first.
const CAUTIONS: [f32; 3] = [0.0, CAUTION, 1.0];
/// The degree of caution of a prior that is taken without a choice.
const CAUTION: f32 = 0.5;

/// A learnt policy for every option of a kind of robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    sac: SacState,
}

impl Prior {
    /// The prior that `sac` was trained to be.
    #[must_use]
    pub const fn new(sac: SacState) -> Self {
        Self { sac }
    }

    /// Reads a prior from the bytes of a safetensors file.
    ///
    /// # Errors
    /// If the bytes are no networks of a learner, or not of a prior's observation and action.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let sac = SacState::from_bytes(bytes)?;
        let spec = sac.actor.spec();
        if spec.observation_len != crate::percept::GUIDE_OBSERVATION_LEN || spec.action_len != 2 {
            let expected = crate::percept::GUIDE_OBSERVATION_LEN;
            return Err(StoreError::Header(format!("networks of {spec:?}, a prior has {expected} and 2")));
        }
        Ok(Self { sac })
    }

    /// The prior as bytes of a safetensors file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.sac.to_bytes()
    }

    /// The shipped prior for robots that move as `robot` does.
    #[must_use]
    pub fn shipped(robot: &RobotModel) -> &'static Self {
        let [turning, steering] = &*SHIPPED;
        if robot.can_turn_in_place() { turning } else { steering }
    }

    /// Its networks, from which an option's own training begins.
    #[must_use]
    pub const fn networks(&self) -> &SacState {
        &self.sac
    }

    /// Its policies for `robot` under `noise`, the least cautious first.
    #[must_use]
    pub fn candidates(&self, robot: &RobotModel, noise: &NoiseModel) -> Vec<OptionPolicy> {
        CAUTIONS.into_iter().map(|caution| self.at(caution, robot, noise)).collect()
    }

    /// Its policy for `robot` under `noise` at middle caution.
    #[must_use]
    pub fn policy(&self, robot: &RobotModel, noise: &NoiseModel) -> OptionPolicy {
        self.at(CAUTION, robot, noise)
    }

    fn at(&self, caution: f32, robot: &RobotModel, noise: &NoiseModel) -> OptionPolicy {
        let form = form(robot, Expectation::new(noise, caution));
        OptionPolicy::Learnt { form, actor: Box::new(self.sac.actor.clone()) }
    }
}

/// For robots that turn in place, and for cars.
static SHIPPED: LazyLock<[Prior; 2]> = LazyLock::new(|| {
    let read = |bytes| Prior::from_bytes(bytes).expect("a test reads every shipped prior");
    [
        read(include_bytes!("../../../../assets/models/prior-husky.safetensors")),
        read(include_bytes!("../../../../assets/models/prior-limo.safetensors")),
    ]
});

/// What a prior of `robot` sees and what its action means.
#[must_use]
pub fn form(robot: &RobotModel, expectation: Expectation) -> Form {
    let top_mps = robot.max_speed_mps;
    let (rule, bearing_rad) = if robot.can_turn_in_place() {
        (Rule::Pursuit { look_ahead_m: 0.5 }, 1.0)
    } else {
        (Rule::Field { look_ahead_m: 0.4, softness_m: 0.5 }, 1.0)
    };
    // The action spans all speeds.
    let base = Follower { rule, speed_mps: 0.5 * top_mps };
    Form::Guide { base, correction: Correction { speed_mps: 0.5 * top_mps, bearing_rad }, expectation }
}

/// How a prior is trained.
#[must_use]
pub fn train_settings() -> TrainSettings {
    TrainSettings::fast().with(|train| {
        train.sac.hidden = vec![128, 128];
        train.sac.learning_rate = 5e-4;
        train.sac.updates_per_step = 0.25;
        train.sac.warmup_steps = 4_000;
        train.sac.zero_last_actor_layer = true;
        train.max_env_steps = 600_000;
        train.evaluate_every = 20_000;
        train.evaluation_episodes = 800;
        train.stop = StopRule::Never;
    })
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_rl::{Environment, EnvironmentSpec, SacSettings, conformance::check_environment, evaluate};
    use sharp_space::Seed;

    use super::*;
    use crate::drawn::{HALL, along, world};

    #[test]
    fn every_shipped_prior_is_sound_and_drives_through_a_hall() {
        let (workspace, abstraction) = world(HALL, OptionKind::Interface);
        let course = courses(&workspace, &abstraction, &[along()], Seed(1)).remove(0);
        let noise = NoiseModel::nominal();
        let policies = Prior::shipped(&workspace.robot).candidates(&workspace.robot, &noise);
        assert_eq!(policies.len(), CAUTIONS.len());
        for (policy, caution) in policies.iter().zip(CAUTIONS) {
            for certificate in course.certify(policy, &noise, 100, Seed(2)) {
                assert!(certificate.tally.rate() > 0.9, "caution {caution}: {certificate:?}");
            }
        }
        let limo = RobotModel::limo();
        assert_eq!(Prior::shipped(&limo).candidates(&limo, &noise).len(), CAUTIONS.len());
        let again = Prior::from_bytes(&Prior::shipped(&limo).to_bytes()).expect("own bytes");
        assert_eq!(&again, Prior::shipped(&limo), "written and read");
    }

    #[test]
    fn networks_of_another_shape_are_no_prior() {
        let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let mut rng = Seed(1).stream("networks", 0);
        let bytes = SacState::new(spec, &SacSettings::fast(), &mut rng).to_bytes();
        let error = Prior::from_bytes(&bytes).expect_err("three numbers are not enough").to_string();
        assert!(error.contains("observation_len: 3"), "{error}");
        assert!(Prior::from_bytes(b"nothing").is_err(), "not even networks");
    }

    #[test]
    fn a_course_runs_on_over_its_hand_overs() {
        let (workspace, abstraction) = world(HALL, OptionKind::Interface);
        let courses = std::sync::Arc::new(courses(&workspace, &abstraction, &[along()], Seed(1)));
        let noises = std::sync::Arc::new(vec![NoiseModel::none()]);
        let mut task = CourseTask::new(courses, noises, Seed(1));
        let checked = check_environment(&mut task, &mut Seed(1).stream("check", 0));
        assert_eq!(checked, Ok(()));
        let mut rng = Seed(1).stream("networks", 0);
        let actor = SacState::new(task.spec(), &train_settings().sac, &mut rng).actor;
        let all = evaluate(std::slice::from_mut(&mut task), &actor, 20, &mut rng).expect("a sound task");
        assert_eq!(all.successes, 20, "without noise the base follower runs through: {all:?}");
        assert!(all.mean_steps > 12.0, "more than a leg at a time: {all:?}");
    }
}

//! Learning in earnest, on one easy option: soft actor-critic by the paper's protocol must beat doing
//! nothing, and by far.

use std::sync::Arc;

use sharp_drive::{Follower, InitialStates, OptionPolicy, StateSpread, SteeringRule};
use sharp_guide::{GuidedOption, Role};
use sharp_options::OptionKind;
use sharp_plan::{Conditions, LearningTask, Method, OptionLearner, PaperProtocol, Query, Search};
use sharp_rl::{StopRule, TrainSettings};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed};

use crate::worlds::{ROOMS, TestWorld};

/// From the middle of the left room to the door: 2.4 m.
fn easy_option(world: &TestWorld) -> Arc<GuidedOption> {
    let query = Query { start: Pose::new(1.6, 1.8, 0.0), goal: Pose::new(6.6, 1.8, 0.0) };
    let method = Method::fast();
    let search =
        Search::new(&world.world, &world.abstraction, &method, &NoiseModel::nominal(), query, [], Seed(1));
    let (_, options) = search.expect("both ends have room").plan(&|_| None, &()).expect("the door is wide");
    let mut options = options.into_iter();
    options.find(|option| option.id.role() == Role::Option).expect("two regions lie between")
}

/// The paper's protocol with smaller networks, faster steps and a stop at 95 %.
fn small_budget() -> PaperProtocol {
    let train = TrainSettings::default().with(|train| {
        train.sac.hidden = vec![64, 64];
        train.sac.learning_rate = 1e-3;
        train.max_env_steps = 6000;
        train.evaluate_every = 1000;
        train.evaluation_episodes = 50;
        train.stop = StopRule::Success { rate: 0.95, episodes: 100 };
    });
    PaperProtocol::new(train)
}

#[test]
fn the_papers_protocol_learns_an_easy_option() {
    let drawn = TestWorld::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let (world, option, method) = (&drawn.world, &easy_option(&drawn), Method::paper());
    let conditions = Conditions::new(world, NoiseModel::nominal());
    let task = LearningTask {
        world,
        conditions: &conditions,
        option,
        next: None,
        tail: &[],
        states: Arc::new(InitialStates::spread(world, option, &StateSpread::default(), 256, Seed(1))),
        wanted_success: method.option_success,
        failure_cost_s: method.failure_cost_s,
        estimate_episodes: 200,
        seed: Seed(1),
    };

    let rule = SteeringRule::Pursuit { look_ahead_m: 0.5 };
    let idle = OptionPolicy::Follower(Follower { rule, speed_mps: 0.0 });
    assert_eq!(task.estimate(&idle).count.successes, 0, "standing still reaches nothing");
    let learnt = small_budget().learn(&task, &|| false).expect("a sound task");
    assert!(matches!(learnt.policy, OptionPolicy::Network(_)), "a network, not {:?}", learnt.policy);
    // Ten seeds gave 83 to 100 %.
    assert!(
        learnt.estimate.count.rate() > 0.5,
        "only {:?} after {} steps",
        learnt.estimate,
        learnt.env_steps
    );
}

//! Learning in earnest, on one easy option: soft actor-critic in the paper's form must beat doing
//! nothing, and by far.

use std::sync::Arc;

use sharp_options::OptionKind;
use sharp_plan::{
    Follower, LearnSettings, LearningMode, Leg, Lesson, OptionPolicy, Planner, Query, Role, Rule,
    SearchSettings, StartSpread, Starts,
};
use sharp_rl::{StopRule, TrainSettings};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed};

use crate::worlds::{ROOMS, World};

/// From the middle of the left room to the door: 2.4 m.
fn easy_option(world: &World) -> Arc<Leg> {
    let query = Query { start: Pose::new(1.6, 1.8, 0.0), goal: Pose::new(6.6, 1.8, 0.0) };
    let settings = SearchSettings::new(&world.workspace);
    let mut planner = Planner::new(&world.workspace, &world.abstraction, settings, query, [], Seed(1))
        .expect("both ends have room");
    let legs = planner.plan(&|_| None, &()).expect("the door is wide");
    legs.into_iter().find(|leg| leg.id.role() == Role::Option).expect("two regions lie between")
}

/// The paper's protocol with smaller networks, faster steps and a stop at 95 %.
fn small_budget() -> LearnSettings {
    let train = TrainSettings::default().with(|train| {
        train.sac.hidden = vec![64, 64];
        train.sac.learning_rate = 1e-3;
        train.max_env_steps = 6000;
        train.evaluate_every = 1000;
        train.evaluation_episodes = 50;
        train.stop = StopRule::Success { rate: 0.95, episodes: 100 };
    });
    LearnSettings { train, certify_episodes: 200, ..LearnSettings::new(LearningMode::Paper) }
}

#[test]
fn the_papers_form_learns_an_easy_option() {
    let world = World::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let (workspace, leg) = (&world.workspace, &easy_option(&world));
    let starts = Arc::new(Starts::spread(workspace, leg, &StartSpread::default(), 256, Seed(1)));
    let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
    let settings = small_budget();
    let lesson = Lesson {
        workspace,
        leg,
        next: None,
        tail: &[],
        starts,
        noise: &noise,
        settings: &settings,
        seed: Seed(1),
    };

    let idle = OptionPolicy::Follower(Follower { rule: Rule::Pursuit { look_ahead_m: 0.5 }, speed_mps: 0.0 });
    assert_eq!(lesson.certify(&idle).tally.successes, 0, "standing still reaches nothing");
    let learnt = lesson.learn(&|| false).expect("a sound task");
    assert!(matches!(learnt.policy, OptionPolicy::Learnt { .. }), "a network, not {:?}", learnt.policy);
    // Ten seeds gave 83 to 100 %.
    assert!(learnt.verified.rate() > 0.5, "only {:?} after {} steps", learnt.verified, learnt.env_steps);
}

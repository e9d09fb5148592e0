//! What the paper promises, as properties of generated floor plans: Theorem 4.1 and Definition 8,
//! for both kinds of options and both robots.

use std::collections::BTreeSet;
use std::sync::Arc;

use sharp_guide::{
    ClearanceSearch, GuidePath, GuideRobot, GuideSettings, GuidedOption, LegId, UnguidedOption,
};
use sharp_maps::FloorplanKind;
use sharp_options::{AllowedRule, OptionKind, OptionSpec};
use sharp_plan::{Candidate, Method, OptionGraph, Query, Search};
use sharp_rbvd::{StateAbstraction, StateId};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed};

use crate::worlds::TestWorld;

/// Calls `check` with a world of every kind of floor plan, robot and kind of option, and a name for messages.
fn for_every_world(mut check: impl FnMut(&TestWorld, &str)) {
    for plan in FloorplanKind::ALL {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            for kind in [OptionKind::Centroid, OptionKind::Interface] {
                let name = format!("{plan:?}, {}, {kind:?}", robot.name);
                check(&TestWorld::generated(plan, robot.clone(), kind), &name);
            }
        }
    }
}

/// The states that sequences of adjacent states lead to from `start`.
fn reachable(states: &dyn StateAbstraction, start: StateId) -> BTreeSet<StateId> {
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(state) = open.pop() {
        open.extend(states.neighbors(state).iter().filter(|&&next| reached.insert(next)));
    }
    reached
}

/// α(x) of a roomy place.
fn state_at(world: &TestWorld, pose: Pose) -> StateId {
    world.abstraction.states.state_at(pose.position).expect("a roomy place has a state")
}

/// `β_i = I_{i+1}` from the start to the goal.
fn assert_composes(world: &TestWorld, legs: &[LegId], name: &str) {
    let ends = |id: LegId| id.endpoints(&world.abstraction.options);
    for pair in legs.windows(2) {
        let (beta, initiation) = (ends(pair[0]).1, ends(pair[1]).0);
        assert!(beta.is_some() && beta == initiation, "{name}: {} does not lead to {}", pair[0], pair[1]);
    }
    assert!(legs.first().is_some_and(|&id| ends(id).0.is_none()), "{name}: begins elsewhere");
    assert!(legs.last().is_some_and(|&id| ends(id).1.is_none()), "{name}: ends elsewhere");
}

/// Theorem 4.1: where a sequence of adjacent states leads to the goal, options compose to a plan.
#[test]
fn options_compose_wherever_adjacent_states_lead() {
    for_every_world(|world, name| {
        let (states, options) = (&*world.abstraction.states, &*world.abstraction.options);
        let mut rng = Seed(1).stream(name, 0);
        for _ in 0..20 {
            let query = world.query(&mut rng);
            let start = (query.start, state_at(world, query.start));
            let goal = (query.goal, state_at(world, query.goal));
            let graph = OptionGraph::new(states, options, start, goal);
            let found = graph.search(1.0, Candidate::straight_m, |_, _| 0.0);
            let expected = reachable(states, start.1).contains(&goal.1);
            assert_eq!(found.is_some(), expected, "{name}: from {:?} to {:?}", start.1, goal.1);
            if let Some((_, legs)) = found {
                assert_composes(world, &legs, name);
            }
        }
    });
}

/// Definition 8: from centre to centre, gaps under t, every point where the option may be.
fn assert_guide(guide: &GuidePath, option: &OptionSpec, world: &TestWorld, name: &str) {
    let (states, options) = (&*world.abstraction.states, &*world.abstraction.options);
    let (from, to) =
        (options.endpoint(option.initiation).center, options.endpoint(option.termination).center);
    assert!((guide.start().position - from).norm() < 1e-9, "{name}, {}: p_1 is not c_I", option.id);
    assert!((guide.end().position - to).norm() < 1e-9, "{name}, {}: p_n is not c_β", option.id);
    for pair in guide.poses().windows(2) {
        let gap_m = pair[0].distance_m(&pair[1]);
        assert!(gap_m < GuideSettings::default().spacing_m, "{name}, {}: a gap of {gap_m} m", option.id);
    }
    let frame = states.frame();
    for pose in guide.poses() {
        let may_be = |rule, point| options.is_allowed(option, rule, point, states);
        assert!(may_be(AllowedRule::Paper, pose.position), "{name}, {}: strays at {pose:?}", option.id);
        // The rule that the reward goes by is kept by whole cells.
        let center = frame.center(frame.cell_at(pose.position).expect("on the map"));
        assert!(may_be(AllowedRule::default(), center), "{name}, {}: the cell at {pose:?}", option.id);
    }
}

/// `option` before it has a guide.
fn unguided(option: &OptionSpec, world: &TestWorld) -> UnguidedOption {
    let center = |endpoint| world.abstraction.options.endpoint(endpoint).center;
    let (id, from, to) = (LegId::Option(option.id), option.id.from(), option.id.to());
    let (start, end) = (center(option.initiation), center(option.termination));
    UnguidedOption { id, from, to, start, end, heading: None, goal_heading: None }
}

#[test]
fn guide_paths_fulfil_definition_8() {
    let (mut guided, mut tried) = (0, 0);
    for_every_world(|world, name| {
        let robot = GuideRobot::new(&*world.world.geometry, world.world.steering());
        let space = world.abstraction.space(AllowedRule::default());
        // A prime stride takes options from all over the map.
        for option in space.options.options().iter().step_by(7) {
            let mut rng = Seed(2).stream("guide", 0);
            tried += 1;
            let planner = ClearanceSearch::default();
            if let Ok(guide) = unguided(option, world).plan_guide(&space, &robot, &planner, &mut rng) {
                guided += 1;
                assert_guide(&guide, option, world, name);
            }
        }
    });
    assert!(tried > 300 && guided * 10 > tried * 9, "only {guided} of {tried} options have a guide");
}

/// The plans of Algorithm 1, line 9, with their guides: composed, guided, from start to goal.
#[test]
fn planned_options_join_and_their_guides_lead_through() {
    let (mut planned, mut possible) = (0, 0);
    for_every_world(|world, name| {
        let query = world.query(&mut Seed(3).stream(name, 0));
        let method = Method::fast();
        let mut search = Search::new(
            &world.world,
            &world.abstraction,
            &method,
            &NoiseModel::nominal(),
            query,
            [],
            Seed(3),
        )
        .expect("roomy places have a state");
        let (start, goal) = (state_at(world, query.start), state_at(world, query.goal));
        possible += usize::from(reachable(&*world.abstraction.states, start).contains(&goal));
        if let Some((_, options)) = search.plan(&|_| None, &()) {
            planned += 1;
            assert_plan(world, &query, &options, name);
        }
    });
    assert!(
        possible > 70 && planned * 10 > possible * 9,
        "only {planned} of {possible} problems have a plan"
    );
}

fn assert_plan(world: &TestWorld, query: &Query, options: &[Arc<GuidedOption>], name: &str) {
    assert_composes(world, &options.iter().map(|option| option.id).collect::<Vec<_>>(), name);
    let (first, last) = (options[0].guide.start(), options[options.len() - 1].guide.end());
    let start = options[0].departure.after_back_off(query.start);
    assert_eq!(first.position, start.position, "{name}: the first guide starts elsewhere");
    // Near a wall it ends where it is easier, well inside the tolerance.
    let off_m = (last.position - query.goal.position).norm();
    let tolerance_m = world.world.robot.goal_tolerance_m;
    assert!(off_m <= 0.5 * tolerance_m + 1e-9, "{name}: the last guide ends {off_m} m from the goal");
    for pair in options.windows(2) {
        let gap_m = pair[0].guide.end().distance_m(&pair[1].guide.start());
        assert!(gap_m < 1e-9, "{name}: {} and {} are {gap_m} m apart", pair[0].id, pair[1].id);
    }
    for option in options {
        if let LegId::Option(id) = option.id {
            let spec = world.abstraction.options.get(id).expect("an option of the set");
            assert_guide(&option.guide, spec, world, name);
        }
    }
}

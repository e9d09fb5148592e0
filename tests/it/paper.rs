//! What the paper promises, as properties of generated floor plans: Theorem 4.1 and Definition 8,
//! for both kinds of options and both robots.

use std::collections::BTreeSet;
use std::sync::Arc;

use sharp_guide::{Abstraction, GuidePath, GuideSettings, OptionGuide, Robot, Steering};
use sharp_maps::FloorplanKind;
use sharp_options::{AllowedRule, EndpointId, OptionKind, OptionSpec};
use sharp_plan::{Leg, LegId, OptionGraph, Planner, Query, SearchSettings};
use sharp_rbvd::{Rbvd, StateId};
use sharp_sim::RobotModel;
use sharp_space::{Pose, Seed};

use crate::worlds::World;

/// Calls `check` with a world of every kind of floor plan, robot and kind of option, and a name for messages.
fn for_every_world(mut check: impl FnMut(&World, &str)) {
    for plan in FloorplanKind::ALL {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            for kind in [OptionKind::Centroid, OptionKind::Interface] {
                let name = format!("{plan:?}, {}, {kind:?}", robot.name);
                check(&World::generated(plan, robot.clone(), kind), &name);
            }
        }
    }
}

/// The states that sequences of adjacent states lead to from `start`.
fn reachable(rbvd: &Rbvd, start: StateId) -> BTreeSet<StateId> {
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(state) = open.pop() {
        open.extend(rbvd.neighbors(state).iter().filter(|&&next| reached.insert(next)));
    }
    reached
}

/// α(x) of a roomy place.
fn state_at(world: &World, pose: Pose) -> StateId {
    world.abstraction.rbvd.state_at(pose.position).expect("a roomy place has a state")
}

/// The names of I and β of a leg, where they are endpoints.
fn ends(world: &World, id: LegId) -> (Option<EndpointId>, Option<EndpointId>) {
    match id {
        LegId::First(endpoint) => (None, Some(EndpointId(endpoint))),
        LegId::Option(option) => {
            let spec = world.abstraction.options.get(option).expect("an option of the set");
            (Some(spec.initiation), Some(spec.termination))
        }
        LegId::Last(endpoint, _) => (Some(EndpointId(endpoint)), None),
        LegId::Direct => (None, None),
    }
}

/// `β_i = I_{i+1}` from the start to the goal.
fn assert_composes(world: &World, legs: &[LegId], name: &str) {
    for pair in legs.windows(2) {
        let (beta, initiation) = (ends(world, pair[0]).1, ends(world, pair[1]).0);
        assert!(beta.is_some() && beta == initiation, "{name}: {} does not lead to {}", pair[0], pair[1]);
    }
    assert!(legs.first().is_some_and(|&id| ends(world, id).0.is_none()), "{name}: begins elsewhere");
    assert!(legs.last().is_some_and(|&id| ends(world, id).1.is_none()), "{name}: ends elsewhere");
}

/// Theorem 4.1: where a sequence of adjacent states leads to the goal, options compose to a plan.
#[test]
fn options_compose_wherever_adjacent_states_lead() {
    for_every_world(|world, name| {
        let (rbvd, options) = (&world.abstraction.rbvd, &world.abstraction.options);
        let mut rng = Seed(1).stream(name, 0);
        for _ in 0..20 {
            let query = world.query(&mut rng);
            let start = (query.start, state_at(world, query.start));
            let goal = (query.goal, state_at(world, query.goal));
            let graph = OptionGraph::new(rbvd, options, start, goal);
            let found = graph.search(1.0, |leg| (leg.end - leg.start).norm(), |_, _| 0.0);
            let expected = reachable(rbvd, start.1).contains(&goal.1);
            assert_eq!(found.is_some(), expected, "{name}: from {:?} to {:?}", start.1, goal.1);
            if let Some((_, legs)) = found {
                assert_composes(world, &legs, name);
            }
        }
    });
}

/// Definition 8: from centre to centre, gaps under t, every point where the option may be.
fn assert_guide(guide: &GuidePath, option: &OptionSpec, world: &World, name: &str) {
    let (rbvd, options) = (&world.abstraction.rbvd, &world.abstraction.options);
    let (from, to) =
        (options.endpoint(option.initiation).center, options.endpoint(option.termination).center);
    assert!((guide.start().position - from).norm() < 1e-9, "{name}, {}: p_1 is not c_I", option.id);
    assert!((guide.end().position - to).norm() < 1e-9, "{name}, {}: p_n is not c_β", option.id);
    for pair in guide.poses().windows(2) {
        let gap_m = pair[0].distance_m(&pair[1]);
        assert!(gap_m < GuideSettings::default().spacing_m, "{name}, {}: a gap of {gap_m} m", option.id);
    }
    let frame = rbvd.frame();
    for pose in guide.poses() {
        let may_be = |rule, point| options.is_allowed(option, rule, point, rbvd);
        assert!(may_be(AllowedRule::Paper, pose.position), "{name}, {}: strays at {pose:?}", option.id);
        // The rule that the reward goes by is kept by whole cells.
        let center = frame.center(frame.cell_at(pose.position).expect("on the map"));
        assert!(may_be(AllowedRule::default(), center), "{name}, {}: the cell at {pose:?}", option.id);
    }
}

fn steering(robot: &RobotModel) -> Steering {
    match robot.min_turning_radius_m() {
        radius_m if radius_m > 0.0 => Steering::Dubins { radius_m },
        _ => Steering::RotateTranslate,
    }
}

#[test]
fn guide_paths_fulfil_definition_8() {
    let (mut guided, mut tried) = (0, 0);
    for_every_world(|world, name| {
        let steering = steering(&world.workspace.robot);
        let robot = Robot { checker: &world.workspace.checker, steering: &steering };
        let options = &world.abstraction.options;
        let rbvd = &world.abstraction.rbvd;
        let abstraction = Abstraction { rbvd, options, rule: AllowedRule::default() };
        // A prime stride takes options from all over the map.
        for option in options.options().iter().step_by(7) {
            let mut rng = Seed(2).stream("guide", 0);
            tried += 1;
            let settings = GuideSettings::default();
            if let Ok(guide) = OptionGuide::new(option, &abstraction, &robot, &settings, &mut rng) {
                guided += 1;
                assert_guide(&guide.path, option, world, name);
            }
        }
    });
    assert!(tried > 300 && guided * 10 > tried * 9, "only {guided} of {tried} options have a guide");
}

/// The plans of Algorithm 1, line 9, with their guides: composed, guided, from start to goal.
#[test]
fn planned_legs_join_and_their_guides_lead_through() {
    let (mut planned, mut possible) = (0, 0);
    for_every_world(|world, name| {
        let (workspace, abstraction) = (&world.workspace, &world.abstraction);
        let query = world.query(&mut Seed(3).stream(name, 0));
        let settings = SearchSettings::new(workspace);
        let mut planner = Planner::new(workspace, abstraction, settings, query, [], Seed(3))
            .expect("roomy places have a state");
        let (start, goal) = (state_at(world, query.start), state_at(world, query.goal));
        possible += usize::from(reachable(&abstraction.rbvd, start).contains(&goal));
        if let Some(legs) = planner.plan(&|_| None, &()) {
            planned += 1;
            assert_plan(world, &query, &legs, name);
        }
    });
    assert!(
        possible > 70 && planned * 10 > possible * 9,
        "only {planned} of {possible} problems have a plan"
    );
}

fn assert_plan(world: &World, query: &Query, legs: &[Arc<Leg>], name: &str) {
    assert_composes(world, &legs.iter().map(|leg| leg.id).collect::<Vec<_>>(), name);
    let (first, last) = (legs[0].guide.start(), legs[legs.len() - 1].guide.end());
    assert_eq!(first.position, query.start.position, "{name}: the first guide starts elsewhere");
    assert_eq!(last.position, query.goal.position, "{name}: the last guide ends elsewhere");
    for pair in legs.windows(2) {
        let gap_m = pair[0].guide.end().distance_m(&pair[1].guide.start());
        assert!(gap_m < 1e-9, "{name}: {} and {} are {gap_m} m apart", pair[0].id, pair[1].id);
    }
    for leg in legs {
        if let LegId::Option(id) = leg.id {
            let option = world.abstraction.options.get(id).expect("an option of the set");
            assert_guide(&leg.guide, option, world, name);
        }
    }
}

//! The library outlives a change of the map, as far as the change does not reach.

use std::sync::Arc;

use sharp_options::OptionKind;
use sharp_plan::{
    Conditions, Method, OptionLibrary, Outcome, PlanningProblem, Query, Selection, Solution, map_hash, solve,
};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed};

use crate::worlds::TestWorld;

/// A corridor of 20 by 2.4 m with five regions in a row, cells of 0.2 m; a pillar stands at its far
/// end if asked for.
fn corridor(pillar: bool) -> TestWorld {
    let (length, width) = (101, 14);
    let mut drawing = String::new();
    for row in 0..width {
        for col in 0..length {
            let is_wall = row == 0 || row == width - 1 || col == 0 || col == length - 1;
            let is_pillar = pillar && (96..99).contains(&col) && (10..13).contains(&row);
            drawing.push(match (row, col) {
                _ if is_wall || is_pillar => '#',
                (6, 10 | 30 | 50 | 70 | 90) => char::from_digit((col as u32 - 10) / 20, 10).expect("0 to 4"),
                _ => '.',
            });
        }
        drawing.push('\n');
    }
    TestWorld::drawn(&drawing, RobotModel::husky(), OptionKind::Centroid)
}

/// The default method without repairs and with fewer episodes.
fn quick() -> Method {
    let mut selection = Selection::default();
    selection.screening_episodes = 40;
    let mut method = Method::fast().with_episodes(100, 100, 100);
    method.learner = Arc::new(selection);
    method.repair.rounds = 0;
    // The direct way uses no option.
    method.search.direct = false;
    method
}

fn solved(world: &TestWorld, library: &mut OptionLibrary) -> Solution {
    let method = quick();
    let conditions = Conditions::new(&world.world, NoiseModel::nominal());
    let query = Query { start: Pose::new(1.0, 1.4, 0.0), goal: Pose::new(18.8, 1.6, 0.0) };
    let problem = PlanningProblem {
        world: &world.world,
        method: &method,
        conditions: &conditions,
        query,
        seed: Seed(1),
        monitor: &(),
    };
    match solve(&problem, &world.abstraction, library) {
        Ok(Outcome::Solved(solution)) => *solution,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_changed_map_costs_only_the_options_whose_corridor_changed() {
    let root = tempfile::tempdir().expect("a temporary folder");
    let open = |world: &TestWorld| {
        let key = format!("husky-{}", map_hash(&world.world.grid));
        OptionLibrary::open(root.path(), &key).expect("a sound library")
    };
    let (before, after) = (corridor(false), corridor(true));
    let first = solved(&before, &mut open(&before));
    let reused = |solution: &Solution| {
        let steps = solution.steps.iter().filter(|step| step.reused);
        steps.map(|step| step.option.id.to_string()).collect::<Vec<_>>()
    };
    assert!(reused(&first).is_empty(), "there was nothing to reuse: {:?}", reused(&first));
    let second = solved(&after, &mut open(&after));
    assert_eq!(reused(&second), ["c:0-1", "c:1-2", "c:2-3"], "all that lies 3 m and more from the pillar");
    for (old, new) in first.steps.iter().zip(&second.steps).filter(|(_, new)| new.reused) {
        assert_eq!(old.learnt.estimate, new.learnt.estimate, "{}: its estimate", new.option.id);
    }
    let third = solved(&after, &mut open(&after));
    assert_eq!(reused(&third).len(), 4, "the second map's own options: {:?}", reused(&third));
}

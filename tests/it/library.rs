//! The library outlives a change of the map, as far as the change does not reach.

use sharp_options::OptionKind;
use sharp_plan::{
    LearnSettings, LearningMode, OptionLibrary, Outcome, Query, Solution, SolveSettings, map_hash, solve,
};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed};

use crate::worlds::World;

/// A corridor of 20 by 2.4 m with five regions in a row, cells of 0.2 m; a pillar stands at its far
/// end if asked for.
fn corridor(pillar: bool) -> World {
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
    World::drawn(&drawing, RobotModel::husky(), OptionKind::Centroid)
}

fn solved(world: &World, library: &mut OptionLibrary) -> Solution {
    let noise = NoiseModel::nominal();
    let settings = SolveSettings::new(&world.workspace, LearningMode::Fast, noise, Seed(1));
    let learn = LearnSettings { screening_episodes: 40, certify_episodes: 100, ..settings.learn };
    let settings = SolveSettings { learn, repair_rounds: 0, verify_episodes: 100, ..settings };
    let query = Query { start: Pose::new(1.0, 1.4, 0.0), goal: Pose::new(18.8, 1.6, 0.0) };
    match solve(&world.workspace, &world.abstraction, query, &settings, library, &()) {
        Ok(Outcome::Solved(solution)) => *solution,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_changed_map_costs_only_the_options_whose_corridor_changed() {
    let root = tempfile::tempdir().expect("a temporary folder");
    let open = |world: &World| {
        let key = format!("husky-{}", map_hash(&world.workspace.grid));
        OptionLibrary::open(root.path(), &key).expect("a sound library")
    };
    let (before, after) = (corridor(false), corridor(true));
    let first = solved(&before, &mut open(&before));
    let reused = |solution: &Solution| {
        let legs = solution.legs.iter().filter(|planned| planned.reused);
        legs.map(|planned| planned.leg.id.to_string()).collect::<Vec<_>>()
    };
    assert!(reused(&first).is_empty(), "there was nothing to reuse: {:?}", reused(&first));
    let second = solved(&after, &mut open(&after));
    assert_eq!(reused(&second), ["c:0-1", "c:1-2", "c:2-3"], "all that lies 3 m and more from the pillar");
    for (old, new) in first.legs.iter().zip(&second.legs).filter(|(_, new)| new.reused) {
        assert_eq!(old.learnt.verified, new.learnt.verified, "{}: its certificate", new.leg.id);
    }
    let third = solved(&after, &mut open(&after));
    assert_eq!(reused(&third).len(), 4, "the second map's own options: {:?}", reused(&third));
}

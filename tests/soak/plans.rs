//! Group 15: every guide of every plan, looked at four times as finely as the planner looks, by a checker of its own.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use sharp_guide::{GuidedOption, join_guides};
use sharp_options::OptionKind;
use sharp_plan::{Method, Search};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{OccupancyGrid, Pose, Seed};

use crate::checker::{Outline, deepest_m};
use crate::worlds::{abstraction, building, query, robot};
use crate::{cases, told};

/// Distance between two looks, metres: a quarter of the planner's.
const LOOK_M: f64 = 0.0125;
/// Between two looks of the planner, in which a point of the outline moves 5 to 8 cm, it may overlap an obstacle by this much, metres.
const ALLOWED_M: f64 = 0.005;
/// Plans that are tried in each building.
const QUERIES: u64 = 25;
/// Buildings in which something was found once: a wall beside a goal that the robot stood in, a bend that became tighter when a
/// joined guide was cut, a way of a minute to no plan, and corners that were cut.
const FOUND: [u64; 7] = [17, 60, 111, 260, 281, 411, 588];

/// What is wrong with the guides of a plan.
pub(crate) fn fault(
    grid: &OccupancyGrid,
    robot: &RobotModel,
    outline: &Outline,
    plan: &[std::sync::Arc<GuidedOption>],
) -> Option<String> {
    for option in plan {
        let poses = option.guide.poses();
        for (index, pair) in poses.windows(2).enumerate() {
            let (length_m, turn) = (pair[0].distance_m(&pair[1]), pair[0].heading.turn_to(pair[1].heading));
            if length_m >= option.guide.spacing_m() {
                return Some(format!("{}: a gap of {length_m} m", option.id));
            }
            let radius_m = robot.min_turning_radius_m();
            if turn.abs() * radius_m > 1.101 * length_m {
                return Some(format!(
                    "{}: a bend of {} m at {:?}, the robot needs {radius_m} m",
                    option.id,
                    length_m / turn.abs(),
                    pair[0]
                ));
            }
            let steps = (length_m / LOOK_M).ceil().max(1.0);
            for i in 0..=steps as usize {
                let share = i as f64 / steps;
                let position = pair[0].position + (pair[1].position - pair[0].position) * share;
                let pose = Pose::at(position, (pair[0].heading.radians() + turn * share).into());
                let overlap_m = deepest_m(grid, outline, pose);
                if overlap_m > ALLOWED_M {
                    return Some(format!(
                        "{}: {overlap_m} m inside an obstacle after pose {index}, at {pose:?}",
                        option.id
                    ));
                }
            }
        }
    }
    None
}

#[test]
fn no_plan_leads_through_an_obstacle_or_round_a_bend_that_is_too_tight() {
    let since = Instant::now();
    let buildings = cases(100, 1_000_000).div_ceil(QUERIES);
    let others = (0..buildings).filter(|number| !FOUND.contains(number));
    let (tried, planned, slowest_ms) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
    let faults: Vec<String> = FOUND
        .into_iter()
        .chain(others)
        .collect::<Vec<_>>()
        .into_par_iter()
        .flat_map_iter(|number| {
            let mut rng = Seed(18).stream("soak plans", number);
            let grid = building(&mut rng);
            let (robot, outline) = robot(&mut rng);
            let kind = [OptionKind::Centroid, OptionKind::Interface][(number % 2) as usize];
            let mut faults = Vec::new();
            let Some((world, abstraction)) = abstraction(&grid, robot.clone(), kind) else { return faults };
            let (method, noise) = (Method::fast(), NoiseModel::nominal());
            for _ in 0..QUERIES {
                let Some(query) = query(&world, &mut rng) else { break };
                tried.fetch_add(1, Ordering::Relaxed);
                let begun = Instant::now();
                let search = Search::new(&world, &abstraction, &method, &noise, query, [], Seed(number));
                let plan = search.ok().and_then(|mut search| search.plan(&|_| None, &()));
                slowest_ms.fetch_max(begun.elapsed().as_millis() as u64, Ordering::Relaxed);
                let Some((_, plan)) = plan else { continue };
                planned.fetch_add(1, Ordering::Relaxed);
                let joined = join_guides(plan, query.start, &world.guide_robot(), &method.search.guide);
                if let Some(fault) = fault(&grid, &robot, &outline, &joined) {
                    faults.push(format!("building {number}, {query:?}: {fault}"));
                }
            }
            faults
        })
        .collect();
    let (tried, planned) = (tried.into_inner(), planned.into_inner());
    told(
        "guides keep clear of obstacles",
        planned,
        &format!(
            "{} faults, {} without a plan, the slowest {:.2} s",
            faults.len(),
            tried - planned,
            Duration::from_millis(slowest_ms.into_inner()).as_secs_f64()
        ),
        since,
    );
    assert!(faults.is_empty(), "{} of {planned}: {:#?}", faults.len(), &faults[..faults.len().min(10)]);
    assert!(2 * planned > tried, "too few have a plan: {planned} of {tried}");
}

//! Group 17: thousands of problems and lines in one process, with flat memory and descriptors.

use std::sync::Arc;
use std::time::Instant;

use rand::RngExt;
use sharp_drive::World;
use sharp_options::OptionId;
use sharp_plan::{Answer, Method, OptionLibrary, Plan, Query, Reading, RemoteDriver, Sharp};
use sharp_rbvd::StateId;
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose, Seed};

use crate::worlds::Drawing;
use crate::{cases, told};

/// Resident memory of this process, megabytes, and its open files; `None` where there is no `/proc`.
fn footprint() -> Option<(f64, usize)> {
    let pages: f64 =
        std::fs::read_to_string("/proc/self/statm").ok()?.split_whitespace().nth(1)?.parse().ok()?;
    Some((pages * 4096.0 / 1e6, std::fs::read_dir("/proc/self/fd").ok()?.count()))
}

/// Calls `work` with 0, 1, ..., and asserts that the second half takes no more memory or files than the first.
fn assert_flat(promise: &str, count: u64, mut work: impl FnMut(u64)) {
    let since = Instant::now();
    (0..count / 2).for_each(&mut work);
    let Some((half_mb, half_files)) = footprint() else { return };
    (count / 2..count).for_each(&mut work);
    let (mb, files) = footprint().expect("it was there");
    told(
        promise,
        count,
        &format!("{half_mb:.0} MB after half, {mb:.0} MB after all, {files} open files"),
        since,
    );
    // The allocator keeps what it had at its peak; a leak grows with the number of cases. Without a soak other tests of this
    // program run meanwhile, and their memory counts as well.
    let slack_mb = if std::env::var_os("SHARP_SOAK").is_some() { 16.0 } else { 128.0 };
    assert!(
        mb < half_mb * 1.1 + slack_mb,
        "{promise}: {half_mb} MB after half of {count}, {mb} MB after all"
    );
    assert!(files <= half_files + 2, "{promise}: {half_files} open files after half, {files} after all");
}

fn hall() -> World {
    let mut drawing = Drawing::room(60, 40);
    drawing.paint(29..31, 0..24, true);
    World::new(drawing.grid(0.1), RobotModel::limo())
}

/// Four rooms in a row with doors at either end by turns.
fn row_of_rooms() -> OccupancyGrid {
    let mut drawing = Drawing::room(160, 40);
    for (col, door) in [(40, 4..18), (80, 22..36), (120, 4..18)] {
        drawing.paint(col..col + 2, 0..40, true);
        drawing.paint(col..col + 2, door, false);
    }
    drawing.grid(0.1)
}

fn quick() -> Method {
    Method::fast().with_episodes(20, 20, 20)
}

#[test]
fn solving_again_and_again_leaks_nothing() {
    let mut sharp = Sharp::new(hall(), GeometricDetector::default()).with_method(quick());
    let mut rng = Seed(17).stream("endurance", 0);
    assert_flat("problems solved in one process", cases(20, 10_000), |_| {
        let mut pose = |x: f64| Pose::new(x + rng.random::<f64>(), 1.0 + 2.0 * rng.random::<f64>(), 0.0);
        let query = Query { start: pose(0.8), goal: pose(4.0) };
        let answer = sharp.solve(query, &()).expect("there is room");
        assert!(matches!(answer, Answer::Solved(_)), "{query:?}: {answer:?}");
    });
}

#[test]
fn a_library_of_a_thousand_options_opens_in_bounded_time() {
    let root = tempfile::tempdir().expect("a folder");
    let mut method = quick();
    method.search.direct = false;
    let library = OptionLibrary::open(root.path(), "key-map").expect("empty");
    let world = World::new(row_of_rooms(), RobotModel::limo());
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(method).with_library(library);
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(15.0, 1.0, 0.0) };
    assert!(matches!(sharp.solve(query, &()), Ok(Answer::Solved(_))), "there is a way");
    let library = sharp.library_mut();
    let option = library.iter().next().expect("an option was learnt").1.clone();
    for number in 0..1000 {
        let id = OptionId::Centroid { from: StateId(number), to: StateId(number + 1) };
        library.insert(id, option.clone()).expect("there is room");
    }
    library.save().expect("written");
    let since = Instant::now();
    let opened = OptionLibrary::open(root.path(), "key-map").expect("sound");
    assert!(opened.len() >= 1000, "{} options", opened.len());
    told("options of one library that is opened", opened.len() as u64, "all are sound", since);
    assert!(since.elapsed().as_secs_f64() < 10.0, "it took {:?}", since.elapsed());
}

#[test]
fn a_hundred_thousand_poses_are_answered() {
    let mut sharp = Sharp::new(hall(), GeometricDetector::default()).with_method(quick());
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(5.0, 1.0, 0.0) };
    let Answer::Solved(plan) = sharp.solve(query, &()).expect("there is room") else { panic!("no plan") };
    let plan: Arc<Plan> = Arc::new(*plan);
    let mut rng = Seed(17).stream("poses", 0);
    let reading = |pose| Reading { pose, speed_mps: None, yaw_rate_radps: None };
    let mut driver: Option<RemoteDriver> = None;
    assert_flat("poses answered", cases(2_000, 100_000), |number| {
        // A robot that jumps about: every answer is one that it can carry out.
        let pose =
            Pose::new(0.5 + 5.0 * rng.random::<f64>(), 0.5 + 3.0 * rng.random::<f64>(), rng.random::<f64>());
        if number % 50 == 0 {
            driver = None;
        }
        let driver =
            driver.get_or_insert_with(|| RemoteDriver::new(vec![Arc::clone(&plan)], &reading(pose), true));
        let answer = driver.answer(&reading(pose));
        assert!(
            answer.speed_mps.is_finite() && answer.waypoint.is_none_or(|at| at.is_finite()),
            "{pose:?}: {answer:?}"
        );
    });
}

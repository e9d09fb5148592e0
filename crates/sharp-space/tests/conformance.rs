//! Our implementations keep the promises of the traits, and the suites notice broken ones.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use sharp_space::conformance::{
    CheckerViolation, DetectorViolation, GeometryViolation, check_collision_checker, check_geometry,
    check_region_detector,
};
use sharp_space::{
    Bounds, Cell, CollisionChecker, Detection, DistanceField, Footprint, FootprintChecker, GridFrame,
    Occupancy, OccupancyGrid, Point, Pose, Region, RegionDetector, RegionId, RobotGeometry,
};

/// Rooms in a frame that is turned and shifted.
fn rooms() -> OccupancyGrid {
    let drawing = "
        ############
        #.....#....#
        #..........#
        #.....#....#
        #.....#....#
        ###..#######
        #..........#
        #......?...#
        ############";
    let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
    let frame = GridFrame { origin: Pose::new(7.0, -3.0, 0.6), resolution_m: 1.0, ..*grid.frame() };
    OccupancyGrid::new(frame, grid.cells().to_vec()).unwrap()
}

fn checker() -> FootprintChecker {
    FootprintChecker::new(&rooms(), Footprint::rectangle(0.5, 0.3).unwrap())
}

#[test]
fn the_footprint_checker_conforms() {
    let checker = checker();
    assert_eq!(check_collision_checker(&checker, checker.field().frame().bounds()), Ok(()));
    assert_eq!(check_geometry(&checker), Ok(()));
    assert_eq!(check_geometry(&*checker.inflated(0.1)), Ok(()), "with a margin");
    for outline in [
        Footprint::disc(0.6).unwrap(),
        Footprint::from_nav2("[[0.9, 0.0], [0.5, 0.4], [-0.2, 0.4], [-0.2, -0.4], [0.5, -0.4]]").unwrap(),
    ] {
        let other = checker.with_footprint(outline);
        assert_eq!(check_geometry(&other), Ok(()), "{outline:?}");
        assert_eq!(check_geometry(&*other.inflated(0.1)), Ok(()), "{outline:?} with a margin");
    }
    assert_eq!(check_geometry(&Arc::new(checker)), Ok(()), "behind a pointer");
}

#[test]
fn a_margin_makes_the_footprint_larger_on_each_side() {
    let checker = checker();
    let expected = Footprint::rectangle(0.5 + 0.1, 0.3 + 0.1).unwrap();
    assert_eq!(*checker.inflated(0.1).footprint(), expected);
    assert_eq!(checker.inflated(30.0).footprint(), checker.footprint(), "too large for a footprint");
}

/// A checker made of two closures: poses and segments.
struct Closures<P, S>(P, S);

impl<P: Fn(Pose) -> bool, S: Fn(Pose, Pose) -> bool> CollisionChecker for Closures<P, S> {
    fn is_free(&self, pose: Pose) -> bool {
        (self.0)(pose)
    }

    fn is_segment_free(&self, from: Pose, to: Pose, _: f64) -> bool {
        (self.1)(from, to)
    }
}

#[test]
fn broken_checkers_are_noticed() {
    let bounds = Bounds { min: Point::new(0.0, 0.0), max: Point::new(5.0, 3.0) };
    let inside = |pose: Pose| pose.is_finite() && bounds.contains(pose.position);
    let violation = |checker: &dyn CollisionChecker| check_collision_checker(checker, bounds).unwrap_err();
    let everywhere = violation(&Closures(|_| true, |_, _| true));
    assert!(matches!(everywhere, CheckerViolation::NotFinite(_)), "{everywhere}");
    let outside = violation(&Closures(|pose: Pose| pose.is_finite(), |_, _| true));
    assert!(matches!(outside, CheckerViolation::Outside(_)), "{outside}");
    let flag = AtomicBool::new(false);
    let fickle =
        violation(&Closures(|pose| inside(pose) && flag.fetch_xor(true, Ordering::Relaxed), |_, _| true));
    assert!(matches!(fickle, CheckerViolation::NotDeterministic(_)), "{fickle}");
    let stuck = violation(&Closures(inside, |_, _| false));
    assert!(matches!(stuck, CheckerViolation::Stay(_)), "{stuck}");
    let right = |pose: Pose| inside(pose) && pose.position.x > 2.0;
    let blind = violation(&Closures(right, |from: Pose, to: Pose| from != to || right(from)));
    assert!(matches!(blind, CheckerViolation::Segment { .. }), "{blind}");
}

/// A geometry that answers with `is_free`, and `inflated` when it is made larger.
#[derive(Clone, Debug)]
struct Odd {
    own: FootprintChecker,
    is_free: fn(&FootprintChecker, Pose) -> bool,
    inflated: fn(&FootprintChecker, f64) -> FootprintChecker,
}

impl CollisionChecker for Odd {
    fn is_free(&self, pose: Pose) -> bool {
        (self.is_free)(&self.own, pose)
    }
}

impl RobotGeometry for Odd {
    fn clearance(&self) -> &DistanceField {
        self.own.field()
    }

    fn footprint(&self) -> &Footprint {
        self.own.footprint()
    }

    fn inflated(&self, margin_m: f64) -> Arc<dyn RobotGeometry> {
        Arc::new(Self { own: (self.inflated)(&self.own, margin_m), ..self.clone() })
    }
}

#[test]
fn broken_geometries_are_noticed() {
    let sound = Odd {
        own: checker(),
        is_free: |own, pose| own.is_free(pose),
        inflated: |own, margin_m| {
            let (length_m, width_m) = (own.footprint().half_length_m(), own.footprint().half_width_m());
            own.with_footprint(Footprint::rectangle(length_m + margin_m, width_m + margin_m).unwrap())
        },
    };
    assert_eq!(check_geometry(&sound), Ok(()));
    let violation = |odd: Odd| check_geometry(&odd).unwrap_err();
    let ghost = violation(Odd {
        is_free: |own, pose| own.field().frame().cell_at(pose.position).is_some(),
        ..sound.clone()
    });
    assert!(matches!(ghost, GeometryViolation::InObstacle(_)), "{ghost}");
    let shy = violation(Odd { is_free: |_, _| false, ..sound.clone() });
    assert!(matches!(shy, GeometryViolation::ClearanceIgnored(_)), "{shy}");
    let smaller = |own: &FootprintChecker, margin_m: f64| {
        own.with_footprint(Footprint::rectangle(0.5 - margin_m, 0.3 - margin_m).unwrap())
    };
    let shrinking = violation(Odd { inflated: smaller, ..sound.clone() });
    assert!(matches!(shrinking, GeometryViolation::InflatedFootprint { .. }), "{shrinking}");
    let elsewhere = |_: &FootprintChecker, margin_m: f64| {
        let grid = OccupancyGrid::from_ascii(0.5, "#....#\n#....#").unwrap();
        if margin_m == 0.0 {
            checker()
        } else {
            FootprintChecker::new(&grid, Footprint::rectangle(0.6 + margin_m, 0.4 + margin_m).unwrap())
        }
    };
    let moved = violation(Odd { inflated: elsewhere, ..sound });
    assert!(matches!(moved, GeometryViolation::InflatedGrid { .. }), "{moved}");
}

/// A detector made of a closure.
struct Detector<F>(F);

impl<F: Fn(&OccupancyGrid) -> Detection + Send + Sync> RegionDetector for Detector<F> {
    fn detect(&self, grid: &OccupancyGrid, _: &Footprint) -> Detection {
        (self.0)(grid)
    }
}

/// One region at the first free cell, with the id `id`.
fn first_free(grid: &OccupancyGrid, id: u32) -> Option<Region> {
    let cell =
        (0..grid.frame().len()).map(|index| grid.frame().cell(index)).find(|&cell| grid.is_free(cell))?;
    Some(Region { id: RegionId(id), cells: vec![cell], representative: cell })
}

#[test]
fn broken_detectors_are_noticed() {
    let with_id =
        |id| move |grid: &OccupancyGrid| Detection::new(first_free(grid, id).into_iter().collect(), "test");
    assert_eq!(check_region_detector(&Detector(with_id(0))), Ok(()));
    let misnumbered = check_region_detector(&Detector(with_id(1)));
    assert_eq!(misnumbered, Err(DetectorViolation::Id { map: "the free map", position: 0, id: 1 }));
    let in_a_wall = |_: &OccupancyGrid| {
        let cell = Cell::new(0, 0);
        Detection::new(vec![Region { id: RegionId(0), cells: vec![cell], representative: cell }], "test")
    };
    let problem = "has a cell that is not free";
    let expected = DetectorViolation::Cells { map: "the blocked map", id: 0, problem };
    assert_eq!(check_region_detector(&Detector(in_a_wall)), Err(expected));
    let nameless = |_: &OccupancyGrid| Detection::new(Vec::new(), "");
    let violation = check_region_detector(&Detector(nameless)).unwrap_err();
    assert!(matches!(violation, DetectorViolation::Source { .. }), "{violation}");
    for values in [vec![0.5; 3], vec![1.5; 24 * 18]] {
        let criticality =
            |_: &OccupancyGrid| Detection::new(Vec::new(), "test").with_criticality(values.clone());
        assert!(check_region_detector(&Detector(criticality)).is_err(), "{} values", values.len());
    }
    let fragile = |grid: &OccupancyGrid| {
        assert!(grid.cells().contains(&Occupancy::Occupied), "no wall");
        Detection::new(Vec::new(), "test")
    };
    let panics = Err(DetectorViolation::Panic { map: "the free map" });
    assert_eq!(check_region_detector(&Detector(fragile)), panics);
}

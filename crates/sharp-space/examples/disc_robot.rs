//! A round robot with a collision test of its own, checked by the conformance suite.
//!
//! `cargo run --release -p sharp-space --example disc_robot`

use std::sync::Arc;

use sharp_space::conformance::check_geometry;
use sharp_space::{CollisionChecker, DistanceField, Footprint, OccupancyGrid, Pose, RobotGeometry};

/// A disc in a map. It is free where the nearest obstacle is further away than its radius.
#[derive(Clone, Debug)]
struct Disc {
    field: Arc<DistanceField>,
    square: Footprint,
}

impl Disc {
    fn new(grid: &OccupancyGrid, radius_m: f64) -> Self {
        let square = Footprint::rectangle(radius_m, radius_m).expect("the radius is positive");
        Self { field: Arc::new(DistanceField::new(grid)), square }
    }
}

impl CollisionChecker for Disc {
    fn is_free(&self, pose: Pose) -> bool {
        pose.is_finite() && self.field.clearance_lower_bound(pose.position) > self.square.half_width_m()
    }
}

impl RobotGeometry for Disc {
    fn clearance(&self) -> &DistanceField {
        &self.field
    }

    fn footprint(&self) -> &Footprint {
        &self.square
    }

    fn inflated(&self, margin_m: f64) -> Arc<dyn RobotGeometry> {
        let radius_m = self.square.half_width_m() + margin_m;
        let square = Footprint::rectangle(radius_m, radius_m).unwrap_or(self.square);
        Arc::new(Self { square, ..self.clone() })
    }
}

fn main() {
    let drawing = "############\n#..........#\n#..........#\n#..........#\n#..........#\n############";
    let grid = OccupancyGrid::from_ascii(0.5, drawing).expect("the drawing is sound");
    let robot = Disc::new(&grid, 0.25);
    assert_eq!(check_geometry(&robot), Ok(()));
    let middle = Pose::new(3.0, 1.5, 0.7);
    assert!(robot.is_free(middle), "the room is 2 m wide");
    assert!(!robot.inflated(0.6).is_free(middle), "with a margin of 0.6 m it is 1.7 m wide itself");
    println!("a disc of 0.25 m passes the conformance suite");
}

//! A robot's outline in one map, as everything above this crate asks for it.

use std::fmt::Debug;
use std::sync::Arc;

use crate::collision::{CollisionChecker, FootprintChecker};
use crate::distance_field::DistanceField;
use crate::footprint::Footprint;

/// Where a robot's outline fits in one map.
///
/// Planners ask for this trait instead of a certain checker, so that a robot of any shape can be planned for.
/// The reference point of the robot must belong to its outline.
/// [`conformance::check_geometry`](crate::conformance::check_geometry) tests an implementation.
pub trait RobotGeometry: CollisionChecker + Debug + Send + Sync {
    /// The distance from each cell to the nearest blocked one, metres.
    fn clearance(&self) -> &DistanceField;

    /// The robot's outline, or a rectangle around it. Its inscribed radius is the least clearance that planners
    /// expect the robot to need; with more than its circumscribed radius the robot is free at any heading.
    fn footprint(&self) -> &Footprint;

    /// The same map for an outline that is `margin_m` metres larger on each side; `margin_m` is at least 0.
    /// An outline that cannot grow that much stays as it is.
    fn inflated(&self, margin_m: f64) -> Arc<dyn RobotGeometry>;
}

impl RobotGeometry for FootprintChecker {
    fn clearance(&self) -> &DistanceField {
        self.field()
    }

    fn footprint(&self) -> &Footprint {
        self.footprint()
    }

    fn inflated(&self, margin_m: f64) -> Arc<dyn RobotGeometry> {
        let own = self.footprint();
        Arc::new(self.with_footprint(own.grown(margin_m).unwrap_or(*own)))
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<G: RobotGeometry + ?Sized> RobotGeometry for $pointer {
            fn clearance(&self) -> &DistanceField {
                (**self).clearance()
            }

            fn footprint(&self) -> &Footprint {
                (**self).footprint()
            }

            fn inflated(&self, margin_m: f64) -> Arc<dyn RobotGeometry> {
                (**self).inflated(margin_m)
            }
        }
    )*};
}

forward!(&G, Box<G>, Arc<G>);

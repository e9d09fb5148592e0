//! The only place where the engine's types meet ours.
//!
//! The engine computes in single precision. Its frame is that of the grid, with the origin in the lower-left
//! corner, so that a map far from the world's origin loses no precision and walls are parallel to the axes.

use parry2d::math::{Pose as EnginePose, Vector as EngineVector};
use parry2d::shape::SharedShape;
use sharp_space::{GridFrame, Heading, Pose, Vector};

use crate::obstacle_map::Wall;
use crate::rectangles::CellRectangle;

/// The walls of the map as one shape in the grid's frame.
#[derive(Clone)]
pub(crate) struct Obstacles {
    shape: SharedShape,
    origin: Pose,
}

impl std::fmt::Debug for Obstacles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Obstacles").field("origin", &self.origin).finish_non_exhaustive()
    }
}

impl Obstacles {
    pub(crate) fn new(frame: &GridFrame, rectangles: &[CellRectangle]) -> Self {
        let cell = frame.resolution_m;
        let (width, height) = (frame.width as f64 * cell, frame.height as f64 * cell);
        // A wall of one metre around the map keeps the robot inside.
        let border = [
            slab(-1.0, -1.0, width + 2.0, 1.0),
            slab(-1.0, height, width + 2.0, 1.0),
            slab(-1.0, 0.0, 1.0, height),
            slab(width, 0.0, 1.0, height),
        ];
        let walls = rectangles.iter().map(|r| {
            let (x, y) = (r.corner.col as f64 * cell, r.corner.row as f64 * cell);
            slab(x, y, r.width as f64 * cell, r.height as f64 * cell)
        });
        let shape = SharedShape::compound(border.into_iter().chain(walls).collect());
        Self { shape, origin: frame.origin }
    }

    pub(crate) fn walls(&self) -> impl Iterator<Item = Wall> {
        let parts = self.shape.as_compound().expect("it was built as a compound").shapes();
        parts.iter().map(|(pose, part)| {
            let half_extents = part.as_cuboid().expect("its parts are boxes").half_extents;
            Wall { center: our_vector(pose.translation), half_extents: our_vector(half_extents) }
        })
    }

    pub(crate) fn shape(&self) -> SharedShape {
        self.shape.clone()
    }

    pub(crate) fn to_engine(&self, pose: &Pose) -> EnginePose {
        let local = self.origin.to_local(pose.position);
        let turn = self.origin.heading.turn_to(pose.heading);
        EnginePose::new(engine_vector(local), turn as f32)
    }

    pub(crate) fn in_world(&self, pose: &EnginePose) -> Pose {
        let heading = Heading::new(self.origin.heading.radians() + f64::from(pose.rotation.angle()));
        Pose::at(self.origin.to_world(our_vector(pose.translation)), heading)
    }
}

pub(crate) fn engine_vector(vector: Vector) -> EngineVector {
    EngineVector::new(vector.x as f32, vector.y as f32)
}

pub(crate) fn our_vector(vector: EngineVector) -> Vector {
    Vector::new(f64::from(vector.x), f64::from(vector.y))
}

/// A box with its lower-left corner at (`x`, `y`), metres.
fn slab(x: f64, y: f64, width: f64, height: f64) -> (EnginePose, SharedShape) {
    let center = Vector::new(x + width / 2.0, y + height / 2.0);
    let shape = SharedShape::cuboid((width / 2.0) as f32, (height / 2.0) as f32);
    (EnginePose::new(engine_vector(center), 0.0), shape)
}

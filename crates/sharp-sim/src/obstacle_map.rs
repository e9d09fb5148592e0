//! The part of a simulation that never changes: the map, prepared for one robot.

use std::sync::Arc;

use sharp_space::{
    DistanceField, Footprint, FootprintChecker, GridFrame, OccupancyGrid, Pose, RobotGeometry, Vector, trig,
};

use crate::convert::Obstacles;
use crate::rectangles::merge_blocked_cells;

/// A block of wall, its sides parallel to the grid's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Its centre as seen from the grid's lower-left corner, metres.
    pub center: Vector,
    /// Half its length along the grid's rows and columns, metres.
    pub half_extents: Vector,
}

/// The map around a robot of a given outline; shared by all simulators and their forks.
#[derive(Clone, Debug)]
pub struct ObstacleMap {
    geometry: Arc<dyn RobotGeometry>,
    obstacles: Obstacles,
    cover: DiscCover,
}

impl ObstacleMap {
    /// Prepares `grid` for a robot of outline `footprint`; whatever is not free blocks it, and so
    /// does the border of the grid.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, footprint: Footprint) -> Self {
        Self::with_geometry(grid, Arc::new(FootprintChecker::new(grid, footprint)))
    }

    /// Prepares `grid` for a robot whose outline `geometry` tests. Engines with contacts take the outline that it
    /// says, [`RobotGeometry::footprint`].
    ///
    /// # Panics
    /// If `geometry` belongs to another grid.
    #[must_use]
    pub fn with_geometry(grid: &OccupancyGrid, geometry: Arc<dyn RobotGeometry>) -> Self {
        assert_eq!(grid.frame(), geometry.clearance().frame(), "grid and geometry are of one map");
        Self {
            obstacles: Obstacles::new(grid.frame(), &merge_blocked_cells(grid)),
            cover: DiscCover::new(geometry.footprint()),
            geometry,
        }
    }

    /// Where the grid lies in the world.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        self.field().frame()
    }

    /// The exact collision test of the robot's outline.
    #[must_use]
    pub fn checker(&self) -> &dyn RobotGeometry {
        &*self.geometry
    }

    /// The distance field of the map.
    #[must_use]
    pub fn field(&self) -> &DistanceField {
        self.geometry.clearance()
    }

    /// Everything that blocks the robot, as few boxes: the blocked cells, merged, and a border of one metre
    /// around the grid.
    pub fn walls(&self) -> impl Iterator<Item = Wall> {
        self.obstacles.walls()
    }

    /// How far every point of the outline at `pose` can certainly move before it meets an obstacle,
    /// metres; 0 or less where only the exact test can tell.
    pub(crate) fn slack_m(&self, pose: &Pose) -> f64 {
        let field = self.field();
        let frame = field.frame();
        let at = |ahead_m: f64| {
            let center = pose.to_world(Vector::new(ahead_m, 0.0));
            frame.cell_at(center).map_or(0.0, |cell| field.at(cell))
        };
        let least = self.cover.offsets_m.iter().map(|&offset| at(offset)).fold(f64::INFINITY, f64::min);
        // The field measures from cell centre to cell centre: half a diagonal at either end.
        least - std::f64::consts::SQRT_2 * frame.resolution_m - self.cover.radius_m
    }

    /// Distance from the reference point to the furthest centre of a disc of the cover, metres.
    pub(crate) const fn cover_reach_m(&self) -> f64 {
        self.cover.offsets_m[2]
    }

    pub(crate) const fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }
}

/// Three discs along the robot's axis that together cover its outline. More discs fit the sides
/// better but stick out further in front.
#[derive(Clone, Copy, Debug)]
struct DiscCover {
    offsets_m: [f64; 3],
    radius_m: f64,
}

impl DiscCover {
    fn new(footprint: &Footprint) -> Self {
        let third_m = footprint.half_length_m() / 3.0;
        Self {
            offsets_m: [-2.0 * third_m, 0.0, 2.0 * third_m],
            radius_m: trig::hypot(third_m, footprint.half_width_m()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_there_is_slack_the_robot_is_free() {
        let grid = OccupancyGrid::from_ascii(
            0.5,
            "
            ##########
            #........#
            #........#
            #......#.#
            #........#
            ##########",
        )
        .unwrap();
        let map = ObstacleMap::new(&grid, Footprint::rectangle(0.4, 0.2).unwrap());
        let mut roomy = 0;
        arbtest::arbtest(|u| {
            let mut number =
                |max: f64| u.int_in_range(0..=100_000_u32).map(|i| f64::from(i) / 100_000.0 * max);
            let pose = Pose::new(number(5.0)?, number(3.0)?, number(6.3)?);
            if map.slack_m(&pose) > 0.0 {
                roomy += 1;
                assert!(map.checker().is_free(pose), "{pose:?}");
            }
            Ok(())
        });
        assert!(roomy > 0, "the room has poses with slack");
        assert!(map.slack_m(&Pose::new(f64::NAN, 0.0, 0.0)) < 0.0, "a pose that is nowhere has no slack");
        assert!(!map.checker().is_free(Pose::new(f64::NAN, 0.0, 0.0)));
    }
}

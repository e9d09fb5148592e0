//! Worlds that several tests share: drawn ones with regions by hand, generated ones with geometric
//! regions. None needs a network.

use std::sync::Arc;

use rand::RngExt;
use sharp_drive::World;
use sharp_maps::{FloorplanKind, generate};
use sharp_options::{OptionKind, OptionSet, OptionSettings};
use sharp_plan::{Abstraction, Query};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_regions::{GeometricSettings, geometric_regions};
use sharp_sim::RobotModel;
use sharp_space::{Cell, DistanceField, OccupancyGrid, Pose, Region, RegionId, Seed, Stream};

/// A map, a robot and the options between the map's regions.
pub(crate) struct TestWorld {
    pub(crate) world: World,
    pub(crate) abstraction: Abstraction,
}

/// Two rooms of 3.8 m and a door of 1.6 m between them; digits are regions, cells are 0.2 m.
pub(crate) const ROOMS: &str = "
    #########################################
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #.......................................#
    #.......................................#
    #.......................................#
    #.......................................#
    #.......0...........1...........2.......#
    #.......................................#
    #.......................................#
    #.......................................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #########################################";

impl TestWorld {
    /// A drawn map with cells of 0.2 m, on which the digits 0, 1, … mark regions of one cell.
    pub(crate) fn drawn(drawing: &str, robot: RobotModel, kind: OptionKind) -> Self {
        let plain: String = drawing.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
        let grid = OccupancyGrid::from_ascii(0.2, &plain).expect("a sound drawing");
        let field = DistanceField::new(&grid);
        let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
        let mut marks: Vec<(u32, Cell)> = Vec::new();
        for (row, line) in rows.iter().rev().enumerate() {
            marks.extend(
                line.char_indices().filter_map(|(col, c)| Some((c.to_digit(10)?, Cell::new(col, row)))),
            );
        }
        marks.sort_unstable();
        let region = |&(id, cell)| Region::new(RegionId(id), vec![cell], &field).expect("one cell");
        let regions: Vec<Region> = marks.iter().map(region).collect();
        Self::new(grid, robot, &regions, kind)
    }

    /// `grid` with one region, its roomiest cell.
    pub(crate) fn with_one_region(grid: OccupancyGrid, robot: RobotModel, kind: OptionKind) -> Self {
        let field = DistanceField::new(&grid);
        let frame = *field.frame();
        let roomiest = (0..frame.len())
            .map(|index| frame.cell(index))
            .max_by(|&a, &b| field.at(a).total_cmp(&field.at(b)));
        let region = Region::new(RegionId(0), roomiest.into_iter().collect(), &field).expect("one cell");
        Self::new(grid, robot, &[region], kind)
    }

    /// A floor plan 15 m wide with cells of 0.1 m and the regions that geometry gives.
    pub(crate) fn generated(plan: FloorplanKind, robot: RobotModel, kind: OptionKind) -> Self {
        let grid = generate(plan, 15.0, 0.1, &mut Seed(11).stream("map", plan as u64));
        let prediction = geometric_regions(&grid, &robot.footprint, &GeometricSettings::default());
        Self::new(grid, robot, &prediction.regions, kind)
    }

    fn new(grid: OccupancyGrid, robot: RobotModel, regions: &[Region], kind: OptionKind) -> Self {
        let resolution_m = grid.frame().resolution_m;
        let world = World::new(grid, robot);
        let settings = RbvdSettings::for_footprint(&world.robot.footprint, 0.5 * resolution_m, resolution_m);
        let rbvd = Rbvd::build(world.geometry.clearance(), regions, &settings).expect("room for the robot");
        let options = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
        Self { world, abstraction: Abstraction { states: Arc::new(rbvd), options: Arc::new(options) } }
    }

    /// Two places where the robot fits whatever its heading, at random.
    pub(crate) fn query(&self, rng: &mut Stream) -> Query {
        let field = self.world.geometry.clearance();
        let frame = field.frame();
        let room_m = self.world.robot.footprint.circumscribed_radius_m() + frame.resolution_m;
        let roomy: Vec<Cell> =
            (0..frame.len()).map(|index| frame.cell(index)).filter(|&cell| field.at(cell) > room_m).collect();
        let mut pose = || {
            let heading = std::f64::consts::TAU * rng.random::<f64>();
            Pose::at(frame.center(roomy[rng.random_range(0..roomy.len())]), heading.into())
        };
        Query { start: pose(), goal: pose() }
    }
}

//! Another state abstraction than the diagram: square tiles instead of critical regions.

use sharp_rbvd::conformance::check_abstraction;
use sharp_rbvd::{Portal, PortalSettings, Rbvd, StateAbstraction, StateGrid, StateId, find_portals};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Point, Region, RegionId};

/// Side of a tile, cells.
const SIDE: usize = 4;

/// One state for each tile of the map; its region is all of its free cells.
#[derive(Debug)]
struct Tiles {
    cells: StateGrid,
    regions: Vec<Region>,
    portals: Vec<Portal>,
}

impl Tiles {
    fn new(grid: &OccupancyGrid) -> Self {
        let (frame, clearance) = (*grid.frame(), DistanceField::new(grid));
        let columns = frame.width.div_ceil(SIDE);
        let tile = |cell: Cell| StateId((cell.row / SIDE * columns + cell.col / SIDE) as u32);
        let all = || (0..frame.len()).map(|index| frame.cell(index));
        let states = all().map(|cell| grid.is_free(cell).then(|| tile(cell)));
        let cells = StateGrid::new(frame, states, 0.0).expect("one state for each cell");
        let count = columns * frame.height.div_ceil(SIDE);
        let members = |id: u32| all().filter(|&cell| cells.state_of(cell) == Some(StateId(id))).collect();
        let region = |id| Region::new(RegionId(id), members(id), &clearance).expect("tiles have free cells");
        let regions = (0..count as u32).map(region).collect();
        let portals = find_portals(&cells, &clearance, &PortalSettings::default());
        Self { cells, regions, portals }
    }
}

impl StateAbstraction for Tiles {
    fn cells(&self) -> &StateGrid {
        &self.cells
    }

    fn regions(&self) -> &[Region] {
        &self.regions
    }

    fn portals(&self) -> &[Portal] {
        &self.portals
    }
}

fn main() {
    let drawing = "........\n........\n........\n.......#\n###..###\n.......#\n........\n........";
    let tiles = Tiles::new(&OccupancyGrid::from_ascii(0.5, drawing).expect("the map is sound"));
    check_abstraction(&tiles).expect("tiles are a state abstraction");
    assert_eq!(tiles.state_at(Point::new(3.9, 0.1)), Some(StateId(1)), "the lower right tile");
    assert_eq!(tiles.neighbors(StateId(0)), [StateId(1), StateId(2)], "right and up");
    assert_eq!(Rbvd::from_abstraction(&tiles).len(), 4, "can be stored like a diagram");
    println!("{} tiles, {} portals", tiles.len(), tiles.portals().len());
}

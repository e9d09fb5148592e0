//! Diagrams of drawn maps, and what holds for every map.

use std::f64::consts::TAU;
use std::sync::Arc;

use arbtest::arbitrary::{Result as Arbitrary, Unstructured};
use expect_test::{Expect, expect};
use sharp_space::{
    Cell, CollisionChecker, DistanceField, Footprint, FootprintChecker, GridFrame, Heading, Occupancy,
    OccupancyGrid, Point, Pose, Region, RegionId, Vector, trig,
};

use crate::conformance::check_abstraction;
use crate::*;

/// Reads a map on which letters and digits mark the regions 0, 1, … in their order.
fn scene(resolution_m: f64, drawing: &str) -> (OccupancyGrid, Vec<Region>) {
    let is_mark = |c: char| c.is_ascii_alphanumeric();
    let plain: String = drawing.chars().map(|c| if is_mark(c) { '.' } else { c }).collect();
    let grid = OccupancyGrid::from_ascii(resolution_m, &plain).unwrap();
    let field = DistanceField::new(&grid);
    let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
    let mut marks: Vec<char> = drawing.chars().filter(|&c| is_mark(c)).collect();
    marks.sort_unstable();
    marks.dedup();
    let cells_of = |mark| {
        let mut cells = Vec::new();
        for (row, line) in rows.iter().rev().enumerate() {
            cells.extend(line.char_indices().filter(|(_, c)| *c == mark).map(|(col, _)| Cell::new(col, row)));
        }
        cells
    };
    let regions = marks.iter().zip(0..);
    let regions = regions.map(|(&mark, id)| Region::new(RegionId(id), cells_of(mark), &field).unwrap());
    (grid.clone(), regions.collect())
}

/// Draws the states as digits, `+` for free cells without a state.
fn draw(rbvd: &Rbvd, grid: &OccupancyGrid) -> String {
    let symbol = |cell| match (rbvd.state_of(cell), grid.is_free(cell)) {
        (Some(state), _) => char::from_digit(state.0, 36).unwrap_or('*'),
        (None, true) => '+',
        (None, false) => '#',
    };
    let rows = (0..grid.frame().height).rev();
    rows.map(|row| (0..grid.frame().width).map(|col| symbol(Cell::new(col, row))).collect::<String>() + "\n")
        .collect()
}

fn build(drawing: &str, settings: &RbvdSettings) -> (Rbvd, OccupancyGrid) {
    let (grid, regions) = scene(1.0, drawing);
    let field = DistanceField::new(&grid);
    let rbvd = Rbvd::build(&field, &regions, settings).unwrap();
    check_definition(&rbvd, &field).unwrap();
    (rbvd, grid)
}

fn check(drawing: &str, settings: &RbvdSettings, states: Expect) -> Rbvd {
    let (rbvd, grid) = build(drawing, settings);
    states.assert_eq(&draw(&rbvd, &grid));
    rbvd
}

#[test]
fn a_corridor_splits_between_two_rooms_and_the_tie_goes_to_the_first() {
    let rbvd = check(
        "
        #########
        #A.....B#
        #########",
        &RbvdSettings::default(),
        expect![[r#"
            #########
            #0000111#
            #########
        "#]],
    );
    assert_eq!(rbvd.neighbors(StateId(0)), [StateId(1)]);
    assert_eq!(rbvd.neighbors(StateId(1)), [StateId(0)]);
    let [portal] = rbvd.portals() else { panic!("one portal, not {:?}", rbvd.portals()) };
    assert_eq!((portal.point, portal.cell), (Point::new(5.0, 1.5), Cell::new(4, 1)));
    assert_eq!((portal.normal, portal.width_m), (Heading::new(0.0), 1.0));
}

#[test]
fn geodesic_distances_go_around_walls_but_straight_ones_do_not() {
    let drawing = "
        ###########
        #A#.......#
        #.#.#####.#
        #.......#B#
        ###########";
    check(
        drawing,
        &RbvdSettings::default(),
        expect![[r#"
            ###########
            #0#0011111#
            #0#0#####1#
            #0000000#1#
            ###########
        "#]],
    );
    check(
        drawing,
        &RbvdSettings::paper(),
        expect![[r#"
            ###########
            #0#0001111#
            #0#0#####1#
            #0000222#1#
            ###########
        "#]],
    );
}

#[test]
fn a_ring_of_three_regions_has_three_neighbourhoods() {
    let rbvd = check(
        "
        .A.......B.
        .#########.
        .#########.
        .....C.....",
        &RbvdSettings::default(),
        expect![[r#"
            00000011111
            0#########1
            0#########1
            02222222221
        "#]],
    );
    let pairs: Vec<_> = rbvd.portals().iter().map(|portal| portal.between).collect();
    assert_eq!(pairs, [(0, 1), (0, 2), (1, 2)].map(|(a, b)| (StateId(a), StateId(b))));
    assert_eq!(rbvd.component_count(), 1);
}

#[test]
fn two_doors_between_two_rooms_are_two_portals() {
    let rbvd = check(
        "
        .....#.....
        ...........
        .....#.....
        ..A..#..B..
        .....#.....
        ...........
        .....#.....",
        &RbvdSettings::default(),
        expect![[r#"
            00000#11111
            00000011111
            00000#11111
            00000#11111
            00000#11111
            00000011111
            00000#11111
        "#]],
    );
    let points: Vec<_> = rbvd.portals_between(StateId(1), StateId(0)).map(|p| p.point).collect();
    assert_eq!(points, [Point::new(6.0, 1.5), Point::new(6.0, 5.5)]);
    assert_eq!(rbvd.portal(PortalId(1)).point, points[1]);
    assert_eq!(rbvd.neighbors(StateId(0)), [StateId(1)], "two portals make one neighbour");
    assert_eq!(rbvd.portals_between(StateId(0), StateId(0)).len(), 0, "a state does not border itself");
}

#[test]
fn a_border_from_a_corridor_into_a_room_is_two_portals() {
    // The border runs along the middle row, through the doorway of the room on the left.
    let drawing = "
        ################
        #BBBBBBBBBBBBBB#
        #..............#
        #........##....#
        #........##....#
        #..............#
        #..............#
        #........##....#
        #........##....#
        #..............#
        #AAAAAAAAAAAAAA#
        ################";
    let (rbvd, _) = build(drawing, &RbvdSettings { portal_min_width_m: 1.0, ..RbvdSettings::default() });
    let columns: Vec<f64> = rbvd.portals().iter().map(|portal| portal.point.x.round()).collect();
    assert_eq!(columns.len(), 2, "one portal in the room, one in the corridor: {columns:?}");
    assert!(columns.iter().any(|&x| x < 9.0) && columns.iter().any(|&x| x > 11.0), "{columns:?}");
}

#[test]
fn narrow_borders_join_no_states() {
    let drawing = "
        .....#.....
        .....#.....
        ..A.....B..
        .....#.....
        .....#.....";
    let with_width = |portal_min_width_m| {
        let settings = RbvdSettings { portal_min_width_m, ..RbvdSettings::default() };
        build(drawing, &settings).0.neighbors(StateId(0)).len()
    };
    assert_eq!(with_width(1.0), 1, "the door is one metre wide");
    assert_eq!(with_width(1.1), 0, "and no wider");
}

#[test]
fn large_parts_without_a_region_get_one() {
    let settings = RbvdSettings { state_min_area_m2: 3.0, ..RbvdSettings::default() };
    let rbvd = check(
        "
        ....#..#.....
        .A..#..#.....
        ....####.....
        ....#..#.....",
        &settings,
        expect![[r#"
            0000#22#11111
            0000#22#11111
            0000####11111
            0000#++#11111
        "#]],
    );
    assert!(rbvd.is_synthetic(StateId(1)), "the right part has a region of its own");
    let share = rbvd.covered_share();
    assert!((share - 40.0 / 42.0).abs() < 1e-12, "two of 42 cells have no state: {share}");
}

#[test]
fn settings_for_a_robot_follow_from_its_width() {
    let footprint = Footprint::rectangle(0.5, 0.3).unwrap();
    let settings = RbvdSettings::for_footprint(&footprint, 0.02, 0.1);
    let half_diagonal_m = 0.05 * std::f64::consts::SQRT_2;
    for (found, expected) in [
        (settings.min_clearance_m, 0.32),
        (settings.fringe_clearance_m, 0.3 - half_diagonal_m),
        (settings.portal_min_width_m, 0.64),
    ] {
        assert!((found - expected).abs() < 1e-12, "{found} m, expected {expected}: {settings:?}");
    }
    let coarse = RbvdSettings::for_footprint(&footprint, 0.02, 1.0);
    assert_eq!(coarse.fringe_clearance_m, 0.0, "where cells are wider than the robot, all count");
}

#[test]
fn a_portal_is_as_wide_as_its_door() {
    for door in 1..=5 {
        let row = |row: usize| match row {
            0 => "A...........B\n",
            row if row < door => ".............\n",
            _ => ".....###.....\n",
        };
        let drawing: String = (0..7).map(row).collect();
        let (rbvd, _) = build(&drawing, &RbvdSettings::default());
        let width_m = rbvd.portals().iter().map(|portal| portal.width_m).fold(0.0, f64::max);
        // The middle of an even number of cells lies between two of them.
        let expected_m = if door % 2 == 1 { door as f64 } else { door as f64 - 1.0 };
        assert_eq!(width_m, expected_m, "a door of {door} m");
    }
}

#[test]
fn a_gap_too_narrow_for_the_robot_stops_growth_but_not_alpha() {
    let settings = RbvdSettings { min_clearance_m: 2.0, fringe_clearance_m: 1.0, ..RbvdSettings::default() };
    let rbvd = check(
        "
        ...............
        ...............
        ......##.......
        ..A............
        ......##.......
        ...............
        ...............",
        &settings,
        expect![[r#"
            000000011111111
            000000011111111
            000000##1111111
            000000011111111
            000000##1111111
            000000011111111
            000000011111111
        "#]],
    );
    assert_eq!(rbvd.covered_share(), 1.0, "the robot may stand in the gap");
    assert_eq!((rbvd.component_count(), rbvd.portals()), (2, &[][..]), "but not pass");
}

#[test]
fn a_region_across_a_wall_keeps_the_piece_with_more_clearance() {
    let rbvd = check(
        "
        ..#......
        AA#AA....
        ..#......",
        &RbvdSettings::default(),
        expect![[r#"
            11#000000
            11#000000
            11#000000
        "#]],
    );
    assert_eq!(rbvd.region(StateId(0)).cells, [Cell::new(3, 1), Cell::new(4, 1)]);
    assert_eq!(rbvd.component_count(), 2);
}

#[test]
fn overlapping_and_buried_regions_keep_their_ids() {
    let (grid, mut regions) = scene(1.0, "#####\n#ABC#\n#####");
    let field = DistanceField::new(&grid);
    regions[1].cells = vec![Cell::new(1, 1), Cell::new(2, 1)];
    regions[2] = Region::new(RegionId(2), vec![Cell::new(0, 0)], &field).unwrap();
    let rbvd = Rbvd::build(&field, &regions, &RbvdSettings::default()).unwrap();
    assert_eq!(draw(&rbvd, &grid), "#####\n#011#\n#####\n");
    assert_eq!(rbvd.region(StateId(1)).cells, [Cell::new(2, 1)], "the shared cell is region 0's");
    assert_eq!(rbvd.neighbors(StateId(2)), [], "a region inside a wall has no neighbours");
}

#[test]
fn normals_point_across_the_border_whatever_the_grid() {
    let resolution_m = 0.1;
    for angle in [0.0, 0.4, 1.2, 2.5, -2.0] {
        let origin = Pose::new(3.0, -1.0, 0.3);
        let frame = GridFrame { origin, resolution_m, width: 80, height: 80 };
        let field = DistanceField::from_mask(frame, |_| false);
        let region = |id, side: f64| {
            let (sin, cos) = trig::sin_cos(angle);
            let at = |v: f64| (40.0 + side * 20.0 * v) as usize;
            Region::new(RegionId(id), vec![Cell::new(at(cos), at(sin))], &field).unwrap()
        };
        let settings = RbvdSettings::paper();
        let rbvd = Rbvd::build(&field, &[region(0, -1.0), region(1, 1.0)], &settings).unwrap();
        let expected = Heading::new(angle + 0.3);
        let off = rbvd.portals()[0].normal.turn_to(expected).abs();
        assert!(off < 0.1, "the border at {angle} rad has a normal {off} rad off");
    }
}

#[test]
fn broken_input_is_refused_with_the_culprit() {
    let (grid, regions) = scene(1.0, "A...B");
    let field = DistanceField::new(&grid);
    let refused = |regions: &[Region], settings: &RbvdSettings| {
        Rbvd::build(&field, regions, settings).unwrap_err().to_string()
    };
    let settings = RbvdSettings::default();
    let broken = RbvdSettings { state_min_area_m2: f64::NAN, ..settings.clone() };
    assert_eq!(refused(&regions, &broken), "state_min_area_m2 is NaN, must be finite and at least 0");
    let message = "region at position 0 is called RegionId(1), must be called by its position";
    assert_eq!(refused(&regions[1..], &settings), message);
    let mut outside = regions.clone();
    outside[1].cells.push(Cell::new(0, 7));
    assert_eq!(refused(&outside, &settings), "region 1 has a cell in column 0, row 7, outside the grid");
    let wide = RbvdSettings { min_clearance_m: 2.0, ..settings.clone() };
    let message = "no part of the map with 2.000 m of clearance has a region or the size of a state";
    assert_eq!(refused(&regions, &wide), message);
    assert_eq!(Rbvd::build(&field, &[], &settings).unwrap().len(), 1, "no region at all is no error");
}

/// A random map of rectangles with up to five random regions.
fn any_scene(u: &mut Unstructured<'_>) -> Arbitrary<(OccupancyGrid, Vec<Region>)> {
    let (width, height) = (u.int_in_range(4..=28)?, u.int_in_range(4..=28)?);
    let origin = Pose::new(-1.0, 2.0, 0.5);
    let frame = GridFrame { origin, resolution_m: 0.25, width, height };
    let mut cells = vec![Occupancy::Free; frame.len()];
    let rectangle = |u: &mut Unstructured<'_>, reach: usize| -> Arbitrary<Vec<Cell>> {
        let (col, row) = (u.choose_index(width)?, u.choose_index(height)?);
        let (right, top) = (u.int_in_range(0..=reach)?, u.int_in_range(0..=reach)?);
        let cols = col..(col + right + 1).min(width);
        Ok(cols.flat_map(|c| (row..(row + top + 1).min(height)).map(move |r| Cell::new(c, r))).collect())
    };
    for _ in 0..u.int_in_range(0..=9)? {
        rectangle(u, 9)?.into_iter().for_each(|cell| cells[frame.index(cell)] = Occupancy::Occupied);
    }
    let grid = OccupancyGrid::new(frame, cells).expect("the frame is sound");
    let field = DistanceField::new(&grid);
    let mut regions = Vec::new();
    for id in 0..u.int_in_range(0..=5)? {
        regions.extend(Region::new(RegionId(id), rectangle(u, 4)?, &field));
    }
    Ok((grid, regions))
}

fn any_settings(u: &mut Unstructured<'_>) -> Arbitrary<RbvdSettings> {
    Ok(RbvdSettings {
        metric: if u.ratio(1, 3)? { CellMetric::Euclidean } else { CellMetric::Geodesic },
        min_clearance_m: f64::from(u.int_in_range(0..=3_u8)?) * 0.25,
        fringe_clearance_m: f64::from(u.int_in_range(0..=2_u8)?) * 0.25,
        portal_min_width_m: f64::from(u.int_in_range(0..=6_u8)?) * 0.25,
        state_min_area_m2: f64::from(u.int_in_range(0..=2_u8)?) * 0.5,
        synthetic_radius_m: 0.5,
    })
}

#[test]
fn diagrams_of_random_maps_satisfy_the_definition() {
    arbtest::arbtest(|u| {
        let (grid, regions) = any_scene(u)?;
        let (settings, field) = (any_settings(u)?, DistanceField::new(&grid));
        let Ok(rbvd) = Rbvd::build(&field, &regions, &settings) else { return Ok(()) };
        if let Err(violation) = check_definition(&rbvd, &field) {
            panic!("{violation}\n{settings:?}\n{regions:?}\n{grid}\n{}", draw(&rbvd, &grid));
        }
        assert_eq!(rbvd, Rbvd::build(&field, &regions, &settings).unwrap(), "built twice");
        Ok(())
    });
}

#[test]
fn diagrams_of_random_maps_are_state_abstractions() {
    arbtest::arbtest(|u| {
        let (grid, regions) = any_scene(u)?;
        let (settings, field) = (any_settings(u)?, DistanceField::new(&grid));
        let Ok(rbvd) = Rbvd::build(&field, &regions, &settings) else { return Ok(()) };
        if let Err(violation) = check_abstraction(&rbvd) {
            panic!("{violation}\n{settings:?}\n{regions:?}\n{grid}\n{}", draw(&rbvd, &grid));
        }
        let shared: Arc<dyn StateAbstraction> = Arc::new(rbvd.clone());
        assert_eq!(check_abstraction(&shared), Ok(()), "behind a shared pointer");
        assert_eq!(Rbvd::from_abstraction(&shared), rbvd, "a diagram stays what it is");
        Ok(())
    });
}

/// The tables of a diagram, and nothing else that a diagram knows.
#[derive(Debug)]
struct Tables(StateGrid, Vec<Region>, Vec<Portal>);

impl StateAbstraction for Tables {
    fn cells(&self) -> &StateGrid {
        &self.0
    }

    fn regions(&self) -> &[Region] {
        &self.1
    }

    fn portals(&self) -> &[Portal] {
        &self.2
    }
}

fn tables(drawing: &str) -> (Tables, Rbvd) {
    let (rbvd, _) = build(drawing, &RbvdSettings::default());
    (Tables(rbvd.cells().clone(), rbvd.regions().to_vec(), rbvd.portals().to_vec()), rbvd)
}

#[test]
fn any_abstraction_can_be_stored_as_a_diagram() {
    let (tables, rbvd) = tables(
        "
        .....#...#...
        ..A.....B#.C.
        .....#...#...",
    );
    assert_eq!(check_abstraction(&tables), Ok(()));
    let stored = Rbvd::from_abstraction(&tables);
    assert_eq!(check_abstraction(&stored), Ok(()));
    assert_eq!(stored.component_count(), 2, "the last room has no door");
    assert_eq!(stored.settings().portal_min_width_m, rbvd.portals()[0].width_m, "there is one portal");
    for state in rbvd.states() {
        assert_eq!(StateAbstraction::neighbors(&tables, state), rbvd.neighbors(state), "{state:?}");
        assert_eq!(stored.neighbors(state), rbvd.neighbors(state), "{state:?}");
    }
    let text = ron::to_string(&stored).unwrap();
    assert_eq!(ron::from_str::<Rbvd>(&text), Ok(stored));
}

#[test]
fn a_stored_abstraction_keeps_where_its_robot_may_stand() {
    let settings = RbvdSettings { min_clearance_m: 2.0, fringe_clearance_m: 1.5, ..RbvdSettings::default() };
    let (rbvd, _) = build(".......\n.......\n...A...\n.......\n.......", &settings);
    let tables = Tables(rbvd.cells().clone(), rbvd.regions().to_vec(), rbvd.portals().to_vec());
    let stored = Rbvd::from_abstraction(&tables).settings().clone();
    assert_eq!((stored.min_clearance_m, stored.fringe_clearance_m), (1.5, 1.5), "{stored:?}");
}

#[test]
fn portals_can_be_found_on_any_labelling() {
    let (grid, regions) = scene(1.0, "..A..#..B..\n...........\n.....#.....");
    let field = DistanceField::new(&grid);
    let rbvd = Rbvd::build(&field, &regions, &RbvdSettings::default()).unwrap();
    assert_eq!(find_portals(rbvd.cells(), &field, &PortalSettings::default()), rbvd.portals());
    let wide = PortalSettings { min_width_m: 9.0, ..PortalSettings::default() };
    assert_eq!(find_portals(rbvd.cells(), &field, &wide), [], "no border is as wide as this");
}

#[test]
fn the_conformance_check_finds_what_is_wrong() {
    let spoilt = |spoil: &dyn Fn(&mut Tables)| {
        let (mut tables, _) = tables("#########\n#A.....B#\n#########");
        spoil(&mut tables);
        check_abstraction(&tables).unwrap_err().to_string()
    };
    let cell = |tables: &mut Tables, col, state| {
        let index = tables.0.frame().index(Cell::new(col, 1));
        tables.0.names_mut()[index] = state;
    };
    assert_eq!(spoilt(&|t| cell(t, 3, 7)), "state 7 is named but there are 2 states");
    assert_eq!(spoilt(&|t| cell(t, 1, 1)), "centre of the region of state 0 lies in Some(StateId(1))");
    let message = "state 0 is not connected: column 3, row 1 is cut off from its region";
    assert_eq!(spoilt(&|t| cell(t, 2, u32::MAX)), message);
    assert_eq!(spoilt(&|t| t.1[1].id = RegionId(0)), "region at position 1 is called 0");
    let message = "region of state 0 is empty, leaves the grid or has a representative outside itself";
    assert_eq!(spoilt(&|t| t.1[0].cells.clear()), message);
    assert_eq!(spoilt(&|t| t.2[0].between.1 = StateId(0)), "portal at position 0 is out of order");
    assert_eq!(spoilt(&|t| t.2[0].point.x += 1.0), "portal 0 does not lie on the border of its states");
    assert_eq!(spoilt(&|t| t.2[0].width_m = f64::NAN), "portal 0 has no sound width or direction");
}

#[test]
fn the_definition_check_finds_what_is_wrong() {
    let drawing = "
        #########
        #A.....B#
        #########";
    let (sound, grid) = build(drawing, &RbvdSettings::default());
    let field = DistanceField::new(&grid);
    let spoilt = |col, row, state| {
        let mut rbvd = sound.clone();
        let index = rbvd.frame().index(Cell::new(col, row));
        rbvd.cells.names_mut()[index] = state;
        check_definition(&rbvd, &field).unwrap_err().to_string()
    };
    assert_eq!(spoilt(0, 0, 1), "column 0, row 0 has state 1 but no room for the robot");
    assert_eq!(spoilt(3, 1, u32::MAX), "column 3, row 1 has no state but a neighbour with one");
    assert_eq!(spoilt(3, 1, 1), "state 1 is not connected: nothing leads from its region to column 3, row 1");
    assert_eq!(spoilt(4, 1, 1), "column 4, row 1 has state 1, nearest is the region of state 0");
}

#[test]
fn neighbourhood_is_symmetric_and_portals_lie_on_their_borders() {
    arbtest::arbtest(|u| {
        let (grid, regions) = any_scene(u)?;
        let (settings, field) = (any_settings(u)?, DistanceField::new(&grid));
        let Ok(rbvd) = Rbvd::build(&field, &regions, &settings) else { return Ok(()) };
        for a in rbvd.states() {
            assert!(rbvd.neighbors(a).is_sorted(), "neighbours of {a:?}");
            for &b in rbvd.neighbors(a) {
                assert!(a != b && rbvd.neighbors(b).contains(&a), "{a:?} and {b:?}");
                assert!(rbvd.portals_between(a, b).len() > 0, "{a:?} and {b:?} lack a portal");
            }
        }
        for portal in rbvd.portals() {
            let (low, high) = portal.between;
            assert!(low < high && rbvd.state_of(portal.cell) == Some(low), "{portal:?}");
            assert!(portal.width_m >= settings.portal_min_width_m - 1e-6, "{portal:?} is too narrow");
            let frame = rbvd.frame();
            let behind = frame.neighbors4(portal.cell).filter(|&cell| rbvd.state_of(cell) == Some(high));
            let start = frame.center(portal.cell);
            let middle = |cell| start + (frame.center(cell) - start) / 2.0;
            let on_border = behind.map(middle).any(|middle| (middle - portal.point).norm() < 1e-9);
            assert!(on_border, "{portal:?} is not on the border");
        }
        Ok(())
    });
}

#[test]
fn every_pose_free_of_collision_has_a_state() {
    arbtest::arbtest(|u| {
        let (grid, regions) = any_scene(u)?;
        let footprint = Footprint::rectangle(0.5, 0.3).expect("the sides are sound");
        let settings = RbvdSettings {
            state_min_area_m2: 0.0,
            ..RbvdSettings::for_footprint(&footprint, 0.0, grid.frame().resolution_m)
        };
        let checker = FootprintChecker::new(&grid, footprint);
        let Ok(rbvd) = Rbvd::build(checker.field(), &regions, &settings) else { return Ok(()) };
        // A part too narrow to travel stays without states; whatever touches a state has one.
        if rbvd.covered_share() < 1.0 {
            return Ok(());
        }
        for _ in 0..20 {
            let mut share = || u.int_in_range(0..=1000_u16).map(|i| f64::from(i) / 1000.0);
            let bounds = grid.frame().bounds();
            let point = bounds.min + Vector::new(bounds.width_m() * share()?, bounds.height_m() * share()?);
            let pose = Pose::at(point, Heading::new(share()? * TAU));
            assert!(
                !checker.is_free(pose) || rbvd.state_at(point).is_some(),
                "{pose:?} is free but has no state in\n{grid}{}",
                draw(&rbvd, &grid)
            );
        }
        Ok(())
    });
}

//! What every layer of a scene looks like, by single pixels and by the elements of the SVG.

use sharp_space::{DistanceField, GridFrame, Heading, Occupancy, RegionId};

use super::layers::spaced;
use super::*;
use crate::color::{STATES, ramp};
use crate::svg_to_png;

fn rooms() -> OccupancyGrid {
    OccupancyGrid::from_ascii(
        0.5,
        "
        ###########
        #....#....#
        #.........#
        #....#....#
        #....#.####
        ###########",
    )
    .unwrap()
}

/// A picture with every layer of an abstraction or of executions, and what the legend calls them.
fn picture(is_driven: bool) -> String {
    let grid = rooms();
    let field = DistanceField::new(&grid);
    let region = Region::new(RegionId(0), vec![Cell::new(5, 3), Cell::new(6, 3)], &field).unwrap();
    let regions = [region];
    let (left, right) = (Point::new(1.5, 1.5), Point::new(4.0, 2.0));
    let pose = |point| Pose::at(point, Heading::new(0.4));
    let driven = [false, true].map(|failed| Trajectory { poses: vec![pose(left), pose(right)], failed });
    let (endpoints, labels, options) = ([left, right], [(0, left), (1, right)], [(left, right)]);
    let guides = [vec![left, right]];
    let scene = Scene::new(&grid).states(&|cell| Some(u32::from(cell.col > 5))).regions(&regions);
    if is_driven {
        let footprint = Footprint::rectangle(0.4, 0.3).unwrap();
        scene
            .faded()
            .guides(&guides)
            .trajectories(&driven, footprint)
            .problem(pose(left), pose(right))
            .to_svg()
    } else {
        scene.options(&options).endpoints(&endpoints, 0.4).labels(&labels).to_svg()
    }
}

/// The colour of the middle of the cell in column `col` and line `line` from the top.
fn pixel(svg: &str, grid: &OccupancyGrid, col: u32, line: u32) -> String {
    let scale = 20;
    let side = grid.frame().width.max(grid.frame().height) as u32 * scale;
    let image = image::load_from_memory(&svg_to_png(svg, side).unwrap()).unwrap().to_rgb8();
    let [r, g, b] = image.get_pixel(col * scale + scale / 2, line * scale + scale / 2).0;
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[test]
fn row_zero_is_at_the_bottom() {
    let grid = OccupancyGrid::from_ascii(1.0, "#..\n..?").unwrap();
    let svg = Scene::new(&grid).bare().to_svg();
    for (col, line, color) in [(0, 0, WALL), (1, 0, FREE), (0, 1, FREE), (2, 1, UNKNOWN)] {
        assert_eq!(pixel(&svg, &grid, col, line), color.to_string(), "column {col}, line {line}");
    }
}

#[test]
fn world_points_follow_the_frame() {
    let frame = GridFrame {
        origin: Pose::new(10.0, -4.0, std::f64::consts::FRAC_PI_2),
        resolution_m: 0.5,
        width: 4,
        height: 2,
    };
    let grid = OccupancyGrid::new(frame, vec![Occupancy::Free; 8]).unwrap();
    let svg = Scene::new(&grid).endpoints(&[frame.center(Cell::new(3, 0))], 0.2).to_svg();
    assert!(svg.contains(r#"<circle cx="3.5" cy="1.5" r="0.4"/>"#), "lower right cell: {svg}");
}

#[test]
fn states_keep_apart_and_walls_cover_them() {
    let grid = rooms();
    let svg = Scene::new(&grid).states(&|cell| Some(u32::from(cell.col > 5))).bare().to_svg();
    let (left, right) = (pixel(&svg, &grid, 1, 4), pixel(&svg, &grid, 9, 1));
    let states = STATES.map(|color| color.to_string());
    assert!(states.contains(&left), "left room is {left}");
    assert!(states.contains(&right), "right room is {right}");
    assert_ne!(left, right, "two states");
    assert_eq!(pixel(&svg, &grid, 8, 4), WALL.to_string(), "wall in the right room");
}

#[test]
fn heat_grows_darker() {
    let grid = rooms();
    let field: Vec<f32> = (0..grid.frame().len()).map(|i| grid.frame().cell(i).col as f32).collect();
    let svg = Scene::new(&grid).heat_map(&field, "column").bare().to_svg();
    assert_eq!(pixel(&svg, &grid, 9, 1), ramp(1.0).to_string(), "the largest value");
    assert_eq!(pixel(&svg, &grid, 0, 3), WALL.to_string(), "walls stay");
    let broken = vec![f32::NAN; field.len()];
    let svg = Scene::new(&grid).heat_map(&broken, "column").bare().to_svg();
    assert_eq!(pixel(&svg, &grid, 9, 1), ramp(0.0).to_string(), "a field of NaN is light");
}

#[test]
fn the_legend_names_what_is_drawn_and_nothing_else() {
    let (abstraction, run) = (picture(false), picture(true));
    for (name, in_abstraction, in_run) in [
        (">1 m<", true, true),
        ("abstract states, numbered", true, false),
        (">abstract states<", false, true),
        ("critical regions", true, true),
        ("endpoints of options", true, false),
        (">options<", true, false),
        ("guide path", false, true),
        ("reached the goal (1)", false, true),
        ("failed (1)", false, true),
        ("robot, every 1 m", false, true),
        (">start<", false, true),
        ("unknown", false, false),
    ] {
        assert_eq!(abstraction.contains(name), in_abstraction, "{name} in an abstraction");
        assert_eq!(run.contains(name), in_run, "{name} in executions");
    }
    let grid = rooms();
    assert!(!Scene::new(&grid).bare().to_svg().contains("<text"), "a bare map has no text");
}

#[test]
fn pictures_are_readable_and_equal_each_time() {
    for is_driven in [false, true] {
        let svg = picture(is_driven);
        assert_eq!(svg, picture(is_driven), "bytes differ");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "not a number: {svg}");
        let png = svg_to_png(&svg, 300).unwrap();
        let size = image::load_from_memory(&png).map(|image| image.width().max(image.height()));
        assert_eq!(size.unwrap(), 300, "longer side as asked");
    }
}

#[test]
fn a_narrow_map_has_room_for_its_legend() {
    let grid = OccupancyGrid::from_ascii(1.0, &["#.#"; 40].join("\n")).unwrap();
    let svg = Scene::new(&grid).problem(Pose::new(1.5, 1.0, 0.0), Pose::new(1.5, 30.0, 0.0)).to_svg();
    assert!(svg.contains("viewBox=\"0 0 480 "), "{svg}");
}

#[test]
fn footprints_stand_apart_and_at_both_ends() {
    let poses: Vec<Pose> = (0..=25).map(|i| Pose::new(f64::from(i) * 0.1, 0.0, 0.0)).collect();
    let x: Vec<f64> = spaced(&poses, 1.0).iter().map(|pose| pose.position.x).collect();
    assert_eq!(x, [0.0, 1.0, 2.0, 2.5]);
    assert!(spaced(&[], 1.0).is_empty(), "no pose");
}

//! Draws a small map with a guide path, two trajectories and a problem into `map.svg` and `map.png`.

use std::error::Error;

use sharp_draw::{Scene, Trajectory, svg_to_png};
use sharp_space::{Footprint, OccupancyGrid, Point, Pose};

const MAP: &str = "
    ######################
    #.........##.........#
    #.........##.........#
    #....................#
    #....................#
    #.........##.........#
    #.........##.........#
    ######################";

fn main() -> Result<(), Box<dyn Error>> {
    let map = OccupancyGrid::from_ascii(0.5, MAP)?;
    let (start, goal) = (Pose::new(1.5, 1.0, 0.8), Pose::new(9.5, 1.0, 0.0));
    let through_the_door = [start.position, Point::new(4.0, 2.0), Point::new(7.0, 2.0), goal.position];
    let guides = [through_the_door.to_vec()];

    let drive = |failed: bool, points: &[Point]| Trajectory {
        poses: points.iter().map(|point| Pose::new(point.x, point.y + 0.1, 0.0)).collect(),
        failed,
    };
    let trajectories = [drive(false, &through_the_door), drive(true, &through_the_door[..3])];

    let svg = Scene::new(&map)
        .guides(&guides)
        .trajectories(&trajectories, Footprint::rectangle(0.3, 0.2)?)
        .problem(start, goal)
        .to_svg();
    let png = svg_to_png(&svg, 1200)?;
    assert!(svg.contains("reached the goal (1)"), "the legend counts what is drawn");
    std::fs::write("map.svg", &svg)?;
    std::fs::write("map.png", &png)?;
    println!("map.svg has {} bytes, map.png {}", svg.len(), png.len());
    Ok(())
}

//! Which pictures belong to a result, and where they go.

use std::path::Path;

use sharp_draw::{Scene, Trajectory, svg_to_png};
use sharp_plan::{Abstraction, Episode, EpisodeEnd, Plan, Query, write_atomic};
use sharp_rbvd::Rbvd;
use sharp_regions::Heatmap;
use sharp_space::{OccupancyGrid, Point, Region};

use crate::outcome::Failure;

/// Longer side of the PNG beside each SVG, pixels.
const PNG_SIDE_PX: u32 = 1200;

/// Writes `svg` as `NAME.svg` and `NAME.png` into `folder`.
pub(crate) fn write(folder: &Path, name: &str, svg: &str) -> Result<(), Failure> {
    write_atomic(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
    write_atomic(&folder.join(format!("{name}.png")), &svg_to_png(svg, PNG_SIDE_PX)?)?;
    Ok(())
}

/// The heat map of criticality with the outlines of the regions made from it.
pub(crate) fn regions(grid: &OccupancyGrid, heatmap: &Heatmap, regions: &[Region]) -> String {
    Scene::new(grid).heat_map(heatmap.values(), "criticality").regions(regions).to_svg()
}

/// The regions of all states.
pub(crate) fn regions_of(rbvd: &Rbvd) -> Vec<Region> {
    rbvd.states().map(|state| rbvd.region(state).clone()).collect()
}

/// Cells coloured by state, with endpoints and options.
pub(crate) fn abstraction(grid: &OccupancyGrid, abstraction: &Abstraction) -> String {
    let (rbvd, options) = (&abstraction.rbvd, &abstraction.options);
    let regions = regions_of(rbvd);
    let frame = grid.frame();
    let labels: Vec<(u32, Point)> =
        rbvd.states().zip(&regions).map(|(state, region)| (state.0, region.center(frame))).collect();
    let centers: Vec<Point> = options.endpoints().iter().map(|endpoint| endpoint.center).collect();
    let radius_m = options.endpoints().first().map_or(0.3, |endpoint| endpoint.radius_m);
    let arrows: Vec<(Point, Point)> = options
        .options()
        .iter()
        .map(|spec| (options.endpoint(spec.initiation).center, options.endpoint(spec.termination).center))
        .collect();
    Scene::new(grid)
        .states(&|cell| rbvd.state_of(cell).map(|state| state.0))
        .regions(&regions)
        .options(&arrows)
        .endpoints(&centers, radius_m)
        .labels(&labels)
        .to_svg()
}

/// The plan's guides over the faded abstraction, with what was driven.
pub(crate) fn plan(plan: &Plan, query: &Query, episodes: &[Episode]) -> String {
    let (rbvd, legs) = (&plan.abstraction.rbvd, &plan.solution.legs);
    let guides: Vec<Vec<Point>> = legs
        .iter()
        .map(|planned| planned.leg.guide.poses().iter().map(|pose| pose.position).collect())
        .collect();
    let targets: Vec<Point> = legs.iter().map(|planned| planned.leg.target.center()).collect();
    let trajectories: Vec<Trajectory> = episodes
        .iter()
        .map(|episode| Trajectory {
            poses: episode.trace.clone(),
            failed: episode.end != EpisodeEnd::Reached,
        })
        .collect();
    Scene::new(&plan.workspace.grid)
        .states(&|cell| rbvd.state_of(cell).map(|state| state.0))
        .faded()
        .endpoints(&targets, plan.workspace.robot.goal_tolerance_m)
        .guides(&guides)
        .trajectories(&trajectories, plan.workspace.robot.footprint)
        .problem(query.start, query.goal)
        .to_svg()
}

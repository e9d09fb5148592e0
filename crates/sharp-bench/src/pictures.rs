//! Which pictures belong to a result, and where they go.

use std::path::Path;

use sharp_draw::{Scene, Trajectory, svg_to_png};
use sharp_drive::EpisodeEnd;
use sharp_plan::{Abstraction, Execution, Plan, Query, Tour, write_atomic};
use sharp_rbvd::StateAbstraction;
use sharp_space::{OccupancyGrid, Point, Region};

use crate::error::BenchError;

/// Longer side of the PNG beside each SVG, pixels.
const PNG_SIDE_PX: u32 = 1200;

/// Of every picture.
const EXTENSIONS: [&str; 2] = ["svg", "png"];

/// Writes `svg` as `NAME.svg` and `NAME.png` into `folder`.
///
/// # Errors
/// If the picture cannot be drawn or a file cannot be written.
pub fn write(folder: &Path, name: &str, svg: &str) -> Result<(), BenchError> {
    write_atomic(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
    write_atomic(&folder.join(format!("{name}.png")), &svg_to_png(svg, PNG_SIDE_PX)?)?;
    Ok(())
}

/// Like [`write()`], for a picture that never changes: it is taken from `kept`, a path without extension, if it is there, and
/// kept there otherwise. A folder that cannot be written keeps nothing.
///
/// # Errors
/// As [`write()`].
pub fn write_kept(
    folder: &Path,
    name: &str,
    kept: Option<&Path>,
    draw: &dyn Fn() -> String,
) -> Result<(), BenchError> {
    let paths = |path: &Path| EXTENSIONS.map(|extension| path.with_extension(extension));
    let new = paths(&folder.join(name));
    let Some(kept) = kept.map(paths) else { return write(folder, name, &draw()) };
    if let [Ok(svg), Ok(png)] = kept.each_ref().map(std::fs::read) {
        write_atomic(&new[0], &svg)?;
        write_atomic(&new[1], &png)?;
        return Ok(());
    }
    write(folder, name, &draw())?;
    for (kept, new) in kept.iter().zip(&new) {
        let _ = std::fs::read(new).map(|bytes| write_atomic(kept, &bytes));
    }
    Ok(())
}

/// Removes the picture at `picture`, a path without extension, if there is one and it can be removed.
pub fn forget(picture: &Path) {
    for path in EXTENSIONS.map(|extension| picture.with_extension(extension)) {
        let _ = std::fs::remove_file(path);
    }
}

/// How critical each cell is, 0 to 1, with the outlines of the regions made from it.
#[must_use]
pub fn regions(grid: &OccupancyGrid, criticality: &[f32], regions: &[Region]) -> String {
    Scene::new(grid).heat_map(criticality, "criticality").regions(regions).to_svg()
}

/// A field over the free cells, called `name`; light where it is low or unknown.
#[must_use]
pub fn field(grid: &OccupancyGrid, field: &[f32], name: &str) -> String {
    Scene::new(grid).heat_map(field, name).to_svg()
}

/// The regions of all states.
#[must_use]
pub fn regions_of(states: &dyn StateAbstraction) -> Vec<Region> {
    states.regions().to_vec()
}

/// Cells coloured by state, with endpoints and options.
#[must_use]
pub fn abstraction(grid: &OccupancyGrid, abstraction: &Abstraction) -> String {
    let (rbvd, options) = (&*abstraction.states, &abstraction.options);
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
#[must_use]
pub fn plan(plan: &Plan, query: &Query, executions: &[Execution]) -> String {
    guides(&[plan], query, executions)
}

/// The guides of several plans in a row, with what was driven.
#[must_use]
pub fn tour(tour: &Tour, executions: &[Execution]) -> String {
    let plans: Vec<&Plan> = tour.plans.iter().map(|plan| &**plan).collect();
    let (start, goal) = (plans[0].solution.query.start, plans[plans.len() - 1].solution.query.goal);
    guides(&plans, &Query { start, goal }, executions)
}

fn guides(plans: &[&Plan], query: &Query, executions: &[Execution]) -> String {
    let plan = plans[0];
    let rbvd = &*plan.abstraction.states;
    let steps = || plans.iter().flat_map(|plan| &plan.solution.steps);
    let guides: Vec<Vec<Point>> = steps()
        .map(|planned| planned.option.guide.poses().iter().map(|pose| pose.position).collect())
        .collect();
    let targets: Vec<Point> = steps().map(|planned| planned.option.target.center()).collect();
    let trajectories: Vec<Trajectory> = executions
        .iter()
        .map(|run| Trajectory { poses: run.record.trace.clone(), failed: run.end != EpisodeEnd::Reached })
        .collect();
    Scene::new(&plan.world.grid)
        .states(&|cell| rbvd.state_of(cell).map(|state| state.0))
        .faded()
        .endpoints(&targets, plan.world.robot.goal_tolerance_m)
        .guides(&guides)
        .trajectories(&trajectories, plan.world.robot.footprint)
        .problem(query.start, query.goal)
        .to_svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_kept_is_not_drawn_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let kept = folder.path().join("library/states");
        let svg = |width: u32| {
            format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"2\"/>")
        };
        let drawn = |width, kept: &Path| {
            let new = folder.path().join("plan");
            write_kept(&new, "states", Some(kept), &|| svg(width)).expect("a picture");
            std::fs::read_to_string(new.join("states.svg")).expect("a picture")
        };
        assert_eq!(drawn(3, &kept), svg(3));
        assert_eq!(drawn(4, &kept), svg(3), "the kept one");
        forget(&kept);
        assert_eq!(drawn(4, &kept), svg(4));
        let file = folder.path().join("plan/states.svg/no folder");
        assert_eq!(drawn(5, &file), svg(5), "where nothing can be kept");
    }
}

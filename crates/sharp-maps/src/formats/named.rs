//! The project's own environments, part of the program: a floor plan and five problems each.
//!
//! They stand in for the paper's environments (Section "Evaluating our approach"), whose files were not
//! published. They have the same sizes and are drawn anew in household and office style. `a` to `d` are 15 m
//! wide in cells of 0.05 m, `e` to `g` 75 m in cells of 0.1 m.

use super::error::MapError;
use super::floor_plan;
use super::load::{MapFile, Problem};

/// An environment's letter, floor plan and problems, from the files of its name.
macro_rules! environments {
    ($($letter:literal)*) => {
        [$((
            $letter,
            include_str!(concat!("../../assets/", $letter, ".ron")),
            include_str!(concat!("../../assets/", $letter, ".problems.ron")),
        )),*]
    };
}

const NAMED: &[(&str, &str, &str)] = &environments!["a" "b" "c" "d" "e" "f" "g"];

/// The names of the own environments, in order.
pub fn named_maps() -> impl Iterator<Item = &'static str> {
    NAMED.iter().map(|(name, ..)| *name)
}

/// The own environment called `name`, if there is one.
pub(crate) fn find(name: &str) -> Option<Result<MapFile, MapError>> {
    let (name, plan, problems) = NAMED.iter().find(|(letter, ..)| *letter == name)?;
    Some(read(name, plan, problems))
}

/// The names and floor plans of all environments, in order.
#[cfg(test)]
pub(crate) fn plans() -> impl Iterator<Item = (&'static str, &'static str)> {
    NAMED.iter().map(|(name, plan, _)| (*name, *plan))
}

fn read(name: &str, plan: &str, problems: &str) -> Result<MapFile, MapError> {
    let file = format!("{name}.problems.ron");
    let problems: Vec<Problem> = ron::from_str(problems)
        .map_err(|e| MapError::syntax(&file, format!("is no list of problems: {e}")))?;
    let grid = floor_plan::parse(&format!("{name}.ron"), plan)?;
    let picture = *grid.frame();
    Ok(MapFile { name: name.to_owned(), grid, problems, warnings: Vec::new(), picture })
}

#[cfg(test)]
mod tests {
    use sharp_space::DistanceField;

    use super::*;
    use crate::formats::drivable::{DrivableRobot, drive_m};

    fn maps() -> impl Iterator<Item = MapFile> {
        named_maps().map(|name| find(name).expect("listed").expect("the assets are sound"))
    }

    #[test]
    fn every_environment_has_its_size_and_five_problems_in_open_spots() {
        for map in maps() {
            let side_m = if map.name.as_str() < "e" { 15.0 } else { 75.0 };
            let frame = map.grid.frame();
            assert!((frame.width_m() - side_m).abs() < 1e-9, "{} is {} m wide", map.name, frame.width_m());
            assert_eq!(frame.width, frame.height, "{} is square", map.name);
            assert_eq!(map.problems.len(), 5, "problems of {}", map.name);
            let field = DistanceField::new(&map.grid);
            for (number, pose) in
                map.problems.iter().enumerate().flat_map(|(n, p)| [(n, p.start), (n, p.goal)])
            {
                let clearance = field.clearance_lower_bound(pose.position);
                // The Husky's corners reach 0.60 m from its centre: it can turn round everywhere.
                assert!(clearance >= 0.65, "{} P{}: {pose:?} has {clearance} m", map.name, number + 1);
            }
        }
    }

    #[test]
    fn both_robots_can_drive_every_problem() {
        for map in maps() {
            let large = map.grid.frame().width_m() > 20.0;
            for robot in [DrivableRobot::Husky, DrivableRobot::Limo] {
                let checker = robot.checker(&map.grid, 0.04);
                for (number, problem) in map.problems.iter().enumerate() {
                    let length = drive_m(robot, &checker, problem.start, problem.goal);
                    let range = if large { 20.0..150.0 } else { 7.0..30.0 };
                    let ok = length.is_some_and(|length| range.contains(&length));
                    assert!(ok, "{} P{} {robot:?}: {length:?}", map.name, number + 1);
                }
            }
        }
    }

    #[test]
    fn doors_for_the_limo_turn_the_husky_away() {
        for map in maps().take(4) {
            let last = map.problems[4];
            let length_m = |robot: DrivableRobot| {
                let checker = robot.checker(&map.grid, 0.0);
                drive_m(robot, &checker, last.start, last.goal).expect("tested above")
            };
            let (husky_m, limo_m) = (length_m(DrivableRobot::Husky), length_m(DrivableRobot::Limo));
            assert!(husky_m > 1.5 * limo_m, "{} P5: Husky {husky_m:.1} m, Limo {limo_m:.1} m", map.name);
        }
    }
}

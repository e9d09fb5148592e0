//! A plan and a library in a small hall, made by the program itself: what the fuzzer begins with.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use sharp_drive::World;
use sharp_plan::{Answer, Method, OptionLibrary, Query, Sharp};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose};

/// Where the sound files lie.
#[derive(Debug)]
pub struct Sound {
    /// The map they belong to.
    pub grid: OccupancyGrid,
    /// The folder of the plan.
    pub plan: PathBuf,
    /// The folder of the library, whose key is `key-map`.
    pub library: PathBuf,
}

/// Three rooms in a row, cells of 0.1 m.
fn hall() -> OccupancyGrid {
    let is_wall = |col: usize, row: usize| {
        let wall = col == 0 || col == 99 || row == 0 || row == 39;
        let first = (33..35).contains(&col) && !(4..18).contains(&row);
        let second = (66..68).contains(&col) && !(22..36).contains(&row);
        wall || first || second
    };
    let row = |row| (0..100).map(|col| if is_wall(col, row) { '#' } else { '.' }).collect::<String>();
    let drawing: Vec<String> = (0..40).map(row).collect();
    OccupancyGrid::from_ascii(0.1, &drawing.join("\n")).expect("drawn")
}

/// The files; made at the first call.
///
/// # Panics
/// If they cannot be made.
pub fn sound() -> &'static Sound {
    static SOUND: OnceLock<Sound> = OnceLock::new();
    SOUND.get_or_init(|| make(&crate::folder().join("sound")))
}

fn make(folder: &Path) -> Sound {
    let grid = hall();
    let (plan_folder, library_folder) = (folder.join("plan"), folder.join("library"));
    let mut method = Method::fast().with_episodes(20, 20, 20);
    method.search.direct = false;
    let library = OptionLibrary::open(&library_folder, "key-map").expect("empty");
    let world = World::new(grid.clone(), RobotModel::limo());
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(method).with_library(library);
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(9.0, 1.0, 0.0) };
    let Answer::Solved(plan) = sharp.solve(query, &()).expect("there is room") else { panic!("no plan") };
    sharp.library_mut().save().expect("written");
    let abstraction = sharp.abstraction_file(&()).expect("there is room");
    plan.save(&plan_folder, &abstraction).expect("written");
    Sound { grid, plan: plan_folder, library: library_folder }
}

/// Puts every file of `folder` that `is_wanted` by its name into the folder that `FUZZ_SEEDS` names, if it names one.
///
/// # Panics
/// If a file cannot be copied.
pub fn seed(folder: &Path, is_wanted: impl Fn(&str) -> bool) {
    let Some(seeds) = std::env::var_os("FUZZ_SEEDS").map(PathBuf::from) else { return };
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if is_wanted(&name) {
            fs::copy(&path, seeds.join(name)).expect("copied");
        }
    }
}

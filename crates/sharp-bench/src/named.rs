//! Robots, noises and detectors by name or file, as a command, a job or a notebook is given them.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sharp_drive::World;
use sharp_maps::MapFile;
use sharp_plan::Query;
use sharp_regions::{
    GeometricDetector, GridDetector, ListDetector, NetworkDetector, RandomDetector, RegionCount,
    RegionPredictor,
};
use sharp_sim::{NoiseError, NoiseModel, RobotError, RobotModel};
use sharp_space::{Detection, Footprint, OccupancyGrid, Point, RegionDetector, Seed};
use thiserror::Error;

/// Larger than any description of a robot, a noise or regions, bytes.
const TEXT_MAX_BYTES: u64 = 1 << 20;

/// The detectors that have a name; anything else is a file of places.
pub(crate) const DETECTORS: [&str; 4] = ["net", "geometric", "random", "grid"];

/// Why nothing is known under a name.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum InputError {
    /// It is no known name, and no text file.
    #[error("{what} {name:?} {problem}, expected {expected}")]
    Unreadable {
        /// What was asked for: robot, noise or regions.
        what: &'static str,
        /// The name.
        name: String,
        /// What is wrong with it.
        problem: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The file describes no robot.
    #[error("{}: {source}", file.display())]
    Robot {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: RobotError,
    },
    /// The name has a broken factor, or the file describes no noise.
    #[error("{place}{source}")]
    Noise {
        /// The file and a colon, or nothing for a name.
        place: String,
        /// What is wrong with it.
        source: NoiseError,
    },
    /// The file lists no places with room for the robot.
    #[error("{}: {problem}", file.display())]
    Regions {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

impl InputError {
    /// A short name for programs, as in `ROBOT_INVALID`.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "FILE_UNREADABLE",
            Self::Robot { .. } => "ROBOT_INVALID",
            Self::Noise { .. } => "NOISE_INVALID",
            Self::Regions { .. } => "REGIONS_INVALID",
        }
    }
}

/// `name` as a worker finds it that was started elsewhere: files by their whole path.
pub(crate) fn from_here(name: &str) -> String {
    let path = std::path::absolute(name).ok().filter(|path| path.is_file());
    path.map_or_else(|| name.to_owned(), |path| path.display().to_string())
}

/// A problem with the names that reports print beside it.
#[derive(Clone, Debug)]
pub struct NamedProblem {
    /// The name of the map.
    pub map: String,
    /// Map and robot.
    pub world: World,
    /// Start and goal.
    pub query: Query,
    /// The name of the noise, or its file.
    pub noise: String,
    /// The noise itself.
    pub noise_model: NoiseModel,
}

impl NamedProblem {
    /// `query` on `map` for the robot and the noise with these names.
    ///
    /// # Errors
    /// Names what is not known.
    pub fn new(map: &MapFile, query: Query, robot_name: &str, noise_name: &str) -> Result<Self, InputError> {
        Ok(Self {
            map: map.name.clone(),
            world: world(map, robot(robot_name)?),
            query,
            noise: noise_name.to_owned(),
            noise_model: noise(noise_name)?,
        })
    }
}

/// `robot` in `map`. Where a cell is wider than the robot, the map is drawn finer: ways, states and distances are only as
/// fine as the cells.
#[must_use]
pub fn world(map: &MapFile, robot: RobotModel) -> World {
    let inscribed_m = robot.footprint.inscribed_radius_m();
    let is_coarse = map.grid.frame().resolution_m > 2.0 * inscribed_m;
    let grid = if is_coarse { map.grid_with_cells(inscribed_m) } else { map.grid.clone() };
    World::new(grid, robot)
}

/// What is expected in place of an unknown robot.
const ROBOTS: &str = "husky, limo, turtlebot3, jackal, car or a robot file";

/// The robot called `name` (`husky`, `limo`, ..., in any case), or described by the file of that name (RON). A robot
/// whose file does not name it has the file's name.
///
/// # Errors
/// If it is no known name and no file, or the file describes no robot.
pub fn robot(name: &str) -> Result<RobotModel, InputError> {
    if let Some(robot) = RobotModel::built_in(name) {
        return Ok(robot);
    }
    let text = read_text(name, "robot", ROBOTS)?;
    let stem = Path::new(name).file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    RobotModel::from_ron_named(&text, &stem).map_err(|source| InputError::Robot { file: name.into(), source })
}

/// The noise called `name` (`none`, `nominal`, `harsh`, `biased`, each also with a factor as in `nominal*2`), or
/// described by the file of that name (RON).
///
/// # Errors
/// If it is no known name and no file, or describes no noise.
pub fn noise(name: &str) -> Result<NoiseModel, InputError> {
    match NoiseModel::by_name(name) {
        Ok(noise) => return Ok(noise),
        Err(NoiseError::Name(_)) => {}
        Err(source) => return Err(InputError::Noise { place: String::new(), source }),
    }
    let expected = "none, nominal, harsh, biased, one of them as nominal*2, or a noise file";
    let text = read_text(name, "noise", expected)?;
    NoiseModel::from_ron(&text).map_err(|source| InputError::Noise { place: format!("{name}: "), source })
}

/// The detector of critical regions called `name` (`net`, `geometric`, `random`, `grid`), or the places that the file
/// of that name lists (RON, pairs of metres).
///
/// # Errors
/// If it is no known name and no file, or the file lists a place without room for the robot.
pub fn detector(world: &World, name: &str) -> Result<Arc<dyn RegionDetector>, InputError> {
    let network = || ShippedNetwork;
    // As many regions as the network finds: what a predictor must beat.
    let count = || RegionCount::Like(Arc::new(network()));
    Ok(match name {
        "net" => Arc::new(network()),
        "geometric" => Arc::new(GeometricDetector::default()),
        "random" => Arc::new(RandomDetector { count: count(), seed: Seed(1) }),
        "grid" => Arc::new(GridDetector { count: count() }),
        file => Arc::new(places(world, file)?),
    })
}

/// The shipped network, read when it is asked: where the states are known already nobody asks.
struct ShippedNetwork;

impl RegionDetector for ShippedNetwork {
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        NetworkDetector::new(RegionPredictor::shipped_for(footprint)).detect(grid, footprint)
    }
}

/// The places listed in `file`, each of which must have room for the robot.
fn places(world: &World, file: &str) -> Result<ListDetector, InputError> {
    let broken = |problem: String| InputError::Regions { file: file.into(), problem };
    let text = read_regions(file)?;
    let centers: Vec<(f64, f64)> = ron::from_str(&text).map_err(|error| broken(error.to_string()))?;
    let places = centers.into_iter().map(|(x, y)| Point::new(x, y)).collect();
    let detector = ListDetector::new(places).with_source(file);
    detector.regions(&world.grid, &world.robot.footprint).map_err(|error| broken(error.to_string()))?;
    Ok(detector)
}

/// The text of a file of places.
pub(crate) fn read_regions(file: &str) -> Result<String, InputError> {
    read_text(file, "regions", "net, geometric, random, grid or a file")
}

/// The content of a small text file.
fn read_text(file: &str, what: &'static str, expected: &'static str) -> Result<String, InputError> {
    let refuse = |problem: String| InputError::Unreadable { what, name: file.to_owned(), problem, expected };
    let metadata = fs::metadata(file).map_err(|error| match error.kind() {
        ErrorKind::NotFound => refuse("is no known name and no file".to_owned()),
        _ => refuse(format!("cannot be read: {error}")),
    })?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "is a folder" } else { "is no regular file" };
        return Err(refuse(kind.to_owned()));
    }
    if metadata.len() > TEXT_MAX_BYTES {
        return Err(refuse("is larger than 1 MiB".to_owned()));
    }
    fs::read_to_string(file).map_err(|error| match error.kind() {
        ErrorKind::InvalidData => refuse("is not UTF-8 text".to_owned()),
        _ => refuse(format!("cannot be read: {error}")),
    })
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    #[test]
    fn what_is_not_known_is_told_with_what_would_be() {
        let message = robot("tank").expect_err("unknown").to_string();
        assert_eq!(
            message,
            "robot \"tank\" is no known name and no file, expected husky, limo, turtlebot3, jackal, car or a robot file"
        );
        assert_eq!(noise("nominal*-1").expect_err("a broken factor").code(), "NOISE_INVALID");
        assert_eq!(noise("loud").expect_err("unknown").code(), "FILE_UNREADABLE");
    }

    #[test]
    fn cells_wider_than_the_robot_are_divided() {
        let map = |resolution_m: f64| MapFile {
            name: "drawn".to_owned(),
            grid: OccupancyGrid::from_ascii(resolution_m, "...\n...\n...").expect("a drawing"),
            problems: vec![],
            warnings: vec![],
            picture: *OccupancyGrid::from_ascii(resolution_m, "...\n...\n...").expect("a drawing").frame(),
        };
        let cell_m =
            |resolution_m: f64| world(&map(resolution_m), RobotModel::husky()).grid.frame().resolution_m;
        assert_eq!(cell_m(0.5), 0.5, "as wide as the map says");
        assert!((cell_m(1.0) - 1.0 / 3.0).abs() < 1e-12, "half as wide as a Husky: {}", cell_m(1.0));
    }

    #[test]
    fn files_are_read_with_their_names_in_every_complaint() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("robot.ron");
        fs::write(&path, "(").expect("a file");
        let name = path.to_str().expect("a printable path");
        let error = robot(name).expect_err("broken");
        assert!(error.code() == "ROBOT_INVALID" && error.to_string().starts_with(name), "{error}");
        let error = robot(folder.path().to_str().expect("printable")).expect_err("a folder").to_string();
        assert!(error.contains("is a folder"), "{error}");
    }
}

//! The façade as the flags ask for it: regions, abstraction, library.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sharp_drive::World;
use sharp_options::OptionKind;
use sharp_plan::{
    AbstractionFile, AbstractionSettings, FORMAT, Monitor, OptionLibrary, Phase, Sharp, hash, map_hash,
};
use sharp_rbvd::CellMetric;
use sharp_regions::{
    GeometricDetector, GridDetector, Heatmap, ListDetector, NetworkDetector, RandomDetector, RegionCount,
    RegionPredictor,
};
use sharp_sim::{NoiseModel, RobotModel, SimulatorKind};
use sharp_space::{Detection, GridFrame, Point, RegionDetector, Seed};

use crate::args::{AbstractionArgs, Kind, Learning, Metric};
use crate::input::read_text;
use crate::outcome::Failure;

impl From<Kind> for OptionKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Centroid => Self::Centroid,
            Kind::Interface => Self::Interface,
        }
    }
}

/// The robot of `world` as `args` ask for it, with its abstraction: from `cache` if it holds it, and kept there.
pub(crate) fn sharp(
    world: World,
    args: &AbstractionArgs,
    cache: Option<&Path>,
    monitor: &dyn Monitor,
) -> Result<(Sharp, AbstractionFile), Failure> {
    let map = map_hash(&world.grid);
    let mut settings = AbstractionSettings::new(&world);
    if args.metric == Metric::Paper {
        settings.metric = CellMetric::Euclidean;
    }
    let detector = detector(&world, &args.regions)?;
    let sharp =
        Sharp::new(world, detector).with_options(args.options.into()).with_abstraction_settings(settings);
    let path = cache.map(|folder| folder.join(cache_name(args)));
    let (sharp, file) = match path.as_deref().filter(|path| path.exists()) {
        Some(path) => {
            monitor.phase(Phase::Abstraction);
            let file = AbstractionFile::load(path, &map)?;
            (sharp.with_abstraction(file.abstraction(), &file.regions), file)
        }
        None => {
            let mut sharp = sharp;
            let file = sharp.abstraction_file(monitor)?;
            path.map_or(Ok(()), |path| file.save(&path))?;
            (sharp, file)
        }
    };
    monitor.phase(Phase::Done);
    Ok((sharp, file))
}

fn cache_name(args: &AbstractionArgs) -> String {
    let regions = match args.regions.as_str() {
        name @ ("net" | "geometric" | "random" | "grid") => name.to_owned(),
        file => hash(std::fs::read(file).unwrap_or_default().as_slice())[..8].to_owned(),
    };
    format!("abstraction-{:?}-{:?}-{regions}.ron", args.options, args.metric).to_lowercase()
}

/// The detector of critical regions that `choice` names: one of ours, or a file of places.
pub(crate) fn detector(world: &World, choice: &str) -> Result<Box<dyn RegionDetector>, Failure> {
    let network = || NetworkDetector::new(shipped(&world.robot));
    // As many regions as the network finds: what a predictor must beat.
    let count = || RegionCount::Like(Arc::new(network()));
    Ok(match choice {
        "net" => Box::new(network()),
        "geometric" => Box::new(GeometricDetector::default()),
        "random" => Box::new(RandomDetector { count: count(), seed: Seed(1) }),
        "grid" => Box::new(GridDetector { count: count() }),
        file => Box::new(places(world, file)?),
    })
}

/// The places listed in `file`, each of which must have room for the robot.
fn places(world: &World, file: &str) -> Result<ListDetector, Failure> {
    let broken = |problem: String| Failure::new("REGIONS_INVALID", format!("{file}: {problem}"));
    let text = read_text(file, "regions", "net, geometric, random, grid or a file")?;
    let centers: Vec<(f64, f64)> = ron::from_str(&text).map_err(|error| broken(error.to_string()))?;
    let places = centers.into_iter().map(|(x, y)| Point::new(x, y)).collect();
    let detector = ListDetector::new(places).with_source(file);
    detector.regions(&world.grid, &world.robot.footprint).map_err(|error| broken(error.to_string()))?;
    Ok(detector)
}

/// What `choice` finds in the map of `world`.
pub(crate) fn detect(world: &World, choice: &str) -> Result<Detection, Failure> {
    Ok(detector(world, choice)?.detect(&world.grid, &world.robot.footprint))
}

/// The heat map of a detection, if the detector knows how critical each cell is.
pub(crate) fn heatmap(frame: &GridFrame, detection: &Detection) -> Option<Heatmap> {
    detection.criticality.clone().map(|values| Heatmap::from_values(*frame, values))
}

/// The shipped network for `robot`, or the one trained for the footprint nearest in width.
pub(crate) fn shipped(robot: &RobotModel) -> RegionPredictor {
    RegionPredictor::shipped_for(&robot.footprint)
}

/// The library for `choice` ("none", a folder, or by default a cache folder), opened for this world.
pub(crate) fn library(
    choice: Option<&str>,
    world: &World,
    conditions: (SimulatorKind, &NoiseModel),
    learning: Learning,
) -> Result<OptionLibrary, Failure> {
    let root = match choice {
        Some("none") => return Ok(OptionLibrary::in_memory()),
        Some(folder) => PathBuf::from(folder),
        None => cache_folder(),
    };
    Ok(OptionLibrary::open(&root, &library_key(world, conditions, learning))?)
}

/// Options learnt in one world say nothing about another: the key names robot, noise, method, format and
/// any simulator but the usual one, and then the map.
fn library_key(
    world: &World,
    (simulator, noise): (SimulatorKind, &NoiseModel),
    learning: Learning,
) -> String {
    let mut key = format!("{:?} {noise:?} {learning:?} {FORMAT}", world.robot);
    if simulator != SimulatorKind::Kinematic {
        key += &format!(" {simulator:?}");
    }
    let key = &hash(key.as_bytes())[..8];
    format!("{}-{key}-{}", world.robot.name, &map_hash(&world.grid)[..16])
}

fn cache_folder() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("XDG_CACHE_HOME")
        .or_else(|| set("HOME").map(|home| home.join(".cache")))
        .unwrap_or_else(std::env::temp_dir)
        .join("sharp")
}

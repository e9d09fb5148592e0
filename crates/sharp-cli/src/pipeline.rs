//! Lines 1 to 7 of Algorithm 1: regions, diagram and options of one map for one robot.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sharp_drive::World;
use sharp_options::{OptionKind, OptionSettings};
use sharp_plan::{AbstractionFile, FORMAT, OptionLibrary, hash, map_hash};
use sharp_rbvd::{CellMetric, Rbvd, RbvdSettings};
use sharp_regions::{
    GeometricDetector, GridDetector, Heatmap, ListDetector, NetworkDetector, RandomDetector, RegionCount,
    RegionPredictor,
};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Point, Region, RegionDetector, Seed};

use crate::args::{AbstractionArgs, Kind, Learning, Metric};
use crate::input::read_text;
use crate::outcome::Failure;
use crate::progress::Stopwatch;

/// What the abstraction of one map consists of.
#[derive(Debug)]
pub(crate) struct Built {
    /// Diagram and option settings, as they are kept in a file.
    pub(crate) file: AbstractionFile,
    /// Where the regions came from: net, geometric or a file.
    pub(crate) source: String,
    /// The heat map, unless the abstraction was loaded or the regions came from a file.
    pub(crate) heatmap: Option<Heatmap>,
}

impl From<Kind> for OptionKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Centroid => Self::Centroid,
            Kind::Interface => Self::Interface,
        }
    }
}

/// The abstraction for `args`, from `cache` if it holds it, and kept there.
pub(crate) fn abstraction(
    world: &World,
    args: &AbstractionArgs,
    cache: Option<&Path>,
    stopwatch: &mut Stopwatch,
) -> Result<Built, Failure> {
    let map = map_hash(&world.grid);
    let path = cache.map(|folder| folder.join(cache_name(args)));
    if let Some(path) = path.as_deref().filter(|path| path.exists()) {
        stopwatch.enter("abstraction");
        let file = AbstractionFile::load(path, &map)?;
        stopwatch.stop();
        return Ok(Built { source: file.regions.clone(), file, heatmap: None });
    }
    stopwatch.enter("regions");
    let (heatmap, regions, source) = regions(world, &args.regions)?;
    stopwatch.enter("abstraction");
    let rbvd = diagram(world, &regions, args.metric)?;
    let settings = option_settings(world);
    let file = AbstractionFile::new(map, source.clone(), args.options.into(), settings, &rbvd);
    if let Some(path) = path {
        file.save(&path)?;
    }
    stopwatch.stop();
    Ok(Built { file, source, heatmap })
}

fn cache_name(args: &AbstractionArgs) -> String {
    let regions = match args.regions.as_str() {
        name @ ("net" | "geometric" | "random" | "grid") => name.to_owned(),
        file => hash(std::fs::read(file).unwrap_or_default().as_slice())[..8].to_owned(),
    };
    format!("abstraction-{:?}-{:?}-{regions}.ron", args.options, args.metric).to_lowercase()
}

/// Critical regions as `choice` asks for them, with the name of their source.
pub(crate) fn regions(
    world: &World,
    choice: &str,
) -> Result<(Option<Heatmap>, Vec<Region>, String), Failure> {
    let (grid, footprint) = (&world.grid, &world.robot.footprint);
    let network = || NetworkDetector::new(shipped(&world.robot));
    // As many regions as the network finds: what a predictor must beat.
    let count = || RegionCount::Like(Arc::new(network()));
    let detection = match choice {
        "net" => network().detect(grid, footprint),
        "geometric" => GeometricDetector::default().detect(grid, footprint),
        "random" => RandomDetector { count: count(), seed: Seed(1) }.detect(grid, footprint),
        "grid" => GridDetector { count: count() }.detect(grid, footprint),
        file => return Ok((None, regions_from_file(world, file)?, file.to_owned())),
    };
    let heatmap = detection.criticality.map(|values| Heatmap::from_values(*grid.frame(), values));
    Ok((heatmap, detection.regions, detection.source))
}

/// The shipped network for `robot`, or the one trained for the footprint nearest in width.
pub(crate) fn shipped(robot: &RobotModel) -> RegionPredictor {
    RegionPredictor::shipped_for(&robot.footprint)
}

/// A region of one cell's neighbourhood around each centre listed in a file.
fn regions_from_file(world: &World, file: &str) -> Result<Vec<Region>, Failure> {
    let broken = |problem: String| Failure::new("REGIONS_INVALID", format!("{file}: {problem}"));
    let text = read_text(file, "regions", "net, geometric, random, grid or a file")?;
    let centers: Vec<(f64, f64)> = ron::from_str(&text).map_err(|error| broken(error.to_string()))?;
    let places = centers.into_iter().map(|(x, y)| Point::new(x, y)).collect();
    let found = ListDetector::new(places).regions(&world.grid, &world.robot.footprint);
    found.map_err(|error| broken(error.to_string()))
}

/// How options are made for the robot of `world`.
pub(crate) fn option_settings(world: &World) -> OptionSettings {
    // A car has to round the corners of its plans within them.
    let factor = if world.robot.can_turn_in_place() { 1.0 } else { 2.0 };
    let mut settings = OptionSettings::default();
    settings.endpoint_radius_m = factor * world.robot.goal_tolerance_m;
    settings
}

/// How the diagram is built for the robot of `world`: half a cell is what distances may be wrong by.
pub(crate) fn rbvd_settings(world: &World) -> RbvdSettings {
    let resolution_m = world.grid.frame().resolution_m;
    RbvdSettings::for_footprint(&world.robot.footprint, 0.5 * resolution_m, resolution_m)
}

/// The region-based Voronoi diagram of `regions`.
pub(crate) fn diagram(world: &World, regions: &[Region], metric: Metric) -> Result<Rbvd, Failure> {
    let mut settings = rbvd_settings(world);
    if metric == Metric::Paper {
        settings.metric = CellMetric::Euclidean;
    }
    Rbvd::build(world.geometry.clearance(), regions, &settings).map_err(|error| {
        Failure::new("NO_FREE_SPACE", format!("map has no room for the {}: {error}", world.robot.name))
    })
}

/// The library for `choice` ("none", a folder, or by default a cache folder), opened for this world.
pub(crate) fn library(
    choice: Option<&str>,
    world: &World,
    noise: &NoiseModel,
    learning: Learning,
) -> Result<OptionLibrary, Failure> {
    let root = match choice {
        Some("none") => return Ok(OptionLibrary::in_memory()),
        Some(folder) => PathBuf::from(folder),
        None => cache_folder(),
    };
    Ok(OptionLibrary::open(&root, &library_key(world, noise, learning))?)
}

/// Options learnt in one world say nothing about another: the key names robot, noise, mode and format,
/// and then the map.
fn library_key(world: &World, noise: &NoiseModel, learning: Learning) -> String {
    let key = format!("{:?} {noise:?} {learning:?} {FORMAT}", world.robot);
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

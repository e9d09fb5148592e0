//! `sharp abstract`: the abstraction of a map, as files, pictures and a route graph.

use serde::Serialize;
use sharp_bench::{MapReport, SolveTimes, Stopwatch, TimedMonitor, named, pictures, prepare};
use sharp_drive::World;
use sharp_export::RouteGraph;
use sharp_options::{OptionKind, OptionSet};
use sharp_plan::{Abstraction, Method, Monitor, Phase, write_atomic};
use sharp_sim::NoiseModel;
use sharp_space::Seed;

use crate::args::Abstract;
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::SolveMonitor;

/// `sharp.abstract/1`.
#[derive(Debug, Serialize)]
struct AbstractReport {
    schema: &'static str,
    map: MapReport,
    robot: String,
    regions: String,
    states: usize,
    neighbors: usize,
    options_centroid: usize,
    options_interface: usize,
    /// Options of the kind asked for that have no guide, and so no edge in the route graph.
    options_unguided: usize,
    covered: f64,
    components: usize,
    time_s: SolveTimes,
}

pub(crate) fn run(args: &Abstract, seed: u64, json: bool) -> Result<Exit, Failure> {
    let stopwatch = Stopwatch::start("load");
    let map = input::map(&args.map)?;
    let world = named::world(&map, named::robot(&args.abstraction.robot)?);
    let spinner = SolveMonitor::new("building the abstraction", None);
    let monitor = TimedMonitor::new(stopwatch, None, &spinner);
    let (sharp, file) = prepare(world, &args.abstraction.request(), None, &monitor)?;
    let (world, abstraction) = (sharp.world(), file.abstraction());
    monitor.phase(Phase::Guide);
    let graph = route_graph(world, &abstraction, seed);
    monitor.phase(Phase::Done);
    let time_s = monitor.times();
    spinner.finish();
    let count = |kind| OptionSet::synthesize(&file.rbvd, kind, &file.options).options().len();

    file.save(&args.out.join("abstraction.ron"))?;
    // Another detector may have no picture of its own.
    pictures::forget(&args.out.join("regions"));
    if let Some(criticality) = sharp.detection().and_then(|found| found.criticality.as_deref()) {
        let regions = pictures::regions_of(&file.rbvd);
        pictures::write(&args.out, "regions", &pictures::regions(&world.grid, criticality, &regions))?;
    }
    pictures::write(&args.out, "abstraction", &pictures::abstraction(&world.grid, &abstraction))?;
    write_atomic(&args.out.join("route.geojson"), graph.to_geojson().as_bytes())?;

    let rbvd = &file.rbvd;
    let report = AbstractReport {
        schema: "sharp.abstract/1",
        map: MapReport::new(&map.name, &map.grid),
        robot: world.robot.name.clone(),
        regions: file.regions.clone(),
        states: rbvd.len(),
        neighbors: rbvd.states().map(|state| rbvd.neighbors(state).len()).sum::<usize>() / 2,
        options_centroid: count(OptionKind::Centroid),
        options_interface: count(OptionKind::Interface),
        options_unguided: graph.unguided.len(),
        covered: rbvd.covered_share(),
        components: rbvd.component_count(),
        time_s,
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        say!(
            "{}: {} states (regions: {}), {} pairs of neighbours, {} centroid and {} interface options; {:.1} % of the free space covered; {:.1} s; files in {}",
            map.name,
            report.states,
            report.regions,
            report.neighbors,
            report.options_centroid,
            report.options_interface,
            100.0 * report.covered,
            report.time_s.total,
            args.out.display()
        );
    }
    Ok(Exit::Done)
}

/// The options with their guides, timed for nominal noise.
fn route_graph(world: &World, abstraction: &Abstraction, seed: u64) -> RouteGraph {
    RouteGraph::of_options(world, abstraction, &Method::default(), &NoiseModel::nominal(), Seed(seed))
}

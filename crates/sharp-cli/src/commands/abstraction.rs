//! `sharp abstract`: the abstraction of a map, as files, pictures and a route graph.

use sharp_bench::SolveTimes;
use sharp_options::{OptionKind, OptionSet};
use sharp_plan::{Workspace, write_atomic};

use crate::args::Abstract;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::Stopwatch;
use crate::report::{AbstractReport, MapReport};
use crate::{geojson, input, pictures, pipeline};

pub(crate) fn run(args: &Abstract, json: bool) -> Result<Exit, Failure> {
    let mut stopwatch = Stopwatch::start();
    stopwatch.enter("load");
    let map = input::map(&args.map)?;
    let workspace = Workspace::new(map.grid.clone(), input::robot(&args.abstraction.robot)?);
    let built = pipeline::abstraction(&workspace, &args.abstraction, None, &mut stopwatch)?;
    let abstraction = built.file.abstraction();
    let count = |kind| OptionSet::synthesize(&built.file.rbvd, kind, &built.file.options).options().len();

    built.file.save(&args.out.join("abstraction.ron"))?;
    if let Some(heatmap) = &built.heatmap {
        pictures::write(
            &args.out,
            "regions",
            &pictures::regions(&map.grid, heatmap, &pictures::regions_of(&built.file.rbvd)),
        )?;
    }
    pictures::write(&args.out, "abstraction", &pictures::abstraction(&map.grid, &abstraction))?;
    let route = geojson::route(&abstraction, workspace.robot.max_speed_mps);
    write_atomic(&args.out.join("route.geojson"), route.as_bytes())?;

    let rbvd = &built.file.rbvd;
    let report = AbstractReport {
        schema: "sharp.abstract/1",
        map: MapReport::new(&map.name, &map.grid),
        robot: workspace.robot.name.clone(),
        regions: built.source.clone(),
        states: rbvd.len(),
        neighbors: rbvd.states().map(|state| rbvd.neighbors(state).len()).sum::<usize>() / 2,
        options_centroid: count(OptionKind::Centroid),
        options_interface: count(OptionKind::Interface),
        covered: rbvd.covered_share(),
        components: rbvd.component_count(),
        time_s: SolveTimes::from(&stopwatch),
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

//! How SHARP drives beside `track` and MPPI on random problems of any map, without a library.
//!
//! ```text
//! cargo run --release --workspace --example random_problems -- map.yaml husky interface 10 200
//! ```
//!
//! The last two numbers: problems, and executions of each method on each of them. A third one, 7 where it is left out, is the
//! root of the random starts, goals and executions. A line for each problem, then the sums of those that SHARP solved.

#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a measurement reads its arguments and prints"
)]

use std::sync::Arc;

use sharp_bench::{
    AbstractionRequest, BaselineKind, BaselineReport, BaselineSettings, NamedWorld, SolveSettings, Stopwatch,
    measure,
};
use sharp_drive::EpisodeEnd;
use sharp_maps::{LoadOptions, load};
use sharp_options::OptionKind;
use sharp_plan::{Answer, Method, Plan, RunSettings, run, success};
use sharp_rbvd::CellMetric;
use sharp_sim::SimulatorKind;
use sharp_space::{Pose, Seed};

/// The methods, as the columns name them.
const METHODS: [&str; 3] = ["sharp", "track", "mppi"];

/// What the executions of one method on one problem came to.
#[derive(Clone, Copy)]
struct MethodScore {
    success: f64,
    /// Mean driving time of the successes; 0 without any.
    time_s: f64,
}

impl From<BaselineReport> for MethodScore {
    fn from(report: BaselineReport) -> Self {
        Self { success: report.success_rate, time_s: report.mean_sim_time_s }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (args, seed) = match &args[..] {
        [all @ .., seed] if args.len() == 6 => (all, seed.parse()?),
        all => (all, 7),
    };
    let [map, robot, kind, problems, episodes] = args else {
        return Err("expected MAP ROBOT KIND PROBLEMS EPISODES [SEED]".into());
    };
    let (problems, episodes): (usize, u32) = (problems.parse()?, episodes.parse()?);
    let map = load(map, &LoadOptions::default())?;
    let place = NamedWorld::new(&map, robot, "nominal")?;
    let options = if kind == "centroid" { OptionKind::Centroid } else { OptionKind::Interface };
    let settings = SolveSettings {
        abstraction: AbstractionRequest { options, regions: "net".into(), metric: CellMetric::Geodesic },
        method: Method::fast(),
        simulator: SimulatorKind::Kinematic,
        seed: 1,
    };
    println!("start -> goal: {}: success, seconds; SHARP's prediction in brackets", METHODS.join(" | "));
    let (mut solved, mut predicted_well) = (Vec::new(), 0);
    for (number, query) in place.random_queries(problems, Seed(seed)).into_iter().enumerate() {
        let ends = [query.start, query.goal].map(|pose: Pose| {
            format!("{:.2},{:.2},{:.2}", pose.position.x, pose.position.y, pose.heading.radians())
        });
        let [track, mppi] = [BaselineKind::Track, BaselineKind::Mppi].map(|kind| {
            let settings = BaselineSettings::new(kind, episodes, seed + number as u64);
            measure(&place.problem(query), &settings, Stopwatch::start("plan"), &())
        });
        let (track, mppi) = (MethodScore::from(track?), MethodScore::from(mppi?));
        let peers = [track, mppi].map(|MethodScore { success, time_s }| format!("{success:.3} {time_s:.1}"));
        let (mut sharp, _) = place.open(&settings, None)?;
        match sharp.solve(query, &())? {
            Answer::Solved(plan) => {
                let predicted = plan.solution.success();
                let ours = executed(*plan, episodes, Seed(seed + number as u64));
                predicted_well += usize::from((predicted - ours.success).abs() <= 0.03);
                let own = format!("{:.3} ({predicted:.3}) {:.1}", ours.success, ours.time_s);
                println!("{}: {own} | {}", ends.join(" -> "), peers.join(" | "));
                solved.push([ours, track, mppi]);
            }
            Answer::NoPlan(reason) => println!("{}: {reason} | {}", ends.join(" -> "), peers.join(" | ")),
            Answer::Stopped => {}
        }
    }
    if solved.is_empty() {
        println!("none solved; the map may have no two free places that far apart");
        return Ok(());
    }
    let count = solved.len() as f64;
    println!("{} solved, {predicted_well} predicted within 3 points", solved.len());
    for (index, name) in METHODS.iter().enumerate() {
        let success: f64 = solved.iter().map(|row| row[index].success).sum();
        let worst = solved.iter().map(|row| row[index].success).fold(1.0, f64::min);
        // Times count where all methods arrive at all.
        let all_arrive = solved.iter().filter(|row| row.iter().all(|driven| driven.success > 0.0));
        let ratios = all_arrive.map(|row| (row[0].time_s / row[index].time_s).ln());
        let (sum, of) = ratios.fold((0.0, 0), |(sum, of), ratio| (sum + ratio, of + 1));
        let ratio = (sum / f64::from(of.max(1))).exp();
        println!(
            "{name}: success {:.4}, worst {worst:.3}; SHARP's time is {ratio:.3} of it",
            success / count
        );
    }
    Ok(())
}

/// Drives `plan` as the project measures plans.
fn executed(plan: Plan, episodes: u32, seed: Seed) -> MethodScore {
    let plan = Arc::new(plan);
    let executions = run(&plan, &RunSettings::new(&plan, episodes, seed), &|| 0.0);
    let reached = executions.iter().filter(|one| one.end == EpisodeEnd::Reached);
    let times: Vec<f64> = reached.map(|one| one.record.time_s).collect();
    let time_s = times.iter().sum::<f64>() / times.len().max(1) as f64;
    MethodScore { success: success(&executions).rate(), time_s }
}

//! Asks a learnt building many random questions: how fast it answers, and whether its odds hold.
//!
//! ```text
//! sharp learn a --robot husky --library LIB
//! cargo run --release --workspace --example questions -- a husky interface LIB 1000 200
//! ```
//!
//! The last two numbers: questions, and how many of them are compared with 1,000 executions each (0 for none). A third
//! one, 7 where it is left out, is the root of the random starts, goals and executions. With `COLD` set the plans are also
//! compared with plans that are made without the library, with `SLOW` set slow answers are told.

#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a measurement reads the clock and prints"
)]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use sharp_bench::{AbstractionRequest, NamedWorld, SolveSettings, Stopwatch, TimedMonitor};
use sharp_drive::SuccessCount;
use sharp_maps::{LoadOptions, load};
use sharp_options::OptionKind;
use sharp_plan::{Answer, Method, Plan, Query, RunSettings, run, success};
use sharp_rbvd::CellMetric;
use sharp_sim::SimulatorKind;
use sharp_space::Seed;

/// Executions that a prediction is compared with.
const EXECUTIONS: u32 = 1000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (args, seed) = match &args[..] {
        [all @ .., seed] if args.len() == 7 => (all, seed.parse()?),
        all => (all, 7),
    };
    let [map, robot, kind, library, questions, compared] = args else {
        return Err("expected MAP ROBOT KIND LIBRARY QUESTIONS COMPARED [SEED]".into());
    };
    let (questions, compared): (usize, usize) = (questions.parse()?, compared.parse()?);
    let map = load(map, &LoadOptions::default())?;
    let began = Instant::now();
    let place = NamedWorld::new(&map, robot, "nominal")?;
    println!("world after {:.3} s", began.elapsed().as_secs_f64());
    let options = if kind == "centroid" { OptionKind::Centroid } else { OptionKind::Interface };
    let abstraction = AbstractionRequest { options, regions: "net".into(), metric: CellMetric::Geodesic };
    let mut method = Method::fast().composed();
    method.search.direct = std::env::var_os("DIRECT").is_none_or(|value| value != "0");
    let settings = SolveSettings { abstraction, method, simulator: SimulatorKind::Kinematic, seed: 1 };
    let (mut sharp, _) = place.open(&settings, Some(Path::new(library)))?;
    println!(
        "library of {} options open after {:.3} s",
        sharp.library().len(),
        began.elapsed().as_secs_f64()
    );
    let asked = place.random_queries(questions, Seed(seed));
    // The first question makes what all others share.
    let first = Instant::now();
    sharp.solve(asked[0], &())?;
    println!("first answer {:.1} ms", 1e3 * first.elapsed().as_secs_f64());
    let mut cpus_ms: Vec<f64> = Vec::new();
    let (mut times_ms, mut plans, mut refused) = (Vec::new(), Vec::new(), 0);
    let (mut uses, mut reused, mut direct, mut phases) = (0, 0, 0, [0.0; 4]);
    for query in &asked {
        let (began, cpu) = (Instant::now(), cpu_ms());
        let monitor = TimedMonitor::new(Stopwatch::start("load"), None, &());
        let answer = sharp.solve(*query, &monitor)?;
        times_ms.push(1e3 * began.elapsed().as_secs_f64());
        cpus_ms.push(cpu_ms() - cpu);
        let spent = monitor.times();
        let row = [spent.search, spent.guide, spent.learn, spent.verify];
        if std::env::var_os("SLOW").is_some() {
            let ends = [query.start, query.goal].map(|pose| {
                let (at, heading) = (pose.position, pose.heading.radians());
                format!("{:.3},{:.3},{heading:.3}", at.x, at.y)
            });
            let parts = row.map(|seconds| format!("{:.1}", 1e3 * seconds)).join(" + ");
            println!("{:.1} ms = {parts} for {}", times_ms[times_ms.len() - 1], ends.join(" -> "));
        }
        phases = std::array::from_fn(|i| phases[i] + row[i]);
        match answer {
            Answer::Solved(plan) => {
                let (of, from) = plan.solution.reuse();
                (uses, reused) = (uses + of, reused + from);
                direct += usize::from(plan.solution.steps.len() == 1);
                plans.push(plan);
            }
            Answer::NoPlan(reason) => {
                refused += 1;
                println!("refused: {reason}");
            }
            Answer::Stopped => {}
        }
    }
    println!(
        "{} answered, {refused} refused, {direct} direct, {reused} of {uses} options reused",
        plans.len()
    );
    for (name, times_ms) in [("wall", &mut times_ms), ("processor", &mut cpus_ms)] {
        times_ms.sort_by(f64::total_cmp);
        let at = |share: f64| times_ms[((times_ms.len() - 1) as f64 * share) as usize];
        println!(
            "answers in ms of {name} time: median {:.1}, 90 % {:.1}, 99 % {:.1}, worst {:.1}",
            at(0.5),
            at(0.9),
            at(0.99),
            at(1.0)
        );
    }
    let predicted: f64 = plans.iter().map(|plan| plan.solution.success()).sum();
    println!("mean predicted success {:.4}", predicted / plans.len().max(1) as f64);
    let mean_ms = phases.map(|seconds| 1e3 * seconds / asked.len() as f64);
    println!(
        "mean in ms: search {:.2}, guides {:.2}, learning {:.2}, odds {:.2}",
        mean_ms[0], mean_ms[1], mean_ms[2], mean_ms[3]
    );
    compare(&place, &settings, &plans[..compared.min(plans.len())], seed)
}

/// Processor time of all threads so far, milliseconds.
fn cpu_ms() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let spent = |task: std::fs::DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    tasks.filter_map(spent).sum::<f64>() / 1e6
}

/// Holds `plans` against executions and against plans that know no library.
fn compare(
    place: &NamedWorld,
    settings: &SolveSettings,
    plans: &[Box<Plan>],
    seed: u64,
) -> Result<(), Box<dyn std::error::Error>> {
    let (mut close, mut bounded, mut above, mut timed) = (0, 0, 0, 0);
    let (mut alike, mut alike_bounded) = (0, 0);
    let (mut error, mut sums, mut cold) = (0.0, [0.0; 4], [0.0; 3]);
    let tells_each = std::env::var_os("SLOW").is_some();
    for (index, plan) in plans.iter().enumerate() {
        let odds = plan.solution.odds();
        let plan = Arc::new((**plan).clone());
        let (count, time_s) = executed(&plan, Seed(seed).child("plan", index as u64));
        let measured = count.rate();
        close += usize::from((odds.success - measured).abs() <= 0.03);
        // What was executed is known to a point or so itself.
        bounded += usize::from(odds.lower95 <= count.upper95() && count.lower95() <= odds.upper95);
        above += usize::from(count.upper95() >= odds.lower95);
        timed += usize::from((odds.time_s / time_s - 1.0).abs() <= 0.05);
        if tells_each {
            let legs = plan.solution.steps.len();
            println!("question {index}: {measured:.3} ({:.3}) in {time_s:.1} s by {legs} legs", odds.success);
        }
        let same = driven_as_learnt(&plan, Seed(seed).child("same", index as u64));
        alike += usize::from((odds.success - same.rate()).abs() <= 0.03);
        alike_bounded += usize::from(odds.lower95 <= same.upper95() && same.lower95() <= odds.upper95);
        error += odds.success - measured;
        let row = [odds.success, measured, odds.time_s, time_s];
        sums = std::array::from_fn(|i| sums[i] + row[i]);
        if (odds.success - measured).abs() > 0.03 || (odds.time_s / time_s - 1.0).abs() > 0.05 {
            let legs: Vec<String> =
                plan.solution.steps.iter().map(|step| step.option.id.to_string()).collect();
            let Query { start, goal } = plan.solution.query;
            println!("{:?} {:?} {:?}", start.position, start.heading, goal.position);
            println!("{:?}", by_leg(&plan));
            println!(
                "{row:.3?} {:.3} {:?} {}",
                same.rate(),
                odds.pieces.iter().map(|p| (p.success * 1000.0).round() / 1000.0).collect::<Vec<_>>(),
                legs.join(" ")
            );
        }
        if std::env::var_os("COLD").is_some() {
            let alone = SolveSettings { method: Method::fast(), ..settings.clone() };
            let (mut sharp, _) = place.open(&alone, None)?;
            if let Answer::Solved(other) = sharp.solve(plan.solution.query, &())? {
                let legs = other.solution.steps.len();
                let (count, other_s) = executed(&Arc::new(*other), Seed(seed).child("plan", index as u64));
                if tells_each {
                    println!("  without the library {:.3} in {other_s:.1} s by {legs} legs", count.rate());
                }
                cold = [cold[0] + count.rate(), cold[1] + (time_s / other_s).ln(), cold[2] + 1.0];
            }
        }
    }
    let n = plans.len().max(1) as f64;
    println!("{} plans against {EXECUTIONS} executions each:", plans.len());
    println!(
        "  success within 3 points: {:.3}, bounds hold: {:.3}, lower bound holds: {:.3}",
        close as f64 / n,
        bounded as f64 / n,
        above as f64 / n
    );
    println!(
        "  the same in the simulator of learning, without recovery: {:.3}, {:.3}",
        alike as f64 / n,
        alike_bounded as f64 / n
    );
    println!("  time within 5 %: {:.3}", timed as f64 / n);
    println!(
        "  mean error of success {:+.4}; predicted {:.4}, executed {:.4}",
        error / n,
        sums[0] / n,
        sums[1] / n
    );
    println!("  time predicted {:.2} s, executed {:.2} s", sums[2] / n, sums[3] / n);
    if cold[2] > 0.0 {
        println!(
            "  without the library: success {:.4} ({} plans), our time is {:.3} of it",
            cold[0] / cold[2],
            cold[2],
            (cold[1] / cold[2]).exp()
        );
    }
    Ok(())
}

/// How often `plan` succeeds as it is executed, and how long that takes, seconds.
fn executed(plan: &Arc<Plan>, seed: Seed) -> (SuccessCount, f64) {
    let executions = run(plan, &RunSettings::new(plan, EXECUTIONS, seed.child("executions", 0)), &|| 0.0);
    let reached = executions.iter().filter(|one| one.end == sharp_drive::EpisodeEnd::Reached);
    let times: Vec<f64> = reached.map(|one| one.record.time_s).collect();
    (success(&executions), times.iter().sum::<f64>() / times.len().max(1) as f64)
}

/// The same in the simulator that policies are learnt in, without recovery.
fn driven_as_learnt(plan: &Arc<Plan>, seed: Seed) -> SuccessCount {
    let mut settings = RunSettings::new(plan, EXECUTIONS, seed.child("executions", 0));
    settings.simulator = plan.world.simulator(SimulatorKind::Kinematic);
    settings.recovery = false;
    success(&run(plan, &settings, &|| 0.0))
}

/// Of those that entered a leg, the share that came through.
fn by_leg(plan: &Arc<Plan>) -> Vec<f64> {
    use sharp_drive::{Driver, MonteCarlo};
    let steps = &plan.solution.steps;
    let next = |leg: usize| steps.get(leg + 1).map(|next| &next.option);
    let legs = steps.iter().enumerate();
    let drivers: Vec<_> =
        legs.map(|(leg, step)| Driver::new(&step.option, &step.learnt.policy, next(leg))).collect();
    let simulator = plan.world.simulator(SimulatorKind::Kinematic);
    let trial =
        MonteCarlo::new(&plan.world, &*simulator, &plan.noise).with_episodes(EXECUTIONS).with_seed(Seed(5));
    let runs = trial.runs(&drivers, sharp_sim::RobotState::at_rest(plan.solution.query.start));
    let entered = |leg: usize| runs.iter().filter(move |run| run.visits.len() > leg);
    (0..steps.len())
        .map(|leg| {
            let count = SuccessCount::count(entered(leg).map(|run| run.passed(leg)));
            (1000.0 * count.rate()).round() / 1000.0
        })
        .collect()
}

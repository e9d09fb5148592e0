//! `sharp eval`: suites of problems, one JSON line a result, and a table.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use sharp_plan::{RunSettings, run as run_plan, write_atomic};
use sharp_space::Seed;

use crate::args::{AbstractionArgs, Eval, Guide, Kind, Learning, MapArgs, Metric, Solve, Suite, Unknown};
use crate::commands::solve::{Solved, solve_problem};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::pictures;
use crate::progress::{bar, is_interrupted};
use crate::report::{Reuse, RunReport, SolveTimes};

/// One problem for one robot with one kind of option.
#[derive(Clone, Debug, PartialEq)]
struct Case {
    env: String,
    robot: &'static str,
    kind: Kind,
    problem: usize,
}

/// `sharp.result/1`: one line of `results.jsonl`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct ResultLine {
    schema: String,
    version: String,
    method: String,
    learning: String,
    env: String,
    problem: usize,
    robot: String,
    options: String,
    #[serde(default = "net")]
    regions: String,
    /// Options synthesised in the environment.
    #[serde(default)]
    options_available: usize,
    noise: String,
    trial: u32,
    seed: u64,
    status: String,
    episodes: u32,
    successes: u32,
    collisions: u32,
    timeouts: u32,
    recoveries: u32,
    mean_sim_time_s: f64,
    predicted_success: f64,
    reuse: Reuse,
    env_steps: u64,
    gradient_steps: u64,
    time_s: SolveTimes,
}

/// What results were made with before there was a choice.
fn net() -> String {
    "net".to_owned()
}

pub(crate) fn run(args: &Eval, seed: u64, json: bool) -> Result<Exit, Failure> {
    let cases = selected(cases(args.suite)?, args)?;
    let path = args.out.join("results.jsonl");
    let mut lines = read_lines(&path)?;
    let progress = bar(cases.len() as u64, "evaluating");
    for case in &cases {
        if is_interrupted() {
            return Ok(Exit::Interrupted);
        }
        progress.set_message(
            format!("{} P{} {} {:?}", case.env, case.problem, case.robot, case.kind).to_lowercase(),
        );
        if !lines.iter().any(|line| is_result_of(line, case, args, seed)) {
            let Some(line) = evaluate(case, args, seed)? else { return Ok(Exit::Interrupted) };
            progress.println(row_text(&line));
            lines.push(line);
            let text: String = lines.iter().map(|line| to_json(line) + "\n").collect();
            write_atomic(&path, text.as_bytes())?;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let wanted: Vec<&ResultLine> =
        lines.iter().filter(|line| cases.iter().any(|case| is_result_of(line, case, args, seed))).collect();
    let table = table(&wanted);
    write_atomic(&args.out.join("report").join("tables.md"), table.as_bytes())?;
    if json {
        for line in wanted {
            say!("{}", to_json(line));
        }
    } else {
        say!("{}", table);
        say!("results in {}, pictures of every plan in {}", path.display(), args.out.join("plans").display());
    }
    Ok(Exit::Done)
}

fn cases(suite: Suite) -> Result<Vec<Case>, Failure> {
    let (envs, robots): (Vec<&str>, &[&'static str]) = match suite {
        Suite::Smoke => (vec!["a"], &["husky"]),
        Suite::Quick => (sharp_maps::named_maps().collect(), &["husky", "limo"]),
    };
    let mut cases = Vec::new();
    for env in envs {
        let problems = sharp_maps::load(env, &sharp_maps::LoadOptions::default())?.problems.len();
        for &robot in robots {
            for kind in [Kind::Centroid, Kind::Interface] {
                cases.extend((1..=problems).map(|problem| Case {
                    env: env.to_owned(),
                    robot,
                    kind,
                    problem,
                }));
            }
        }
    }
    Ok(cases)
}

/// The cases that `args` asks for; a name that selects nothing is an error.
fn selected(mut cases: Vec<Case>, args: &Eval) -> Result<Vec<Case>, Failure> {
    for (flag, names, known) in [
        ("--envs", &args.envs, cases.iter().map(|case| case.env.as_str()).collect::<Vec<_>>()),
        ("--robots", &args.robots, cases.iter().map(|case| case.robot).collect()),
    ] {
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(Failure::new("USAGE", format!("{flag}: the suite has no {name:?}")));
        }
    }
    if let Some(number) =
        args.problems.iter().find(|&&number| cases.iter().all(|case| case.problem != number))
    {
        return Err(Failure::new("USAGE", format!("--problems: the suite has no problem {number}")));
    }
    cases.retain(|case| {
        (args.envs.is_empty() || args.envs.contains(&case.env))
            && (args.robots.is_empty() || args.robots.iter().any(|name| name == case.robot))
            && args.options.is_none_or(|kind| kind == case.kind)
            && (args.problems.is_empty() || args.problems.contains(&case.problem))
    });
    Ok(cases)
}

fn is_result_of(line: &ResultLine, case: &Case, args: &Eval, seed: u64) -> bool {
    line.env == case.env
        && line.problem == case.problem
        && line.robot == case.robot
        && line.options == sharp_plan::kind_name(case.kind.into())
        && line.regions == args.regions
        && line.noise == args.noise
        && line.learning == learning_name(args.learning)
        && line.seed == seed
        && line.episodes == args.episodes
}

const fn learning_name(learning: Learning) -> &'static str {
    match learning {
        Learning::Fast => "fast",
        Learning::Paper => "paper",
    }
}

/// The results that an earlier run left; a last line cut short by a crash is dropped.
fn read_lines(path: &Path) -> Result<Vec<ResultLine>, Failure> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(vec![]) };
    text.lines()
        .enumerate()
        .map(|(index, line)| {
            serde_json::from_str(line).map_err(|error| {
                Failure::new("FILE_INVALID", format!("{} line {}: {error}", path.display(), index + 1))
            })
        })
        .collect()
}

/// Solves and runs one case; `None` if it was interrupted.
fn evaluate(case: &Case, args: &Eval, seed: u64) -> Result<Option<ResultLine>, Failure> {
    let kind = sharp_plan::kind_name(case.kind.into());
    // Problems of one environment, robot and kind share a library: P2 to P5 reuse what P1 learnt.
    let learning = learning_name(args.learning);
    let mut group = format!("{}-{}-{kind}-{learning}-{seed}", case.env, case.robot);
    if args.regions != net() {
        group = format!("{group}-{}", args.regions);
    }
    let folder = args.out.join("plans").join(format!("{group}-p{}", case.problem));
    let solve = solve_args(case, args, args.out.join("library").join(&group), folder.clone());
    let Solved { report, plan } = solve_problem(&solve, seed)?;
    if plan.is_none() && is_interrupted() {
        return Ok(None);
    }
    let run = plan.map(|plan| drive(&Arc::new(plan), args.episodes, seed, &folder)).transpose()?;
    Ok(Some(ResultLine {
        schema: "sharp.result/1".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        method: "sharp".to_owned(),
        learning: report.learning.to_owned(),
        env: case.env.clone(),
        problem: case.problem,
        robot: case.robot.to_owned(),
        options: kind.to_owned(),
        regions: args.regions.clone(),
        options_available: report.options_available,
        noise: args.noise.clone(),
        trial: 0,
        seed,
        status: report.status.to_owned(),
        episodes: args.episodes,
        successes: run.as_ref().map_or(0, |run| run.successes),
        collisions: run.as_ref().map_or(0, |run| run.collisions),
        timeouts: run.as_ref().map_or(0, |run| run.timeouts),
        recoveries: run.as_ref().map_or(0, |run| run.recoveries),
        mean_sim_time_s: run.as_ref().map_or(0.0, |run| run.mean_sim_time_s),
        predicted_success: report.predicted.as_ref().map_or(0.0, |predicted| predicted.success),
        reuse: report.reuse,
        env_steps: report.plan.iter().filter(|leg| !leg.reused).map(|leg| leg.env_steps).sum(),
        gradient_steps: report.plan.iter().filter(|leg| !leg.reused).map(|leg| leg.gradient_steps).sum(),
        time_s: report.time_s,
    }))
}

fn solve_args(case: &Case, args: &Eval, library: PathBuf, out: PathBuf) -> Solve {
    let map =
        MapArgs { map: case.env.clone(), resolution: None, unknown: Unknown::Blocked, allow_outside: false };
    let abstraction = AbstractionArgs {
        robot: case.robot.to_owned(),
        options: case.kind,
        regions: args.regions.clone(),
        metric: Metric::Geodesic,
    };
    Solve {
        map,
        abstraction,
        start: None,
        goal: None,
        problem: Some(case.problem),
        learning: args.learning,
        noise: args.noise.clone(),
        guide: Guide::Ridge,
        library: Some(library.display().to_string()),
        out: Some(out),
        time_limit: Some(2400.0),
    }
}

/// Executes the plan, draws what was driven, and counts.
fn drive(
    plan: &Arc<sharp_plan::Plan>,
    episodes: u32,
    seed: u64,
    folder: &Path,
) -> Result<RunReport, Failure> {
    let begun = Instant::now();
    // Executions draw their noise from another root than learning did.
    let settings = RunSettings::new(plan, episodes, Seed(seed).child("evaluation", 0));
    let driven = run_plan(plan, &settings, &|| begun.elapsed().as_secs_f64() * 1e6);
    pictures::write(folder, "run", &pictures::plan(plan, &plan.solution.query, &driven))?;
    Ok(RunReport::new(plan, &driven))
}

fn row_text(line: &ResultLine) -> String {
    format!(
        "{} P{} {} {}: {} of {} (predicted {:.3}), reused {} of {}, {:.1} s",
        line.env,
        line.problem,
        line.robot,
        line.options,
        line.successes,
        line.episodes,
        line.predicted_success,
        line.reuse.reused,
        line.reuse.uses,
        line.time_s.total
    )
}

/// The results as a Markdown table.
fn table(lines: &[&ResultLine]) -> String {
    let mut text = String::from(
        "| env | problem | robot | options | success | 95 % interval | predicted | reused | driving s | regions s | abstraction s | search s | guides s | learn s | verify s | total s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for line in lines {
        let tally = sharp_plan::Tally { episodes: line.episodes, successes: line.successes };
        let time = &line.time_s;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {} | P{} | {} | {} | {}/{} | {:.2}-{:.2} | {:.3} | {}/{} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} | {:.1} |",
            line.env,
            line.problem,
            line.robot,
            line.options,
            line.successes,
            line.episodes,
            tally.lower95(),
            tally.upper95(),
            line.predicted_success,
            line.reuse.reused,
            line.reuse.uses,
            line.mean_sim_time_s,
            time.regions,
            time.abstraction,
            time.search,
            time.guide,
            time.learn,
            time.verify,
            time.total
        );
    }
    text
}

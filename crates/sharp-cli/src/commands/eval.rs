//! `sharp eval`: suites of problems, one JSON line a result, and a report.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::ValueEnum;
use sharp_plan::{RunSettings, run as run_plan, write_atomic};
use sharp_space::Seed;

use crate::args::{AbstractionArgs, Eval, Guide, Kind, MapArgs, Metric, Solve, Suite, Switch, Unknown};
use crate::commands::solve::{Solved, solve_problem};
use crate::evaluation::{
    self, BaselineLine, Evaluation, ResultLine, group, plan_folder, read_baselines, read_results, row_text,
};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::pictures;
use crate::progress::{bar, is_interrupted};
use crate::report::RunReport;

/// One problem for one robot with one kind of option.
#[derive(Clone, Debug, PartialEq)]
struct Case {
    env: String,
    robot: &'static str,
    kind: Kind,
    problem: usize,
}

pub(crate) fn run(args: &Eval, seed: u64, json: bool) -> Result<Exit, Failure> {
    let cases = selected(cases(args.suite)?, args)?;
    let path = args.out.join("results.jsonl");
    let baselines = baselines(args)?;
    let mut lines = read_results(&path)?;
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
    let command = command(args, seed);
    let rivals: Vec<ResultLine> = baselines.iter().map(ResultLine::from).collect();
    let all = lines.iter().chain(&rivals).collect();
    let page = evaluation::write(&Evaluation { lines: all, command, out: &args.out })?;
    if json {
        for line in wanted {
            say!("{}", to_json(line));
        }
    } else {
        say!("{}", evaluation::table(&wanted));
        say!("results in {}, pictures of every plan in {}", path.display(), args.out.join("plans").display());
        say!("report in {}", page.display());
    }
    Ok(Exit::Done)
}

/// The baselines that were measured elsewhere.
fn baselines(args: &Eval) -> Result<Vec<BaselineLine>, Failure> {
    Ok(args.baselines.as_deref().map(read_baselines).transpose()?.unwrap_or_default())
}

/// The call that gives the same results, with everything that decides them.
fn command(args: &Eval, seed: u64) -> String {
    let name = |value: Option<clap::builder::PossibleValue>| {
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    };
    let numbers: Vec<String> = args.problems.iter().map(ToString::to_string).collect();
    let mut command = format!(
        "sharp --seed {seed} eval {} --episodes {} --learning {} --noise {} --regions {}",
        name(args.suite.to_possible_value()),
        args.episodes,
        args.learning.name(),
        args.noise,
        args.regions
    );
    for (flag, value) in [
        ("envs", args.envs.join(",")),
        ("robots", args.robots.join(",")),
        ("options", name(args.options.and_then(|kind| kind.to_possible_value()))),
        ("problems", numbers.join(",")),
        ("baselines", args.baselines.as_ref().map_or_else(String::new, |path| path.display().to_string())),
        ("out", args.out.display().to_string()),
    ] {
        if !value.is_empty() {
            command += &format!(" --{flag} {value}");
        }
    }
    command
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
        && line.learning == args.learning.name()
        && line.seed == seed
        && line.episodes == args.episodes
}

/// Solves and runs one case; `None` if it was interrupted.
fn evaluate(case: &Case, args: &Eval, seed: u64) -> Result<Option<ResultLine>, Failure> {
    let kind = sharp_plan::kind_name(case.kind.into());
    let group = group(&case.env, case.robot, kind, args.learning.name(), seed, &args.regions);
    let folder = plan_folder(&args.out, &group, case.problem);
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
        variant: "default".to_owned(),
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
        cost_update: Switch::On,
        guide: Guide::Ridge,
        library: Some(library.display().to_string()),
        out: Some(out),
        time_limit: Some(2400.0),
        tensorboard: None,
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Command};

    #[test]
    fn the_command_of_a_report_says_everything_that_decides_it() {
        let text = "sharp --seed 7 eval quick --episodes 50 --learning fast --noise harsh --regions grid \
                    --envs a,b --options interface --problems 1,3 --out here";
        let cli = Cli::parse_from(text.split_whitespace());
        let Command::Eval(args) = &cli.command else { panic!("{:?} is no evaluation", cli.command) };
        assert_eq!(command(args, cli.seed), text);
    }
}

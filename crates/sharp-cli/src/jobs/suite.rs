//! Which jobs a suite consists of.

use clap::ValueEnum;
use sharp_space::Seed;

use super::spec::{Inputs, SharpSpec, Spec, version};
use crate::args::{Kind, Learning, Suite, SuiteSelection, SystemName};
use crate::outcome::Failure;

/// The jobs that `selection` asks for, in the order of their results; `seed` is the root of trial 0.
///
/// # Errors
/// Returns an error if a name selects nothing, or an input cannot be read.
pub(crate) fn specs(selection: &SuiteSelection, seed: u64) -> Result<Vec<Spec>, Failure> {
    check(selection)?;
    let mut specs = Vec::new();
    for env in chosen("--envs", &selection.envs, &envs(selection.suite))? {
        let problems = problems(&env, selection)?;
        for robot in chosen("--robots", &selection.robots, robots(selection.suite))? {
            for noise in &selection.noise {
                let inputs = Inputs::read(&env, &robot, noise, Some(&selection.regions))?;
                let world = SuiteWorld { env: &env, robot: &robot, noise, problems: &problems, inputs };
                specs.extend(world.specs(selection, seed));
            }
        }
    }
    Ok(specs)
}

/// Where all methods are measured beside each other.
struct SuiteWorld<'a> {
    env: &'a str,
    robot: &'a str,
    noise: &'a str,
    problems: &'a [usize],
    inputs: Inputs,
}

impl SuiteWorld<'_> {
    /// All methods in each trial.
    fn specs(&self, selection: &SuiteSelection, seed: u64) -> Vec<Spec> {
        let trials = selection.trials.unwrap_or(if selection.suite == Suite::Paper { 5 } else { 1 });
        let systems = contenders(selection);
        let all = (0..trials).flat_map(|trial| systems.iter().map(move |system| (trial, system)));
        all.map(|(trial, (system, sharp))| self.spec(selection, (trial, seed), *system, sharp.clone()))
            .collect()
    }

    fn spec(
        &self,
        selection: &SuiteSelection,
        (trial, seed): (u32, u64),
        system: SystemName,
        sharp: Option<SharpSpec>,
    ) -> Spec {
        let regions = self.inputs.regions.clone().filter(|_| sharp.is_some());
        Spec {
            version: version().to_owned(),
            env: self.env.to_owned(),
            robot: self.robot.to_owned(),
            system,
            sharp,
            noise: self.noise.to_owned(),
            trial,
            seed: trial_seed(seed, trial),
            episodes: selection.episodes,
            problems: self.problems.to_vec(),
            time_limit_s: selection.time_limit,
            inputs: Inputs { regions, ..self.inputs.clone() },
        }
    }
}

/// The call of `sharp SUBCOMMAND` that asks for the same jobs.
pub(crate) fn command(subcommand: &str, selection: &SuiteSelection, seed: u64) -> String {
    let SuiteSelection { suite, episodes, regions, time_limit, .. } = selection;
    let mut text = format!(
        "sharp --seed {seed} {subcommand} {} --episodes {episodes} --noise {} --regions {regions} \
         --recovery {} --cost-update {} --time-limit {time_limit}",
        flag_word(suite),
        selection.noise.join(","),
        flag_word(&selection.recovery),
        flag_word(&selection.cost_update),
    );
    let numbers = |numbers: &[usize]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    for (flag, value) in [
        ("learning", flag_words(&selection.learning)),
        ("envs", selection.envs.join(",")),
        ("robots", selection.robots.join(",")),
        ("options", flag_words(selection.options.as_slice())),
        ("problems", numbers(&selection.problems)),
        ("methods", flag_words(&selection.methods)),
        ("trials", selection.trials.map_or_else(String::new, |trials| trials.to_string())),
    ] {
        if !value.is_empty() {
            text += &format!(" --{flag} {value}");
        }
    }
    text
}

fn flag_words<T: ValueEnum>(values: &[T]) -> String {
    values.iter().map(flag_word).collect::<Vec<_>>().join(",")
}

/// How a value is typed.
fn flag_word<T: ValueEnum>(value: &T) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Trial 0 is the root itself; the others are children of it, small enough for every reader of JSON.
fn trial_seed(root: u64, trial: u32) -> u64 {
    const EXACT_BITS: u64 = (1 << 53) - 1;
    if trial == 0 { root } else { Seed(root).child("trial", u64::from(trial)).0 & EXACT_BITS }
}

fn check(selection: &SuiteSelection) -> Result<(), Failure> {
    let limit_s = selection.time_limit;
    if limit_s.is_finite() && limit_s > 0.0 {
        return Ok(());
    }
    let message = format!("--time-limit is {limit_s}, expected a positive number of seconds");
    Err(Failure::new("USAGE", message))
}

fn envs(suite: Suite) -> Vec<&'static str> {
    match suite {
        Suite::Smoke => vec!["a"],
        Suite::Quick | Suite::Paper => sharp_maps::named_maps().collect(),
    }
}

const fn robots(suite: Suite) -> &'static [&'static str] {
    match suite {
        Suite::Smoke => &["husky"],
        Suite::Quick | Suite::Paper => &["husky", "limo"],
    }
}

/// Those of `known` that `names` chooses, all without a choice; a name that is not known is an error.
fn chosen(flag: &str, names: &[String], known: &[&str]) -> Result<Vec<String>, Failure> {
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(Failure::new("USAGE", format!("{flag}: the suite has no {name:?}")));
    }
    let is_chosen = |name: &str| names.is_empty() || names.iter().any(|chosen| chosen == name);
    Ok(known.iter().filter(|name| is_chosen(name)).map(|&name| name.to_owned()).collect())
}

fn problems(env: &str, selection: &SuiteSelection) -> Result<Vec<usize>, Failure> {
    let count = sharp_maps::load(env, &sharp_maps::LoadOptions::default())?.problems.len();
    if let Some(number) = selection.problems.iter().find(|&&number| !(1..=count).contains(&number)) {
        return Err(Failure::new("USAGE", format!("--problems: environment {env} has no problem {number}")));
    }
    let is_chosen = |number: &usize| selection.problems.is_empty() || selection.problems.contains(number);
    Ok((1..=count).filter(is_chosen).collect())
}

/// The methods on one environment: SHARP in all its settings, then the baselines.
fn contenders(selection: &SuiteSelection) -> Vec<(SystemName, Option<SharpSpec>)> {
    let methods = match selection.suite {
        _ if !selection.methods.is_empty() => &selection.methods[..],
        Suite::Smoke | Suite::Quick => {
            &[SystemName::Sharp, SystemName::Rrt, SystemName::Track, SystemName::Mppi]
        }
        Suite::Paper => &[
            SystemName::Sharp,
            SystemName::Rrt,
            SystemName::RrtContact,
            SystemName::Track,
            SystemName::Mppi,
            SystemName::Sac,
        ],
    };
    let settings = |&system: &SystemName| match system {
        SystemName::Sharp => {
            sharp_settings(selection).into_iter().map(|sharp| (system, Some(sharp))).collect()
        }
        _ => vec![(system, None)],
    };
    methods.iter().flat_map(settings).collect()
}

fn sharp_settings(selection: &SuiteSelection) -> Vec<SharpSpec> {
    let learning = match selection.suite {
        _ if !selection.learning.is_empty() => &selection.learning[..],
        Suite::Paper => &[Learning::Fast, Learning::Paper],
        Suite::Smoke | Suite::Quick => &[Learning::Fast],
    };
    let kinds = selection.options.map_or_else(|| vec![Kind::Centroid, Kind::Interface], |kind| vec![kind]);
    let setting = |learning: Learning, options: Kind| SharpSpec {
        options,
        learning,
        regions: selection.regions.clone(),
        recovery: selection.recovery,
        cost_update: selection.cost_update,
    };
    learning.iter().flat_map(|&learning| kinds.iter().map(move |&kind| setting(learning, kind))).collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Subcommands};

    fn specs_of(flags: &str) -> Result<Vec<Spec>, Failure> {
        let cli = Cli::parse_from(format!("sharp eval {flags}").split_whitespace());
        let Subcommands::Eval(args) = &cli.command else { panic!("{:?} is no evaluation", cli.command) };
        specs(&args.selection, cli.seed)
    }

    #[test]
    fn the_call_of_a_job_says_everything_that_decides_it() {
        let text = "sharp --seed 7 eval quick --episodes 50 --noise harsh,none --regions grid --recovery off \
                    --cost-update on --time-limit 60 --learning fast,paper --envs a,b --options interface \
                    --problems 1,3 --methods sharp,rrt-contact --trials 2";
        let cli = Cli::parse_from(text.split_whitespace());
        let Subcommands::Eval(args) = &cli.command else { panic!("{:?} is no evaluation", cli.command) };
        assert_eq!(command("eval", &args.selection, cli.seed), text);
    }

    #[test]
    fn suites_have_the_jobs_that_their_names_promise() {
        let count = |flags: &str| {
            let specs = specs_of(flags).expect("a suite");
            let keys: std::collections::BTreeSet<String> = specs.iter().map(Spec::key).collect();
            assert_eq!(keys.len(), specs.len(), "{flags}: no job twice");
            (specs.len(), specs.iter().map(|spec| spec.problems.len()).sum::<usize>())
        };
        assert_eq!(count("smoke"), (2 + 3, 25), "two kinds and three baselines, five problems");
        assert_eq!(count("quick"), (7 * 2 * (2 + 3), 350), "two kinds, three baselines");
        assert_eq!(count("paper"), (7 * 2 * 5 * (4 + 5), 3150), "five trials, two modes, five baselines");
        assert_eq!(count("quick --envs a --robots limo --options centroid --problems 2,4"), (1 + 3, 8));
        assert_eq!(count("smoke --methods track,mppi --noise none,harsh --trials 3"), (2 * 2 * 3, 60));
    }

    #[test]
    fn names_that_select_nothing_are_refused() {
        for (flags, expected) in [
            ("smoke --envs z", "--envs: the suite has no \"z\""),
            ("smoke --robots limo", "--robots: the suite has no \"limo\""),
            ("smoke --problems 6", "--problems: environment a has no problem 6"),
            ("smoke --time-limit=-1", "--time-limit is -1, expected a positive number of seconds"),
        ] {
            assert_eq!(specs_of(flags).expect_err(flags).to_string(), expected);
        }
        assert!(specs_of("smoke --noise loud").expect_err("unknown").to_string().contains("\"loud\""));
    }

    #[test]
    fn trials_have_seeds_of_their_own_and_the_first_has_the_root() {
        let seeds: Vec<u64> = specs_of("smoke --methods track --trials 3")
            .expect("jobs")
            .iter()
            .map(|spec| spec.seed)
            .collect();
        assert_eq!(seeds[0], 1, "what the root gave before there were trials");
        assert!(
            seeds[1] != seeds[2] && seeds[1..].iter().all(|&seed| seed != 1 && seed < 1 << 53),
            "{seeds:?}"
        );
    }
}

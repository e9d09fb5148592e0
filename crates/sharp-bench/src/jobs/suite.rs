//! Which experiments a suite consists of.

use sharp_options::OptionKind;
use sharp_plan::Method;
use sharp_space::Seed;

use super::experiment::{Experiment, Inputs, SharpSettings, System};
use super::machine::version;
use crate::error::BenchError;
use crate::named::from_here;
use crate::result::default_regions;

/// A suite of problems, or a part of it. Empty lists select everything that the suite has.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SuiteSelection {
    /// Which suite.
    pub suite: Suite,
    /// Executions of each plan.
    pub episodes: u32,
    /// Names of methods; the suite's own if empty.
    pub learning: Vec<String>,
    /// Names or files of noises.
    pub noise: Vec<String>,
    /// Names of maps of the suite.
    pub envs: Vec<String>,
    /// Names of robots of the suite.
    pub robots: Vec<String>,
    /// Kinds of option.
    pub options: Vec<OptionKind>,
    /// Where critical regions come from.
    pub regions: String,
    /// Numbers of problems of each map, from 1.
    pub problems: Vec<usize>,
    /// Names of systems, as [`System::name`] gives them; the suite's own if empty.
    pub systems: Vec<String>,
    /// Independent repetitions; the suite's own number if `None`.
    pub trials: Option<u32>,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    pub recovery: bool,
    /// Whether the search learns from the costs that were measured.
    pub cost_update: bool,
    /// Wall time of solving one problem, or of one baseline on it, seconds.
    pub time_limit_s: f64,
    /// The root of all randomness.
    pub seed: u64,
}

/// Suites of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Suite {
    /// Environment `a`, Husky, both kinds of option, and the baselines that need no learning.
    Smoke,
    /// The same on every named environment for both robots.
    Quick,
    /// The same with every baseline, both learning modes and five trials.
    Paper,
}

impl Suite {
    fn envs(self) -> Vec<&'static str> {
        match self {
            Self::Smoke => vec!["a"],
            Self::Quick | Self::Paper => sharp_maps::named_maps().collect(),
        }
    }

    const fn robots(self) -> &'static [&'static str] {
        match self {
            Self::Smoke => &["husky"],
            Self::Quick | Self::Paper => &["husky", "limo"],
        }
    }

    const fn systems(self) -> &'static [&'static str] {
        match self {
            Self::Smoke | Self::Quick => &["sharp", "rrt", "track", "mppi"],
            Self::Paper => &["sharp", "rrt", "rrt-contact", "track", "mppi", "sac"],
        }
    }

    const fn learning(self) -> &'static [&'static str] {
        match self {
            Self::Smoke | Self::Quick => &["fast"],
            Self::Paper => &["fast", "paper"],
        }
    }

    const fn trials(self) -> u32 {
        match self {
            Self::Smoke | Self::Quick => 1,
            Self::Paper => 5,
        }
    }
}

impl SuiteSelection {
    /// The whole of `suite` under nominal noise, with 20 executions a plan.
    #[must_use]
    pub fn new(suite: Suite, seed: u64) -> Self {
        Self {
            suite,
            episodes: 20,
            learning: vec![],
            noise: vec!["nominal".to_owned()],
            envs: vec![],
            robots: vec![],
            options: vec![],
            regions: default_regions(),
            problems: vec![],
            systems: vec![],
            trials: None,
            recovery: true,
            cost_update: true,
            time_limit_s: 2400.0,
            seed,
        }
    }

    /// The experiments that are selected, in the order of their results.
    ///
    /// # Errors
    /// If a name selects nothing, or an input cannot be read.
    pub fn experiments(&self) -> Result<Vec<Experiment>, BenchError> {
        if !(self.time_limit_s.is_finite() && self.time_limit_s > 0.0) {
            let problem = format!("{}, expected a positive number of seconds", self.time_limit_s);
            return Err(BenchError::Setting { setting: "time-limit", problem });
        }
        let systems = self.systems()?;
        let mut experiments = Vec::new();
        for env in chosen("envs", &self.envs, &self.suite.envs())? {
            let problems = self.problems_of(&env)?;
            for robot in chosen("robots", &self.robots, self.suite.robots())? {
                for noise in &self.noise {
                    let (noise, regions) = (from_here(noise), from_here(&self.regions));
                    let inputs = Inputs::read(&env, &robot, &noise, Some(&regions))?;
                    let world =
                        SuiteWorld { env: &env, robot: &robot, noise: &noise, problems: &problems, inputs };
                    for trial in 0..self.trials.unwrap_or(self.suite.trials()) {
                        let system = |system: &System| self.experiment(&world, trial, system.clone());
                        experiments.extend(systems.iter().map(system));
                    }
                }
            }
        }
        Ok(experiments)
    }

    fn experiment(&self, world: &SuiteWorld<'_>, trial: u32, system: System) -> Experiment {
        let regions = world.inputs.regions.clone().filter(|_| system.sharp().is_some());
        Experiment {
            version: version().to_owned(),
            env: world.env.to_owned(),
            robot: world.robot.to_owned(),
            system,
            noise: world.noise.to_owned(),
            trial,
            seed: trial_seed(self.seed, trial),
            episodes: self.episodes,
            problems: world.problems.to_vec(),
            time_limit_s: self.time_limit_s,
            inputs: Inputs { regions, ..world.inputs.clone() },
        }
    }

    fn problems_of(&self, env: &str) -> Result<Vec<usize>, BenchError> {
        let count = sharp_maps::load(env, &sharp_maps::LoadOptions::default())?.problems.len();
        if let Some(number) = self.problems.iter().find(|&&number| !(1..=count).contains(&number)) {
            let problem = format!("environment {env} has no problem {number}");
            return Err(BenchError::Setting { setting: "problems", problem });
        }
        let is_chosen = |number: &usize| self.problems.is_empty() || self.problems.contains(number);
        Ok((1..=count).filter(is_chosen).collect())
    }

    /// What is measured in each environment: SHARP in all its settings, then the baselines.
    fn systems(&self) -> Result<Vec<System>, BenchError> {
        let own = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let names: Vec<String> =
            if self.systems.is_empty() { own(self.suite.systems()) } else { self.systems.clone() };
        let learning: Vec<String> =
            if self.learning.is_empty() { own(self.suite.learning()) } else { self.learning.clone() };
        if let Some(unknown) = learning.iter().find(|name| Method::by_name(name).is_none()) {
            let problem = format!("{unknown:?}, expected fast, paper, paper-tuned or prior");
            return Err(BenchError::Setting { setting: "learning", problem });
        }
        let both = vec![OptionKind::Centroid, OptionKind::Interface];
        let kinds = if self.options.is_empty() { &both } else { &self.options };
        let mut systems = Vec::new();
        for name in &names {
            match name.as_str() {
                "sharp" => {
                    let pairs =
                        learning.iter().flat_map(|method| kinds.iter().map(move |&kind| (method, kind)));
                    systems.extend(pairs.map(|(method, kind)| System::Sharp(self.sharp(method, kind))));
                }
                "rrt" => systems.push(System::Rrt),
                "rrt-contact" => systems.push(System::RrtContact),
                "track" => systems.push(System::Track),
                "mppi" => systems.push(System::Mppi),
                "sac" => systems.push(System::Sac),
                _ => {
                    let problem = format!("{name:?}, expected {}", Suite::Paper.systems().join(", "));
                    return Err(BenchError::Setting { setting: "methods", problem });
                }
            }
        }
        Ok(systems)
    }

    fn sharp(&self, learning: &str, options: OptionKind) -> SharpSettings {
        SharpSettings {
            options,
            learning: learning.to_owned(),
            regions: from_here(&self.regions),
            recovery: self.recovery,
            cost_update: self.cost_update,
        }
    }
}

/// Where all systems are measured beside each other.
struct SuiteWorld<'a> {
    env: &'a str,
    robot: &'a str,
    noise: &'a str,
    problems: &'a [usize],
    inputs: Inputs,
}

/// Trial 0 is the root itself; the others are children of it, small enough for every reader of JSON.
fn trial_seed(root: u64, trial: u32) -> u64 {
    const EXACT_BITS: u64 = (1 << 53) - 1;
    if trial == 0 { root } else { Seed(root).child("trial", u64::from(trial)).0 & EXACT_BITS }
}

/// Those of `known` that `names` chooses, all without a choice; a name that is not known is an error.
fn chosen(setting: &'static str, names: &[String], known: &[&str]) -> Result<Vec<String>, BenchError> {
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(BenchError::Setting { setting, problem: format!("the suite has no {name:?}") });
    }
    let is_chosen = |name: &str| names.is_empty() || names.iter().any(|chosen| chosen == name);
    Ok(known.iter().filter(|name| is_chosen(name)).map(|&name| name.to_owned()).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn of(suite: Suite, change: impl FnOnce(&mut SuiteSelection)) -> Result<Vec<Experiment>, BenchError> {
        let mut selection = SuiteSelection::new(suite, 1);
        change(&mut selection);
        selection.experiments()
    }

    fn words(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn suites_have_the_jobs_that_their_names_promise() {
        let count = |suite, change: fn(&mut SuiteSelection)| {
            let experiments = of(suite, change).expect("a suite");
            let keys: BTreeSet<String> = experiments.iter().map(Experiment::key).collect();
            assert_eq!(keys.len(), experiments.len(), "no job twice");
            (experiments.len(), experiments.iter().map(|one| one.problems.len()).sum::<usize>())
        };
        assert_eq!(count(Suite::Smoke, |_| ()), (2 + 3, 25), "two kinds and three baselines, five problems");
        assert_eq!(count(Suite::Quick, |_| ()), (7 * 2 * (2 + 3), 350), "two kinds, three baselines");
        assert_eq!(count(Suite::Paper, |_| ()), (7 * 2 * 5 * (4 + 5), 3150), "five trials, two modes");
        let part = |selection: &mut SuiteSelection| {
            selection.envs = words(&["a"]);
            selection.robots = words(&["limo"]);
            selection.options = vec![OptionKind::Centroid];
            selection.problems = vec![2, 4];
        };
        assert_eq!(count(Suite::Quick, part), (1 + 3, 8));
        let baselines = |selection: &mut SuiteSelection| {
            selection.systems = words(&["track", "mppi"]);
            selection.noise = words(&["none", "harsh"]);
            selection.trials = Some(3);
        };
        assert_eq!(count(Suite::Smoke, baselines), (2 * 2 * 3, 60));
    }

    #[test]
    fn names_that_select_nothing_are_refused() {
        let message = |change: fn(&mut SuiteSelection)| {
            of(Suite::Smoke, change).expect_err("nothing is selected").to_string()
        };
        assert_eq!(message(|one| one.envs = words(&["z"])), "envs: the suite has no \"z\"");
        assert_eq!(message(|one| one.robots = words(&["limo"])), "robots: the suite has no \"limo\"");
        assert_eq!(message(|one| one.problems = vec![6]), "problems: environment a has no problem 6");
        assert_eq!(
            message(|one| one.systems = words(&["ompl"])),
            "methods: \"ompl\", expected sharp, rrt, rrt-contact, track, mppi, sac"
        );
        let limit = message(|one| one.time_limit_s = -1.0);
        assert_eq!(limit, "time-limit: -1, expected a positive number of seconds");
        assert!(message(|one| one.noise = words(&["loud"])).contains("\"loud\""));
    }

    #[test]
    fn trials_have_seeds_of_their_own_and_the_first_has_the_root() {
        let experiments = of(Suite::Smoke, |selection| {
            selection.systems = words(&["track"]);
            selection.trials = Some(3);
        });
        let seeds: Vec<u64> = experiments.expect("jobs").iter().map(|one| one.seed).collect();
        assert_eq!(seeds[0], 1, "what the root gave before there were trials");
        assert!(
            seeds[1] != seeds[2] && seeds[1..].iter().all(|&seed| seed != 1 && seed < 1 << 53),
            "{seeds:?}"
        );
    }
}

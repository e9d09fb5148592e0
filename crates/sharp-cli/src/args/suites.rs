//! What `sharp eval` and `sharp jobs` may be asked.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use sharp_bench::{Suite, SuiteSelection, shell_word};

use super::{Kind, Learning, Switch};

#[derive(Debug, Args)]
pub(crate) struct Eval {
    #[command(flatten)]
    pub(crate) selection: SuiteArgs,
    /// Where results are written; a run that was stopped goes on where it was.
    #[arg(long, value_name = "DIR", default_value = "out/eval")]
    pub(crate) out: PathBuf,
    /// Results of other runs, for the figures: the baselines in a results.jsonl.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) baselines: Option<PathBuf>,
    /// Who does the jobs: threads of this process, or a Slurm cluster.
    #[arg(long, value_enum, default_value_t = EngineName::Local)]
    pub(crate) engine: EngineName,
    /// Jobs at once of the local engine, each on one thread [default: as many as --threads].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) jobs: Option<u32>,
    /// Go on where an earlier run stopped; what is finished is never done again, with or without this.
    #[arg(long)]
    pub(crate) resume: bool,
}

/// Who does the jobs of a suite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EngineName {
    Local,
    Slurm,
}

/// A suite of problems, or a part of it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SuiteArgs {
    /// Which suite.
    #[arg(value_enum, default_value_t = SuiteName::Smoke)]
    pub(crate) suite: SuiteName,
    /// Executions of each plan.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) episodes: u32,
    /// How policies are learnt, separated by commas [default: fast; both in `paper`].
    #[arg(long, value_enum, value_delimiter = ',')]
    pub(crate) learning: Vec<Learning>,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or noise files (.ron), separated
    /// by commas.
    #[arg(long, value_delimiter = ',', default_value = "nominal", value_name = "NAMES|FILES")]
    pub(crate) noise: Vec<String>,
    /// Only these maps of the suite: names, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) envs: Vec<String>,
    /// Only these robots of the suite: names, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) robots: Vec<String>,
    /// Only this kind of option.
    #[arg(long, value_enum)]
    pub(crate) options: Option<Kind>,
    /// Where critical regions come from.
    #[arg(long, default_value = "net", value_name = "net|geometric|random|grid")]
    pub(crate) regions: String,
    /// Only these problems of each map: numbers from 1, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "NUMBERS")]
    pub(crate) problems: Vec<usize>,
    /// These methods instead of the suite's, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub(crate) methods: Vec<SystemName>,
    /// Independent repetitions [default: 1; 5 in `paper`].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) trials: Option<u32>,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    #[arg(long, value_enum, default_value_t = Switch::On)]
    pub(crate) recovery: Switch,
    /// Whether the search learns from the costs that were measured.
    #[arg(long, value_enum, default_value_t = Switch::On)]
    pub(crate) cost_update: Switch,
    /// Wall time of solving one problem, or of one baseline on it, seconds.
    #[arg(long, value_name = "S", default_value_t = 2400.0, allow_negative_numbers = true)]
    pub(crate) time_limit: f64,
}

/// Suites of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SuiteName {
    /// Environment a, Husky, both kinds of option, and the baselines that need no learning.
    Smoke,
    /// The same on every named environment for both robots.
    Quick,
    /// The same with every baseline, both learning modes and five trials.
    Paper,
}

/// What a suite measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SystemName {
    /// This project.
    Sharp,
    /// RRT with replanning; a contact is a failure.
    Rrt,
    /// RRT with replanning that bumps into walls and goes on, as in the paper.
    RrtContact,
    /// Tracking of a planned path.
    Track,
    /// Model-predictive path integral control.
    Mppi,
    /// One flat soft actor-critic policy.
    Sac,
}

/// Jobs on many machines: plan once, run anywhere and as often as needed, merge.
#[derive(Debug, Subcommand)]
pub(crate) enum Jobs {
    /// Write DIR/manifest.jsonl: one line a job. Jobs that are planned already stay as they are.
    Plan {
        #[command(flatten)]
        selection: SuiteArgs,
        /// The folder that all jobs share.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Do one job or a block of them; what is finished is left alone.
    Run {
        /// The folder that `sharp jobs plan` wrote.
        dir: PathBuf,
        /// Job N, or jobs N to M - 1 [default: the task's number in an array of Slurm or Kubernetes].
        #[arg(long, value_name = "N[..M]")]
        index: Option<String>,
    },
    /// Verify what all jobs left and write results.jsonl and the report; exit code 3 if jobs are missing.
    Merge {
        /// The folder that `sharp jobs plan` wrote.
        dir: PathBuf,
    },
    /// Hand the jobs that are not finished to a cluster, and a merge that waits for them.
    Submit(Submit),
}

#[derive(Debug, Args)]
pub(crate) struct Submit {
    /// The folder that `sharp jobs plan` wrote, on a disk that all nodes share.
    pub(crate) dir: PathBuf,
    /// Slurm: one job array, one task a block of jobs.
    #[arg(long, required = true)]
    pub(crate) slurm: bool,
    /// Tasks of the array at once.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) array_limit: Option<u32>,
    /// Wall time of a task, minutes; a task that runs out of it is requeued and goes on.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) time: Option<u32>,
    /// Expected length of a task: short jobs are packed until they fill it, minutes.
    #[arg(long, value_name = "M", default_value_t = 10.0)]
    pub(crate) pack: f64,
    /// Write and print the scripts, submit nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// What else sbatch is told, after `--`: partition, account, memory.
    #[arg(last = true, value_name = "SBATCH ARGS")]
    pub(crate) sbatch: Vec<String>,
}

impl From<SuiteName> for Suite {
    fn from(name: SuiteName) -> Self {
        match name {
            SuiteName::Smoke => Self::Smoke,
            SuiteName::Quick => Self::Quick,
            SuiteName::Paper => Self::Paper,
        }
    }
}

impl SuiteArgs {
    /// What the flags select; `seed` is the root of trial 0.
    pub(crate) fn request(&self, seed: u64) -> SuiteSelection {
        let mut selection = SuiteSelection::new(self.suite.into(), seed);
        selection.episodes = self.episodes;
        selection.learning = self.learning.iter().map(|learning| learning.name().to_owned()).collect();
        selection.noise.clone_from(&self.noise);
        selection.envs.clone_from(&self.envs);
        selection.robots.clone_from(&self.robots);
        selection.options = self.options.into_iter().map(Into::into).collect();
        selection.regions.clone_from(&self.regions);
        selection.problems.clone_from(&self.problems);
        selection.systems = self.methods.iter().map(word).collect();
        selection.trials = self.trials;
        selection.recovery = self.recovery == Switch::On;
        selection.cost_update = self.cost_update == Switch::On;
        selection.time_limit_s = self.time_limit;
        selection
    }

    /// The call of `sharp SUBCOMMAND` that asks for the same jobs in the folder `out`.
    pub(crate) fn command(&self, subcommand: &str, seed: u64, out: &Path) -> String {
        let Self { suite, episodes, regions, time_limit, .. } = self;
        let mut text = format!(
            "sharp --seed {seed} {subcommand} {} --episodes {episodes} --noise {} --regions {} \
             --recovery {} --cost-update {} --time-limit {time_limit}",
            word(suite),
            shell_word(&self.noise.join(",")),
            shell_word(regions),
            word(&self.recovery),
            word(&self.cost_update),
        );
        let numbers =
            |numbers: &[usize]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
        for (flag, value) in [
            ("learning", words(&self.learning)),
            ("envs", self.envs.join(",")),
            ("robots", self.robots.join(",")),
            ("options", words(self.options.as_slice())),
            ("problems", numbers(&self.problems)),
            ("methods", words(&self.methods)),
            ("trials", self.trials.map_or_else(String::new, |trials| trials.to_string())),
        ] {
            if !value.is_empty() {
                text += &format!(" --{flag} {value}");
            }
        }
        text + &format!(" --out {}", shell_word(&out.display().to_string()))
    }
}

fn words<T: ValueEnum>(values: &[T]) -> String {
    values.iter().map(word).collect::<Vec<_>>().join(",")
}

/// How a value is typed.
fn word<T: ValueEnum>(value: &T) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use sharp_bench::Experiment;

    use super::*;
    use crate::args::{Cli, Subcommands};

    fn parse(text: &str) -> (SuiteArgs, u64) {
        let cli = Cli::parse_from(text.split_whitespace());
        let Subcommands::Eval(args) = cli.command else { panic!("{:?} is no evaluation", cli.command) };
        (args.selection, cli.seed)
    }

    #[test]
    fn the_call_of_a_job_says_everything_that_decides_it() {
        let text = "sharp --seed 7 eval quick --episodes 50 --noise harsh,none --regions grid --recovery off \
                    --cost-update on --time-limit 60 --learning fast,paper --envs a,b --options interface \
                    --problems 1,3 --methods sharp,rrt-contact --trials 2";
        let (args, seed) = parse(text);
        assert_eq!(args.command("eval", seed, Path::new("out/e")), format!("{text} --out out/e"));
        let (args, seed) = parse("sharp eval quick --noise nominal*2");
        let command = args.command("eval", seed, Path::new("my out"));
        assert!(
            command.contains(" --noise 'nominal*2' ") && command.ends_with(" --out 'my out'"),
            "{command}"
        );
    }

    #[test]
    fn every_flag_reaches_the_experiments() {
        let (args, seed) = parse(
            "sharp --seed 7 eval quick --episodes 50 --noise harsh --regions grid --recovery off --time-limit 60 \
             --learning prior --envs a --robots limo --options centroid --problems 1,3 --methods sharp,rrt-contact",
        );
        let experiments = args.request(seed).experiments().expect("jobs");
        let names: Vec<String> = experiments.iter().map(Experiment::name).collect();
        let begins = ["a-limo-centroid-prior-grid-no_recovery-harsh-t0-", "a-limo-rrt-contact-harsh-t0-"];
        assert!(names.iter().zip(begins).all(|(name, begin)| name.starts_with(begin)), "{names:?}");
        let first = &experiments[0];
        assert_eq!((first.episodes, first.seed, first.time_limit_s), (50, 7, 60.0));
        assert_eq!((experiments.len(), &*first.problems), (2, &[1, 3][..]));
    }
}

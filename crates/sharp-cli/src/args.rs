//! What a user may type: one definition feeds parsing and help.

mod learn;
mod problem;
mod robots;
mod suites;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use sharp_bench::{AbstractionRequest, BaselineKind, BaselineSettings};
use sharp_options::OptionKind;
use sharp_rbvd::CellMetric;

pub(crate) use learn::Learn;
pub(crate) use problem::{ProblemArgs, SpeedArgs};
pub(crate) use robots::{DriveName, Robots};
pub(crate) use suites::{EngineName, Eval, Jobs, Submit, SuiteArgs};

/// From a map to a policy that knows its odds: option learning for stochastic path planning.
#[derive(Debug, Parser)]
#[command(name = "sharp", version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// Print one JSON object on stdout instead of text.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Root of all randomness: equal seeds give equal bytes, from equal libraries. The default library keeps what
    /// earlier solves learnt, so a second solve may differ; --library none starts from nothing.
    #[arg(long, global = true, default_value_t = 1, value_name = "N", allow_negative_numbers = true)]
    pub(crate) seed: u64,
    /// Worker threads; the result does not depend on it [default: all cores].
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) threads: Option<u32>,
    #[command(subcommand)]
    pub(crate) command: Subcommands,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Subcommands {
    /// Solve a path planning problem: regions, abstraction, search, learning, a policy on disk.
    Solve(Box<Solve>),
    /// Learn every option of a building ahead of time, so that later problems are answered at once.
    Learn(Learn),
    /// Run a solved plan in a simulator and count how often it holds.
    Run(Run),
    /// Write a plan in a format that others read: tables, MCAP, route graphs, networks.
    Export(Export),
    /// Drive a robot from outside: poses in, waypoints out, as JSON lines.
    Serve(Serve),
    /// Build the abstraction of a map and draw it.
    Abstract(Abstract),
    /// Train, use and score the predictor of critical regions.
    #[command(subcommand)]
    Regions(Regions),
    /// Train and score the policy that options begin with.
    #[command(subcommand)]
    Prior(PriorCommand),
    /// Look at a map file, or write it as a ROS map.
    #[command(subcommand)]
    Map(Map),
    /// Look at an option library.
    #[command(subcommand)]
    Library(Library),
    /// Look at robots, or make one of a Nav2 parameter file or a URDF.
    #[command(subcommand)]
    Robot(Robots),
    /// Measure a system to compare with: RRT, tracking, MPPI or one flat policy.
    Baseline(Baseline),
    /// Run a suite of problems and write results and tables.
    Eval(Eval),
    /// The jobs under `eval`, for clusters: plan, run, merge, submit.
    #[command(subcommand)]
    Jobs(Jobs),
    /// Print a completion script for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page, or write one for each command.
    Man {
        /// Write the pages of all commands there, as into ~/.local/share/man/man1 [default: print the first one].
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// Which map, and how to read it.
#[derive(Debug, Args)]
pub(crate) struct MapArgs {
    /// A ROS map YAML, a MovingAI .map, a PNG, PGM or BMP image, or a named map (a, b, ...).
    #[arg(value_name = "MAP")]
    pub(crate) map: String,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// How to read a map.
#[derive(Debug, Args)]
pub(crate) struct ReadingArgs {
    /// Metres a cell, for files that do not say.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) resolution: Option<f64>,
    /// What unknown cells count as.
    #[arg(long, value_enum, default_value_t = Unknown::Blocked)]
    pub(crate) unknown: Unknown,
    /// Let a ROS map name an image outside its own folder.
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Keep out of the occupied cells of this map as if there were walls, a keep-out mask of Nav2; may be repeated.
    #[arg(long, value_name = "MASK")]
    pub(crate) keepout: Vec<String>,
    /// Make one cell of N x N; it is occupied if any of them is.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) downsample: u32,
}

impl ReadingArgs {
    /// Whether nothing was said of how to read a map.
    pub(crate) fn is_usual(&self) -> bool {
        let Self { resolution, unknown, allow_outside, keepout, downsample } = self;
        resolution.is_none()
            && *unknown == Unknown::Blocked
            && !allow_outside
            && keepout.is_empty()
            && *downsample == 1
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Unknown {
    Blocked,
    Free,
}

/// The kind of option.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    Centroid,
    Interface,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Learning {
    /// The shipped prior; a hand-written follower where it succeeds too rarely, and further training where that is not enough.
    Fast,
    /// The paper's protocol.
    Paper,
    /// The same with smaller networks, a stop at 97 % success without contact, and a reward that also pays for the heading on
    /// arrival.
    PaperTuned,
    /// The shipped prior as it is, only measured: the difference to `fast` is what learning on the map is worth.
    Prior,
}

impl Learning {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Paper => "paper",
            Self::PaperTuned => "paper-tuned",
            Self::Prior => "prior",
        }
    }
}

/// What an abstraction is made of.
#[derive(Debug, Args)]
pub(crate) struct AbstractionArgs {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// The kind of option: interface options cross a region from one neighbour to another, centroid options lead from the
    /// centre of a region to that of a neighbour.
    #[arg(long, value_enum, default_value_t = Kind::Interface)]
    pub(crate) options: Kind,
    /// Where critical regions come from: net, geometric, or a file of region centres (.ron, a list as in [(1.0, 2.5), (4.0, 2.5)]);
    /// for comparison also random and grid, as many discs as the network finds regions.
    #[arg(long, default_value = "net", value_name = "net|geometric|random|grid|FILE")]
    pub(crate) regions: String,
    /// Distances of the diagram: geodesic, or the paper's Euclidean rule.
    #[arg(long, value_enum, default_value_t = Metric::Geodesic)]
    pub(crate) metric: Metric,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Metric {
    Geodesic,
    Paper,
}

impl AbstractionArgs {
    /// What the flags ask for.
    pub(crate) fn request(&self) -> AbstractionRequest {
        let metric = if self.metric == Metric::Paper { CellMetric::Euclidean } else { CellMetric::Geodesic };
        AbstractionRequest { options: self.options.into(), regions: self.regions.clone(), metric }
    }
}

impl From<Kind> for OptionKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Centroid => Self::Centroid,
            Kind::Interface => Self::Interface,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Solve {
    #[command(flatten)]
    pub(crate) map: MapArgs,
    #[command(flatten)]
    pub(crate) abstraction: AbstractionArgs,
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    #[command(flatten)]
    pub(crate) speed: SpeedArgs,
    /// Drive there first, before the goal; may be repeated, in this order.
    #[arg(long, value_name = "X,Y[,YAW]", allow_hyphen_values = true)]
    pub(crate) via: Vec<String>,
    /// Arrive in the goal's heading, at most so many radians off, or degrees as in 20deg [default: any heading will do].
    #[arg(long, value_name = "RAD", conflicts_with = "via", value_parser = radians, allow_negative_numbers = true)]
    pub(crate) goal_heading_tolerance: Option<f64>,
    /// Exit with 1 if the plan predicts less success than this; it is written all the same.
    #[arg(long, value_name = "P", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) min_success: f64,
    /// How policies are learnt.
    #[arg(long, value_enum, default_value_t = Learning::Fast)]
    pub(crate) learning: Learning,
    /// The prior that options begin with, a file of `sharp prior train` [default: the shipped one of the robot's kind].
    #[arg(long, value_name = "FILE")]
    pub(crate) prior: Option<PathBuf>,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file (.ron).
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE")]
    pub(crate) noise: String,
    /// The simulator in which policies are learnt and the plan is verified; they are described at `run`
    /// [default: kinematic; rapier2d with --learning paper and paper-tuned].
    #[arg(long, value_name = "kinematic|rapier2d|rapier3d")]
    pub(crate) simulator: Option<String>,
    /// Whether measured costs of options flow back into the search, or A* keeps its first ones.
    #[arg(long, value_enum, default_value_t = Switch::On)]
    pub(crate) cost_update: Switch,
    /// What a failure counts for beside the seconds of a success: more makes plans safer and slower
    /// [default: 1000; 0 with --learning paper and paper-tuned].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) failure_cost: Option<f64>,
    /// How guides are planned: along the ridge of clearance, or by the paper's learn-and-link trees.
    #[arg(long, value_enum, default_value_t = Guide::Ridge)]
    pub(crate) guide: Guide,
    /// Where learnt options are kept for the next problem; "none" keeps nothing [default: a cache folder].
    #[arg(long, value_name = "DIR|none")]
    pub(crate) library: Option<String>,
    /// Where the plan is written [default: a fresh folder under ./sharp-plans].
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Runs of the whole plan that its predicted success is counted on; auto stops as soon as the 95 % interval is two
    /// points wide, at the latest after 1000; 0 composes it of what the library knows of options and hand-overs, and runs
    /// a plan only where that promises less than 95 %.
    #[arg(long, default_value = "auto", value_name = "N|auto", allow_negative_numbers = true)]
    pub(crate) verify: String,
    /// Stop after so many seconds of wall time, with the best plan so far; what was learnt is kept.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) time_limit: Option<f64>,
    /// Drive the plan and write a page to look at: map, options, drives that move, weak places [default file: show.html
    /// in the plan's folder].
    #[arg(long, value_name = "FILE.html", num_args = 0..=1, value_parser = page_file)]
    pub(crate) show: Option<Option<PathBuf>>,
    /// Write learning curves for TensorBoard there, one run a leg that is trained [default: none].
    #[arg(long, value_name = "DIR")]
    pub(crate) tensorboard: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Guide {
    Ridge,
    Paper,
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The folder that `sharp solve` wrote.
    pub(crate) plan_dir: PathBuf,
    /// Number of executions.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) episodes: u32,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file [default: the plan's].
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) noise: Option<String>,
    /// The simulator: walls to push and graze, walls that stop, or wheels and gravity in three
    /// dimensions, which a build with `--features rigid3d` has.
    #[arg(long, default_value = "rapier2d", value_name = "rapier2d|kinematic|rapier3d")]
    pub(crate) simulator: String,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    #[arg(long, value_enum, default_value_t = Switch::On)]
    pub(crate) recovery: Switch,
    /// What touching a wall means: the end of the episode, or a bump after which it goes on.
    #[arg(long, value_enum, default_value_t = Collisions::End)]
    pub(crate) collisions: Collisions,
    /// Write all episodes there, one after the other, as ROS 2 messages in an MCAP file, for Foxglove and others.
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) record: Option<PathBuf>,
    /// Write a page of the executions to look at, as `sharp solve --show` does [default file: show.html in the plan's
    /// folder].
    #[arg(long, value_name = "FILE.html", num_args = 0..=1, value_parser = page_file)]
    pub(crate) show: Option<Option<PathBuf>>,
}

/// An angle in radians, or in degrees with `deg` behind it.
fn radians(text: &str) -> Result<f64, String> {
    let angle = match text.strip_suffix("deg") {
        Some(degrees) => degrees.trim().parse::<f64>().map(f64::to_radians),
        None => text.parse(),
    };
    angle.map_err(|_| "expected radians, or degrees as in 20deg".to_owned())
}

/// The name of a page. What follows `--show` may be the next argument of the command instead, which this tells apart.
fn page_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_page = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("html"));
    let expected = "expected a file that ends in .html; without a file, put --show last";
    is_page.then_some(path).ok_or_else(|| expected.to_owned())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Switch {
    On,
    Off,
}

impl Switch {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::On => "on",
            Self::Off => "off",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Collisions {
    End,
    Contact,
}

/// A format that others read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// The path as a table: poses with arc length, time and speed.
    Csv,
    /// The same as JSON, shaped like the path message of ROS.
    Json,
    /// Map, path and drive as ROS 2 messages in an MCAP file.
    Mcap,
    /// Options and path as a route graph for the Route Server of Nav2.
    Geojson,
    /// Its networks as ONNX models, one file for each different network.
    Onnx,
    /// Its networks as weights, one file for each different network.
    Safetensors,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The folder that `sharp solve` wrote.
    pub(crate) plan_dir: PathBuf,
    /// The format.
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// The file to write; where a plan has several networks, those after the first get -2, -3, ... before the ending.
    #[arg(long, value_name = "PATH")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
#[command(mut_args(of_a_library))]
pub(crate) struct Serve {
    /// The folder that `sharp solve` wrote; with --library a map, in which goals come as lines.
    #[arg(value_name = "PLAN_DIR|MAP")]
    pub(crate) place: String,
    /// A library that `sharp learn` filled: goals come as lines, and the first argument is the map.
    #[arg(long, value_name = "DIR")]
    pub(crate) library: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) abstraction: AbstractionArgs,
    /// With --library: none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file (.ron).
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE")]
    pub(crate) noise: String,
}

/// What a plan has settled can be asked for with a library only.
fn of_a_library(arg: clap::Arg) -> clap::Arg {
    let is_settled = ["robot", "options", "regions", "metric", "noise"].contains(&arg.get_id().as_str());
    if is_settled { arg.requires("library") } else { arg }
}

#[derive(Debug, Args)]
pub(crate) struct Abstract {
    #[command(flatten)]
    pub(crate) map: MapArgs,
    #[command(flatten)]
    pub(crate) abstraction: AbstractionArgs,
    /// Where the files are written.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Regions {
    /// Make labels on generated maps and train the network.
    Train(RegionsTrain),
    /// Draw the heat map of one map and list its regions.
    Predict(Abstract),
    /// Score network, geometric detector, random regions and a grid on held-out maps, or one of them at
    /// the doors of a map.
    Score(RegionsScore),
}

#[derive(Debug, Args)]
pub(crate) struct RegionsTrain {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// What computes: flex, or ndarray where it is compiled in.
    #[arg(long, default_value = "flex")]
    pub(crate) device: String,
    /// Size and kind of the run; paper-small has the nonlinearity, rate and batch of the paper and the rest of
    /// default.
    #[arg(long, default_value = "default", value_name = "tiny|default|paper|paper-small")]
    pub(crate) preset: String,
    /// Training maps, instead of the preset's number.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) maps: Option<u32>,
    /// Goals on each map, instead of the preset's number.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) goals: Option<u32>,
    /// Starts for each goal, instead of the preset's number.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) starts: Option<u32>,
    /// Gradient steps, instead of the preset's number.
    #[arg(long)]
    pub(crate) steps: Option<u32>,
    /// Where the network is written; labels, checkpoint, sample pictures and TensorBoard events go to a
    /// folder beside it that ends in .work.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Go on from the checkpoint beside FILE.
    #[arg(long)]
    pub(crate) resume: bool,
}

#[derive(Debug, Args)]
pub(crate) struct RegionsScore {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// A map to score at its doors, instead of generated ones.
    #[arg(requires = "doors")]
    pub(crate) map: Option<String>,
    /// The doors of MAP: a YAML list with name and corners of each.
    #[arg(long, value_name = "FILE", requires = "map")]
    pub(crate) doors: Option<PathBuf>,
    /// Held-out maps of each kind.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) maps: u32,
    /// Goals on each held-out map, instead of training's number.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) goals: Option<u32>,
    /// Starts for each goal, instead of training's number.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) starts: Option<u32>,
    /// What is scored at the doors: net, geometric, random, grid or a file.
    #[arg(long, default_value = "net", value_name = "net|geometric|random|grid|FILE")]
    pub(crate) regions: String,
    /// A network to score instead of the shipped one.
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Score extraction thresholds on the validation maps and name the best, instead of scoring.
    #[arg(long, conflicts_with = "map")]
    pub(crate) calibrate: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum PriorCommand {
    /// Train the policy that options begin with, on generated maps.
    Train(PriorTrain),
    /// Fit the model of what it costs to drive on a prior.
    Cost(PriorCost),
    /// How often it holds on held-out kinds of map, beside the followers, and how well its cost is known.
    ///
    /// The rows are numbered from 00: the prior becomes more careful with each number; a follower (constant speed) or a
    /// profiled one (slower before bends and in narrow places) has another speed or way to steer with each.
    Score(PriorScore),
}

/// A recipe for a prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Preset {
    Tiny,
    Default,
}

impl Preset {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Tiny => "tiny",
            Self::Default => "default",
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct PriorTrain {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// The file to write, safetensors; a run that was interrupted goes on from FILE.state.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// How long to train: tiny takes about a minute, default is the recipe of the shipped priors.
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    pub(crate) preset: Preset,
    /// Write learning curves for TensorBoard there, as one run [default: none].
    #[arg(long, value_name = "DIR")]
    pub(crate) tensorboard: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct PriorCost {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// The prior, as `sharp prior train` writes it [default: the shipped one].
    #[arg(long, value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
    /// The file to write, safetensors.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// How long to drive: tiny takes seconds, default is the recipe of the shipped models.
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    pub(crate) preset: Preset,
}

#[derive(Debug, Args)]
pub(crate) struct PriorScore {
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file (.ron).
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE")]
    pub(crate) noise: String,
    /// Number of generated maps.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) maps: u32,
    /// Episodes of each policy on each leg.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) episodes: u32,
    /// Score the prior only, not the followers beside it.
    #[arg(long)]
    pub(crate) prior_only: bool,
    /// A prior's file instead of the shipped one.
    #[arg(long, value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
    /// A cost model's file instead of the shipped one.
    #[arg(long, value_name = "FILE")]
    pub(crate) cost: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Map {
    /// Size, resolution and free area of a map.
    Info(MapArgs),
    /// Write a map of any kind as a ROS map: a YAML file, and a PGM image beside it.
    Save {
        #[command(flatten)]
        map: MapArgs,
        /// The YAML file.
        #[arg(long, value_name = "FILE.yaml")]
        out: PathBuf,
    },
    /// Whether a robot has room in a map; exit code 1 if not.
    Check {
        #[command(flatten)]
        map: MapArgs,
        /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
        #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
        robot: String,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Library {
    /// List the options of a library.
    List {
        /// The folder given to `--library`.
        dir: PathBuf,
    },
    /// Read every file of a library and verify its checksum.
    Check {
        /// The folder given to `--library`.
        dir: PathBuf,
    },
}

/// A system to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BaselineName {
    /// The paper's: RRT, executed open-loop, planned anew from where it ended.
    Rrt,
    /// A drivable path, tracked in closed loop, planned anew on deviation.
    Track,
    /// Model-predictive path integral control along that path.
    Mppi,
    /// The paper's: one soft actor-critic policy from start to goal.
    Sac,
}

impl From<BaselineName> for BaselineKind {
    fn from(name: BaselineName) -> Self {
        match name {
            BaselineName::Rrt => Self::Rrt,
            BaselineName::Track => Self::Track,
            BaselineName::Mppi => Self::Mppi,
            BaselineName::Sac => Self::Sac,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Baseline {
    /// The system.
    #[arg(value_enum, value_name = "METHOD")]
    pub(crate) system: BaselineName,
    #[command(flatten)]
    pub(crate) map: MapArgs,
    /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
    #[arg(long, default_value = "husky", value_name = "NAME|FILE")]
    pub(crate) robot: String,
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// Number of executions.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) episodes: u32,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file (.ron).
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE")]
    pub(crate) noise: String,
    /// The simulator: walls to push and graze, walls that stop, or wheels and gravity in three
    /// dimensions, which a build with `--features rigid3d` has.
    #[arg(long, default_value = "rapier2d", value_name = "rapier2d|kinematic|rapier3d")]
    pub(crate) simulator: String,
    /// What touching a wall means: the end of the episode, or a bump after which it goes on.
    #[arg(long, value_enum, default_value_t = Collisions::End)]
    pub(crate) collisions: Collisions,
    /// Stop learning, or give up driving, after so many seconds of wall time [default: 2400]. Executions that came to
    /// an end are counted; if those are not all, the exit code is 1.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) time_limit: Option<f64>,
    /// Samples of one plan of rrt; a plan that takes more has failed.
    #[arg(long, value_name = "N", default_value_t = BaselineSettings::RRT_SAMPLES)]
    pub(crate) rrt_samples: usize,
    /// Environment steps that sac may learn from; unlike a time limit they give equal bytes.
    #[arg(long, value_name = "N", default_value_t = BaselineSettings::MAX_ENV_STEPS)]
    pub(crate) max_env_steps: u64,
    /// Write learning curves for TensorBoard there, of sac [default: none].
    #[arg(long, value_name = "DIR")]
    pub(crate) tensorboard: Option<PathBuf>,
}

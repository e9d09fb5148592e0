//! How SHARP is compared with other systems: contenders, baselines, experiments, and the engines that run them.
//!
//! The nouns: a [`Contender`] is a system that was prepared for one problem; it gives each episode a controller.
//! [`compare`] lets it drive under the same simulator, noise, collision rule, success rule and time limit as all
//! others. [`Rrt`] and [`FlatSac`] are the paper's baselines, [`Track`] and [`Mpc`] what an engineer would use,
//! [`Composed`] is SHARP. [`solve`] and [`measure`] take one problem from names and numbers to a report.
//!
//! An [`Experiment`] is everything that decides the results of one system in one environment. A [`Manifest`] lists
//! experiments as jobs, an [`Engine`] does them: [`LocalEngine`] on threads, [`SlurmEngine`] on a cluster. A
//! [`ResultLine`] is what one system did on one problem; [`write_report`] turns many of them into tables, figures and
//! one page. Equal results give equal bytes.
//!
//! ```
//! use sharp_bench::{Engine, LocalEngine, Manifest, Suite, SuiteSelection, merge, totals};
//!
//! let mut selection = SuiteSelection::new(Suite::Smoke, 1);
//! selection.systems = vec!["track".into()];
//! selection.problems = vec![1];
//! selection.episodes = 5;
//! let folder = tempfile::tempdir().unwrap();
//! let (manifest, jobs) = Manifest::extend(folder.path(), selection.experiments()?, "an example")?;
//! LocalEngine { workers: 1 }.run(&manifest, &jobs, &())?;
//! let merged = merge(&manifest)?;
//! let table = totals(&merged.lines().collect::<Vec<_>>());
//! assert!(table.contains("| track | nominal | husky | 5/5 |"), "{table}");
//! # Ok::<(), sharp_bench::BenchError>(())
//! ```

pub mod conformance;
pub mod named;
pub mod pictures;

mod baselines;
mod contender;
mod curves;
mod data_uri;
mod dispatch;
mod error;
mod evaluation;
mod jobs;
mod json;
mod learn;
mod measure;
mod prior;
mod reports;
mod result;
mod robot_import;
mod serve_line;
mod shell;
mod show;
mod solve;
mod speed_mask;
mod stopwatch;
mod tensorboard;
mod times;
mod tour;
mod yardstick;

#[cfg(test)]
mod tests;

pub use baselines::{FlatSac, Mpc, RoutePlanner, Rrt, SacBudget, Track};
pub use contender::{ComparisonSettings, Composed, Contender, Driven, compare};
pub use curves::CurveFolder;
pub use dispatch::{DispatchLine, DispatchReply, Dispatcher, Odds};
pub use error::BenchError;
pub use evaluation::{
    PaperLeg, PaperLine, PaperRow, ReportError, ReportInput, paper_rows, table, totals, write_paper,
    write_report,
};
pub use jobs::{
    Done, Ended, Engine, EngineMonitor, Experiment, Inputs, Job, JobWork, Lesson, LessonRound, LocalEngine,
    Manifest, Merged, SharpSettings, SlurmEngine, SlurmScripts, Submission, Suite, SuiteSelection, System,
    clean, count_results, merge, run_job, unfinished,
};
pub use json::to_json;
pub use learn::{BuildingSuccess, LearnReport, LearntBuilding, NamedWorld, WeakReport, learn, learn_by};
pub use measure::{BaselineKind, BaselineSettings, MeasureMonitor, measure};
pub use named::{InputError, NamedProblem};
pub use prior::{
    CostError, CostRecipe, CostScore, FittedCost, HELD_OUT, PolicyScore, PriorCourses, PriorEnd,
    PriorProgress, PriorRecipe, PriorStage, PriorTrainError, fit_cost, prior_candidates, score_cost,
    score_policies, train_prior,
};
pub use reports::{
    BaselineReport, BaselineTimes, EvaluationReport, GoalReport, MapReport, OptionReport, Predicted,
    RunReport, SolveReport, TrainingReport, UnsolvedTraining, Verified,
};
pub use result::{
    Machine, ResultError, ResultLine, Variant, default_regions, problem_folder, read_baselines, row_text,
};
pub use robot_import::{ImportError, ImportWishes, ImportedField, ImportedRobot, import_robot};
pub use serve_line::{ServeLine, parse_pose_line, parse_serve_line};
pub use shell::shell_word;
pub use show::PlanPage;
pub use solve::{AbstractionRequest, SolveFolders, SolveSettings, Solved, prepare, solve};
pub use speed_mask::{SpeedMaskError, SpeedRule, speed_limits};
pub use stopwatch::{Stopwatch, TimedMonitor, clock_us};
pub use tensorboard::EventFile;
pub use times::{DecisionTimes, Reuse, SolveTimes};
pub use tour::{SolvedTour, solve_tour};
pub use yardstick::{
    InformedPolicy, PolicyCost, ValueSettings, ValueTable, YardstickLine, YardstickOption, yardstick_picture,
    yardstick_table,
};

//! How SHARP is compared with other systems: contenders, baselines, suites and the jobs they consist of.
//!
//! The nouns: a [`Contender`] is a system that was prepared for one problem; it gives each episode a controller.
//! [`compare`] lets it drive under the same simulator, noise, collision rule, success rule and time limit as all
//! others. [`Rrt`] and [`FlatSac`] are the paper's baselines, [`Track`] and [`Mpc`] what an engineer would use,
//! [`Composed`] is SHARP. A [`ResultLine`] is what one method did on one problem; [`write_report`] turns many of
//! them into tables, figures and one page. Equal results give equal bytes.
//!
//! ```
//! use sharp_bench::{ResultLine, totals};
//!
//! let line = ResultLine::example("a", "limo", "interface", 1);
//! let table = totals(&[&line]);
//! assert!(table.contains("| sharp interface | nominal | limo | 20/20 |"), "{table}");
//! ```

pub mod conformance;

mod baselines;
mod contender;
mod evaluation;
mod prior;
mod result;
mod times;

pub use baselines::{FlatSac, Mpc, RoutePlanner, Rrt, SacBudget, Track};
pub use contender::{ComparisonSettings, Composed, Contender, Driven, compare};
pub use evaluation::{ReportError, ReportInput, table, totals, write_report};
pub use prior::{
    HELD_OUT, PolicyScore, PriorCourses, PriorEnd, PriorProgress, PriorRecipe, PriorStage, PriorTrainError,
    prior_candidates, score_policies, train_prior,
};
pub use result::{
    Machine, ResultError, ResultLine, Variant, default_regions, problem_folder, read_baselines, row_text,
};
pub use times::{DecisionTimes, Reuse, SolveTimes};

//! What a suite of problems came to: results as lines of JSON, and the report made from them.
//!
//! A [`ResultLine`] is what one method did on one problem. [`write_report`] turns many of them into
//! tables, figures and one page. Equal results give equal bytes.
//!
//! ```
//! use sharp_bench::{ResultLine, totals};
//!
//! let line = ResultLine::example("a", "limo", "interface", 1);
//! let table = totals(&[&line]);
//! assert!(table.contains("| sharp interface | nominal | limo | 20/20 |"), "{table}");
//! ```

mod evaluation;
mod result;
mod times;

pub use evaluation::{ReportError, ReportInput, table, totals, write_report};
pub use result::{
    Machine, ResultError, ResultLine, Variant, default_regions, problem_folder, read_baselines, row_text,
};
pub use times::{DecisionTimes, Reuse, SolveTimes};

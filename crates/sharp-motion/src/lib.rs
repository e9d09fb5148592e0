//! Sampling-based motion planners.
//!
//! A [`MotionQuery`] asks for a path from one pose to another, a [`Steering`] says what the robot can drive
//! in free space, a [`Sampler`] says where to look, and a planner answers with an [`PathOutcome`]. All
//! motions are directed: a forward-only robot cannot drive an edge backwards.
//!
//! ```
//! use sharp_motion::{PathOutcome, MotionQuery, RrtSettings, Steering, Uniform, rrt_connect};
//! use sharp_space::{Footprint, FootprintChecker, OccupancyGrid, Pose, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(1.0, "#######\n#.....#\n#.....#\n#.....#\n#######").unwrap();
//! let checker = FootprintChecker::new(&grid, Footprint::rectangle(0.4, 0.3).unwrap());
//! let query = MotionQuery { start: Pose::new(1.5, 1.5, 0.0), goal: Pose::new(5.0, 3.0, 1.0) };
//! let mut everywhere = Uniform { bounds: grid.frame().bounds() };
//! let outcome = rrt_connect(
//!     &query,
//!     &checker,
//!     &Steering::RotateTranslate,
//!     &mut everywhere,
//!     &RrtSettings::default(),
//!     &mut Seed(7).stream("plan", 0),
//! );
//! let PathOutcome::Solved(path) = outcome else { panic!("an open room has a path") };
//! assert_eq!(path.end(), query.goal);
//! ```

mod dubins;
mod hybrid_astar;
mod learn_and_link;
mod maneuver;
mod nearest;
mod path;
mod planner;
mod query;
mod rrt;
mod rrt_connect;
mod sampler;
mod shortcut;
mod steering;
mod tree;

pub mod conformance;

pub use hybrid_astar::{HybridSettings, hybrid_astar};
pub use learn_and_link::learn_and_link;
pub use maneuver::{Maneuver, Primitive};
pub use nearest::Nearest;
pub use path::Path;
pub use planner::{Algorithm, MotionPlanner, SamplingPlanner};
pub use query::{Budget, MotionQuery, PathOutcome, RrtSettings};
pub use rrt::rrt;
pub use rrt_connect::rrt_connect;
pub use sampler::{FromCells, Mixture, Sampler, Uniform};
pub use shortcut::{ShortcutSettings, shortcut};
pub use steering::Steering;

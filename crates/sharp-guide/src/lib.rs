//! Option guides: guide paths, rewards and guided options (paper, section "Synthesizing and using Option Guides").
//!
//! The nouns: a [`GuidePath`] leads from one endpoint of an option to the other (definition 8). A [`GuidePlanner`]
//! plans it through the cells that the option may use, for the robot's whole outline. A [`Reward`] pays a learner:
//! [`PseudoReward`] is the paper's (definition 9), [`ProgressReward`] learns faster. A [`GuidedOption`] puts them
//! together (definition 7): it is what policies are learnt for and run in.
//!
//! ```
//! use sharp_guide::{ClearanceSearch, GuideEnd, GuidePlanner, GuideRequest, GuideRobot, Steering};
//! use sharp_space::{Footprint, FootprintChecker, OccupancyGrid, Point, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, &["..........................."; 8].join("\n")).unwrap();
//! let checker = FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.335).unwrap());
//! let robot = GuideRobot::new(&checker, Steering::RotateTranslate);
//! let request = GuideRequest {
//!     start: GuideEnd { position: Point::new(2.0, 2.0), heading: None },
//!     goal: GuideEnd { position: Point::new(10.0, 2.0), heading: None },
//!     allowed: &|_| true,
//! };
//! let mut rng = Seed(1).stream("guide", 0);
//! let guide = ClearanceSearch::default().plan(&request, &robot, &mut rng).unwrap();
//! assert!((guide.length_m() - 8.0).abs() < 0.01, "nothing is in the way: {} m", guide.length_m());
//! ```

pub mod conformance;

mod arrival;
mod band;
mod context;
mod crossing;
mod departure;
mod gap;
mod goal;
mod guided_option;
mod inflate;
mod join;
mod path;
mod plan;
mod planner;
mod request;
mod reward;
mod ridge;
mod route;
mod sampled;
mod settings;
mod traversable;

pub use arrival::arriving;
pub use crossing::crossing_heading;
pub use departure::{Departure, departures, is_tight};
pub use gap::gap_m;
pub use goal::Goal;
pub use guided_option::{GuidedOption, LegId, OptionSpace, Role, Target};
pub use inflate::{GuideRobot, InflatedRobot, inflated_robots};
pub use join::{end_in_passing, join_guides};
pub use path::{GuidePath, GuidePathError, Projection};
pub use planner::{ClearanceSearch, GuidePlanner, LearnAndLink};
pub use request::{GuideEnd, GuideRequest, NoGuide, UnguidedOption};
pub use reward::{Place, ProgressReward, PseudoReward, Reward, StepEvents, Transition};
pub use route::{joining, ridge_routes, route_beyond, routes, shortest_way_m};
pub use settings::{GuideSettings, PlannerKind};
pub use sharp_motion::Steering;

//! Option guides: guide paths and pseudo-rewards (paper, section "Synthesizing and using Option Guides").
//!
//! [`plan_guide`] draws a [`GuidePath`] between the endpoints of an option, through the cells that
//! the option may use, and certifies it with the robot's whole outline. [`PseudoReward`] is the
//! paper's reward along it, [`ShapedReward`] the one that learns faster.
//!
//! ```
//! use sharp_guide::{GuideEnd, GuideRequest, GuideSettings, plan_guide};
//! use sharp_motion::Steering;
//! use sharp_space::{Footprint, FootprintChecker, OccupancyGrid, Point, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, &["..........................."; 8].join("\n")).unwrap();
//! let checker = FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.335).unwrap());
//! let request = GuideRequest {
//!     start: GuideEnd { position: Point::new(2.0, 2.0), heading: None },
//!     goal: GuideEnd { position: Point::new(10.0, 2.0), heading: None },
//!     allowed: &|_| true,
//! };
//! let (settings, mut rng) = (GuideSettings::default(), Seed(1).stream("guide", 0));
//! let guide = plan_guide(&request, &checker, &Steering::RotateTranslate, &settings, &mut rng).unwrap();
//! assert!((guide.length_m() - 8.0).abs() < 0.01, "nothing is in the way: {} m", guide.length_m());
//! ```

mod band;
mod floor;
mod option_guide;
mod path;
mod plan;
mod reward;
mod ridge;
mod sampled;
mod settings;
mod workbench;

pub use option_guide::{Abstraction, OptionGuide, Robot};
pub use path::{GuidePath, GuidePathError, Projection};
pub use plan::{GuideEnd, GuideRequest, NoGuide, plan_guide, smooth_guide};
pub use reward::{Place, PseudoReward, ShapedReward, StepEvents};
pub use settings::{GuidePlanner, GuideSettings};
pub use sharp_motion::Steering;

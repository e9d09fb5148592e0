//! Where a drive begins and ends.

use std::path::PathBuf;

use clap::Args;
use sharp_bench::SpeedRule;

/// Start and goal: as poses, as pixels, or by the number of a problem.
#[derive(Debug, Args)]
pub(crate) struct ProblemArgs {
    /// Initial configuration: metres, metres, radians in the map's frame; degrees as in 2,3,90deg.
    #[arg(long, value_name = "X,Y,YAW", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    /// Goal configuration; its heading is free and may be left out.
    #[arg(long, value_name = "X,Y[,YAW]", allow_hyphen_values = true)]
    pub(crate) goal: Option<String>,
    /// Start in the middle of a pixel of the map's picture: column and row from the upper left, from 0, and radians in
    /// the map's frame [default heading: towards the goal].
    #[arg(long, value_name = "C,R[,YAW]", conflicts_with = "start", allow_hyphen_values = true)]
    pub(crate) start_pixel: Option<String>,
    /// Goal in the middle of a pixel.
    #[arg(long, value_name = "C,R", conflicts_with = "goal", allow_hyphen_values = true)]
    pub(crate) goal_pixel: Option<String>,
    /// One of a named map's own problems, or of --scen, instead of start and goal.
    #[arg(long, value_name = "N", conflicts_with_all = ["start", "goal", "start_pixel", "goal_pixel"])]
    pub(crate) problem: Option<usize>,
    /// The MovingAI scenarios (.scen) that --problem numbers, from 1. The robot begins with its heading towards the goal.
    #[arg(long, value_name = "FILE", requires = "problem")]
    pub(crate) scen: Option<PathBuf>,
}

/// Speed limits by place.
#[derive(Debug, Args)]
pub(crate) struct SpeedArgs {
    /// Drive slower where this mask (a ROS map of mode scale or raw) says so, as the speed filter of Nav2 does: the limit
    /// is --speed-base + --speed-multiplier x value; 0 and unknown cells have none.
    #[arg(long, value_name = "MASK.yaml")]
    pub(crate) speed_mask: Option<PathBuf>,
    /// The base of the limits, as in Nav2's `CostmapFilterInfo`.
    #[arg(long, value_name = "B", default_value_t = SpeedRule::default().base, requires = "speed_mask", allow_hyphen_values = true)]
    pub(crate) speed_base: f64,
    /// The multiplier of the limits, as there.
    #[arg(long, value_name = "M", default_value_t = SpeedRule::default().multiplier, requires = "speed_mask", allow_hyphen_values = true)]
    pub(crate) speed_multiplier: f64,
    /// Limits are metres per second (type 2 of Nav2), not percent of the robot's top speed (type 1).
    #[arg(long, requires = "speed_mask")]
    pub(crate) speed_absolute: bool,
}

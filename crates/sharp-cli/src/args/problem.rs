//! Where a drive begins and ends.

use std::path::PathBuf;

use clap::Args;

/// Start and goal: as poses, as pixels, or by the number of a problem.
#[derive(Debug, Args)]
pub(crate) struct ProblemArgs {
    /// Initial configuration: metres, metres, radians in the map's frame.
    #[arg(long, value_name = "X,Y,YAW", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    /// Goal configuration; its heading is free and may be left out.
    #[arg(long, value_name = "X,Y[,YAW]", allow_hyphen_values = true)]
    pub(crate) goal: Option<String>,
    /// Start in the middle of a pixel of the map's picture: column and row from the upper left, from 0, and radians in
    /// the map's frame [default heading: towards the goal].
    #[arg(long, value_name = "C,R[,YAW]", conflicts_with = "start")]
    pub(crate) start_pixel: Option<String>,
    /// Goal in the middle of a pixel.
    #[arg(long, value_name = "C,R", conflicts_with = "goal")]
    pub(crate) goal_pixel: Option<String>,
    /// One of a named map's own problems, or of --scen, instead of start and goal.
    #[arg(long, value_name = "N", conflicts_with_all = ["start", "goal", "start_pixel", "goal_pixel"])]
    pub(crate) problem: Option<usize>,
    /// The MovingAI scenarios (.scen) that --problem numbers, from 1. The robot begins with its heading towards the goal.
    #[arg(long, value_name = "FILE", requires = "problem")]
    pub(crate) scen: Option<PathBuf>,
}

//! `sharp robot`.

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};

#[derive(Debug, Subcommand)]
pub(crate) enum Robots {
    /// List the robots that are built in.
    List,
    /// Show a robot with all that its file leaves to defaults.
    Show {
        /// husky, limo, turtlebot3, jackal, car or a robot file (.ron).
        #[arg(value_name = "NAME|FILE")]
        robot: String,
    },
    /// Make a robot file of the robot's Nav2 parameters (YAML) or its URDF.
    Import {
        /// The file; several where each holds a part, the first one counts where two say the same.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Where the robot file is written [default: the robot's name with .ron, if there is no such file].
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// What the robot is called [default: as in the URDF, or as the first file].
        #[arg(long)]
        name: Option<String>,
        /// Its top speed, metres per second [default: the controller's].
        #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
        max_speed: Option<f64>,
        /// How it steers [default: what the files say].
        #[arg(long, value_enum)]
        drive: Option<DriveName>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DriveName {
    Differential,
    Ackermann,
}

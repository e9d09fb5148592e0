//! What `sharp learn` is told.

use std::path::PathBuf;

use clap::Args;
use sharp_plan::{Area, Part};
use sharp_space::Point;

use super::{AbstractionArgs, EngineName, Learning, MapArgs};

/// Learn every option of a building ahead of time.
#[derive(Debug, Args)]
pub(crate) struct Learn {
    #[command(flatten)]
    pub(crate) map: MapArgs,
    #[command(flatten)]
    pub(crate) abstraction: AbstractionArgs,
    /// How policies are learnt.
    #[arg(long, value_enum, default_value_t = Learning::Fast)]
    pub(crate) learning: Learning,
    /// none, nominal, harsh or biased, also with a factor as in nominal*2, or a noise file (.ron).
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE")]
    pub(crate) noise: String,
    /// The simulator in which policies are learnt; they are described at `run` [default: kinematic; with --learning paper
    /// and paper-tuned rapier2d].
    #[arg(long, value_name = "kinematic|rapier2d|rapier3d")]
    pub(crate) simulator: Option<String>,
    /// Where options are kept [default: a cache folder].
    #[arg(long, value_name = "DIR")]
    pub(crate) library: Option<String>,
    /// Where the pictures success and speed are written [default: none].
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Only the options whose two ends lie in this rectangle, metres in the map's frame.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = area)]
    pub(crate) within: Option<Area>,
    /// Who learns: this process, or a Slurm cluster all nodes of which see the library.
    #[arg(long, value_enum, default_value_t = EngineName::Local)]
    pub(crate) engine: EngineName,
    /// Parts that the work is split into, each done by one thread or task; the result does not depend on it [default: none,
    /// on Slurm 16].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) jobs: Option<u32>,
    /// Only part I of N of the work, from 0: what one of several processes or tasks of a cluster does (docs/scale.md).
    #[arg(long, value_name = "I/N", value_parser = part, conflicts_with_all = ["jobs", "engine"])]
    pub(crate) part: Option<Part>,
}

fn area(text: &str) -> Result<Area, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => {
            Ok(Area { min: Point::new(x0, y0), max: Point::new(x1, y1) })
        }
        _ => Err("expected four numbers X0,Y0,X1,Y1 with X0 below X1 and Y0 below Y1".to_owned()),
    }
}

fn part(text: &str) -> Result<Part, String> {
    let part = text.split_once('/').and_then(|(index, count)| {
        Some(Part { index: index.trim().parse().ok()?, count: count.trim().parse().ok()? })
    });
    part.filter(|part| part.index < part.count).ok_or_else(|| "expected I/N with I below N".to_owned())
}

//! Masks whose cells are numbers, as the speed filter of Nav2 reads them.

use std::path::Path;

use sharp_space::GridFrame;

use super::error::MapError;
use super::load::LoadOptions;
use super::ros;

/// The numbers of a ROS map, as Nav2 publishes them.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueMask {
    /// Where its cells are.
    pub frame: GridFrame,
    /// A number from 0 to 100 for each cell, -1 where it is unknown; row-major from the lower left cell.
    pub values: Vec<i8>,
    /// What was accepted but is probably a mistake, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads the ROS map at `path` (YAML) as numbers. The mode `scale` has numbers between 0 and 100, `raw` those of the
/// image, `trinary` only 0 and 100.
///
/// # Errors
/// As [`load`](crate::load) for a ROS map.
pub fn load_values(path: &Path, options: &LoadOptions) -> Result<ValueMask, MapError> {
    let mut warnings = Vec::new();
    let (frame, values) = ros::values(path, options, &mut warnings)?;
    Ok(ValueMask { frame, values, warnings })
}

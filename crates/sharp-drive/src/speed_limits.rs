//! Speed limits that depend on the place, as the speed filter of Nav2 has them.
//!
//! They hold for commands: whatever a policy decides, a robot is told to drive no faster than the place where it is, and
//! the way that it covers in the next action, allow. Predictions, learning and execution share this rule, so predicted
//! times have the limits in them. A robot under noise may overshoot a limit as it overshoots any command.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::ActionSettings;
use sharp_space::{GridFrame, Heading, Point, Pose};
use thiserror::Error;

use crate::command::Command;

/// The lowest limit, metres per second: a slower robot counts as standing still.
pub const SPEED_LIMIT_MIN_MPS: f64 = 0.05;
/// Distance between two places at which the way ahead is looked at, metres.
const LOOK_M: f64 = 0.05;
/// A robot that is slower than this needs more actions than options have, metres per second.
const UNHURRIED_MPS: f64 = 0.3;

/// Why limits are refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SpeedLimitsError {
    /// There is not one limit a cell.
    #[error("there are {found} limits, expected one for each of {cells} cells")]
    Count {
        /// Limits.
        found: usize,
        /// Cells.
        cells: usize,
    },
    /// A limit is not a speed that a robot can drive at.
    #[error("a limit is {limit_mps} m/s, expected {SPEED_LIMIT_MIN_MPS} m/s or more, or 0 for none")]
    Slow {
        /// The limit, metres per second.
        limit_mps: f32,
    },
}

/// Speed limits on a grid of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SpeedLimitRuns", into = "SpeedLimitRuns")]
pub struct SpeedLimits {
    frame: GridFrame,
    /// Metres per second, row-major from the lower left cell; 0 where there is no limit.
    limits_mps: Vec<f32>,
}

/// The limits as files have them: so many cells with the same limit, one run after the other.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeedLimitRuns {
    frame: GridFrame,
    runs: Vec<(usize, f32)>,
}

impl SpeedLimits {
    /// `limits_mps` (metres per second, 0 for none) for the cells of `frame`, row-major from the lower left cell.
    ///
    /// # Errors
    /// If there is not one limit a cell, or one is neither 0 nor at least [`SPEED_LIMIT_MIN_MPS`].
    pub fn new(frame: GridFrame, limits_mps: Vec<f32>) -> Result<Self, SpeedLimitsError> {
        if limits_mps.len() != frame.len() {
            return Err(SpeedLimitsError::Count { found: limits_mps.len(), cells: frame.len() });
        }
        let is_sound = |limit_mps: f32| limit_mps == 0.0 || f64::from(limit_mps) >= SPEED_LIMIT_MIN_MPS;
        match limits_mps.iter().find(|&&limit_mps| !is_sound(limit_mps)) {
            Some(&limit_mps) => Err(SpeedLimitsError::Slow { limit_mps }),
            None => Ok(Self { frame, limits_mps }),
        }
    }

    /// The limit at `point`, metres per second; infinite where there is none and outside the grid.
    #[must_use]
    pub fn at(&self, point: Point) -> f64 {
        let limit_mps = self.frame.cell_at(point).map_or(0.0, |cell| self.limits_mps[self.frame.index(cell)]);
        if limit_mps > 0.0 { f64::from(limit_mps) } else { f64::INFINITY }
    }

    /// `command` for a robot at `pose`, no faster than the limits here and on the way of one action.
    #[must_use]
    pub fn held(&self, pose: &Pose, command: Command) -> Command {
        let along = Heading::new(pose.heading.radians() + command.bearing_rad).unit();
        let action_s = ActionSettings::default().action_s;
        let (mut speed_mps, mut ahead_m) = (command.speed_mps.min(self.at(pose.position)), 0.0);
        // A limit further ahead is of no concern once the robot is slow enough not to get there.
        while ahead_m < speed_mps * action_s {
            let reached_mps = ahead_m / action_s;
            ahead_m += LOOK_M;
            speed_mps = speed_mps.min(self.at(pose.position + along * ahead_m).max(reached_mps));
        }
        Command { speed_mps: speed_mps.min(command.speed_mps), ..command }
    }

    /// How much longer `guide` takes a robot that would drive it at `speed_mps` everywhere, seconds.
    #[must_use]
    pub fn delay_s(&self, guide: &GuidePath, speed_mps: f64) -> f64 {
        let delay_s = |pair: &[Pose]| {
            let (length_m, limit_mps) = (pair[0].distance_m(&pair[1]), self.at(pair[0].position));
            (length_m / limit_mps.min(speed_mps)) - length_m / speed_mps
        };
        guide.poses().windows(2).map(delay_s).sum()
    }
}

/// How much of an action counts against the horizon of an option for a robot that may drive this fast, 0 to 1.
pub(crate) fn action_share(speed_mps: f64) -> f64 {
    (speed_mps / UNHURRIED_MPS).min(1.0)
}

impl From<SpeedLimits> for SpeedLimitRuns {
    fn from(SpeedLimits { frame, limits_mps }: SpeedLimits) -> Self {
        let runs = limits_mps.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0])).collect();
        Self { frame, runs }
    }
}

impl TryFrom<SpeedLimitRuns> for SpeedLimits {
    type Error = SpeedLimitsError;

    fn try_from(SpeedLimitRuns { frame, runs }: SpeedLimitRuns) -> Result<Self, Self::Error> {
        let found = runs.iter().fold(0_usize, |sum, run| sum.saturating_add(run.0));
        if found != frame.len() {
            return Err(SpeedLimitsError::Count { found, cells: frame.len() });
        }
        let limits = runs.into_iter().flat_map(|(count, limit_mps)| std::iter::repeat_n(limit_mps, count));
        Self::new(frame, limits.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten metres to the east: free, then 0.4 m/s from 4 m to 6 m, then free again.
    fn zone() -> SpeedLimits {
        let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 1.0, width: 10, height: 1 };
        SpeedLimits::new(frame, vec![0.0, 0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.0, 0.0, 0.0]).expect("sound limits")
    }

    fn speed_mps(x: f64, bearing_rad: f64) -> f64 {
        let command = Command { reach_m: 1.0, bearing_rad, speed_mps: 1.0 };
        zone().held(&Pose::new(x, 0.5, 0.0), command).speed_mps
    }

    #[test]
    fn a_limit_holds_where_it_is_and_just_before() {
        assert_eq!([speed_mps(1.0, 0.0), speed_mps(7.0, 0.0)], [1.0, 1.0], "where there is none");
        assert_eq!(speed_mps(20.0, 0.0), 1.0, "outside the grid");
        assert!((speed_mps(5.0, 0.0) - 0.4).abs() < 1e-6, "inside: {}", speed_mps(5.0, 0.0));
        let near = speed_mps(3.9, 0.0);
        assert!((0.4..0.5).contains(&near), "half an action before: {near}");
        assert_eq!(speed_mps(3.9, std::f64::consts::PI), 1.0, "away from it");
        let command = Command { reach_m: 1.0, bearing_rad: 0.0, speed_mps: 0.2 };
        assert_eq!(zone().held(&Pose::new(5.0, 0.5, 0.0), command), command, "slower than the limit");
    }

    #[test]
    fn a_guide_takes_longer_by_the_time_lost_in_the_zone() {
        let poses = (0..=90).map(|i| Pose::new(0.5 + 0.1 * f64::from(i), 0.5, 0.0)).collect();
        let guide = GuidePath::new(poses, 0.2).expect("a path");
        // Two metres at 0.4 m/s in place of 1 m/s.
        assert!((zone().delay_s(&guide, 1.0) - 3.0).abs() < 0.3, "{}", zone().delay_s(&guide, 1.0));
        assert_eq!(zone().delay_s(&guide, 0.3), 0.0, "a slow robot loses nothing");
    }

    #[test]
    fn what_is_no_limit_is_refused_and_files_keep_the_rest() {
        let frame = zone().frame;
        assert_eq!(
            SpeedLimits::new(frame, vec![0.0; 9]),
            Err(SpeedLimitsError::Count { found: 9, cells: 10 })
        );
        for limit_mps in [0.01, -1.0, f32::NAN] {
            assert!(SpeedLimits::new(frame, vec![limit_mps; 10]).is_err(), "{limit_mps}");
        }
        let text = ron::to_string(&zone()).expect("text");
        assert!(text.contains("runs:[(4,0.0),(2,0.4),(4,0.0)]"), "{text}");
        assert_eq!(ron::from_str::<SpeedLimits>(&text).expect("limits"), zone());
        let error = ron::from_str::<SpeedLimits>(&text.replace("(2,", "(3,")).unwrap_err().to_string();
        assert!(error.contains("11 limits"), "{error}");
    }
}

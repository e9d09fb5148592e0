//! Noticing that a robot stands still.

use sharp_space::Pose;

/// Actions over which standing still is judged: five seconds.
const ACTIONS: u32 = 10;
/// A robot that moved less than this over [`ACTIONS`], and turned less than [`TURN_RAD`], stands still, metres.
/// A policy at its slowest still drives 0.25 m in that time.
const MOVED_M: f64 = 0.1;
const TURN_RAD: f64 = 0.3;

/// Counts actions since a robot last moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandstillDetector {
    anchor: Pose,
    since: u32,
}

impl StandstillDetector {
    /// A robot that has just arrived at `pose`.
    #[must_use]
    pub const fn new(pose: Pose) -> Self {
        Self { anchor: pose, since: 0 }
    }

    /// After an action the robot is at `pose`.
    pub fn observe(&mut self, pose: &Pose) {
        let turned = self.anchor.heading.turn_to(pose.heading).abs() > TURN_RAD;
        let moved = turned || self.anchor.distance_m(pose) > MOVED_M;
        *self = if moved { Self::new(*pose) } else { Self { since: self.since + 1, ..*self } };
    }

    /// Returns true if the robot stands still.
    #[must_use]
    pub const fn stands_still(&self) -> bool {
        self.since >= ACTIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crawling_and_turning_is_not_standing_still() {
        let start = Pose::new(1.0, 1.0, 0.0);
        let still_after = |speed_mps: f64, rate_radps: f64| {
            let mut detector = StandstillDetector::new(start);
            (1..40).find(|&action| {
                let time_s = 0.5 * f64::from(action);
                detector.observe(&Pose::new(1.0 + speed_mps * time_s, 1.0, rate_radps * time_s));
                detector.stands_still()
            })
        };
        assert_eq!(still_after(0.0, 0.0), Some(10));
        assert_eq!(still_after(0.05, 0.0), None, "the slowest policy");
        assert_eq!(still_after(0.0, 0.1), None, "turning in place");
    }
}

//! Exact contact tests, skipped while the robot cannot have come near anything.

use sharp_space::Pose;

use crate::obstacle_map::ObstacleMap;

/// Remembers how far the robot may still travel before contact has to be tested.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ContactGuard {
    slack_m: f64,
}

impl ContactGuard {
    /// Exact test of `pose`, given that no point of the robot's axis moved more than `moved_m` since
    /// the last call.
    pub(crate) fn is_free(&mut self, map: &ObstacleMap, pose: &Pose, moved_m: f64) -> bool {
        self.slack_m -= moved_m;
        if self.slack_m > 0.0 {
            return true;
        }
        self.slack_m = map.slack_m(pose);
        self.slack_m > 0.0 || map.checker().is_free(*pose)
    }

    /// Returns true if no point of the outline at `pose` can meet anything while it moves by `room_m`. False
    /// means that it is not known.
    pub(crate) fn has_room(&mut self, map: &ObstacleMap, pose: &Pose, room_m: f64) -> bool {
        if self.slack_m <= room_m {
            self.slack_m = map.slack_m(pose);
        }
        self.slack_m > room_m
    }

    /// Notes that no point of the robot's axis moved more than `moved_m`.
    pub(crate) fn spend(&mut self, moved_m: f64) {
        self.slack_m -= moved_m;
    }

    /// Makes the next call test exactly, however little the robot moves.
    pub(crate) fn forget(&mut self) {
        self.slack_m = 0.0;
    }
}

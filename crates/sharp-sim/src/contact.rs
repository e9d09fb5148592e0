//! Exact contact tests, skipped while the robot cannot have come near anything.

use sharp_space::Pose;

use crate::world::World;

/// Remembers how far the robot may still travel before contact has to be tested.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ContactGuard {
    slack_m: f64,
}

impl ContactGuard {
    /// Exact test of `pose`, given that no point of the robot's axis moved more than `moved_m` since
    /// the last call.
    pub(crate) fn is_free(&mut self, world: &World, pose: &Pose, moved_m: f64) -> bool {
        self.slack_m -= moved_m;
        if self.slack_m > 0.0 {
            return true;
        }
        self.slack_m = world.slack_m(pose);
        self.slack_m > 0.0 || world.checker().is_free_exact(*pose)
    }

    /// Returns true if no point of the outline at `pose` meets anything on a way of `room_m`; false
    /// does not say that one does.
    pub(crate) fn has_room(&mut self, world: &World, pose: &Pose, room_m: f64) -> bool {
        if self.slack_m <= room_m {
            self.slack_m = world.slack_m(pose);
        }
        self.slack_m > room_m
    }

    /// Takes note that no point of the robot's axis moved more than `moved_m`.
    pub(crate) fn spend(&mut self, moved_m: f64) {
        self.slack_m -= moved_m;
    }

    /// Tests at the next call, however short the way.
    pub(crate) fn forget(&mut self) {
        self.slack_m = 0.0;
    }
}

//! What a policy sees: the world, what the robot knows of itself, and where it is on its guide.

use sharp_guide::GuidePath;
use sharp_sim::{ActionSettings, EpisodeBias, NoiseModel, RobotState};
use sharp_space::{Heading, Pose, Stream, Vector};

use crate::command::Command;
use crate::episode::Motion;
use crate::slip_filter::SlipEstimate;
use crate::world::World;

/// Share of the older mean that is kept from one action to the next in [`Observation::residuals`].
const RESIDUAL_KEPT: f64 = 0.8;
/// Actions that [`Observation::long_residuals`] reach back at most.
const LONG_ACTIONS: u32 = 50;

/// Everything that a policy may look at when it decides.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// What the robot knows of itself.
    pub observation: &'a Observation,
    /// Where it is on its guide.
    pub progress: &'a GuideProgress,
    /// The guide, and the one after it where it is known.
    pub guide: GuideView<'a>,
}

/// What the robot knows of itself at the moment of a decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Pose and motion.
    pub state: RobotState,
    /// How the last action moved it, in the frame it had before: ahead, left (metres), turn (radians).
    pub last_displacement: [f64; 3],
    /// The last command.
    pub last_command: Command,
    /// Exponential means over the actions so far: turn beyond the bearing that was commanded, radians an action,
    /// and distance driven as a share of the distance that was commanded.
    pub residuals: [f64; 2],
    /// The same as plain means over all actions so far, or over the last fifty or so: what stays the same
    /// for an episode shows here.
    pub long_residuals: [f64; 2],
    /// Actions behind these means.
    pub(crate) felt_actions: u32,
    /// The slip estimate, where the policies use it.
    pub(crate) slip: Option<SlipEstimate>,
}

impl Observation {
    /// The observation of a robot in `state` that has not acted yet; `noise` is the prior of its slip estimate.
    #[must_use]
    pub fn first(state: RobotState, noise: &NoiseModel) -> Self {
        let slip = Some(SlipEstimate::new(noise));
        let last_command = Command::default();
        Self {
            state,
            last_displacement: [0.0; 3],
            last_command,
            residuals: [0.0, 1.0],
            long_residuals: [0.0, 1.0],
            felt_actions: 0,
            slip,
        }
    }

    /// The same without a slip estimate, which takes as long as the simulation.
    #[must_use]
    pub fn without_slip_estimate(self) -> Self {
        Self { slip: None, ..self }
    }

    /// A slip and a pull of this episode, drawn from what the robot believes of them; `None` without a slip estimate.
    #[must_use]
    pub fn draw_bias(&self, rng: &mut Stream) -> Option<EpisodeBias> {
        self.slip.map(|slip| slip.draw(rng))
    }

    /// The observation after `motion`.
    ///
    /// Only a commanded action without contact says something about slip: backing off is no answer to a waypoint,
    /// and an action that a wall ended stopped for another reason.
    #[must_use]
    pub fn after(&self, world: &World, motion: &Motion) -> Self {
        let (before, after) = (&self.state.pose, motion.after);
        let moved = before.to_local(after.pose.position);
        let turn = before.heading.turn_to(after.pose.heading);
        let last_displacement = [moved.x, moved.y, turn];
        let Some(command) = motion.command else {
            return Self { state: after, last_displacement, ..*self };
        };
        let commanded_m = command.speed_mps.mul_add(ActionSettings::default().action_s, 0.05);
        let now = [turn - command.bearing_rad.clamp(-1.0, 1.0), moved.norm() / commanded_m];
        let residuals = [0, 1].map(|i| RESIDUAL_KEPT * self.residuals[i] + (1.0 - RESIDUAL_KEPT) * now[i]);
        // The first value counts like an action: one action alone says little.
        let felt_actions = self.felt_actions + 1;
        let weight = 1.0 / f64::from(1 + felt_actions.min(LONG_ACTIONS));
        let long_residuals =
            [0, 1].map(|i| self.long_residuals[i] + weight * (now[i] - self.long_residuals[i]));
        let learn = |slip: SlipEstimate| match motion.contact {
            true => slip,
            false => slip.after(&world.model, (&self.state, command), &after),
        };
        let slip = self.slip.map(learn);
        Self {
            state: after,
            last_displacement,
            last_command: command,
            residuals,
            long_residuals,
            felt_actions,
            slip,
        }
    }
}

/// Where a robot is on its guide: the projection of its position.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct GuideProgress {
    /// Arc length of the projection, metres; never runs back far.
    pub arc_m: f64,
    /// Signed distance from the guide, metres, left positive.
    pub cross_track_m: f64,
    /// Arc length still to go, metres.
    pub remaining_m: f64,
    /// Direction of the guide there.
    pub tangent: Heading,
}

impl GuideProgress {
    /// The projection of a robot that begins `guide` at `pose`.
    #[must_use]
    pub fn start(guide: &GuidePath, pose: &Pose) -> Self {
        let mut progress = Self::default();
        progress.update(guide, pose);
        progress
    }

    /// Follows the robot to `pose`.
    pub fn update(&mut self, guide: &GuidePath, pose: &Pose) {
        let projection = guide.project(pose.position, self.arc_m);
        self.arc_m = projection.arc_m;
        self.cross_track_m = projection.cross_track_m;
        self.remaining_m = projection.remaining_m;
        self.tangent = projection.tangent;
    }
}

/// A guide path and, where it is known, the one that follows it.
#[derive(Clone, Copy, Debug)]
pub struct GuideView<'a> {
    /// The guide of the option that is running.
    pub current: &'a GuidePath,
    /// The guide of the option after it: looking ahead runs on into it.
    pub next: Option<&'a GuidePath>,
}

impl GuideView<'_> {
    /// The guide's pose `arc_m` metres from its start; past the end, the next guide's pose or the
    /// straight continuation.
    #[must_use]
    pub fn ahead(&self, arc_m: f64) -> Pose {
        let beyond_m = arc_m - self.current.length_m();
        if beyond_m <= 0.0 {
            return self.current.pose_at(arc_m);
        }
        match self.next {
            Some(next) if next.length_m() >= beyond_m => next.pose_at(beyond_m),
            Some(next) => extend(next.pose_at(next.length_m()), beyond_m - next.length_m()),
            None => extend(self.current.pose_at(self.current.length_m()), beyond_m),
        }
    }
}

fn extend(pose: Pose, by_m: f64) -> Pose {
    Pose::at(pose.to_world(Vector::new(by_m, 0.0)), pose.heading)
}

#[cfg(test)]
mod tests {
    use sharp_space::Point;

    use super::*;
    use crate::test_worlds::{hall, straight};

    #[test]
    fn displacements_are_in_the_frame_before_the_action() {
        let world = hall();
        let state = RobotState::at_rest(Pose::new(1.0, 1.0, std::f64::consts::FRAC_PI_2));
        let before = Observation::first(state, &NoiseModel::harsh());
        let command = Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 1.0 };
        let motion = Motion::commanded(command, RobotState::at_rest(Pose::new(0.9, 1.4, 2.0)));
        let after = before.after(&world, &motion);
        let [ahead, left, turn] = after.last_displacement;
        assert!((ahead - 0.4).abs() < 1e-9 && (left - 0.1).abs() < 1e-9, "{ahead} ahead, {left} left");
        assert!((turn - (2.0 - std::f64::consts::FRAC_PI_2)).abs() < 1e-9, "{turn}");
        assert_eq!(after.last_command, command);
    }

    /// Backing off after a contact used to be credited to the waypoint before it, and the slip estimate learnt
    /// that the robot drives backwards.
    #[test]
    fn neither_contact_nor_backing_off_says_anything_about_slip() {
        let world = hall();
        let before = Observation::first(RobotState::at_rest(Pose::new(2.0, 2.0, 0.0)), &NoiseModel::harsh());
        let command = Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 0.5 };
        let moved = RobotState::rolling(Pose::new(2.2, 2.0, 0.05), 0.5);
        let learnt = before.after(&world, &Motion::commanded(command, moved));
        assert_ne!(learnt.slip, before.slip, "a free action says something");
        let bumped = before.after(&world, &Motion { contact: true, ..Motion::commanded(command, moved) });
        assert_eq!(bumped.slip, before.slip, "a contact");
        let backed = before.after(&world, &Motion { command: None, ..Motion::commanded(command, moved) });
        assert_eq!((backed.slip, backed.residuals), (before.slip, before.residuals), "backing off");
        assert_eq!(backed.state, moved, "the robot is where it is");
    }

    #[test]
    fn progress_follows_the_robot() {
        let guide = straight((0.0, 0.0), (4.0, 0.0));
        let mut progress = GuideProgress::start(&guide, &Pose::new(0.0, 0.2, 0.0));
        for (x, y) in [(0.5, 0.1), (1.5, -0.2), (2.5, 0.0)] {
            progress.update(&guide, &Pose::new(x, y, 0.0));
            assert!((progress.arc_m - x).abs() < 1e-9, "{progress:?} at {x} m");
            assert!((progress.cross_track_m - y).abs() < 1e-9, "{progress:?} beside {y} m");
            assert!((progress.arc_m + progress.remaining_m - 4.0).abs() < 1e-9, "{progress:?} of 4 m");
        }
    }

    #[test]
    fn looking_ahead_runs_on_into_the_next_guide_and_straight_past_the_last() {
        let (current, next) = (straight((0.0, 0.0), (2.0, 0.0)), straight((2.0, 0.0), (2.0, 1.0)));
        let alone = GuideView { current: &current, next: None };
        let followed = GuideView { current: &current, next: Some(&next) };
        for (view, arc_m, x, y) in [
            (alone, 1.5, 1.5, 0.0),
            (alone, 3.0, 3.0, 0.0),
            (followed, 1.5, 1.5, 0.0),
            (followed, 2.5, 2.0, 0.5),
            (followed, 4.0, 2.0, 2.0),
        ] {
            let ahead = view.ahead(arc_m).position;
            assert!((ahead - Point::new(x, y)).norm() < 1e-9, "{arc_m} m ahead lies {ahead:?}");
        }
    }
}

//! Plans and drives as MCAP files of ROS 2 messages.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::write::Writer;
use mcap::{McapError, WriteOptions};
use sharp_drive::EpisodeEnd;
use sharp_guide::LegId;
use sharp_plan::{Moment, Plan, Recording};
use sharp_sim::RobotState;
use sharp_space::{Pose, Vector};
use thiserror::Error;

use crate::messages::{self, MessageType};
use crate::path::{PathPoint, PlannedPath, nanoseconds};

/// When a file begins, seconds: viewers and transform buffers take 0 for "no time".
const BEGIN_S: f64 = 1.0;
/// Time between two episodes of a file, seconds.
const PAUSE_S: f64 = 1.0;

/// Why a recording could not be made.
#[derive(Debug, Error)]
#[error("MCAP: {0}")]
pub struct RecordError(#[from] McapError);

/// A recording of `plan` as it should be driven: the robot is on the path, at the times of [`PlannedPath`].
///
/// # Errors
/// If the file grows beyond what the format holds.
pub fn planned_mcap(plan: &Plan) -> Result<Vec<u8>, RecordError> {
    let path = PlannedPath::new(plan);
    let steps = &plan.solution.steps;
    let moments: Vec<Moment> = path
        .points
        .iter()
        .enumerate()
        .map(|(i, point)| Moment {
            time_s: point.time_s,
            state: planned_state(&path.points, i),
            plan: 0,
            option: steps[point.step].option.id,
            command: None,
            is_recovering: false,
        })
        .collect();
    let mut file = File::begin(plan, &path)?;
    file.episode(plan, BEGIN_S, &moments, "planned")?;
    file.finish()
}

/// A recording of driven episodes of `plan`, one after the other.
///
/// # Errors
/// If the file grows beyond what the format holds.
pub fn driven_mcap(plan: &Plan, recordings: &[Recording]) -> Result<Vec<u8>, RecordError> {
    let mut file = File::begin(plan, &PlannedPath::new(plan))?;
    let mut begin_s = BEGIN_S;
    for (number, Recording { execution, moments }) in recordings.iter().enumerate() {
        let outcome = format!("episode {}: {}", number + 1, outcome(execution.end));
        begin_s = file.episode(plan, begin_s, moments, &outcome)? + PAUSE_S;
    }
    file.finish()
}

const fn outcome(end: EpisodeEnd) -> &'static str {
    match end {
        EpisodeEnd::Reached => "reached",
        EpisodeEnd::Collided => "collided",
        EpisodeEnd::TimedOut => "timed out",
        EpisodeEnd::Lost => "lost",
        EpisodeEnd::Stopped => "stopped",
    }
}

/// The state of a robot that is on the path.
fn planned_state(points: &[PathPoint], i: usize) -> RobotState {
    let PathPoint { pose, speed_mps, time_s, .. } = points[i];
    let yaw_rate_radps = points.get(i + 1).map_or(0.0, |next| {
        let gap_s = next.time_s - time_s;
        if gap_s > 1e-6 { pose.heading.turn_to(next.pose.heading) / gap_s } else { 0.0 }
    });
    RobotState { velocity: Vector::new(speed_mps, 0.0), yaw_rate_radps, ..RobotState::at_rest(pose) }
}

/// A file that is being written.
struct File {
    writer: Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<&'static str, Channel>,
    /// Chance of success from each leg of the plan on.
    odds: BTreeMap<LegId, f64>,
}

struct Channel {
    id: u16,
    sequence: u32,
}

impl File {
    /// A file with the map, the path and the goal of `plan`.
    fn begin(plan: &Plan, path: &PlannedPath) -> Result<Self, RecordError> {
        let library = concat!("sharp ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().profile("ros2").library(library).compression(None);
        let writer = options.create(Cursor::new(Vec::new()))?;
        let mut file = Self { writer, channels: BTreeMap::new(), odds: odds(plan) };
        let poses: Vec<(f64, Pose)> =
            path.points.iter().map(|point| (BEGIN_S + point.time_s, point.pose)).collect();
        let map = messages::occupancy_grid(BEGIN_S, &plan.world.grid);
        file.put("/map", messages::OCCUPANCY_GRID, BEGIN_S, &map)?;
        file.put("/plan", messages::PATH, BEGIN_S, &messages::path(BEGIN_S, &poses))?;
        let goal = messages::pose_stamped(BEGIN_S, &plan.solution.query.goal);
        file.put("/goal_pose", messages::POSE_STAMPED_TYPE, BEGIN_S, &goal)?;
        Ok(file)
    }

    /// Writes one episode that begins at `begin_s`; returns when it ends.
    fn episode(
        &mut self,
        plan: &Plan,
        begin_s: f64,
        moments: &[Moment],
        outcome: &str,
    ) -> Result<f64, RecordError> {
        let (mut before, mut is_planned_anew) = (None, false);
        let mut now_s = begin_s;
        for moment in moments {
            now_s = begin_s + moment.time_s;
            let state = &moment.state;
            is_planned_anew |= moment.is_recovering;
            self.put("/tf", messages::TF, now_s, &messages::transforms(now_s, &state.pose))?;
            self.put("/odom", messages::ODOMETRY, now_s, &messages::odometry(now_s, state))?;
            let outline = messages::outline(now_s, &plan.world.robot.footprint);
            self.put("/footprint", messages::POLYGON, now_s, &outline)?;
            if before != Some(moment.option) {
                before = Some(moment.option);
                let name = moment.option.to_string();
                self.put("/sharp/option", messages::STRING, now_s, &messages::string(&name))?;
                // Legs of a new plan can have the names of old ones.
                if let Some(&odds) = self.odds.get(&moment.option).filter(|_| !is_planned_anew) {
                    self.put("/sharp/odds", messages::FLOAT64, now_s, &messages::float64(odds))?;
                }
            }
            if let Some(command) = moment.command {
                let waypoint = Pose::at(command.to_world(&state.pose), state.pose.heading);
                let waypoint = messages::pose_stamped(now_s, &waypoint);
                self.put("/sharp/waypoint", messages::POSE_STAMPED_TYPE, now_s, &waypoint)?;
            }
        }
        self.put("/sharp/outcome", messages::STRING, now_s, &messages::string(outcome))?;
        Ok(now_s)
    }

    fn put(
        &mut self,
        topic: &'static str,
        kind: MessageType,
        time_s: f64,
        payload: &[u8],
    ) -> Result<(), RecordError> {
        if !self.channels.contains_key(topic) {
            let schema = self.writer.add_schema(kind.name, "ros2msg", kind.definition().as_bytes())?;
            let id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
            self.channels.insert(topic, Channel { id, sequence: 0 });
        }
        let channel = self.channels.get_mut(topic).expect("just made");
        let time = nanoseconds(time_s);
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: time,
            publish_time: time,
        };
        channel.sequence += 1;
        Ok(self.writer.write_to_known_channel(&header, payload)?)
    }

    fn finish(mut self) -> Result<Vec<u8>, RecordError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}

/// The chance to reach the goal from the beginning of each leg of `plan`.
fn odds(plan: &Plan) -> BTreeMap<LegId, f64> {
    let odds = plan.solution.odds();
    let legs = plan.solution.steps.iter().enumerate();
    legs.map(|(leg, step)| (step.option.id, odds.rest((leg, 0.0)).0)).collect()
}

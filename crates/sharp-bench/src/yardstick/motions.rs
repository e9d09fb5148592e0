//! What each action may do to a robot in free space, by its speed and turn: motions in the robot's own frame.

use std::f64::consts::TAU;

use sharp_drive::{Command, Episode, EpisodeRules, World};
use sharp_sim::{Drive, EpisodeBias, NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{OccupancyGrid, Pose, Seed, Vector, trig};

/// Shares of the top speed that a robot may have.
const SPEEDS: [f64; 3] = [0.1, 0.55, 1.0];
/// Shares of the largest yaw rate (a robot with fixed wheels) or steering angle (a car) that it may have.
const TURNS: [f64; 3] = [-0.6, 0.0, 0.6];
/// Commanded speeds, shares of the top speed.
const COMMANDED: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// Commanded bearings, radians.
const BEARINGS: [f64; 11] = [-1.6, -1.0, -0.6, -0.35, -0.15, 0.0, 0.15, 0.35, 0.6, 1.0, 1.6];
/// Poses noted on the way of an action, its end included.
pub(super) const VIA: usize = 5;
/// Side of the free space, metres.
const FREE_M: f64 = 10.0;

/// How fast a robot moves and turns: between which of the tabulated motions it is, and how near to the upper ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gait {
    speed: (usize, f32),
    turn: (usize, f32),
}

/// Tabulated motions.
pub(super) const GAITS: usize = SPEEDS.len() * TURNS.len();

/// What one action did in one draw of its noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActionMotion {
    /// Poses on the way in the frame of the first one, evenly spaced in time; the last one is the end.
    pub(super) via: [[f32; 3]; VIA],
    /// How it moves at the end.
    pub(super) gait: Gait,
}

/// The scale of a robot's gaits.
#[derive(Clone, Copy, Debug)]
pub(super) struct GaitScale {
    speed_mps: f64,
    /// Yaw rate, rad/s, or steering angle, rad.
    turn: f64,
    is_car: bool,
}

impl GaitScale {
    pub(super) fn of(robot: &RobotModel) -> Self {
        let (turn, is_car) = match robot.drive {
            Drive::Differential { .. } => (robot.max_yaw_rate_radps, false),
            Drive::Ackermann { max_steer_rad, .. } => (max_steer_rad, true),
        };
        Self { speed_mps: robot.max_speed_mps, turn, is_car }
    }

    /// The gait of a robot in `state`.
    pub(super) fn gait(&self, state: &RobotState) -> Gait {
        let turn = if self.is_car { state.steer_rad } else { state.yaw_rate_radps };
        Gait {
            speed: between(&SPEEDS, state.wheel_speed_mps / self.speed_mps),
            turn: between(&TURNS, turn / self.turn),
        }
    }

    /// A robot at the origin of `frame` with the tabulated gait number `index`.
    fn state(&self, robot: &RobotModel, pose: Pose, index: usize) -> RobotState {
        let speed = SPEEDS[index / TURNS.len()] * self.speed_mps;
        let turn = TURNS[index % TURNS.len()] * self.turn;
        let mut state = RobotState::rolling(pose, speed);
        match robot.drive {
            Drive::Differential { .. } => {
                state.yaw_rate_radps = turn;
                state.wheel_yaw_rate_radps = turn / robot.yaw_gain();
            }
            Drive::Ackermann { wheelbase_m, .. } => {
                let tan = trig::tan(turn);
                state.steer_rad = turn;
                state.yaw_rate_radps = speed * tan / wheelbase_m;
                state.velocity = Vector::new(speed, 0.5 * speed * tan);
            }
        }
        state
    }
}

impl Gait {
    /// The tabulated gaits around it with their weights, which add up to 1.
    pub(super) fn corners(self) -> [(usize, f32); 4] {
        let Self { speed: (i, a), turn: (j, b) } = self;
        let at = |i: usize, j: usize| i * TURNS.len() + j;
        [
            (at(i, j), (1.0 - a) * (1.0 - b)),
            (at(i, j + 1), (1.0 - a) * b),
            (at(i + 1, j), a * (1.0 - b)),
            (at(i + 1, j + 1), a * b),
        ]
    }
}

/// The number of the interval of `values` that holds `value`, and how far up in it: 0 to 1.
fn between(values: &[f64], value: f64) -> (usize, f32) {
    let last = values.len() - 2;
    let index = (0..last).find(|&i| value < values[i + 1]).unwrap_or(last);
    let share = (value - values[index]) / (values[index + 1] - values[index]);
    (index, share.clamp(0.0, 1.0) as f32)
}

/// The actions that are compared: speeds by bearings.
#[derive(Clone, Debug)]
pub(super) struct ActionSet {
    commands: Vec<Command>,
}

impl ActionSet {
    pub(super) fn of(robot: &RobotModel) -> Self {
        let command = |speed: f64, bearing_rad| Command {
            reach_m: robot.waypoint_reach_m,
            bearing_rad,
            speed_mps: (speed * robot.max_speed_mps).max(robot.min_speed_mps),
        };
        let commands =
            COMMANDED.iter().flat_map(|&speed| BEARINGS.iter().map(move |&bearing| command(speed, bearing)));
        Self { commands: commands.collect() }
    }

    pub(super) fn commands(&self) -> &[Command] {
        &self.commands
    }

    /// The actions next to number `index` in speed and in bearing, itself included.
    pub(super) fn near(index: usize) -> impl Iterator<Item = usize> {
        let (speed, bearing) = (index / BEARINGS.len(), index % BEARINGS.len());
        let speeds = speed.saturating_sub(1)..=(speed + 1).min(COMMANDED.len() - 1);
        speeds.flat_map(move |speed| {
            let bearings = bearing.saturating_sub(1)..=(bearing + 1).min(BEARINGS.len() - 1);
            bearings.map(move |bearing| speed * BEARINGS.len() + bearing)
        })
    }
}

/// Motions of every action from every tabulated gait, in several draws of the noise.
#[derive(Clone, Debug)]
pub(super) struct MotionTable {
    motions: Vec<ActionMotion>,
    actions: usize,
    draws: usize,
    /// No action leads farther, metres.
    pub(super) reach_m: f64,
}

impl MotionTable {
    /// Motions of `robot` with this slip and pull under `noise`; each action of each gait has `draws` of its own.
    pub(super) fn new(
        robot: &RobotModel,
        noise: &NoiseModel,
        bias: EpisodeBias,
        draws: usize,
        seed: Seed,
    ) -> Self {
        let (actions, scale) = (ActionSet::of(robot), GaitScale::of(robot));
        let world = free_space(robot);
        let origin = Pose::new(0.5 * FREE_M, 0.5 * FREE_M, 0.0);
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let mut episode = Episode::new(world.vehicle(&*simulator, noise, true), EpisodeRules::default());
        let mut motions = Vec::with_capacity(GAITS * actions.commands.len() * draws);
        for index in 0..GAITS {
            let state = scale.state(robot, origin, index);
            for &command in &actions.commands {
                for _ in 0..draws {
                    // The number of the motion is the number of its noise.
                    episode.begin_with_bias(state, (seed, motions.len() as u64), bias);
                    let after = episode.act(command).after;
                    motions.push(ActionMotion { via: arc(&origin, &after.pose), gait: scale.gait(&after) });
                }
            }
        }
        let far = |motion: &ActionMotion| motion.via.iter().map(|[x, y, _]| x.hypot(*y)).fold(0.0, f32::max);
        let reach_m = f64::from(motions.iter().map(far).fold(0.0, f32::max));
        Self { motions, actions: actions.commands.len(), draws, reach_m }
    }

    /// The draws of action number `action` from the tabulated gait number `gait`.
    pub(super) fn draws(&self, gait: usize, action: usize) -> &[ActionMotion] {
        &self.motions[(gait * self.actions + action) * self.draws..][..self.draws]
    }
}

/// Poses on the circle from `from` to `to`, in the frame of `from`: nearly how a robot drives an action.
fn arc(from: &Pose, to: &Pose) -> [[f32; 3]; VIA] {
    let chord = from.to_local(to.position);
    let (turn, way, direction) =
        (from.heading.turn_to(to.heading), chord.norm(), trig::atan2(chord.y, chord.x));
    std::array::from_fn(|i| {
        let share = (i + 1) as f64 / VIA as f64;
        let way = if turn.abs() < 1e-6 {
            share * way
        } else {
            way * trig::sin_cos(0.5 * share * turn).0 / trig::sin_cos(0.5 * turn).0
        };
        let (sin, cos) = trig::sin_cos(direction - 0.5 * (1.0 - share) * turn);
        [(way * cos) as f32, (way * sin) as f32, (share * turn) as f32]
    })
}

/// A map without obstacles.
fn free_space(robot: &RobotModel) -> World {
    const CELLS: usize = 20;
    let rows = [".".repeat(CELLS).as_str(); CELLS].join("\n");
    let grid = OccupancyGrid::from_ascii(FREE_M / CELLS as f64, &rows).expect("equal rows of free cells");
    World::new(grid, robot.clone())
}

/// `angle` as a number of intervals of a circle that is cut into `count`.
pub(super) fn intervals(angle: f64, count: usize) -> f64 {
    let turns = angle / TAU;
    (turns - turns.floor()) * count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaits_are_interpolated() {
        let robot = RobotModel::limo();
        let scale = GaitScale::of(&robot);
        for index in 0..GAITS {
            let state = scale.state(&robot, Pose::new(0.0, 0.0, 0.0), index);
            let weight: f32 = scale
                .gait(&state)
                .corners()
                .iter()
                .filter(|corner| corner.0 == index)
                .map(|corner| corner.1)
                .sum();
            assert!((weight - 1.0).abs() < 1e-5, "gait {index} is itself: {weight}");
        }
        let between = scale.gait(&RobotState::rolling(Pose::new(0.0, 0.0, 0.0), 0.8)).corners();
        assert!((between.iter().map(|corner| corner.1).sum::<f32>() - 1.0).abs() < 1e-6, "{between:?}");
        assert!(between.iter().all(|corner| corner.0 < GAITS), "{between:?}");
    }

    #[test]
    fn a_quarter_of_a_circle_is_a_circle() {
        let via = arc(&Pose::new(1.0, 2.0, 0.0), &Pose::new(2.0, 3.0, 0.5 * std::f64::consts::PI));
        for (i, [x, y, turn]) in via.into_iter().enumerate() {
            let expected = (i + 1) as f32 / VIA as f32 * 0.5 * std::f32::consts::PI;
            let off = (x - expected.sin()).hypot(y - (1.0 - expected.cos()));
            assert!(off < 1e-5 && (turn - expected).abs() < 1e-5, "{i}: {x} {y} {turn}");
        }
    }

    #[test]
    fn without_noise_an_action_ahead_leads_ahead() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let bias = EpisodeBias::default();
            let table = MotionTable::new(&robot, &NoiseModel::none(), bias, 1, Seed(1));
            let ahead = BEARINGS.len() * (COMMANDED.len() - 1) + BEARINGS.len() / 2;
            let fastest = (SPEEDS.len() - 1) * TURNS.len() + 1;
            let [x, y, turn] = table.draws(fastest, ahead)[0].via[VIA - 1];
            assert!((x - 0.5).abs() < 0.02 && y.abs() < 1e-3 && turn.abs() < 1e-3, "{x} {y} {turn}");
            assert!((0.4..0.7).contains(&table.reach_m), "{}", table.reach_m);
            let slipping = EpisodeBias { speed_slip: 0.3, ..bias };
            let table = MotionTable::new(&robot, &NoiseModel::none(), slipping, 1, Seed(1));
            assert!(table.draws(fastest, ahead)[0].via[VIA - 1][0] < 0.45, "a robot that slips covers less");
        }
    }
}

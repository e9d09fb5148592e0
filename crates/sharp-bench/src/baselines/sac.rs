//! One flat soft actor-critic policy from start to goal: the learning baseline of Sec. 5.
//!
//! It sees the configuration and the vector to the goal and chooses the displacement to the next
//! point. The goal is worth 1000, a step costs 1. While it learns a wall blocks it and the episode
//! goes on: were contact the end, an early end would be the cheapest way to fail.

use rand::RngExt;
use sharp_drive::{Command, Controller, Decision, Episode, EpisodeRules, Motion, Readiness, World};
use sharp_plan::{Conditions, Query};
use sharp_rl::{
    Actor, ActorScratch, Environment, EnvironmentSpec, Observer, Step, StopRule, TrainError, TrainSettings,
    train,
};
use sharp_sim::{ActionSettings, RobotModel, RobotState};
use sharp_space::{Pose, Seed, Stream, Vector};

use crate::contender::Contender;

/// Configuration (3) and vector to the goal (2).
const OBSERVATION_LEN: usize = 5;
/// Reward at the goal.
const GOAL_REWARD: f32 = 1000.0;
/// Reward of every step that does not reach it.
const STEP_REWARD: f32 = -1.0;

/// How long a flat policy may learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SacBudget {
    /// Environment steps.
    pub max_env_steps: u64,
    /// How long one crossing may take, simulated seconds; also the time limit of executions.
    pub horizon_s: f64,
}

/// The baseline `sac`.
#[derive(Clone, Debug)]
pub struct FlatSac<'a> {
    world: &'a World,
    query: Query,
    budget: SacBudget,
    actor: Actor,
    env_steps: u64,
    updates: u64,
}

impl<'a> FlatSac<'a> {
    /// Learns until 20 episodes return 500 on average, the budget is used up, or `observer` breaks off;
    /// then the best policy so far is kept.
    ///
    /// # Errors
    /// If anything in the task stops being finite.
    pub fn learn(
        world: &'a World,
        query: Query,
        (conditions, seed): (&Conditions, Seed),
        budget: SacBudget,
        observer: &mut Observer<'_>,
    ) -> Result<Self, TrainError> {
        let mut task = [FlatTask::new(world, query, (conditions, seed), budget.horizon_s)];
        let settings = TrainSettings::default().with(|train| {
            train.max_env_steps = budget.max_env_steps;
            train.stop = StopRule::MeanReturn(500.0);
        });
        let trained = train(&mut task, &settings, &mut seed.stream("sac", 0), observer)?;
        let (env_steps, updates) = (trained.env_steps, trained.updates);
        Ok(Self { world, query, budget, actor: trained.actor, env_steps, updates })
    }

    /// Environment steps that learning took.
    #[must_use]
    pub const fn env_steps(&self) -> u64 {
        self.env_steps
    }

    /// Gradient steps that learning took.
    #[must_use]
    pub const fn gradient_steps(&self) -> u64 {
        self.updates
    }
}

impl Contender for FlatSac<'_> {
    fn controller(&self, start: RobotState, _episode: u64) -> Box<dyn Controller + '_> {
        let scratch = ActorScratch::default();
        Box::new(SacController {
            baseline: self,
            pose: start.pose,
            begun: false,
            must_back_off: false,
            scratch,
        })
    }
}

#[derive(Debug)]
struct SacController<'a> {
    baseline: &'a FlatSac<'a>,
    pose: Pose,
    begun: bool,
    must_back_off: bool,
    scratch: ActorScratch,
}

impl Controller for SacController<'_> {
    fn prepare(&mut self) -> Readiness {
        if std::mem::replace(&mut self.begun, true) {
            return Readiness::Ready;
        }
        // A third, for the limit is three times as much.
        Readiness::Planned { nominal_time_s: self.baseline.budget.horizon_s / 3.0 }
    }

    fn decide(&mut self) -> Decision {
        let FlatSac { world, query, actor, .. } = self.baseline;
        if std::mem::take(&mut self.must_back_off) {
            return Decision::BackOff { distance_m: world.robot.recovery_reverse_m };
        }
        if is_at_goal(&world.robot, query, &self.pose) {
            return Decision::Reached;
        }
        let (mut observation, mut action) = ([0.0; OBSERVATION_LEN], [0.0; 2]);
        observe(query, &self.pose, &mut observation);
        actor.act_mean(&observation, &mut self.scratch, &mut action);
        Decision::Drive(command(&world.robot, &self.pose, action))
    }

    fn observe(&mut self, motion: &Motion) {
        self.pose = motion.after.pose;
        self.must_back_off = motion.contact && motion.command.is_some();
    }
}

fn is_at_goal(robot: &RobotModel, query: &Query, pose: &Pose) -> bool {
    (pose.position - query.goal.position).norm() < robot.goal_tolerance_m
}

/// Writes configuration and vector to the goal, raw as in the paper.
fn observe(query: &Query, pose: &Pose, observation: &mut [f32]) {
    let to_goal = query.goal.position - pose.position;
    let values = [pose.position.x, pose.position.y, pose.heading.radians(), to_goal.x, to_goal.y];
    for (entry, value) in observation.iter_mut().zip(values) {
        *entry = value as f32;
    }
}

/// The point that an action in [−1, 1]² stands for: a displacement in the world frame.
fn command(robot: &RobotModel, pose: &Pose, action: [f32; 2]) -> Command {
    let displacement = Vector::new(f64::from(action[0]), f64::from(action[1])) * robot.waypoint_reach_m;
    let seen = Command::of(pose, pose.position + displacement, robot.max_speed_mps);
    Command { reach_m: seen.reach_m.min(robot.waypoint_reach_m), ..seen }
}

/// The whole problem as one Markov decision process.
#[derive(Clone, Debug)]
struct FlatTask {
    query: Query,
    episode: Episode,
    seed: Seed,
    horizon_actions: u32,
    actions: u32,
}

impl FlatTask {
    fn new(world: &World, query: Query, (conditions, seed): (&Conditions, Seed), horizon_s: f64) -> Self {
        let vehicle = world.vehicle(&*conditions.simulator, &conditions.noise, false);
        let episode = Episode::new(vehicle, EpisodeRules::default().with_contact_ends(false));
        let horizon_actions = (horizon_s / ActionSettings::default().action_s).ceil() as u32;
        Self { query, episode, seed, horizon_actions, actions: 0 }
    }
}

impl Environment for FlatTask {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: OBSERVATION_LEN, action_len: 2 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        self.episode.begin(RobotState::at_rest(self.query.start), self.seed, rng.random());
        self.actions = 0;
        observe(&self.query, &self.query.start, observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let pose = self.episode.state().pose;
        let command = command(self.episode.vehicle().robot(), &pose, [action[0], action[1]]);
        let after = self.episode.act(command).after.pose;
        self.actions += 1;
        observe(&self.query, &after, observation);
        let success = is_at_goal(self.episode.vehicle().robot(), &self.query, &after);
        Step {
            reward: if success { GOAL_REWARD } else { STEP_REWARD },
            terminated: success,
            truncated: !success && self.actions >= self.horizon_actions,
            success,
        }
    }
}

//! Learning the policy of one leg (Algorithm 1, lines 11, 16 and 19).

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_guide::{Place, PseudoReward, ShapedReward, StepEvents};
use sharp_rl::{Exploration, Progress, SacState, StopRule, TrainError, TrainSettings, fine_tune, train};
use sharp_sim::{ActionSettings, KinematicSim, NoiseModel, Vehicle};
use sharp_space::{Pose, Seed};

use crate::certify::{Certificate, FAILURE_COST_S, Trial};
use crate::leg::Leg;
use crate::pace::PacedFollower;
use crate::percept::{Expectation, Tracker, Workspace};
use crate::policy::{Follower, Form, OptionPolicy};
use crate::prior::{self, Prior};
use crate::rollout::Driver;
use crate::starts::Starts;
use crate::stats::Tally;
use crate::task::LegTask;

/// Rounds in which candidates are compared: the share of [`LearnSettings::screening_episodes`] that each
/// drives, and how many go on. Those that the last round leaves are compared in full.
const ROUNDS: [(f64, usize); 3] = [(0.1, 10), (0.3, 5), (1.0, 3)];
/// Reward of a contact while a prior is trained on: what it was trained with at full caution.
const FINE_CONTACT: f64 = -20.0;

/// How policies are learnt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LearningMode {
    /// In the guide's frame: certified followers first, a learnt correction where none holds.
    Fast,
    /// The prior at its middle caution, as it is: nothing to choose from and no training, to compare with.
    Prior,
    /// The paper's protocol.
    Paper,
}

/// Budgets and levels of learning.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnSettings {
    /// The mode.
    pub mode: LearningMode,
    /// Success wanted of an option, share of episodes.
    pub wanted_success: f64,
    /// Where a plan falls short, the prior is trained on a leg on which nothing else holds as often as this;
    /// 0 for never.
    pub train_below: f64,
    /// What a failure counts for beside the seconds of a success, seconds: the more, the safer and slower.
    pub failure_cost_s: f64,
    /// Episodes in which candidates are compared.
    pub screening_episodes: u32,
    /// Fresh episodes that certify the chosen one.
    pub certify_episodes: u32,
    /// Environments that learn side by side.
    pub environments: u64,
    /// Soft actor-critic, its budget and its stop rule.
    pub train: TrainSettings,
}

impl LearnSettings {
    /// The settings of `mode`.
    #[must_use]
    pub fn new(mode: LearningMode) -> Self {
        match mode {
            LearningMode::Fast | LearningMode::Prior => Self {
                mode,
                wanted_success: 0.99,
                train_below: if mode == LearningMode::Prior { 0.0 } else { 0.97 },
                failure_cost_s: FAILURE_COST_S,
                screening_episodes: 200,
                certify_episodes: 1000,
                environments: 16,
                // Few steps: the prior drives already, and what it has not learnt then it hardly will.
                train: TrainSettings::fast().with(|train| {
                    train.sac = prior::train_settings().sac.with(|sac| {
                        sac.learning_rate = 3e-4;
                        sac.updates_per_step = 0.25;
                        sac.warmup_steps = 1_000;
                        sac.exploration = Exploration::Policy;
                        sac.zero_last_actor_layer = false;
                    });
                    train.max_env_steps = 12_000;
                    train.evaluate_every = 2_000;
                    train.stop = StopRule::Success { rate: 0.995, episodes: 400 };
                }),
            },
            // Section 5: at most 150 k steps, 20 evaluation episodes each 10 k, one environment.
            LearningMode::Paper => Self {
                mode,
                wanted_success: 0.99,
                train_below: 1.0,
                failure_cost_s: FAILURE_COST_S,
                screening_episodes: 20,
                certify_episodes: 1000,
                environments: 1,
                train: TrainSettings::default(),
            },
        }
    }
}

/// A policy and what was measured of it.
#[derive(Clone, Debug)]
pub struct Learnt {
    /// The policy.
    pub policy: OptionPolicy,
    /// Fresh episodes that certify it.
    pub verified: Tally,
    /// Mean simulated time of a successful episode, seconds.
    pub mean_time_s: f64,
    /// Environment steps that learning took.
    pub env_steps: u64,
    /// Gradient steps that learning took.
    pub gradient_steps: u64,
}

impl Learnt {
    /// The cost that A* uses: seconds per success, and `failure_cost_s` seconds for each failure.
    ///
    /// The paper takes the mean number of steps and knows no failure.
    #[must_use]
    pub fn cost_s(&self, failure_cost_s: f64) -> f64 {
        Certificate { tally: self.verified, mean_time_s: self.mean_time_s }.cost_s(failure_cost_s)
    }
}

/// Why a leg has no policy.
#[derive(Debug)]
pub enum LearnFailure {
    /// The caller asked to stop.
    Stopped,
    /// Something was wrong with the task: a NaN, an impossible observation.
    Broken(TrainError),
}

/// Watches a lesson and may stop it; a closure that says whether to stop watches nothing else.
pub trait LessonMonitor: Sync {
    /// Asked now and then; true gives the lesson up.
    fn should_stop(&self) -> bool;
    /// A training took a step.
    fn trained(&self, _progress: &Progress<'_>) {}
}

impl<F: Fn() -> bool + Sync> LessonMonitor for F {
    fn should_stop(&self) -> bool {
        self()
    }
}

/// Which pseudo-reward teaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RewardMode {
    /// Definition 9; contact blocks the robot and the episode goes on.
    Paper(PseudoReward),
    /// Progress along the guide; contact ends the episode.
    Shaped(ShapedReward),
}

impl RewardMode {
    /// Returns true if an episode ends when the robot touches a wall.
    #[must_use]
    pub const fn contact_ends(&self) -> bool {
        matches!(self, Self::Shaped(_))
    }

    /// The reward of an action that moved the robot to `pose` and its projection from `trackers.0`
    /// to `trackers.1`.
    #[must_use]
    pub fn of(
        &self,
        leg: &Leg,
        pose: &Pose,
        trackers: (&Tracker, &Tracker),
        contact: bool,
        success: bool,
    ) -> f64 {
        let stray = !leg.is_allowed(pose);
        match self {
            Self::Paper(reward) => {
                let place = match (success, stray) {
                    (true, _) => Place::Termination,
                    (false, true) => Place::Astray,
                    (false, false) => Place::Allowed,
                };
                reward.value(&leg.guide, pose, place)
            }
            Self::Shaped(reward) => {
                let (before, after) = trackers;
                let deviation_m = after.cross_track_m.abs() - before.cross_track_m.abs();
                reward.value(after.arc_m - before.arc_m, deviation_m, StepEvents { success, contact, stray })
            }
        }
    }
}

/// A vehicle in the kinematic simulator; its actions end at contact if `stop_at_contact`.
pub(crate) fn kinematic_vehicle(
    workspace: &Workspace,
    noise: &NoiseModel,
    stop_at_contact: bool,
) -> Vehicle<KinematicSim> {
    let settings = ActionSettings { stop_at_contact, ..ActionSettings::default() };
    let sim = KinematicSim::new(Arc::clone(&workspace.world), &workspace.robot);
    Vehicle::new(sim, Arc::clone(&workspace.robot), noise.clone(), settings)
}

/// One leg to be learnt.
#[derive(Clone, Debug)]
pub struct Lesson<'a> {
    /// Map and robot.
    pub workspace: &'a Workspace,
    /// The leg.
    pub leg: &'a Arc<Leg>,
    /// The leg after it, where one is known: followers look ahead into its guide.
    pub next: Option<&'a Arc<Leg>>,
    /// The legs after it with their policies, where they are known: a policy that arrives badly is a
    /// bad one. The first of them is `next`.
    pub tail: &'a [Driver<'a>],
    /// Where its episodes begin.
    pub starts: Arc<Starts>,
    /// The noise of the simulator.
    pub noise: &'a NoiseModel,
    /// Budgets and levels.
    pub settings: &'a LearnSettings,
    /// The root of the lesson's random streams.
    pub seed: Seed,
}

impl Lesson<'_> {
    /// Learns a policy; `monitor` may give it up.
    ///
    /// # Errors
    /// Says whether it was stopped or what broke. A policy that merely falls short is returned with
    /// its certificate: the planner decides what it is worth.
    pub fn learn(&self, monitor: &dyn LessonMonitor) -> Result<Learnt, LearnFailure> {
        match self.settings.mode {
            LearningMode::Fast => {
                self.learn_fast(monitor, None).map(|learnt| learnt.expect("there are candidates"))
            }
            LearningMode::Prior => Ok(self.take_prior()),
            LearningMode::Paper => self.learn_paper(monitor),
        }
    }

    fn trial(&self, episodes: u32, purpose: &str, index: u64) -> Trial<'_> {
        Trial {
            workspace: self.workspace,
            noise: self.noise,
            episodes,
            seed: self.seed.child(purpose, index),
        }
    }

    /// The leg under `policy`, and what comes after it.
    fn drivers<'b>(&'b self, policy: &'b OptionPolicy) -> Vec<Driver<'b>> {
        let first = Driver::new(self.leg, policy, self.next.map(AsRef::as_ref));
        std::iter::once(first).chain(self.tail.iter().copied()).collect()
    }

    /// What `policy` holds on the lesson's fresh episodes.
    #[must_use]
    pub fn certify(&self, policy: &OptionPolicy) -> Certificate {
        let trial = self.trial(self.settings.certify_episodes, "certify", 0);
        trial.of_leg(&self.drivers(policy)[0], &self.starts)
    }

    /// What `policy` is worth to the plan: what it and the legs after it hold, on fresh episodes.
    #[must_use]
    pub fn judge(&self, policy: &OptionPolicy) -> Certificate {
        self.judge_while(policy, u32::MAX)
    }

    /// The same, but gives up soon after more than `failures_max` failures.
    fn judge_while(&self, policy: &OptionPolicy, failures_max: u32) -> Certificate {
        let trial = self.trial(self.settings.certify_episodes, "certify", 0);
        trial.of_legs_while(&self.drivers(policy), &self.starts, failures_max)
    }

    /// `policy` with its certificate: what was judged, unless others had a part in that.
    fn learnt(&self, policy: OptionPolicy, judged: Certificate, effort: (u64, u64)) -> Learnt {
        let certificate = if self.tail.is_empty() { judged } else { self.certify(&policy) };
        learnt(policy, certificate, effort)
    }

    /// The cheapest policy at hand that holds as wanted; where none does, the one that holds most often.
    ///
    /// With `beaten`, as [`judge`](Self::judge) counts, only what holds more often is of use, and the prior
    /// is trained on this leg where nothing at hand holds often enough.
    pub(crate) fn learn_fast(
        &self,
        monitor: &dyn LessonMonitor,
        beaten: Option<Tally>,
    ) -> Result<Option<Learnt>, LearnFailure> {
        let episodes = self.settings.certify_episodes;
        let allowed = (f64::from(episodes) * (1.0 - self.settings.wanted_success)).floor() as u32;
        let mut most = beaten;
        let mut best: Option<(Certificate, OptionPolicy)> = None;
        for policy in self.screen() {
            if monitor.should_stop() {
                return Err(LearnFailure::Stopped);
            }
            let useful = most.map_or(episodes, |most| most.failures().saturating_sub(1));
            let judged = self.judge_while(&policy, useful.max(allowed));
            if judged.tally.episodes < episodes {
                continue;
            }
            let holds = judged.tally.failures() <= allowed;
            if holds || most.is_none_or(|most| judged.tally.successes > most.successes) {
                most = Some(judged.tally);
                best = Some((judged, policy));
            }
            if holds {
                break;
            }
        }
        // What a first choice lacks, the plan may not need: training takes longer than all the rest.
        let weak = most.filter(|most| beaten.is_some() && most.rate() < self.settings.train_below);
        let mut effort = (0, 0);
        if let Some(most) = weak {
            let trained = self.train_on(monitor)?;
            let alone = Certificate { tally: trained.verified, mean_time_s: trained.mean_time_s };
            let judged = if self.tail.is_empty() { alone } else { self.judge(&trained.policy) };
            if judged.tally.successes > most.successes {
                return Ok(Some(trained));
            }
            effort = (trained.env_steps, trained.gradient_steps);
        }
        Ok(best.map(|(judged, policy)| self.learnt(policy, judged, effort)))
    }

    /// The prior as it was trained on other maps.
    fn take_prior(&self) -> Learnt {
        let robot = &self.workspace.robot;
        let policy = Prior::shipped(robot).policy(robot, self.noise);
        let judged = self.judge(&policy);
        self.learnt(policy, judged, (0, 0))
    }

    /// What drives without learning: the few that cost least.
    fn screen(&self) -> Vec<OptionPolicy> {
        screen(self.workspace, self.noise, self.settings.screening_episodes, |policy, episodes, round| {
            let trial = self.trial(episodes, "screen", round);
            trial.of_legs(&self.drivers(policy), &self.starts).cost_s(self.settings.failure_cost_s)
        })
    }

    /// The prior, trained further on this leg alone.
    fn train_on(&self, monitor: &dyn LessonMonitor) -> Result<Learnt, LearnFailure> {
        let robot = &self.workspace.robot;
        let form = prior::form(robot, Expectation::new(self.noise, 1.0));
        let reward = ShapedReward { contact: FINE_CONTACT, ..ShapedReward::default() };
        let networks = Prior::shipped(robot).networks();
        self.learn_sac(form, RewardMode::Shaped(reward), Some(networks), monitor)
    }

    fn learn_paper(&self, monitor: &dyn LessonMonitor) -> Result<Learnt, LearnFailure> {
        let form = Form::Absolute { reach_m: self.workspace.robot.waypoint_reach_m };
        self.learn_sac(form, RewardMode::Paper(PseudoReward::default()), None, monitor)
    }

    fn learn_sac(
        &self,
        form: Form,
        reward: RewardMode,
        networks: Option<&SacState>,
        monitor: &dyn LessonMonitor,
    ) -> Result<Learnt, LearnFailure> {
        let task = |index| {
            let starts = Arc::clone(&self.starts);
            let noise = (self.noise, self.seed.child("environment", index));
            let legs = (Arc::clone(self.leg), self.next.cloned());
            LegTask::new(self.workspace, legs, form, reward, starts, noise)
        };
        let mut tasks: Vec<LegTask> = (0..self.settings.environments).map(task).collect();
        let mut observer = |progress: &Progress<'_>| {
            monitor.trained(progress);
            if monitor.should_stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let mut rng = self.seed.stream("sac", 0);
        let settings = &self.settings.train;
        let trained = match networks {
            Some(networks) => fine_tune(&mut tasks, networks, settings, &mut rng, &mut observer),
            None => train(&mut tasks, settings, &mut rng, &mut observer),
        };
        let trained = trained.map_err(LearnFailure::Broken)?;
        if monitor.should_stop() {
            return Err(LearnFailure::Stopped);
        }
        let policy = OptionPolicy::Learnt { form, actor: Box::new(trained.actor) };
        let certificate = self.certify(&policy);
        Ok(learnt(policy, certificate, (trained.env_steps, trained.updates)))
    }
}

fn learnt(policy: OptionPolicy, certificate: Certificate, (env_steps, gradient_steps): (u64, u64)) -> Learnt {
    let Certificate { tally, mean_time_s } = certificate;
    Learnt { policy, verified: tally, mean_time_s, env_steps, gradient_steps }
}

/// All policies that drive without learning on the map, and of them the few that cost least: each round
/// compares fewer on more episodes. `cost_s` drives a policy for so many episodes of one round.
pub(crate) fn screen(
    workspace: &Workspace,
    noise: &NoiseModel,
    episodes: u32,
    cost_s: impl Fn(&OptionPolicy, u32, u64) -> f64 + Sync,
) -> Vec<OptionPolicy> {
    let robot = &workspace.robot;
    let mut left: Vec<OptionPolicy> =
        Follower::candidates(robot).into_iter().map(OptionPolicy::Follower).collect();
    left.extend(PacedFollower::candidates(robot).into_iter().map(OptionPolicy::Paced));
    left.extend(Prior::shipped(robot).candidates(robot, noise));
    for (round, (share, keep)) in (0..).zip(ROUNDS) {
        let episodes = (share * f64::from(episodes)).ceil() as u32;
        let mut costs: Vec<(f64, OptionPolicy)> =
            left.into_par_iter().map(|policy| (cost_s(&policy, episodes, round), policy)).collect();
        costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        left = costs.into_iter().take(keep).map(|(_, policy)| policy).collect();
    }
    left
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, along, followed, legs, world};

    #[test]
    fn a_leg_that_fails_costs_its_recoveries() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let with =
            |successes| Learnt { verified: Tally { episodes: 100, successes }, ..followed(&workspace) };
        assert_eq!(with(100).cost_s(1000.0), 5.0, "its mean time");
        assert_eq!(with(50).cost_s(1000.0), 510.0, "twice the time and half of what a failure costs");
        assert_eq!(with(50).cost_s(0.0), 10.0, "twice the time");
        assert!(with(0).cost_s(1000.0) > 2000.0, "dear beyond use");
    }

    #[test]
    fn rewards_know_their_three_places() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let paper = RewardMode::Paper(PseudoReward::default());
        let shaped = RewardMode::Shaped(ShapedReward::default());
        let reward = |mode: &RewardMode, from: &Pose, to: &Pose, success| {
            let (before, after) = (Tracker::start(&leg.guide, from), Tracker::start(&leg.guide, to));
            mode.of(leg, to, (&before, &after), false, success)
        };
        let (start, middle) = (leg.guide.start(), leg.guide.pose_at(0.5 * leg.guide.length_m()));
        let astray = Pose::new(9.0, 2.0, 0.0);
        assert_eq!(reward(&paper, &start, &leg.guide.end(), true), 1000.0, "r_t");
        assert_eq!(reward(&paper, &start, &astray, false), -100.0, "r_p");
        let (near, far) = (reward(&paper, &start, &middle, false), reward(&paper, &start, &start, false));
        assert!(far < near && near < 0.0, "nearer the end is better: {near} against {far}");
        let (ahead, back) =
            (reward(&shaped, &start, &middle, false), reward(&shaped, &middle, &start, false));
        assert!(ahead > 0.0 && back < 0.0, "progress pays {ahead}, going back {back}");
    }

    #[test]
    fn an_easy_leg_is_certified_without_a_network() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let starts = Arc::new(Starts::exactly(sharp_sim::RobotState::at_rest(leg.guide.start())));
        let settings = LearnSettings::new(LearningMode::Fast);
        let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
        let lesson = Lesson {
            workspace: &workspace,
            leg,
            next: None,
            tail: &[],
            starts,
            noise: &noise,
            settings: &settings,
            seed: Seed(1),
        };
        let learnt = lesson.learn(&|| false).expect("a sound task");
        assert!(matches!(learnt.policy, OptionPolicy::Follower(_)), "a network in an open hall");
        assert_eq!(learnt.verified.episodes, 1000, "certified on fresh episodes");
        assert!(learnt.verified.rate() >= 0.99, "only {:?}", learnt.verified);
        assert!(matches!(lesson.learn(&|| true), Err(LearnFailure::Stopped)), "a stop is heard");
    }
}

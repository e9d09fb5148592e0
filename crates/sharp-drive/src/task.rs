//! Guided options as learning tasks: where simulator, guide and reinforcement learning meet.
//!
//! [`OptionTask`] is one episode at a time, for soft actor-critic. [`DrivingBatch`] is many at once, for proximal
//! policy optimisation: there a contact or a used-up horizon is a failure of its own beside the reward, and the critic
//! is told what the robot cannot know. Both step the same [`RunningTask`].

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use rand::RngExt;
use rayon::prelude::*;
use sharp_guide::{Reward, StepEvents, Transition};
use sharp_rl::{BatchEnvironment, BatchSpec, BatchStep, Environment, EnvironmentSpec, SeenBatch, Step};
use sharp_sim::{EpisodeBias, NoiseModel, RobotState, Simulator};
use sharp_space::{Seed, Stream};

use crate::automaton::{Automaton, Link};
use crate::episode::{Episode, EpisodeRules, Motion};
use crate::initial_states::InitialStates;
use crate::network::PolicyInterface;
use crate::situation::{GuideProgress, Observation};
use crate::still::StandstillDetector;
use crate::world::World;

/// What one episode of learning consists of.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Map and robot.
    pub world: World,
    /// A simulator of the robot in the map.
    pub simulator: Box<dyn Simulator>,
    /// Its noise.
    pub noise: NoiseModel,
    /// The options to drive, one after the other; to finish the last one is the success.
    pub links: Arc<[Link]>,
    /// What the network sees and what its action means.
    pub interface: PolicyInterface,
    /// What it is paid.
    pub reward: Arc<dyn Reward>,
    /// Share of each option's horizon after which an episode ends; 1 is the rule of estimates.
    pub horizon_share: f64,
    /// Whether an episode in which the robot stands still is out of time at once ([`StandstillDetector`]). Otherwise a robot
    /// that is wedged in fills the rest of its horizon, and the learner's memory, with steps in which nothing moves.
    pub ends_at_standstill: bool,
    /// Where the robot begins.
    pub start: RobotState,
}

/// Draws the scenario of each episode.
pub trait ScenarioSource: Debug + Send + Sync {
    /// The next scenario; everything random comes from `rng`.
    fn draw(&self, rng: &mut Stream) -> Scenario;

    /// The length of what the network sees; the same for all scenarios.
    fn observation_len(&self) -> usize;
}

/// One option, again and again: what Algorithm 1 trains (line 16).
#[derive(Clone, Debug)]
pub struct SingleOption {
    /// Everything but where episodes begin, which is drawn from `states`.
    pub scenario: Scenario,
    /// Where episodes begin.
    pub states: Arc<InitialStates>,
}

impl ScenarioSource for SingleOption {
    fn draw(&self, rng: &mut Stream) -> Scenario {
        Scenario { start: self.states.draw(rng), ..self.scenario.clone() }
    }

    fn observation_len(&self) -> usize {
        self.scenario.interface.observation_len()
    }
}

/// Driving scenarios as a Markov decision process for [`sharp_rl`].
#[derive(Clone, Debug)]
pub struct OptionTask {
    source: Arc<dyn ScenarioSource>,
    seed: Seed,
    running: Option<RunningTask>,
}

impl OptionTask {
    /// The task of driving what `source` draws; episodes draw their noise from `seed`.
    #[must_use]
    pub fn new(source: Arc<dyn ScenarioSource>, seed: Seed) -> Self {
        Self { source, seed, running: None }
    }
}

impl Environment for OptionTask {
    fn spec(&self) -> EnvironmentSpec {
        let observation_len = self.source.observation_len();
        EnvironmentSpec { observation_len, action_len: PolicyInterface::ACTION_LEN }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        let scenario = self.source.draw(rng);
        // The caller's stream numbers the episode, so that a clone does not repeat its original.
        let running = RunningTask::begin(scenario, self.seed, rng.random());
        running.observe(observation);
        self.running = Some(running);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let running = self.running.as_mut().expect("reset comes before step");
        let outcome = running.step(action);
        running.observe(observation);
        let terminated = outcome.done || outcome.collided;
        Step { reward: outcome.reward as f32, terminated, truncated: outcome.late, success: outcome.success }
    }
}

/// Way and options left that count as one, for the critic.
const WAY_UNIT_M: f64 = 10.0;
const OPTIONS_UNIT: f64 = 4.0;
/// Slots that a thread takes at once.
const SLOTS_MIN: usize = 16;

/// Many episodes of driving side by side, for [`sharp_rl::train_ppo`].
#[derive(Clone, Debug)]
pub struct DrivingBatch {
    source: Arc<dyn ScenarioSource>,
    seed: Seed,
    slots: Vec<Option<RunningTask>>,
}

impl DrivingBatch {
    /// So many `slots`, each of which drives what `source` draws; episodes draw their noise from `seed`.
    #[must_use]
    pub fn new(source: Arc<dyn ScenarioSource>, slots: usize, seed: Seed) -> Self {
        Self { source, seed, slots: vec![None; slots] }
    }
}

impl BatchEnvironment for DrivingBatch {
    fn spec(&self) -> BatchSpec {
        let observation_len = self.source.observation_len();
        BatchSpec {
            slots: self.slots.len(),
            lengths: EnvironmentSpec { observation_len, action_len: PolicyInterface::ACTION_LEN },
            privileged_len: RunningTask::PRIVILEGED_LEN,
        }
    }

    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch) {
        let len = self.spec().lengths.observation_len;
        let scenario = self.source.draw(rng);
        let running = RunningTask::begin(scenario, self.seed, rng.random());
        running.observe(&mut seen.observations[slot * len..][..len]);
        let privileged = &mut seen.privileged[slot * RunningTask::PRIVILEGED_LEN..];
        running.reveal(&mut privileged[..RunningTask::PRIVILEGED_LEN]);
        self.slots[slot] = Some(running);
    }

    /// Slots do not depend on each other, so that any number of threads gives the same.
    fn step(&mut self, slots: Range<usize>, actions: &[f32], seen: &mut SeenBatch, steps: &mut [BatchStep]) {
        let len = self.spec().lengths.observation_len;
        let rows = |len: usize| slots.start * len..slots.end * len;
        let observations = seen.observations[rows(len)].par_chunks_mut(len);
        let privileged =
            seen.privileged[rows(RunningTask::PRIVILEGED_LEN)].par_chunks_mut(RunningTask::PRIVILEGED_LEN);
        let given = actions.par_chunks(PolicyInterface::ACTION_LEN).zip(self.slots[slots].par_iter_mut());
        given.zip(observations.zip(privileged)).zip(steps).with_min_len(SLOTS_MIN).for_each(
            |(((action, running), (observation, privileged)), step)| {
                let running = running.as_mut().expect("reset comes before step");
                *step = running.step(action).into_batch_step(&running.interface);
                running.observe(observation);
                running.reveal(privileged);
            },
        );
    }
}

/// What came of an action.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ActionOutcome {
    reward: f64,
    /// The last option is done.
    done: bool,
    /// The same, and no contact on the way spoils it.
    success: bool,
    collided: bool,
    /// The horizon is used up, or the robot stands still where that ends episodes, and nothing else ended this one.
    late: bool,
}

impl ActionOutcome {
    fn into_batch_step(self, interface: &PolicyInterface) -> BatchStep {
        let caution = match interface {
            PolicyInterface::Guide { context, .. } => context.caution,
            PolicyInterface::Absolute { .. } => 0.0,
        };
        let failed = self.collided || self.late || (self.done && !self.success);
        BatchStep {
            reward: self.reward as f32,
            failed,
            terminated: failed || self.done,
            truncated: false,
            success: self.success,
            caution,
        }
    }
}

/// An episode of learning under way.
#[derive(Clone, Debug)]
struct RunningTask {
    world: World,
    interface: PolicyInterface,
    reward: Arc<dyn Reward>,
    horizon_share: f64,
    episode: Episode,
    automaton: Automaton,
    /// `None` where standing still does not end episodes.
    standstill: Option<StandstillDetector>,
    /// The robot has touched an obstacle.
    has_touched: bool,
}

impl RunningTask {
    /// Numbers in [`Self::reveal`].
    const PRIVILEGED_LEN: usize = 6;

    fn begin(scenario: Scenario, seed: Seed, number: u64) -> Self {
        let Scenario { world, noise, links, interface, reward, horizon_share, start, .. } = scenario;
        let rules = EpisodeRules::default().with_contact_ends(reward.contact_ends());
        let mut episode =
            Episode::new(world.vehicle(&*scenario.simulator, &noise, rules.contact_ends), rules);
        episode.begin(start, seed, number);
        let automaton = Automaton::new(links, Observation::first(start, &noise).without_slip_estimate());
        let standstill = scenario.ends_at_standstill.then(|| StandstillDetector::new(start.pose));
        let has_touched = false;
        let mut task =
            Self { world, interface, reward, horizon_share, episode, automaton, standstill, has_touched };
        // The learner begins where its guide does.
        task.carry_out_maneuvers();
        let pose = task.episode.state().pose;
        task.standstill = task.standstill.map(|_| StandstillDetector::new(pose));
        task
    }

    /// Does what no policy does. Returns true if the robot touched an obstacle.
    fn carry_out_maneuvers(&mut self) -> bool {
        let mut touched = false;
        while let Some(decision) = self.automaton.maneuver(&self.world).filter(|_| !self.automaton.is_late())
        {
            let Ok(motion) = self.episode.carry_out(decision) else { break };
            touched |= motion.contact;
            self.automaton.observe(&self.world, &motion);
        }
        self.has_touched |= touched;
        touched
    }

    fn observe(&self, observation: &mut [f32]) {
        self.interface.observe(&self.automaton.situation(&self.world), observation);
    }

    /// What the robot cannot know: slip of speed and of turn, pull, way and options left, share of the horizon used.
    fn reveal(&self, privileged: &mut [f32]) {
        let EpisodeBias { speed_slip, yaw_slip, drift_radps } = self.episode.vehicle().bias();
        let (index, links) = (self.automaton.index(), self.automaton.links());
        let later_m: f64 = links[index + 1..].iter().map(|link| link.option.guide.length_m()).sum();
        let way_m = self.automaton.progress().remaining_m + later_m;
        let used = f64::from(self.automaton.actions()) / self.horizon_actions();
        let options_left = (links.len() - 1 - index) as f64;
        let values =
            [speed_slip, yaw_slip, drift_radps, way_m / WAY_UNIT_M, options_left / OPTIONS_UNIT, used];
        for (entry, value) in privileged.iter_mut().zip(values) {
            *entry = value as f32;
        }
    }

    /// Actions that the option that runs may take.
    fn horizon_actions(&self) -> f64 {
        self.horizon_share * f64::from(self.automaton.link().option.horizon_actions())
    }

    fn step(&mut self, action: &[f32]) -> ActionOutcome {
        let command = self.interface.command(&self.automaton.situation(&self.world), action);
        let command = self.world.held(&self.episode.state().pose, command);
        let motion = self.episode.act(command);
        let before = *self.automaton.progress();
        self.automaton.observe(&self.world, &motion);
        self.has_touched |= motion.contact;
        let mut collided = motion.contact && self.reward.contact_ends();
        // Turning at the goal is no policy's business, as it is not when the plan is driven.
        if !collided {
            collided = self.carry_out_maneuvers() && self.reward.contact_ends();
        }
        let done = !collided && self.automaton.is_done();
        let reward = self.reward(&motion, &before, done);
        let is_still = self.standstill.as_mut().is_some_and(|standstill| {
            standstill.observe(&motion.after.pose);
            standstill.stands_still()
        });
        let late = is_still || f64::from(self.automaton.actions()) >= self.horizon_actions();
        let late = late && !done && !collided;
        // From here on the next option of the chain runs, if there is one.
        let done = done && !self.automaton.advance();
        let success = done && !(self.has_touched && self.reward.contact_fails());
        ActionOutcome { reward, done, success, collided, late }
    }

    /// Pays for `motion`; `done` if the termination set was reached, however that came about.
    fn reward(&self, motion: &Motion, before: &GuideProgress, done: bool) -> f64 {
        let (option, after) = (&self.automaton.link().option, self.automaton.progress());
        let pose = &motion.after.pose;
        let stray = !option.is_allowed(pose);
        self.reward.reward(&Transition {
            option,
            pose,
            progress_m: after.arc_m - before.arc_m,
            deviation_m: after.cross_track_m.abs() - before.cross_track_m.abs(),
            events: StepEvents { success: done, contact: motion.contact, stray },
        })
    }
}

#[cfg(test)]
mod tests {
    use sharp_guide::{ProgressReward, PseudoReward};
    use sharp_rl::conformance::{check_batch, check_environment};
    use sharp_sim::SimulatorKind;

    use super::*;
    use crate::follower::Follower;
    use crate::network::{Correction, PolicyContext};
    use crate::test_worlds::{hall, hall_options};

    fn interfaces(world: &World) -> [(PolicyInterface, Arc<dyn Reward>); 2] {
        let base = Follower::cautious(&world.robot);
        let correction = Correction { speed_mps: 0.5, bearing_rad: 0.8 };
        let context = PolicyContext::default();
        [
            (PolicyInterface::Guide { base, correction, context }, Arc::new(ProgressReward::default())),
            (PolicyInterface::Absolute { reach_m: 0.5 }, Arc::new(PseudoReward::default())),
        ]
    }

    /// Driving `links` from the start of the first one's guide.
    fn scenario(
        world: &World,
        links: Vec<Link>,
        noise: NoiseModel,
        (interface, reward): (PolicyInterface, Arc<dyn Reward>),
    ) -> Scenario {
        Scenario {
            world: world.clone(),
            simulator: world.simulator(SimulatorKind::Kinematic),
            noise,
            interface,
            reward,
            horizon_share: 1.0,
            ends_at_standstill: false,
            start: RobotState::at_rest(links[0].option.guide.start()),
            links: links.into(),
        }
    }

    /// Episodes of `scenario` from its start.
    fn single(scenario: Scenario) -> Arc<SingleOption> {
        let states = Arc::new(InitialStates::exactly(scenario.start));
        Arc::new(SingleOption { scenario, states })
    }

    fn task(
        world: &World,
        links: Vec<Link>,
        noise: NoiseModel,
        parts: (PolicyInterface, Arc<dyn Reward>),
    ) -> OptionTask {
        OptionTask::new(single(scenario(world, links, noise, parts)), Seed(1))
    }

    #[test]
    fn both_interfaces_keep_the_contract_of_an_environment() {
        let (world, options) = (hall(), hall_options());
        for parts in interfaces(&world) {
            let mut task =
                task(&world, vec![Link::new(options[1].clone(), None)], NoiseModel::nominal(), parts);
            let checked = check_environment(&mut task, &mut Seed(1).stream("check", 0));
            assert_eq!(checked, Ok(()));
        }
    }

    #[test]
    fn the_base_follower_succeeds_and_standing_still_runs_out_of_time() {
        let (world, options) = (hall(), hall_options());
        let option = &options[1];
        for (parts, succeeds) in interfaces(&world).into_iter().zip([true, false]) {
            let mut observation = vec![0.0; parts.0.observation_len()];
            let mut task = task(&world, vec![Link::new(option.clone(), None)], NoiseModel::nominal(), parts);
            task.reset(&mut Seed(1).stream("reset", 0), &mut observation);
            let mut steps = 1;
            let mut step = task.step(&[0.0, 0.0], &mut observation);
            while !(step.terminated || step.truncated) {
                step = task.step(&[0.0, 0.0], &mut observation);
                steps += 1;
            }
            assert_eq!((step.success, step.terminated), (succeeds, succeeds), "after {steps} steps");
            assert_eq!(step.truncated, !succeeds, "a time-out is no end of the decision process");
            let horizon = option.horizon_actions();
            assert!(steps <= horizon && (succeeds || steps == horizon), "{steps} of {horizon} steps");
        }
    }

    #[test]
    fn standing_still_may_end_an_episode_early() {
        let (world, options) = (hall(), hall_options());
        let parts = interfaces(&world).into_iter().next_back().expect("two");
        let mut observation = vec![0.0; parts.0.observation_len()];
        let links = vec![Link::new(options[1].clone(), None)];
        let scenario =
            Scenario { ends_at_standstill: true, ..scenario(&world, links, NoiseModel::none(), parts) };
        let mut task = OptionTask::new(single(scenario), Seed(1));
        task.reset(&mut Seed(1).stream("reset", 0), &mut observation);
        let steps: Vec<Step> = (0..10).map(|_| task.step(&[0.0, 0.0], &mut observation)).collect();
        assert!(steps[..9].iter().all(|step| !step.truncated), "not before five seconds: {steps:?}");
        assert!(steps[9].truncated && !steps[9].terminated, "a time-out is no end of the decision process");
    }

    #[test]
    fn an_episode_with_a_contact_is_no_success_where_a_contact_costs() {
        let (world, options) = (hall(), hall_options());
        let (interface, _) = interfaces(&world).into_iter().next().expect("two");
        let end = |contact: f64, has_touched: bool| {
            let reward = Arc::new(PseudoReward { contact, ..PseudoReward::default() });
            let links = vec![Link::new(options[1].clone(), None)];
            let scenario = scenario(&world, links, NoiseModel::none(), (interface, reward));
            let mut task = RunningTask { has_touched, ..RunningTask::begin(scenario, Seed(1), 0) };
            let end = (0..200).map(|_| task.step(&[0.0, 0.0])).find(|outcome| outcome.done || outcome.late);
            end.expect("the base follower arrives")
        };
        for (contact, has_touched, success) in [(0.0, true, true), (-3.0, false, true), (-3.0, true, false)] {
            let end = end(contact, has_touched);
            assert!(end.done && end.reward > 990.0, "the termination set is paid for: {end:?}");
            assert_eq!(end.success, success, "a contact costs {contact}, touched: {has_touched}");
            assert_eq!(end.into_batch_step(&interface).failed, !success);
        }
    }

    #[test]
    fn a_chain_runs_on_over_its_hand_overs() {
        let (world, options) = (hall(), hall_options());
        let parts = interfaces(&world).into_iter().next().expect("two");
        let mut observation = vec![0.0; parts.0.observation_len()];
        let mut task = task(&world, Link::chain(&options), NoiseModel::none(), parts);
        task.reset(&mut Seed(1).stream("reset", 0), &mut observation);
        let mut paid = 0;
        loop {
            let step = task.step(&[0.0, 0.0], &mut observation);
            paid += u32::from(step.reward > 1.5);
            assert!(!step.truncated, "the base follower is in time");
            if step.terminated {
                assert!(step.success, "it ends at the goal");
                break;
            }
        }
        assert_eq!(paid as usize, options.len(), "each termination set is paid for");
    }

    /// Slots that drive from the start of the hall, with this share of the horizon.
    fn batch(horizon_share: f64, slots: usize) -> DrivingBatch {
        let (world, options) = (hall(), hall_options());
        let parts = interfaces(&world).into_iter().next().expect("two");
        let scenario = scenario(&world, Link::chain(&options), NoiseModel::harsh(), parts);
        DrivingBatch::new(single(Scenario { horizon_share, ..scenario }), slots, Seed(1))
    }

    #[test]
    fn slots_of_a_batch_do_not_depend_on_each_other() {
        let (mut together, mut alone) = (batch(1.0, 40), batch(1.0, 40));
        let checked = check_batch((&mut together, &mut alone), &mut Seed(1).stream("check", 0));
        assert_eq!(checked, Ok(()));
    }

    #[test]
    fn a_batch_drives_as_a_single_task_does() {
        let mut batch = batch(1.0, 1);
        let mut single = OptionTask::new(Arc::clone(&batch.source), Seed(1));
        let mut seen = SeenBatch::new(&batch.spec());
        let mut observation = vec![0.0; seen.observations.len()];
        batch.reset(0, &mut Seed(2).stream("reset", 0), &mut seen);
        single.reset(&mut Seed(2).stream("reset", 0), &mut observation);
        let mut steps = [BatchStep::default()];
        while !steps[0].is_last() {
            let used = seen.privileged[5];
            batch.step(0..1, &[0.3, 0.1], &mut seen, &mut steps);
            let step = single.step(&[0.3, 0.1], &mut observation);
            assert_eq!((step.reward, step.success), (steps[0].reward, steps[0].success));
            assert_eq!(observation, seen.observations, "the same is seen");
            assert!(seen.privileged[5] > used || seen.privileged[4] < 1.0, "time or options pass");
        }
    }

    #[test]
    fn who_uses_up_the_horizon_has_failed() {
        let mut batch = batch(0.02, 1);
        let mut seen = SeenBatch::new(&batch.spec());
        batch.reset(0, &mut Seed(2).stream("reset", 0), &mut seen);
        let mut steps = [BatchStep::default()];
        let mut count = 0;
        while !steps[0].is_last() {
            batch.step(0..1, &[-1.0, 0.0], &mut seen, &mut steps);
            count += 1;
        }
        assert!(steps[0].failed && !steps[0].success, "{:?}", steps[0]);
        assert!(count < 5, "{count} actions");
    }
}

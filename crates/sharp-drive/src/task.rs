//! Guided options as learning tasks: where simulator, guide and reinforcement learning meet.

use std::fmt::Debug;
use std::sync::Arc;

use rand::RngExt;
use sharp_guide::{Reward, StepEvents, Transition};
use sharp_rl::{Environment, EnvironmentSpec, Step};
use sharp_sim::{NoiseModel, RobotState, Simulator};
use sharp_space::{Seed, Stream};

use crate::automaton::{Automaton, Link};
use crate::episode::{Episode, EpisodeRules, Motion};
use crate::initial_states::InitialStates;
use crate::network::PolicyInterface;
use crate::situation::{GuideProgress, Observation};
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
        let step = running.step(action);
        running.observe(observation);
        step
    }
}

/// An episode of learning under way.
#[derive(Clone, Debug)]
struct RunningTask {
    world: World,
    interface: PolicyInterface,
    reward: Arc<dyn Reward>,
    episode: Episode,
    automaton: Automaton,
}

impl RunningTask {
    fn begin(scenario: Scenario, seed: Seed, number: u64) -> Self {
        let Scenario { world, simulator, noise, links, interface, reward, start } = scenario;
        let rules = EpisodeRules::default().with_contact_ends(reward.contact_ends());
        let mut episode = Episode::new(world.vehicle(&*simulator, &noise, rules.contact_ends), rules);
        episode.begin(start, seed, number);
        let automaton = Automaton::new(links, Observation::first(start, &noise).without_slip_estimate());
        Self { world, interface, reward, episode, automaton }
    }

    fn observe(&self, observation: &mut [f32]) {
        self.interface.observe(&self.automaton.situation(&self.world), observation);
    }

    fn step(&mut self, action: &[f32]) -> Step {
        let command = self.interface.command(&self.automaton.situation(&self.world), action);
        let motion = self.episode.act(command);
        let before = *self.automaton.progress();
        self.automaton.observe(&self.world, &motion);
        let collided = motion.contact && self.reward.contact_ends();
        let done = !collided && self.automaton.is_done();
        let reward = self.reward(&motion, &before, done);
        let late = self.automaton.is_late();
        // From here on the next option of the chain runs, if there is one.
        let success = done && !self.automaton.advance();
        let terminated = success || collided;
        Step { reward: reward as f32, terminated, truncated: !terminated && !done && late, success }
    }

    fn reward(&self, motion: &Motion, before: &GuideProgress, success: bool) -> f64 {
        let (option, after) = (&self.automaton.link().option, self.automaton.progress());
        let pose = &motion.after.pose;
        let stray = !option.is_allowed(pose);
        self.reward.reward(&Transition {
            option,
            pose,
            progress_m: after.arc_m - before.arc_m,
            deviation_m: after.cross_track_m.abs() - before.cross_track_m.abs(),
            events: StepEvents { success, contact: motion.contact, stray },
        })
    }
}

#[cfg(test)]
mod tests {
    use sharp_guide::{ProgressReward, PseudoReward};
    use sharp_rl::conformance::check_environment;
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

    /// The task of `links` from the start of the first one's guide.
    fn task(
        world: &World,
        links: Vec<Link>,
        noise: NoiseModel,
        (interface, reward): (PolicyInterface, Arc<dyn Reward>),
    ) -> OptionTask {
        let start = RobotState::at_rest(links[0].option.guide.start());
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let (world, links) = (world.clone(), links.into());
        let scenario = Scenario { world, simulator, noise, links, interface, reward, start };
        let states = Arc::new(InitialStates::exactly(start));
        OptionTask::new(Arc::new(SingleOption { scenario, states }), Seed(1))
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
}

//! Driving a chain of guided options by their policies, without recovery: the paper's composed policy.

use std::sync::Arc;

use sharp_guide::GuidedOption;
use sharp_sim::{NoiseModel, RobotState};
use sharp_space::Seed;

use crate::automaton::{Automaton, Link, Visit};
use crate::episode::{Controller, Decision, Episode, EpisodeEnd, Motion, Supervisor};
use crate::policy::{OptionPolicy, Policy};
use crate::situation::Observation;
use crate::world::World;

/// An option and the policy that drives it, as a step of a chain.
#[derive(Clone, Debug)]
pub struct Driver<'a> {
    /// The option.
    pub link: Link,
    /// Its policy.
    pub policy: &'a OptionPolicy,
}

impl<'a> Driver<'a> {
    /// `policy` drives `option`; `next` is the option after it.
    #[must_use]
    pub fn new(
        option: &Arc<GuidedOption>,
        policy: &'a OptionPolicy,
        next: Option<&Arc<GuidedOption>>,
    ) -> Self {
        Self { link: Link::new(Arc::clone(option), next.cloned()), policy }
    }
}

/// A chain with a copy of its policies: what one thread needs to run it again and again.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    links: Arc<[Link]>,
    policies: Vec<OptionPolicy>,
    uses_slip_estimate: bool,
}

impl Chain {
    pub(crate) fn new(drivers: &[Driver<'_>]) -> Self {
        let links: Arc<[Link]> = drivers.iter().map(|driver| driver.link.clone()).collect();
        let policies: Vec<OptionPolicy> = drivers.iter().map(|driver| driver.policy.clone()).collect();
        // Who leaves a tight place with care compensates its drift, whatever policy drives afterwards.
        let is_careful = |link: &Link| link.option.departure.careful_m > 0.0;
        let uses_slip_estimate =
            policies.iter().any(Policy::uses_slip_estimate) || links.iter().any(is_careful);
        Self { links, policies, uses_slip_estimate }
    }

    /// Runs the chain once in `episode`, from `start` under the noise of (`seed`, `number`). What policies remember of an
    /// episode ends with it.
    pub(crate) fn run(
        &self,
        world: &World,
        episode: &mut Episode,
        start: RobotState,
        (seed, number): (Seed, u64),
    ) -> ChainRun {
        episode.begin(start, seed, number);
        let observation = self.first(start, episode.vehicle().noise());
        let (links, mut policies) = (Arc::clone(&self.links), self.policies.clone());
        let mut controller = ChainController::new(world, links, &mut policies, observation);
        let end = episode.drive(&mut controller, &Supervisor::silent());
        let arrival = controller.automaton.observation().state;
        ChainRun { visits: controller.automaton.visits().to_vec(), arrival, end }
    }

    fn first(&self, start: RobotState, noise: &NoiseModel) -> Observation {
        let first = Observation::first(start, noise);
        if self.uses_slip_estimate { first } else { first.without_slip_estimate() }
    }
}

/// Lets each option's policy drive until the option is done or its horizon is used up.
#[derive(Debug)]
pub struct ChainController<'a, P = OptionPolicy> {
    world: &'a World,
    policies: &'a mut [P],
    automaton: Automaton,
    /// Options whose policy knows that it was entered.
    entered: usize,
}

impl<'a, P: Policy> ChainController<'a, P> {
    /// Drives `links` one after the other, each by its policy, from where the robot first observes itself.
    ///
    /// # Panics
    /// If there are not as many policies as links.
    #[must_use]
    pub fn new(world: &'a World, links: Arc<[Link]>, policies: &'a mut [P], first: Observation) -> Self {
        assert_eq!(links.len(), policies.len(), "a policy for each option");
        Self { world, policies, automaton: Automaton::new(links, first), entered: 0 }
    }
}

impl<P: Policy> Controller for ChainController<'_, P> {
    fn decide(&mut self) -> Decision {
        if !self.automaton.advance() {
            return Decision::Reached;
        }
        if self.automaton.is_late() {
            return Decision::Lost;
        }
        if let Some(decision) = self.automaton.maneuver(self.world) {
            return decision;
        }
        let (index, situation) = (self.automaton.index(), self.automaton.situation(self.world));
        let policy = &mut self.policies[index];
        if self.entered <= index {
            self.entered = index + 1;
            policy.enter(&situation);
        }
        Decision::Drive(policy.decide(&situation))
    }

    fn observe(&mut self, motion: &Motion) {
        self.automaton.observe(self.world, motion);
    }
}

/// One run through a chain of options.
#[derive(Clone, Debug)]
pub struct ChainRun {
    /// The options that were entered, in order.
    pub visits: Vec<Visit>,
    /// The state at the end.
    pub arrival: RobotState,
    /// How it ended; a horizon that was used up counts as [`EpisodeEnd::Lost`].
    pub end: EpisodeEnd,
}

impl ChainRun {
    /// Returns true if option number `index` was entered and ended in its termination set.
    #[must_use]
    pub fn passed(&self, index: usize) -> bool {
        index + 1 < self.visits.len() || (index + 1 == self.visits.len() && self.end == EpisodeEnd::Reached)
    }

    /// Simulated time of the whole run, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.visits.iter().map(|visit| visit.time_s).sum()
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::SimulatorKind;
    use sharp_space::Pose;

    use super::*;
    use crate::estimate::MonteCarlo;
    use crate::follower::Follower;
    use crate::test_worlds::{hall, hall_options};

    #[test]
    fn without_noise_a_chain_of_followers_ends_at_the_goal() {
        let (world, options) = (hall(), hall_options());
        let policy = OptionPolicy::Follower(Follower::cautious(&world.robot));
        let drivers: Vec<Driver<'_>> =
            options.iter().map(|option| Driver::new(option, &policy, None)).collect();
        let noise = NoiseModel::none();
        let start = RobotState::at_rest(options[0].guide.start());
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let trial = MonteCarlo::new(&world, &*simulator, &noise).with_episodes(1);
        let run = trial.runs(&drivers, start).remove(0);
        assert_eq!(run.end, EpisodeEnd::Reached, "{run:?}");
        assert!((0..options.len()).all(|index| run.passed(index)), "every option succeeded");
        assert!(options[options.len() - 1].is_done(&run.arrival.pose), "ends at {:?}", run.arrival.pose);
        assert!((10.0..40.0).contains(&run.time_s()), "8 m in {} s", run.time_s());
    }

    #[test]
    fn an_option_counts_as_passed_only_if_the_next_was_entered_or_the_goal_reached() {
        let arrival = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        let visits = vec![Visit { entry: arrival, time_s: 1.0, half_s: None }; 2];
        for (end, passed) in
            [(EpisodeEnd::Reached, [true, true, false]), (EpisodeEnd::Collided, [true, false, false])]
        {
            let run = ChainRun { visits: visits.clone(), arrival, end };
            assert_eq!([0, 1, 2].map(|index| run.passed(index)), passed, "{end:?}");
        }
    }
}

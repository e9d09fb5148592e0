//! The learning task of an option: where simulator, guide and reinforcement learning meet.

use std::sync::Arc;

use rand::RngExt;
use sharp_rl::{Environment, EnvironmentSpec, Step};
use sharp_sim::{KinematicSim, NoiseModel, Vehicle};
use sharp_space::{Seed, Stream};

use crate::learn::RewardMode;
use crate::leg::Leg;
use crate::percept::{Percept, Tracker, Workspace};
use crate::policy::{Form, GuideView};
use crate::starts::Starts;

/// A leg as a Markov decision process for [`sharp_rl`].
#[derive(Clone, Debug)]
pub struct LegTask {
    workspace: Workspace,
    leg: Arc<Leg>,
    next: Option<Arc<Leg>>,
    form: Form,
    reward: RewardMode,
    starts: Arc<Starts>,
    vehicle: Vehicle<KinematicSim>,
    seed: Seed,
    percept: Option<Percept>,
    tracker: Tracker,
    actions: u32,
}

impl LegTask {
    /// The task of the first of `legs`, with the one after it where it is known, under `noise`;
    /// episodes draw their noise from `seed`.
    #[must_use]
    pub fn new(
        workspace: &Workspace,
        (leg, next): (Arc<Leg>, Option<Arc<Leg>>),
        form: Form,
        reward: RewardMode,
        starts: Arc<Starts>,
        (noise, seed): (&NoiseModel, Seed),
    ) -> Self {
        let vehicle = crate::learn::kinematic_vehicle(workspace, noise, reward.contact_ends());
        Self {
            workspace: workspace.clone(),
            leg,
            next,
            form,
            reward,
            starts,
            vehicle,
            seed,
            percept: None,
            tracker: Tracker::default(),
            actions: 0,
        }
    }

    fn view(&self) -> GuideView<'_> {
        GuideView { guide: &self.leg.guide, next: self.next.as_ref().map(|next| &next.guide) }
    }

    fn observe(&self, percept: &Percept, observation: &mut [f32]) {
        self.form.observe(&self.workspace, percept, &self.tracker, &self.view(), observation);
    }
}

impl Environment for LegTask {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: self.form.observation_len(), action_len: 2 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        let state = self.starts.draw(rng);
        // The caller's stream numbers the episode, so that a clone does not repeat its original.
        self.vehicle.reset(state, self.seed, rng.random());
        let percept = Percept::first(state, self.vehicle.noise()).without_belief();
        self.tracker = Tracker::start(&self.leg.guide, &state.pose);
        self.actions = 0;
        self.observe(&percept, observation);
        self.percept = Some(percept);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let percept = self.percept.expect("reset comes before step");
        let pose = percept.state.pose;
        let command = self.form.waypoint(&self.workspace.robot, &pose, &self.tracker, &self.view(), action);
        let report = self.vehicle.act_at(command.to_world(&pose), command.speed_mps);
        let percept = percept.next(&self.workspace, command, report.after);
        let before = self.tracker;
        self.tracker.update(&self.leg.guide, &percept.state.pose);
        self.actions += 1;

        let success =
            !(report.contact && self.reward.contact_ends()) && self.leg.is_done(&percept.state.pose);
        let reward =
            self.reward.of(&self.leg, &percept.state.pose, (&before, &self.tracker), report.contact, success);
        self.observe(&percept, observation);
        self.percept = Some(percept);
        let terminated = success || (report.contact && self.reward.contact_ends());
        let horizon = self.leg.horizon_actions(crate::SLOWEST_REACH_M);
        Step { reward: reward as f32, terminated, truncated: !terminated && self.actions >= horizon, success }
    }
}

#[cfg(test)]
mod tests {
    use sharp_guide::{PseudoReward, ShapedReward};
    use sharp_options::OptionKind;
    use sharp_rl::conformance::check_environment;
    use sharp_sim::RobotState;

    use super::*;
    use crate::drawn::{HALL, along, legs, world};
    use crate::percept::Expectation;
    use crate::policy::{Correction, Follower};

    fn forms(workspace: &Workspace) -> [(Form, RewardMode); 2] {
        let base = Follower::cautious(&workspace.robot);
        let correction = Correction { speed_mps: 0.5, bearing_rad: 0.8 };
        [
            (
                Form::Guide { base, correction, expectation: Expectation::default() },
                RewardMode::Shaped(ShapedReward::default()),
            ),
            (Form::Absolute { reach_m: 0.5 }, RewardMode::Paper(PseudoReward::default())),
        ]
    }

    fn task(workspace: &Workspace, leg: &Arc<Leg>, (form, reward): (Form, RewardMode)) -> LegTask {
        let starts = Arc::new(Starts::exactly(RobotState::at_rest(leg.guide.start())));
        let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
        LegTask::new(workspace, (Arc::clone(leg), None), form, reward, starts, (&noise, Seed(1)))
    }

    #[test]
    fn both_forms_keep_the_contract_of_an_environment() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        for form in forms(&workspace) {
            let checked =
                check_environment(&mut task(&workspace, leg, form), &mut Seed(1).stream("check", 0));
            assert_eq!(checked, Ok(()), "{form:?}");
        }
    }

    #[test]
    fn the_base_follower_succeeds_and_standing_still_runs_out_of_time() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let horizon = leg.horizon_actions(crate::SLOWEST_REACH_M);
        for (form, succeeds) in forms(&workspace).into_iter().zip([true, false]) {
            let mut task = task(&workspace, leg, form);
            let mut observation = vec![0.0; form.0.observation_len()];
            task.reset(&mut Seed(1).stream("reset", 0), &mut observation);
            let mut steps = 1;
            let mut step = task.step(&[0.0, 0.0], &mut observation);
            while !(step.terminated || step.truncated) {
                step = task.step(&[0.0, 0.0], &mut observation);
                steps += 1;
            }
            assert_eq!((step.success, step.terminated), (succeeds, succeeds), "{form:?} after {steps} steps");
            assert_eq!(step.truncated, !succeeds, "{form:?}: time out is no end");
            assert!(
                steps <= horizon && (succeeds || steps == horizon),
                "{form:?}: {steps} of {horizon} steps"
            );
        }
    }
}

//! Executions moment by moment, for whoever shows or analyses them.

use std::sync::Arc;

use sharp_drive::{Command, Controller, Decision, Motion, Readiness, Supervisor};
use sharp_guide::LegId;
use sharp_sim::RobotState;

use crate::execute::{Execution, RunSettings, rules};
use crate::plan_file::Plan;
use crate::tour::{Tour, TourPolicy};

/// The robot at the moment of a decision, or at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Simulated time since the start of the episode, seconds.
    pub time_s: f64,
    /// Pose and motion.
    pub state: RobotState,
    /// Which plan of a tour runs, from 0; 0 where there is one plan.
    pub plan: usize,
    /// The option that runs.
    pub option: LegId,
    /// What was decided; `None` at the end and where the robot backs off.
    pub command: Option<Command>,
    /// True where the decision came with a new plan.
    pub is_recovering: bool,
}

/// An execution with all its moments.
#[derive(Clone, Debug)]
pub struct Recording {
    /// How it ended.
    pub execution: Execution,
    /// From the start to the end, in order; at least one.
    pub moments: Vec<Moment>,
}

/// Runs `plan` as [`run`](crate::run) does, and keeps every moment.
#[must_use]
pub fn record(
    plan: &Arc<Plan>,
    settings: &RunSettings,
    clock_us: &(dyn Fn() -> f64 + Sync),
) -> Vec<Recording> {
    Tour::from(Arc::clone(plan)).record(settings, clock_us)
}

impl Tour {
    /// Runs the tour as [`Tour::run`] does, and keeps every moment.
    #[must_use]
    pub fn record(&self, settings: &RunSettings, clock_us: &(dyn Fn() -> f64 + Sync)) -> Vec<Recording> {
        let supervisor = Supervisor { clock_us, ..Supervisor::silent() };
        let last = self.plans.len() - 1;
        self.episodes(settings, rules(settings).with_trace(), |mut episode, policy| {
            let state = *episode.state();
            let mut noted = NotedPolicy { policy, last, state, time_s: 0.0, moments: Vec::new() };
            let end = episode.drive(&mut noted, &supervisor);
            noted.note(None);
            let execution = Execution { end, record: episode.into_record(), events: noted.policy.events() };
            Recording { execution, moments: noted.moments }
        })
    }
}

/// A policy whose decisions are noted.
#[derive(Debug)]
struct NotedPolicy {
    policy: TourPolicy,
    /// The number of the last plan.
    last: usize,
    state: RobotState,
    time_s: f64,
    moments: Vec<Moment>,
}

impl NotedPolicy {
    /// Notes what is now; the last decision of all is asked for at the end, and noted once.
    fn note(&mut self, command: Option<Command>) {
        if self.moments.last().is_some_and(|last| last.time_s >= self.time_s) {
            return;
        }
        self.moments.push(Moment {
            time_s: self.time_s,
            state: self.state,
            plan: self.last - self.policy.goals_to_come(),
            option: self.policy.option().id,
            command,
            is_recovering: self.policy.is_recovering(),
        });
    }
}

impl Controller for NotedPolicy {
    fn decide(&mut self) -> Decision {
        let decision = self.policy.decide();
        self.note(if let Decision::Drive(command) = decision { Some(command) } else { None });
        decision
    }

    fn observe(&mut self, motion: &Motion) {
        self.time_s += motion.time_s;
        self.state = motion.after;
        self.policy.observe(motion);
    }

    fn prepare(&mut self) -> Readiness {
        self.policy.prepare()
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_space::{Pose, Seed};

    use super::*;
    use crate::execute::run;
    use crate::test_worlds::plan;

    #[test]
    fn a_recording_is_the_run_with_its_moments() {
        let plan = plan(OptionKind::Interface);
        let settings = RunSettings::new(&plan, 2, Seed(1));
        let (runs, recordings) = (run(&plan, &settings, &|| 0.0), record(&plan, &settings, &|| 0.0));
        assert_eq!(runs.len(), recordings.len(), "an execution each");
        for (run, Recording { execution, moments }) in runs.iter().zip(&recordings) {
            assert_eq!((run.end, &run.record), (execution.end, &execution.record), "the same run");
            let poses: Vec<Pose> = moments.iter().map(|moment| moment.state.pose).collect();
            assert_eq!(poses, run.record.trace, "a moment for each pose");
            assert!(moments.windows(2).all(|pair| pair[0].time_s < pair[1].time_s), "time goes on");
            let last = moments.last().expect("at least one");
            assert!((last.time_s - run.record.time_s).abs() < 1e-9, "it lasts as long as the run");
            assert_eq!(last.command, None, "nothing is decided at the end");
            let mut options: Vec<_> = moments.iter().map(|moment| moment.option).collect();
            options.dedup();
            let planned: Vec<_> = plan.solution.steps.iter().map(|step| step.option.id).collect();
            assert_eq!(options, planned, "one option after the other");
            assert!(moments.iter().all(|moment| moment.plan == 0), "there is one plan");
        }
    }
}

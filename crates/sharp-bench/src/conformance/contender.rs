//! The suite that every [`Contender`] must pass, ours and anybody's.

use sharp_drive::{
    Command, Controller, Decision, Episode, EpisodeEnd, EpisodeRules, Motion, Readiness, Supervisor, World,
};
use sharp_plan::Query;
use sharp_sim::{NoiseModel, RobotState, SimulatorKind};
use sharp_space::Seed;
use thiserror::Error;

use crate::contender::Contender;

/// How a contender breaks its promise.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ContenderViolation {
    /// A command is NaN or infinite, or its speed is negative.
    #[error("decision {decision} is {command:?}, expected finite numbers and a speed from 0 on")]
    Command {
        /// The number of the decision, from 0.
        decision: usize,
        /// The command.
        command: Command,
    },
    /// The nominal time of a plan is no time: it sets the limit of the episode.
    #[error("a plan takes {0} s nominally, expected a finite time")]
    NominalTime(f64),
    /// Asked twice for the same episode, it drives differently.
    #[error("asked again for episode {episode}, it differs from decision {decision} on")]
    Random {
        /// The number of the episode.
        episode: u64,
        /// The first decision that differs.
        decision: usize,
    },
    /// It says that it is at the goal, and it is not.
    #[error("{off_m} m from the goal it says that it is there")]
    NotThere {
        /// Distance from the goal, metres.
        off_m: f64,
    },
}

/// Longest episode of the suite, seconds.
const TIME_LIMIT_S: f64 = 120.0;

/// Lets `contender`, which is prepared for `query` in `world`, drive two episodes under nominal noise, each twice.
///
/// Whether it reaches the goal is not asked: that is what a comparison is for.
///
/// # Errors
/// Says which promise is broken.
pub fn check_contender(
    contender: &dyn Contender,
    world: &World,
    query: &Query,
) -> Result<(), ContenderViolation> {
    for episode in [0, 1] {
        let (first, second) =
            (drive(contender, world, query, episode), drive(contender, world, query, episode));
        first.check(world, query)?;
        if first != second {
            let pairs = first.decisions.iter().zip(&second.decisions);
            let decision = pairs.take_while(|(a, b)| a == b).count();
            return Err(ContenderViolation::Random { episode, decision });
        }
    }
    Ok(())
}

/// One drive of the suite.
#[derive(Debug, PartialEq)]
struct SuiteDrive {
    end: EpisodeEnd,
    decisions: Vec<Decision>,
    nominal_times_s: Vec<f64>,
    last: RobotState,
}

impl SuiteDrive {
    fn check(&self, world: &World, query: &Query) -> Result<(), ContenderViolation> {
        for (decision, made) in self.decisions.iter().enumerate() {
            let Decision::Drive(command) = *made else { continue };
            let Command { reach_m, bearing_rad, speed_mps } = command;
            let is_finite = [reach_m, bearing_rad, speed_mps].iter().all(|number| number.is_finite());
            if !is_finite || speed_mps < 0.0 {
                return Err(ContenderViolation::Command { decision, command });
            }
        }
        let is_time = |time_s: &&f64| time_s.is_finite() && **time_s >= 0.0;
        if let Some(&broken) = self.nominal_times_s.iter().find(|time_s| !is_time(time_s)) {
            return Err(ContenderViolation::NominalTime(broken));
        }
        let off_m = self.last.pose.distance_m(&query.goal);
        if self.end == EpisodeEnd::Reached && off_m >= world.robot.goal_tolerance_m {
            return Err(ContenderViolation::NotThere { off_m });
        }
        Ok(())
    }
}

fn drive(contender: &dyn Contender, world: &World, query: &Query, number: u64) -> SuiteDrive {
    let start = RobotState::at_rest(query.start);
    let simulator = world.simulator(SimulatorKind::Kinematic);
    let rules = EpisodeRules::default().with_time_limit_s(TIME_LIMIT_S);
    let mut episode = Episode::new(world.vehicle(&*simulator, &NoiseModel::nominal(), true), rules);
    episode.begin(start, Seed(1), number);
    let inner = contender.controller(start, number);
    let mut controller = DecisionRecorder { inner, decisions: Vec::new(), nominal_times_s: Vec::new() };
    let end = episode.drive(&mut controller, &Supervisor::silent());
    let DecisionRecorder { decisions, nominal_times_s, .. } = controller;
    SuiteDrive { end, decisions, nominal_times_s, last: *episode.state() }
}

/// Notes every decision of a controller.
struct DecisionRecorder<'a> {
    inner: Box<dyn Controller + 'a>,
    decisions: Vec<Decision>,
    nominal_times_s: Vec<f64>,
}

impl Controller for DecisionRecorder<'_> {
    fn decide(&mut self) -> Decision {
        let decision = self.inner.decide();
        self.decisions.push(decision);
        decision
    }

    fn observe(&mut self, motion: &Motion) {
        self.inner.observe(motion);
    }

    fn prepare(&mut self) -> Readiness {
        let readiness = self.inner.prepare();
        if let Readiness::Planned { nominal_time_s } = readiness {
            self.nominal_times_s.push(nominal_time_s);
        }
        readiness
    }
}

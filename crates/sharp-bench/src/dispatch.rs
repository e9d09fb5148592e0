//! A robot in a learnt building that is given goals while it drives.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use sharp_plan::{
    AbstractionFile, Answer, ComposedOdds, Instruction, MOVED, Plan, Query, Reading, RemoteDriver,
    RemoteStatus, Sharp, end_of, is_elsewhere, is_placed,
};
use sharp_sim::RobotState;
use sharp_space::Pose;

use crate::error::BenchError;
use crate::learn::NamedWorld;
use crate::reports::SolveReport;
use crate::solve::{SolveSettings, answered, blank_report};
use crate::stopwatch::{Stopwatch, TimedMonitor};

/// What a robot is told: where to drive next, and what it may hope for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DispatchReply {
    /// Where to drive, metres and radians; `None` where it is to stand.
    pub waypoint: Option<[f64; 3]>,
    /// Speed at which the waypoint is to be approached, metres per second; negative for backwards.
    pub speed: f64,
    /// The option that runs; empty without a plan.
    pub option: String,
    /// `running`, `recovering`, `reached`, `lost` or `no_plan`.
    pub status: &'static str,
    /// The odds of what remains of the drive, later goals included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odds: Option<Odds>,
}

/// The odds of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Odds {
    /// The chance to arrive.
    pub success: f64,
    /// Mean time, seconds.
    pub time_s: f64,
}

/// A line that answers another.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum DispatchLine {
    /// The plan to a goal, or why there is none.
    Plan {
        /// The report.
        plan: Box<SolveReport>,
    },
    /// What to do now.
    Reply(DispatchReply),
}

/// Plans and drives for one robot in one building.
#[derive(Debug)]
pub struct Dispatcher {
    place: NamedWorld,
    settings: SolveSettings,
    sharp: Sharp,
    file: AbstractionFile,
    state: Option<RobotState>,
    /// Goals that come after the present one, or all of them before the first pose.
    to_come: VecDeque<Pose>,
    /// The odds of the plans to them, as they were when the goals were given.
    later: VecDeque<Odds>,
    driving: Option<Driving>,
    /// How the last drive ended, until there is a new goal.
    rest: &'static str,
    /// Where no plan led on to the next goal.
    lost_at: Option<Pose>,
    /// New plans on the way since the robot was last at another place, and where that began.
    recoveries: (u32, Pose),
}

/// So many new plans without leaving a place of this size leave a robot lost, metres and radians.
const RECOVERIES_MAX: u32 = 10;
const STUCK_WITHIN: (f64, f64) = (0.2, 0.8);

#[derive(Debug)]
struct Driving {
    driver: RemoteDriver,
    plan: Arc<Plan>,
    /// `None` where the driver has made a plan of its own.
    odds: Option<ComposedOdds>,
}

impl Dispatcher {
    /// The robot of `place` with what the library in the folder `library` knows of the building.
    ///
    /// # Errors
    /// If the map has no room for the robot, or a file is broken.
    pub fn new(place: NamedWorld, settings: SolveSettings, library: &Path) -> Result<Self, BenchError> {
        let (sharp, file) = place.open(&settings, Some(library))?;
        let (to_come, later) = (VecDeque::new(), VecDeque::new());
        Ok(Self {
            place,
            settings,
            sharp,
            file,
            state: None,
            to_come,
            later,
            driving: None,
            rest: "no_plan",
            lost_at: None,
            recoveries: (0, Pose::new(0.0, 0.0, 0.0)),
        })
    }

    /// The robot's state as it was last told.
    #[must_use]
    pub const fn state(&self) -> Option<&RobotState> {
        self.state.as_ref()
    }

    /// Options and hand-overs of the library.
    #[must_use]
    pub fn known(&self) -> (usize, usize) {
        (self.sharp.library().len(), self.sharp.library().hand_overs().count())
    }

    /// The robot is to drive to `goals` in turn, whatever it was doing before. Answers with a plan for each of them, or up to
    /// the first that cannot be reached; then it stands. Before the first pose it answers nothing.
    ///
    /// # Errors
    /// If the library cannot be written.
    pub fn send(&mut self, goals: &[Pose]) -> Result<Vec<DispatchLine>, BenchError> {
        self.cancel();
        self.to_come = goals.iter().copied().collect();
        match self.state {
            Some(state) => self.plan_route(state),
            None => Ok(vec![]),
        }
    }

    /// The robot is to stand.
    pub fn cancel(&mut self) {
        self.to_come.clear();
        self.later.clear();
        (self.driving, self.rest, self.lost_at) = (None, "no_plan", None);
        self.recoveries.0 = 0;
    }

    /// What to do for a robot that tells `reading`.
    ///
    /// # Errors
    /// If the library cannot be written.
    pub fn drive(&mut self, reading: &Reading) -> Result<Vec<DispatchLine>, BenchError> {
        let state = reading.state(&self.place.world.robot, self.state.as_ref());
        if !is_placed(&self.place.world, &state.pose) {
            // What it knew of the robot before stays, for the next pose may be a real one again.
            return Ok(vec![standing("lost")]);
        }
        self.state = Some(state);
        let mut lines = Vec::new();
        if self.driving.is_none() && self.lost_at.is_some() {
            self.set_out(state)?;
        } else if self.driving.is_none() && !self.to_come.is_empty() {
            lines = self.plan_route(state)?;
        }
        lines.push(self.instruct(state)?);
        Ok(lines)
    }

    /// Plans from `state` to all goals in turn and sets out.
    fn plan_route(&mut self, state: RobotState) -> Result<Vec<DispatchLine>, BenchError> {
        let goals: Vec<Pose> = self.to_come.iter().copied().collect();
        let (mut lines, mut plans, mut start) = (Vec::new(), Vec::new(), state.pose);
        for goal in goals {
            let (report, plan) = self.ask(Query { start, goal })?;
            lines.push(DispatchLine::Plan { plan: Box::new(report) });
            match plan {
                Some(plan) => {
                    start = end_of(&plan);
                    plans.push(plan);
                }
                None => {
                    self.cancel();
                    return Ok(lines);
                }
            }
        }
        self.later = plans.iter().skip(1).map(odds).collect();
        self.to_come.pop_front();
        self.driving = plans.into_iter().next().map(|plan| Driving::new(plan, state));
        Ok(lines)
    }

    /// Plans from `state` to the next goal and sets out; returns false where no plan leads there. Then the robot is lost, and
    /// keeps its goals: from elsewhere there may be one.
    fn set_out(&mut self, state: RobotState) -> Result<bool, BenchError> {
        let may_have_way = self.lost_at.is_none_or(|at| is_elsewhere(&at, &state.pose, MOVED));
        let goal = self.to_come.front().copied().filter(|_| may_have_way);
        let Some(goal) = goal else { return Ok(false) };
        let (_, plan) = self.ask(Query { start: state.pose, goal })?;
        match plan {
            Some(plan) => {
                self.to_come.pop_front();
                (self.driving, self.lost_at) = (Some(Driving::new(plan, state)), None);
            }
            None => (self.rest, self.lost_at) = ("lost", Some(state.pose)),
        }
        Ok(self.driving.is_some())
    }

    fn ask(&mut self, query: Query) -> Result<(SolveReport, Option<Plan>), BenchError> {
        let problem = self.place.problem(query);
        let monitor = TimedMonitor::new(Stopwatch::start("load"), None, &());
        let report = blank_report(&problem, &self.settings, &mut self.sharp, &self.file)?;
        let answer = match query.check(&problem.world) {
            Ok(()) => self.sharp.solve(query, &monitor)?,
            Err(error) => Answer::NoPlan(error.to_string()),
        };
        let (report, plan) = answered(report, answer);
        Ok((SolveReport { time_s: monitor.times(), ..report }, plan))
    }

    fn instruct(&mut self, state: RobotState) -> Result<DispatchLine, BenchError> {
        loop {
            let Some(driving) = &mut self.driving else { return Ok(standing(self.rest)) };
            let told = driving.driver.answer_in(state);
            match told.status {
                RemoteStatus::Running => return Ok(self.reply(&told, "running")),
                RemoteStatus::Recovering => {
                    let goal = driving.plan.solution.query.goal;
                    self.recoveries = match self.recoveries {
                        (count, at) if !is_elsewhere(&at, &state.pose, STUCK_WITHIN) => (count + 1, at),
                        _ => (1, state.pose),
                    };
                    if self.recoveries.0 > RECOVERIES_MAX {
                        self.to_come.push_front(goal);
                        (self.driving, self.rest, self.lost_at) = (None, "lost", Some(state.pose));
                        continue;
                    }
                    // The library knows more than the plan: a new one from here, by its odds.
                    let (_, plan) = self.ask(Query { start: state.pose, goal })?;
                    let Some(plan) = plan else {
                        // The driver's own new plan has no odds.
                        self.driving.iter_mut().for_each(|driving| driving.odds = None);
                        return Ok(self.reply(&told, "recovering"));
                    };
                    let driving = self.driving.insert(Driving::new(plan, state));
                    let told = driving.driver.answer_in(state);
                    return Ok(self.reply(&told, "recovering"));
                }
                RemoteStatus::Reached => {
                    self.later.pop_front();
                    (self.driving, self.rest) = (None, "reached");
                    if !self.to_come.is_empty() && !self.set_out(state)? {
                        return Ok(standing(self.rest));
                    }
                }
                // The driver finds a way again once the robot stands elsewhere.
                RemoteStatus::Lost => return Ok(standing("lost")),
            }
        }
    }

    /// The line that tells the robot `told`.
    fn reply(&self, told: &Instruction, status: &'static str) -> DispatchLine {
        let Some(driving) = &self.driving else { return standing(self.rest) };
        let here = driving.odds.as_ref().map(|odds| odds.rest(driving.driver.progress()));
        let odds = here.map(|(success, time_s)| {
            let later = self.later.iter();
            later.fold(Odds { success, time_s }, |sum, next| Odds {
                success: sum.success * next.success,
                time_s: sum.time_s + next.time_s,
            })
        });
        let waypoint = told.waypoint.map(|pose| [pose.position.x, pose.position.y, pose.heading.radians()]);
        let (speed, option) = (told.speed_mps, told.option.to_string());
        DispatchLine::Reply(DispatchReply { waypoint, speed, option, status, odds })
    }
}

impl Driving {
    fn new(plan: Plan, state: RobotState) -> Self {
        let (odds, plan) = (Some(plan.solution.odds()), Arc::new(plan));
        Self { driver: RemoteDriver::from_state(vec![Arc::clone(&plan)], state, true), plan, odds }
    }
}

fn odds(plan: &Plan) -> Odds {
    let ComposedOdds { success, time_s, .. } = plan.solution.odds();
    Odds { success, time_s }
}

fn standing(status: &'static str) -> DispatchLine {
    DispatchLine::Reply(DispatchReply {
        waypoint: None,
        speed: 0.0,
        option: String::new(),
        status,
        odds: None,
    })
}

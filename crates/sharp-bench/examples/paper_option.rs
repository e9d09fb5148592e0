//! One option learnt by the paper's protocol, with at most a few things changed: what each change is worth.
//!
//! ```sh
//! paper_option MAP ROBOT KIND PROBLEM list
//! paper_option MAP ROBOT KIND PROBLEM LEG [CHANGE=VALUE ...]
//! ```
//!
//! `list` names the legs that `sharp solve --learning paper` would learn first. A leg is learnt with the same seeds as there, with
//! the hyperparameters of Stable-Baselines3 unless `base` says otherwise, and
//! each evaluation prints one JSON object: steps, processor seconds, mean return, whether the paper's stop is met, and how
//! many of 200 episodes succeed under the best policy until then, with contact allowed and with contact as failure. Training
//! goes on behind the paper's stop until a share of 0.95 succeeds, so that one run shows what either stop gives. Changes:
//!
//! * `base=paper`, `base=absolute`: begins with the settings of `--learning paper` or `paper-tuned`; put it first.
//! * `simulator=kinematic`: where it is learnt; rapier2d otherwise.
//! * `contact=-10`: added to the reward of each step with a contact; an episode with a contact is no success then.
//! * `heading=-300`: added in the termination set for each radian off the guide's heading there.
//! * `still=true`: an episode in which the robot stands still is out of time.
//! * `starts=centre`: episodes begin at rest where the guide does, not spread over the initiation set.
//! * `scale=0.01`: rewards are multiplied inside the algorithm; the task stays the same.
//! * `normalise=true`: observations are normalised by those of the warm-up.
//! * `hidden=64`, `batch=128`, `rate=1e-3`, `gamma=0.97`, `tau=0.01`, `nstep=3`, `warmup=1000`, `alpha=0.05`, `updates=0.5`:
//!   units of each hidden layer, transitions of a gradient step, learning rate, and the other settings of `SacSettings`.
//! * `best=return`: the best policy is chosen by mean return + 1,000 x success rate.
//! * `restart=25000`: training begins anew after so many steps without a mean return above 0, while twice as many are left (so it
//!   needs `steps=100000`).
//! * `until=free`: training goes on until the share of 0.95 succeeds without contact.
//! * `steps=60000`, `seed=1`: the budget, and the root of all randomness.

#![allow(clippy::disallowed_methods, reason = "an example is a command: it reads its arguments")]

use std::ops::ControlFlow;
use std::sync::Arc;

use serde_json::json;
use sharp_bench::{AbstractionRequest, NamedProblem, Stopwatch, TimedMonitor, default_regions, prepare};
use sharp_drive::{
    Follower, InitialStates, Link, OptionPolicy, OptionTask, PolicyInterface, Scenario, SingleOption,
    SuccessCount, SuccessEstimate,
};
use sharp_guide::PseudoReward;
use sharp_options::OptionKind;
use sharp_plan::{
    Conditions, LearnFailure, LearningMonitor, LearningTask, LearntPolicy, Method, OptionLearner, Query,
};
use sharp_rl::{
    Actor, BestRule, Evaluation, Normalisation, RestartRule, StopRule, TrainError, TrainSettings, evaluate,
    train,
};
use sharp_sim::{RobotState, SimulatorKind};
use sharp_space::Seed;

/// Episodes that a policy is judged on.
const EPISODES: usize = 200;
/// Success, share of episodes, at which training ends.
const WANTED: f64 = 0.95;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [map, robot, kind, problem, leg, changes @ ..] = &arguments[..] else {
        return Err("usage: paper_option MAP ROBOT KIND PROBLEM LEG|list [CHANGE=VALUE ...]".into());
    };
    let kind = match kind.as_str() {
        "interface" => OptionKind::Interface,
        "centroid" => OptionKind::Centroid,
        _ => return Err(format!("the kind of option is {kind:?}, expected interface or centroid").into()),
    };
    let experiment = LegExperiment::parse(leg, changes)?;
    let map = sharp_maps::load(map, &sharp_maps::LoadOptions::default())?;
    let number: usize = problem.parse()?;
    let found = number.checked_sub(1).and_then(|index| map.problems.get(index));
    let found = found.ok_or_else(|| format!("{} has no problem {problem}", map.name))?;
    let query = Query { start: found.start, goal: found.goal };
    let problem = NamedProblem::new(&map, query, robot, "nominal")?;
    let request =
        AbstractionRequest { options: kind, regions: default_regions(), metric: Default::default() };
    let monitor = TimedMonitor::new(Stopwatch::start("regions"), None, &());
    let (sharp, _) = prepare(problem.world.clone(), &request, None, &monitor)?;
    let (simulator, seed) = (problem.world.simulator(experiment.simulator), experiment.seed);
    // The plan is not what is asked for: a few episodes of it will do.
    let method = Method::paper().with_learner("experiment", Arc::new(experiment)).with_episodes(1, 1, 0);
    let mut sharp = sharp.with_method(method).with_simulator(simulator).with_seed(seed);
    sharp.solve(query, &monitor)?;
    Ok(())
}

/// The leg to be learnt, and what is different from the paper.
#[derive(Clone, Debug)]
struct LegExperiment {
    /// Its name; `list` for none.
    leg: String,
    simulator: SimulatorKind,
    reward: PseudoReward,
    starts_at_centre: bool,
    /// Whether an episode in which the robot stands still is out of time.
    ends_at_standstill: bool,
    /// Whether the share that ends training is of episodes without contact.
    until_free: bool,
    train: TrainSettings,
    seed: Seed,
}

impl LegExperiment {
    fn parse(leg: &str, changes: &[String]) -> Result<Self, Failure> {
        let mut experiment = Self {
            leg: leg.to_owned(),
            simulator: Method::paper().simulator,
            reward: PseudoReward::default(),
            starts_at_centre: false,
            ends_at_standstill: false,
            until_free: false,
            train: TrainSettings::default().with(|train| {
                train.max_env_steps = 60_000;
                train.stop = StopRule::Never;
            }),
            seed: Seed(1),
        };
        for change in changes {
            let (name, value) = change.split_once('=').unwrap_or((change, ""));
            match name {
                "base" => {
                    let base = match value {
                        "paper" => TrainSettings::paper(),
                        "absolute" => TrainSettings::absolute(),
                        _ => return Err(format!("{value:?} is no base, expected paper or absolute").into()),
                    };
                    let TrainSettings { max_env_steps, stop, .. } = experiment.train;
                    experiment.train = base.with(|train| {
                        train.max_env_steps = max_env_steps;
                        train.stop = stop;
                    });
                }
                "simulator" => experiment.simulator = value.parse()?,
                "contact" => experiment.reward.contact = value.parse()?,
                "heading" => experiment.reward.heading = value.parse()?,
                "still" => experiment.ends_at_standstill = value.parse()?,
                "starts" if value == "centre" => experiment.starts_at_centre = true,
                "scale" => experiment.train.sac.reward_scale = value.parse()?,
                "normalise" if value == "true" => {
                    experiment.train.normalisation = Normalisation::FromWarmup;
                }
                "hidden" => experiment.train.sac.hidden = vec![value.parse()?; 2],
                "batch" => experiment.train.sac.batch = value.parse()?,
                "gamma" => experiment.train.sac.gamma = value.parse()?,
                "tau" => experiment.train.sac.tau = value.parse()?,
                "nstep" => experiment.train.sac.n_step = value.parse()?,
                "warmup" => experiment.train.sac.warmup_steps = value.parse()?,
                "alpha" => experiment.train.sac.initial_alpha = value.parse()?,
                "updates" => experiment.train.sac.updates_per_step = value.parse()?,
                "rate" => experiment.train.sac.learning_rate = value.parse()?,
                "best" if value == "return" => experiment.train.best = BestRule::ReturnAndSuccess(1_000.0),
                "restart" => {
                    experiment.train.restart = Some(RestartRule { after: value.parse()?, below: 0.0 });
                }
                "until" if value == "free" => experiment.until_free = true,
                "steps" => experiment.train.max_env_steps = value.parse()?,
                "seed" => experiment.seed = Seed(value.parse()?),
                _ => return Err(format!("{change:?} is no change that is known").into()),
            }
        }
        Ok(experiment)
    }

    fn train(&self, task: &LearningTask<'_>) -> Result<(), TrainError> {
        let states = if self.starts_at_centre {
            Arc::new(InitialStates::exactly(RobotState::at_rest(task.option.guide.start())))
        } else {
            Arc::clone(&task.states)
        };
        let scenario = Scenario {
            ends_at_standstill: self.ends_at_standstill,
            ..scenario(task, task.conditions, self.reward)
        };
        let learnt = option_task(scenario, &states, task.seed.child("environment", 0));
        let (mut best, mut is_stopped) = (None::<(Evaluation, Actor)>, false);
        let (mut failure, mut judging_s) = (None, 0.0);
        let planar = task.conditions.clone().with_simulator(task.world.simulator(SimulatorKind::Planar));
        let begun_s = cpu_seconds();
        let mut rng = task.seed.stream("sac", 0);
        train(&mut [learnt], &self.train, &mut rng, &mut |progress| {
            let Some(evaluation) = progress.evaluation else { return ControlFlow::Continue(()) };
            let cpu_s = cpu_seconds();
            if best.as_ref().is_none_or(|best| self.train.best.prefers(&evaluation, &best.0)) {
                best = Some((evaluation, progress.actor.clone()));
            }
            let (_, actor) = best.as_ref().expect("just set");
            is_stopped |= TrainSettings::default().stop.is_met(&evaluation);
            let own = judge(task, task.conditions, actor);
            let (own, planar) = match own.and_then(|own| Ok((own, judge(task, &planar, actor)?))) {
                Ok(judged) => judged,
                Err(error) => {
                    failure = Some(error);
                    return ControlFlow::Break(());
                }
            };
            let report = json!({
                "leg": task.option.id.to_string(), "length_m": task.option.guide.length_m(),
                "steps": progress.env_steps, "cpu_s": cpu_s - begun_s - judging_s,
                "return": evaluation.mean_return, "stop": is_stopped, "own": own, "rapier2d": planar,
            });
            println!("{report}");
            judging_s += cpu_seconds() - cpu_s;
            let is_over = is_stopped && own[usize::from(self.until_free)] >= WANTED;
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        failure.map_or(Ok(()), Err)
    }
}

impl OptionLearner for LegExperiment {
    fn learn(&self, task: &LearningTask<'_>, _: &dyn LearningMonitor) -> Result<LearntPolicy, LearnFailure> {
        let (leg, length_m) = (task.option.id.to_string(), task.option.guide.length_m());
        if self.leg == "list" {
            println!("{}", json!({ "leg": leg, "length_m": length_m }));
        } else if self.leg == leg {
            self.train(task).map_err(LearnFailure::Broken)?;
        }
        // As good as it was thought to be, so that the search looks for no other way.
        let robot = &task.world.robot;
        let speed_mps = Method::paper().search.nominal_speed * robot.max_speed_mps;
        let count = SuccessCount { episodes: 1, successes: 1 };
        let estimate = SuccessEstimate { count, mean_time_s: length_m / speed_mps };
        Ok(LearntPolicy::untrained(OptionPolicy::Follower(Follower::cautious(robot)), estimate))
    }
}

/// Shares of episodes in which `actor` succeeds, with contact allowed and with contact as failure.
fn judge(task: &LearningTask<'_>, conditions: &Conditions, actor: &Actor) -> Result<[f64; 2], TrainError> {
    let share = |contact| {
        let reward = PseudoReward { contact, ..PseudoReward::default() };
        let scenario = scenario(task, conditions, reward);
        let judged = option_task(scenario, &task.states, task.seed.child("judge", 0));
        evaluate(&mut [judged], actor, EPISODES, &mut task.seed.stream("judge", 0))
    };
    Ok([share(0.0)?.success_rate(), share(-1.0)?.success_rate()])
}

fn scenario(task: &LearningTask<'_>, conditions: &Conditions, reward: PseudoReward) -> Scenario {
    Scenario {
        world: task.world.clone(),
        simulator: conditions.simulator.fork(),
        noise: conditions.noise.clone(),
        links: Arc::new([Link::new(Arc::clone(task.option), task.next.cloned())]),
        interface: PolicyInterface::Absolute { reach_m: task.world.robot.waypoint_reach_m },
        reward: Arc::new(reward),
        horizon_share: 1.0,
        ends_at_standstill: false,
        start: RobotState::at_rest(task.option.guide.start()),
    }
}

/// Episodes of `scenario` that begin in `states`.
fn option_task(scenario: Scenario, states: &Arc<InitialStates>, seed: Seed) -> OptionTask {
    OptionTask::new(Arc::new(SingleOption { scenario, states: Arc::clone(states) }), seed)
}

/// Processor time of all threads of this process, seconds; NaN where Linux does not tell.
fn cpu_seconds() -> f64 {
    // Fields 14 and 15 of proc(5), in hundredths; names end at the last bracket.
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(") ").next().unwrap_or_default().split(' ').skip(11).take(2);
    let ticks: Option<Vec<f64>> = fields.map(|field| field.parse().ok()).collect();
    ticks.filter(|ticks| ticks.len() == 2).map_or(f64::NAN, |ticks| (ticks[0] + ticks[1]) / 100.0)
}

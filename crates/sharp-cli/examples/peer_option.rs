//! Our side of `cargo xtask bench peers option`: the longest option of a saved plan, learnt in several
//! ways.
//!
//! `peer_option MAP PLAN paper SEED LIMIT` learns it by the paper's protocol with the hyperparameters of
//! Stable-Baselines3, `tuned` as `--learning paper-tuned` does (but it never begins anew), `scratch` in the guide's frame from fresh networks, each for at most `LIMIT` seconds;
//! `fast SEED` does what the default mode does. Each prints one JSON object. `serve paper|tuned SEED` is
//! the task that is learnt there, for another program: see [`serve`]. Whoever learns is judged by the
//! same rule, see [`judge`].

#![allow(
    clippy::disallowed_methods,
    reason = "an example is a command: it reads its arguments and the clock"
)]

use std::io::{Read, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};
use sharp_drive::{
    InitialStates, Link, OptionTask, PolicyContext, PolicyInterface, Scenario, SingleOption, StateSpread,
    prior_interface,
};
use sharp_guide::{GuidedOption, ProgressReward, PseudoReward, Reward, Role};
use sharp_plan::{Conditions, LearningTask, Method, Plan, TUNED_REWARD};
use sharp_rl::{
    Actor, Environment, Evaluation, StopRule, Stream, TrainError, TrainSettings, evaluate, train,
};
use sharp_sim::RobotState;
use sharp_space::Seed;

/// Success that counts as learnt, share of episodes.
const WANTED: f64 = 0.95;
/// The budget of a side, as in the paper.
const MAX_STEPS: u64 = 150_000;
/// The paper's stop: the mean return of a look.
const STOP_RETURN: f64 = 500.0;
/// Environment steps between two looks at the success.
const JUDGE_EVERY: u64 = 1_000;
/// Episodes of a look, and further ones where these suffice.
const EPISODES: [usize; 2] = [20, 200];
/// States to begin in: as many as the planner draws.
const STATES: usize = 256;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let usage =
        "usage: peer_option MAP PLAN paper|tuned|scratch SEED LIMIT | fast SEED | serve paper|tuned SEED";
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [map, plan, rest @ ..] = &arguments[..] else { return Err(usage.into()) };
    let grid = sharp_maps::load(map, &sharp_maps::LoadOptions::default())?.grid;
    let peer = PeerTask::new(Plan::load(Path::new(plan), grid)?)?;
    let mut report = match rest.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["serve", kind @ ("paper" | "tuned"), seed] => {
            let seed = Seed(seed.parse()?);
            return serve(peer.paper_task(kind == "tuned", seed), seed);
        }
        [kind @ ("paper" | "tuned"), seed, limit] => {
            peer.paper(kind == "tuned", Seed(seed.parse()?), limit.parse()?)?
        }
        ["scratch", seed, limit] => peer.scratch(Seed(seed.parse()?), limit.parse()?)?,
        ["fast", seed] => peer.fast(Seed(seed.parse()?))?,
        _ => return Err(usage.into()),
    };
    report["option"] = json!(peer.option.id.to_string());
    report["length_m"] = json!(peer.option.guide.length_m());
    println!("{report}");
    Ok(())
}

/// The option with all that its tasks are made of.
struct PeerTask {
    plan: Plan,
    conditions: Conditions,
    option: Arc<GuidedOption>,
    next: Option<Arc<GuidedOption>>,
    states: Arc<InitialStates>,
}

impl PeerTask {
    fn new(plan: Plan) -> Outcome<Self> {
        let steps = &plan.solution.steps;
        let length_m = |index: &usize| steps[*index].option.guide.length_m();
        let options = (0..steps.len()).filter(|&index| steps[index].option.id.role() == Role::Option);
        let index = options.max_by(|a, b| length_m(a).total_cmp(&length_m(b)));
        let index = index.ok_or("the plan has no option")?;
        let option = Arc::clone(&steps[index].option);
        let next = steps.get(index + 1).map(|step| Arc::clone(&step.option));
        let states = InitialStates::spread(&plan.world, &option, &StateSpread::default(), STATES, plan.seed);
        let conditions = Conditions::new(&plan.world, plan.noise.clone());
        Ok(Self { option, next, states: Arc::new(states), conditions, plan })
    }

    fn scenario(&self, interface: PolicyInterface, reward: Arc<dyn Reward>) -> Scenario {
        Scenario {
            world: self.plan.world.clone(),
            simulator: self.conditions.simulator.fork(),
            noise: self.plan.noise.clone(),
            links: Arc::new([Link::new(Arc::clone(&self.option), self.next.clone())]),
            interface,
            reward,
            horizon_share: 1.0,
            ends_at_standstill: false,
            start: RobotState::at_rest(self.option.guide.start()),
        }
    }

    fn task(&self, scenario: Scenario, seed: Seed) -> OptionTask {
        OptionTask::new(Arc::new(SingleOption { scenario, states: Arc::clone(&self.states) }), seed)
    }

    /// The paper's observation, action, reward and simulator; `is_tuned`, with what the tuned mode changes of them.
    fn paper_task(&self, is_tuned: bool, seed: Seed) -> OptionTask {
        let interface = PolicyInterface::Absolute { reach_m: self.plan.world.robot.waypoint_reach_m };
        let reward = if is_tuned { TUNED_REWARD } else { PseudoReward::default() };
        let scenario = self.scenario(interface, Arc::new(reward));
        let simulator = self.plan.world.simulator(Method::paper().simulator);
        self.task(Scenario { simulator, ends_at_standstill: is_tuned, ..scenario }, seed)
    }

    fn paper(&self, is_tuned: bool, seed: Seed, limit_s: f64) -> Result<Value, TrainError> {
        let task = |name| self.paper_task(is_tuned, seed.child(name, 0));
        let settings = if is_tuned { TrainSettings::absolute() } else { TrainSettings::default() };
        learn(vec![task("environment")], task("judge"), settings, seed, limit_s)
    }

    /// A correction in the guide's frame, learnt on this option alone.
    fn scratch(&self, seed: Seed, limit_s: f64) -> Result<Value, TrainError> {
        let Plan { world, noise, .. } = &self.plan;
        let interface = prior_interface(&world.robot, PolicyContext::new(noise, 1.0));
        let scenario = self.scenario(interface, Arc::new(ProgressReward::default()));
        let task = |name, index| self.task(scenario.clone(), seed.child(name, index));
        let tasks = (0..16).map(|index| task("environment", index)).collect();
        let settings = TrainSettings::fast().with(|train| train.sac.zero_last_actor_layer = true);
        learn(tasks, task("judge", 0), settings, seed, limit_s)
    }

    /// What a plan does for the option: candidates, estimates, training where none suffices.
    fn fast(&self, seed: Seed) -> Outcome<Value> {
        let method = Method::fast();
        let task = LearningTask {
            world: &self.plan.world,
            conditions: &self.conditions,
            option: &self.option,
            next: self.next.as_ref(),
            tail: &[],
            states: Arc::clone(&self.states),
            wanted_success: method.option_success,
            failure_cost_s: method.failure_cost_s,
            estimate_episodes: method.estimate_episodes,
            seed,
        };
        let clock = Clock::start();
        let learnt = method.learner.learn(&task, &|| false).map_err(|failure| format!("{failure:?}"))?;
        let best = learnt.estimate.count.rate();
        Ok(clock.report(best >= WANTED, best, (learnt.env_steps, learnt.gradient_steps), &[]))
    }
}

/// Trains until [`judge`] is content, the steps of `settings` are used up or `limit_s` have passed.
fn learn(
    mut tasks: Vec<OptionTask>,
    judged: OptionTask,
    settings: TrainSettings,
    seed: Seed,
    limit_s: f64,
) -> Result<Value, TrainError> {
    // The judge outside takes the place of the evaluations inside.
    let settings = settings.with(|train| {
        train.evaluate_every = u64::MAX / 2;
        train.evaluation_episodes = 1;
        train.max_env_steps = MAX_STEPS;
        train.stop = StopRule::Never;
    });
    let (mut judged, mut judge_rng) = ([judged], seed.stream("judge", 0));
    let (mut looks, mut due, mut effort) = (Vec::new(), JUDGE_EVERY, (0, 0));
    let mut stop = Value::Null;
    let mut failure = None;
    let clock = Clock::start();
    train(&mut tasks, &settings, &mut seed.stream("sac", 0), &mut |progress| {
        effort = (progress.env_steps, progress.updates);
        if effort.0 >= due {
            due += JUDGE_EVERY;
            let mut at_first = |first: &Evaluation| {
                if stop.is_null() && first.mean_return >= STOP_RETURN {
                    stop = clock.spent(effort.0);
                }
            };
            match judge(&mut judged, progress.actor, &mut judge_rng, &mut at_first) {
                Ok(rate) => looks.push((effort.0, rate)),
                Err(error) => failure = Some(error),
            }
        }
        let reached = looks.last().is_some_and(|look| look.1 >= WANTED);
        let is_over = reached || failure.is_some() || clock.seconds() > limit_s;
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    failure.map_or(Ok(()), Err)?;
    let best = looks.iter().map(|look| look.1).fold(0.0, f64::max);
    let mut report = clock.report(best >= WANTED, best, effort, &looks);
    report["stop"] = stop;
    Ok(report)
}

/// The success rate of the most likely actions: over the first episodes where it is too low, and
/// otherwise over many fresh ones, because the best of many short looks is lucky. `at_first` is told
/// what the first ones gave.
fn judge(
    task: &mut [OptionTask],
    actor: &Actor,
    rng: &mut Stream,
    at_first: &mut dyn FnMut(&Evaluation),
) -> Result<f64, TrainError> {
    let [few, many] = EPISODES;
    let first = evaluate(task, actor, few, rng)?;
    at_first(&first);
    let rate = first.success_rate();
    if rate < WANTED {
        return Ok(rate);
    }
    // A policy that succeeded at first is worth no more than what it does then.
    evaluate(task, actor, many, rng).map(|second| second.success_rate().min(rate))
}

/// Time since the beginning, by the wall and by the processor.
struct Clock {
    begun: Instant,
    cpu_s: f64,
}

impl Clock {
    fn start() -> Self {
        Self { begun: Instant::now(), cpu_s: cpu_seconds() }
    }

    fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// What it took to come here.
    fn spent(&self, steps: u64) -> Value {
        json!({"seconds": self.seconds(), "cpu_seconds": cpu_seconds() - self.cpu_s, "steps": steps})
    }

    /// The JSON object on stdout; `looks` are pairs of steps and success.
    fn report(&self, reached: bool, best: f64, (steps, updates): (u64, u64), looks: &[(u64, f64)]) -> Value {
        json!({
            "name": "sharp", "reached": reached, "seconds": self.seconds(),
            "cpu_seconds": cpu_seconds() - self.cpu_s, "steps": steps, "updates": updates,
            "best": best, "looks": looks,
        })
    }
}

/// Processor time of all threads of this process, seconds; NaN where Linux does not tell.
fn cpu_seconds() -> f64 {
    // Fields 14 and 15 of proc(5), in hundredths; names end at the last bracket.
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(") ").next().unwrap_or_default().split(' ').skip(11).take(2);
    let ticks: Option<Vec<f64>> = fields.map(|field| field.parse().ok()).collect();
    ticks.filter(|ticks| ticks.len() == 2).map_or(f64::NAN, |ticks| (ticks[0] + ticks[1]) / 100.0)
}

/// Runs `task` for whoever writes requests to stdin and reads answers from stdout.
///
/// First come the lengths of observation and action, each four bytes, little endian as all that
/// follows. The request `r` begins an episode and is answered by the observation; the request `s`
/// with the components of an action makes a step and is answered by the observation, the reward and
/// a byte: 1 for terminated, 2 for truncated, 4 for success. Components and rewards are `f32`.
fn serve(mut task: OptionTask, seed: Seed) -> Outcome<()> {
    let (mut requests, mut answers) = (std::io::stdin().lock(), std::io::stdout().lock());
    let spec = task.spec();
    let (mut observation, mut action) = (vec![0.0; spec.observation_len], vec![0.0_f32; spec.action_len]);
    for length in [spec.observation_len, spec.action_len] {
        answers.write_all(&(length as u32).to_le_bytes())?;
    }
    answers.flush()?;
    let mut rng = seed.stream("episodes", 0);
    let mut request = [0];
    while requests.read(&mut request)? == 1 {
        let mut end = Vec::new();
        if request == *b"r" {
            task.reset(&mut rng, &mut observation);
        } else {
            for component in &mut action {
                let mut bytes = [0; 4];
                requests.read_exact(&mut bytes)?;
                *component = f32::from_le_bytes(bytes);
            }
            let step = task.step(&action, &mut observation);
            end.extend(step.reward.to_le_bytes());
            end.push(u8::from(step.terminated) | u8::from(step.truncated) << 1 | u8::from(step.success) << 2);
        }
        let mut answer: Vec<u8> = observation.iter().flat_map(|value| value.to_le_bytes()).collect();
        answer.extend(end);
        answers.write_all(&answer)?;
        answers.flush()?;
    }
    Ok(())
}

//! Options and whole problems as tasks for learners in Python, several side by side.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rand::SeedableRng;
use rayon::prelude::*;
use sharp_bench::named;
use sharp_drive::{
    InitialStates, Link, OptionPolicy, OptionTask, PolicyContext, PolicyInterface, Scenario, SingleOption,
    prior_interface,
};
use sharp_guide::{ProgressReward, PseudoReward, Reward};
use sharp_rl::{Environment, Step};
use sharp_sim::RobotState;
use sharp_space::{Seed, Stream};

use crate::error::Raised;
use crate::plan::PyPlan;
use crate::policy::{from_bytes, to_bytes};
use crate::solve::simulator;

/// Initial states that episodes of an option draw from.
const STATE_POOL: usize = 200;

/// How a task is made.
#[derive(FromPyObject)]
struct TaskOptions {
    /// The leg of the plan; none for all of them, from start to goal.
    leg: Option<usize>,
    count: usize,
    observation: String,
    reward: String,
    noise: Option<String>,
    simulator: String,
}

/// Tasks of one kind side by side.
#[pyclass(frozen, module = "sharp._core")]
pub(crate) struct Tasks {
    slots: Mutex<Vec<Slot>>,
    observation_len: usize,
}

struct Slot {
    task: OptionTask,
    has_begun: bool,
    stream: Stream,
    observation: Vec<f32>,
    step: Step,
}

/// Observations and rewards as 32-bit floats, and for each slot: terminated 1, truncated 2, success 4.
type Answer<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>);

#[pymethods]
impl Tasks {
    #[new]
    fn new(plan: &PyPlan, options: TaskOptions) -> PyResult<Self> {
        let scenario = scenario(plan, &options)?;
        let (world, start) = (&scenario.world, scenario.start);
        let states = match options.leg {
            None => InitialStates::exactly(start),
            Some(_) => {
                let option = &scenario.links[0].option;
                InitialStates::of_option(world, option, plan.plan.solution.query.start, STATE_POOL, Seed(1))
            }
        };
        let observation_len = scenario.interface.observation_len();
        let source = Arc::new(SingleOption { scenario, states: Arc::new(states) });
        let slot = |index: usize| Slot {
            task: OptionTask::new(source.clone(), Seed(1)),
            has_begun: false,
            stream: Stream::seed_from_u64(index as u64),
            observation: vec![0.0; observation_len],
            step: Step::default(),
        };
        Ok(Self { slots: Mutex::new((0..options.count).map(slot).collect()), observation_len })
    }

    #[getter]
    fn observation_len(&self) -> usize {
        self.observation_len
    }

    #[getter]
    fn action_len(&self) -> usize {
        PolicyInterface::ACTION_LEN
    }

    /// Begins an episode in slot `index`; with a seed its episodes begin anew. Returns the observation.
    fn reset<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        seed: Option<u64>,
    ) -> Result<Bound<'py, PyBytes>, Raised> {
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        let count = slots.len();
        let Some(slot) = slots.get_mut(index) else {
            return Err(Raised::new("USAGE", format!("slot is {index}, expected below {count}")));
        };
        if let Some(seed) = seed {
            slot.stream = Stream::seed_from_u64(seed);
        }
        slot.begin();
        Ok(to_bytes(py, &slot.observation))
    }

    /// One action in each slot; those in `begins` (a byte a slot, 1 for yes) begin an episode instead.
    fn step<'py>(&self, py: Python<'py>, actions: &[u8], begins: &[u8]) -> Result<Answer<'py>, Raised> {
        let actions = from_bytes(actions);
        let wanted = begins.len() * PolicyInterface::ACTION_LEN;
        // A NaN would stay in what the robot remembers of its last action.
        if let Some(number) = actions.iter().find(|number| !number.is_finite()) {
            return Err(Raised::new(
                "USAGE",
                format!("an action is {number}, expected numbers from -1 to 1"),
            ));
        }
        let result = py.detach(|| {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            if actions.len() != wanted || begins.len() != slots.len() {
                return Err(format!("{} numbers of actions, expected {wanted}", actions.len()));
            }
            if slots.iter().zip(begins).any(|(slot, begins)| !slot.has_begun && *begins != 1) {
                return Err("reset comes before step".to_owned());
            }
            let given = actions.par_chunks_exact(PolicyInterface::ACTION_LEN).zip(begins);
            let each = slots.par_iter_mut().zip(given);
            each.for_each(|(slot, (action, begins))| slot.step(action, *begins == 1));
            let observations: Vec<f32> =
                slots.iter().flat_map(|slot| slot.observation.iter().copied()).collect();
            let rewards: Vec<f32> = slots.iter().map(|slot| slot.step.reward).collect();
            let flags: Vec<u8> = slots.iter().map(|slot| flags(&slot.step)).collect();
            Ok((observations, rewards, flags))
        });
        let (observations, rewards, flags) = result.map_err(|message| Raised::new("USAGE", message))?;
        Ok((to_bytes(py, &observations), to_bytes(py, &rewards), PyBytes::new(py, &flags)))
    }
}

impl Slot {
    fn begin(&mut self) {
        self.task.reset(&mut self.stream, &mut self.observation);
        self.has_begun = true;
    }

    fn step(&mut self, action: &[f32], begins: bool) {
        if begins {
            self.begin();
            self.step = Step::default();
        } else {
            let action: Vec<f32> = action.iter().map(|part| part.clamp(-1.0, 1.0)).collect();
            self.step = self.task.step(&action, &mut self.observation);
        }
    }
}

fn flags(step: &Step) -> u8 {
    u8::from(step.terminated) | u8::from(step.truncated) << 1 | u8::from(step.success) << 2
}

const fn is_in_guide(interface: &PolicyInterface) -> bool {
    matches!(interface, PolicyInterface::Guide { .. })
}

fn scenario(plan: &PyPlan, options: &TaskOptions) -> Result<Scenario, Raised> {
    let (solved, world) = (&plan.plan, plan.plan.world.clone());
    let steps = &solved.solution.steps;
    let noise = match &options.noise {
        Some(name) => named::noise(name)?,
        None => solved.noise.clone(),
    };
    let links: Vec<Link> = match options.leg {
        Some(index) => {
            let next = steps.get(index + 1).map(|step| Arc::clone(&step.option));
            vec![Link::new(Arc::clone(&plan.step(index)?.option), next)]
        }
        None => Link::chain(&steps.iter().map(|step| Arc::clone(&step.option)).collect::<Vec<_>>()),
    };
    let driven = &steps[options.leg.unwrap_or(0)].learnt.policy;
    let interface = match (options.observation.as_str(), driven) {
        ("absolute", _) => PolicyInterface::Absolute { reach_m: world.robot.waypoint_reach_m },
        // What the plan's own network is told, so that it can drive here.
        ("guide", OptionPolicy::Network(network)) if is_in_guide(&network.interface) => network.interface,
        ("guide", _) => prior_interface(&world.robot, PolicyContext::new(&noise, 1.0)),
        (other, _) => {
            let message = format!("observation is {other:?}, expected guide or absolute");
            return Err(Raised::new("USAGE", message));
        }
    };
    let reward: Arc<dyn Reward> = match options.reward.as_str() {
        "progress" => Arc::new(ProgressReward::default()),
        "paper" => Arc::new(PseudoReward::default()),
        other => {
            let message = format!("reward is {other:?}, expected progress or paper");
            return Err(Raised::new("USAGE", message));
        }
    };
    Ok(Scenario {
        simulator: world.simulator(simulator(&options.simulator)?),
        start: RobotState::at_rest(solved.solution.query.start),
        horizon_share: 1.0,
        ends_at_standstill: false,
        links: links.into(),
        world,
        noise,
        interface,
        reward,
    })
}

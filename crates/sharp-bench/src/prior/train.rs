//! The training of a prior, stage by stage; what an interrupted run has learnt is a few bytes.

use std::ops::ControlFlow;
use std::sync::Arc;

use sharp_drive::{DrivingBatch, Prior};
use sharp_plan::{RouteScenarios, hash};
use sharp_rl::{
    Actor, BatchEnvironment, PpoState, Progress, StopReason, StoreError, TrainError, resume_ppo, train_ppo,
};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::Seed;
use thiserror::Error;

use super::courses::PriorCourses;
use super::recipe::{PriorRecipe, PriorStage};

/// First word of a saved state; the number is the version of the format.
const STATE_FORMAT: &str = "sharp.prior.state/2";

/// Why no prior came out.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PriorTrainError {
    /// No plan in any of the generated maps.
    #[error("no course in {map_count} maps for {robot}")]
    NoCourse {
        /// Maps generated.
        map_count: u32,
        /// The robot's name.
        robot: String,
    },
    /// The saved state cannot be read.
    #[error("the saved state beside the output: {0}; remove it to train from nothing")]
    State(String),
    /// Learning failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The trained network is no prior.
    #[error(transparent)]
    Prior(#[from] StoreError),
}

/// How a training ended.
#[derive(Debug)]
pub enum PriorEnd {
    /// With a prior.
    Trained {
        /// The prior.
        prior: Box<Prior>,
        /// Steps of all stages together, those before an interruption included.
        env_steps: u64,
        /// Gradient steps of all stages together.
        updates: u64,
        /// Routes that the last stage drove on.
        courses: usize,
        /// Share of the last training episodes that succeeded, with the noise in the actions.
        success: f64,
    },
    /// The observer stopped it.
    Interrupted,
}

/// What an observer of a training sees.
#[derive(Debug)]
#[non_exhaustive]
pub struct PriorProgress<'a> {
    /// The stage, from 0.
    pub stage: usize,
    /// Steps of the stages before.
    pub steps_before: u64,
    /// What the learner says; its steps are those of this stage.
    pub learner: &'a Progress<'a>,
    /// The hash of robot, recipe and seed.
    training: &'a str,
}

impl PriorProgress<'_> {
    /// The bytes from which the same training goes on.
    #[must_use]
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        Some(saved((self.training, self.stage), &self.learner.checkpoint()?))
    }
}

/// Trains the prior of `robot` as `recipe` says, or goes on from the bytes of an interrupted training.
///
/// Equal recipes and seeds give equal bytes, interrupted or not, on one kind of processor. `on_map` is called after
/// each map in which routes were planned, `observer` after each iteration of learning.
///
/// # Errors
/// If there is nothing to drive on, if the saved state belongs to another training, or if learning diverges.
pub fn train_prior(
    (robot, recipe, seed): (&RobotModel, &PriorRecipe, Seed),
    interrupted: Option<&[u8]>,
    on_map: &(dyn Fn() + Sync),
    observer: &mut dyn FnMut(&PriorProgress<'_>) -> ControlFlow<()>,
) -> Result<PriorEnd, PriorTrainError> {
    let training = hash(format!("{robot:?} {recipe:?} {seed:?}").as_bytes());
    let (first, mut state) = match interrupted {
        Some(bytes) => {
            let (stage, state) = read_saved(bytes, (&training, recipe.stages.len()))?;
            (stage, Some(state))
        }
        None => (0, None),
    };
    let mut actor: Option<Actor> = None;
    let before = |stage: usize| recipe.stages[..stage].iter().map(|stage| stage.ppo.max_env_steps).sum();
    let (mut updates, mut env_steps, mut courses, mut success) = (0, before(first), 0, 0.0);
    for (index, stage) in recipe.stages.iter().enumerate().skip(first) {
        let seed = seed.child("stage", index as u64);
        let Some((mut batch, count)) = batch(robot, stage, seed, on_map) else {
            let robot = robot.name.clone();
            return Err(PriorTrainError::NoCourse { map_count: stage.map_count, robot });
        };
        courses = count;
        let steps_before = before(index);
        let mut note = |progress: &Progress<'_>| {
            success = progress.recent_success_rate;
            observer(&PriorProgress { stage: index, steps_before, learner: progress, training: &training })
        };
        let mut rng = seed.stream("ppo", 0);
        let (end, stop) = match (state.take(), actor.take()) {
            (Some(state), _) => resume_ppo(&mut batch, state, &stage.ppo, &mut note)?,
            (None, Some(actor)) => {
                let state = PpoState::with_actor(actor, &batch.spec(), &stage.ppo, &mut rng);
                resume_ppo(&mut batch, state, &stage.ppo, &mut note)?
            }
            (None, None) => train_ppo(&mut batch, &stage.ppo, &mut rng, &mut note)?,
        };
        if stop == StopReason::Observer && end.env_steps < stage.ppo.max_env_steps {
            return Ok(PriorEnd::Interrupted);
        }
        updates += end.updates;
        env_steps += end.env_steps;
        actor = Some(end.actor);
    }
    let actor = actor.ok_or_else(|| PriorTrainError::State("a recipe without stages".to_owned()))?;
    Ok(PriorEnd::Trained { prior: Box::new(Prior::new(actor)?), env_steps, updates, courses, success })
}

/// The episodes of `stage`, and the number of routes they drive on; `None` if there are none.
fn batch(
    robot: &RobotModel,
    stage: &PriorStage,
    seed: Seed,
    on_map: &(dyn Fn() + Sync),
) -> Option<(DrivingBatch, usize)> {
    let routes = PriorCourses::training(robot, seed).routes(stage.map_count, on_map);
    let count = routes.len();
    if count == 0 {
        return None;
    }
    let noises = Arc::new(vec![NoiseModel::nominal(), NoiseModel::harsh(), NoiseModel::biased()]);
    let scenarios = RouteScenarios::new(Arc::new(routes), noises, stage.strengths.clone());
    Some((DrivingBatch::new(Arc::new(scenarios), stage.slots, seed.child("environment", 0)), count))
}

/// A saved state: format, hash of the training, stage and hash of the rest in a line of text, then the learner's state.
fn saved((training, stage): (&str, usize), state: &[u8]) -> Vec<u8> {
    let mut bytes = format!("{STATE_FORMAT} {training} {stage} {}\n", hash(state)).into_bytes();
    bytes.extend_from_slice(state);
    bytes
}

fn read_saved(bytes: &[u8], (training, stages): (&str, usize)) -> Result<(usize, PpoState), PriorTrainError> {
    let broken = |what: &str| PriorTrainError::State(what.to_owned());
    let line = bytes.iter().position(|&byte| byte == b'\n').ok_or_else(|| broken("no first line"))?;
    let (head, state) = (String::from_utf8_lossy(&bytes[..line]), &bytes[line + 1..]);
    let words: Vec<&str> = head.split(' ').collect();
    let format = words[0];
    if format != STATE_FORMAT {
        return Err(PriorTrainError::State(format!("format {format:?}, expected {STATE_FORMAT:?}")));
    }
    let [_, found, stage, sum] = words[..] else { return Err(broken("a first line of other words")) };
    if found != training {
        return Err(broken("another robot, recipe or seed"));
    }
    if sum != hash(state) {
        return Err(broken("the bytes do not have their hash"));
    }
    match stage.parse() {
        Ok(stage) if stage < stages => Ok((stage, PpoState::from_bytes(state)?)),
        _ => Err(PriorTrainError::State(format!("stage {stage}, the recipe has {stages}"))),
    }
}

#[cfg(test)]
mod tests {
    use sharp_rl::Schedule;

    use super::*;

    /// Two short stages.
    fn recipe() -> PriorRecipe {
        let mut stage = PriorRecipe::tiny().stages.remove(0);
        (stage.map_count, stage.slots) = (2, 8);
        stage.ppo.max_env_steps = 640;
        stage.ppo.rollout_steps = Schedule::constant(20.0);
        stage.ppo.hidden = vec![8];
        let mut second = stage.clone();
        second.ppo.actor_waits = 1;
        PriorRecipe { stages: vec![stage, second] }
    }

    /// Trains, or goes on; stops at the given call of the observer and returns what was saved.
    fn run(interrupted: Option<&[u8]>, stop_at: u32) -> (PriorEnd, Option<Vec<u8>>) {
        let (mut calls, mut last) = (0, None);
        let mut observer = |progress: &PriorProgress<'_>| {
            calls += 1;
            last = progress.checkpoint();
            if calls == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let robot = RobotModel::husky();
        let end = train_prior((&robot, &recipe(), Seed(1)), interrupted, &|| (), &mut observer);
        (end.expect("there are courses"), last)
    }

    #[test]
    fn an_interrupted_training_gives_the_bytes_of_an_uninterrupted_one() {
        let bytes = |end: PriorEnd| match end {
            PriorEnd::Trained { prior, env_steps, .. } => {
                assert_eq!(env_steps, 1280);
                prior.to_bytes()
            }
            PriorEnd::Interrupted => panic!("nobody stopped it"),
        };
        let whole = bytes(run(None, 0).0);
        for stop_at in [2, 6] {
            let (end, saved) = run(None, stop_at);
            assert!(matches!(end, PriorEnd::Interrupted), "stopped at {stop_at}");
            let saved = saved.expect("a state");
            assert!(bytes(run(Some(&saved), 0).0) == whole, "stopped at {stop_at}: other bytes");
        }
    }

    #[test]
    fn a_damaged_state_is_refused() {
        let refusal = |bytes: &[u8]| read_saved(bytes, ("here", 1)).expect_err("damaged").to_string();
        let saved = |stage, state: &[u8]| saved(("here", stage), state);
        assert!(refusal(b"sharp").contains("no first line"), "cut short");
        assert!(refusal(b"sharp.prior.state/0 0 abc\n").contains("format"), "another version");
        let other = super::saved(("there", 0), b"state");
        assert!(refusal(&other).contains("another robot, recipe or seed"), "another robot");
        let mut bytes = saved(0, b"state");
        bytes.push(b'!');
        assert!(refusal(&bytes).contains("the bytes do not have their hash"), "damaged");
        assert!(refusal(&saved(3, b"state")).contains("stage 3, the recipe has 1"), "another recipe");
    }
}

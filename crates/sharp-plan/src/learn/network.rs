//! Training the network of one option by whatever [`Learner`] is at hand.

use std::ops::ControlFlow;
use std::sync::Arc;

use sharp_drive::{
    Link, NetworkPolicy, OptionPolicy, OptionTask, PolicyInterface, Scenario, SingleOption, SuccessCount,
};
use sharp_guide::Reward;
use sharp_rl::{Actor, Environment, Evaluation, Learner, Progress};
use sharp_sim::RobotState;

use super::{
    InterruptedTraining, LearnFailure, LearningMonitor, LearningTask, LearntPolicy, Training, TrainingFile,
    TrainingPoint,
};

/// A training is kept after every evaluation, and where evaluations are rare after so many steps: a few seconds of the
/// paper's mode.
const SAVE_EVERY: u64 = 2_000;

/// How a network is trained.
#[derive(Clone, Debug)]
pub(crate) struct NetworkTraining<'a> {
    pub(crate) interface: PolicyInterface,
    pub(crate) reward: Arc<dyn Reward>,
    pub(crate) learner: &'a dyn Learner,
    /// Whether an episode in which the robot stands still is out of time.
    pub(crate) ends_at_standstill: bool,
    /// Environments that are stepped in turn.
    pub(crate) environments: u64,
}

/// Trains a network on the option of `task` and estimates how often it succeeds by the reward's rule of contacts. Goes on with what `monitor` keeps of an
/// interrupted training.
pub(crate) fn train_network(
    task: &LearningTask<'_>,
    training: &NetworkTraining<'_>,
    monitor: &dyn LearningMonitor,
) -> Result<LearntPolicy, LearnFailure> {
    let source =
        Arc::new(SingleOption { scenario: scenario(task, training), states: Arc::clone(&task.states) });
    let environment = |index| -> Box<dyn Environment> {
        Box::new(OptionTask::new(Arc::clone(&source) as _, task.seed.child("environment", index)))
    };
    let mut environments: Vec<_> = (0..training.environments).map(environment).collect();
    let interrupted = monitor.training_file().map_or(Ok(None), TrainingFile::interrupted);
    let InterruptedTraining { checkpoint, mut points } =
        interrupted.map_err(LearnFailure::File)?.unwrap_or_default();
    for point in &points {
        monitor.evaluated(point);
    }
    let (mut is_due, mut saved_at) = (false, 0);
    let mut observer = |progress: &Progress<'_>| {
        monitor.trained(progress);
        if let Some(evaluation) = &progress.evaluation {
            let point = training_point(task, training, progress.actor, evaluation);
            monitor.evaluated(&point);
            points.push(point);
        }
        let should_stop = monitor.should_stop();
        is_due |= progress.env_steps >= saved_at + SAVE_EVERY;
        if let Some(file) = monitor.training_file().filter(|_| is_due || should_stop)
            // A run may end with an evaluation, so none continues from one.
            && progress.evaluation.is_none()
            && let Some(checkpoint) = progress.checkpoint()
        {
            file.save(&checkpoint, &points);
            (is_due, saved_at) = (false, progress.env_steps);
        }
        is_due |= progress.evaluation.is_some();
        if should_stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let trained = match training.learner.resume(&checkpoint, &mut environments, &mut observer) {
        Some(trained) => trained,
        None => {
            let mut rng = task.seed.stream("sac", 0);
            training.learner.learn(&mut environments, &mut rng, &mut observer)
        }
    };
    let trained = trained.map_err(LearnFailure::Broken)?;
    if monitor.should_stop() {
        return Err(LearnFailure::Stopped);
    }
    let policy = network_policy(training, &trained.actor);
    // In the paper a robot may touch a wall and go on. That counts as a success here too, whatever a contact costs the learner:
    // the search is to know how long the option takes.
    let trial = task.monte_carlo(task.estimate_episodes, "certify", 0);
    let trial = trial.with_contact_ends(training.reward.contact_ends());
    let estimate = trial.estimate(&task.drivers(&policy)[..1], &task.states);
    let record = Training {
        stop: trained.stop,
        mean_return: trained.evaluation.mean_return,
        points,
        failed_before: 0,
    };
    Ok(LearntPolicy {
        env_steps: trained.env_steps,
        gradient_steps: trained.updates,
        training: Some(record),
        ..LearntPolicy::untrained(policy, estimate)
    })
}

fn network_policy(training: &NetworkTraining<'_>, actor: &Actor) -> OptionPolicy {
    OptionPolicy::Network(NetworkPolicy::new(training.interface, Arc::new(actor.clone())))
}

/// What `evaluation` showed of `actor`, and what it holds where a contact is a failure.
fn training_point(
    task: &LearningTask<'_>,
    training: &NetworkTraining<'_>,
    actor: &Actor,
    evaluation: &Evaluation,
) -> TrainingPoint {
    let Evaluation { episodes, successes, mean_return, env_steps, .. } = *evaluation;
    let success = SuccessCount { episodes: episodes as u32, successes: successes as u32 };
    let without_contact = if training.reward.contact_fails() {
        success
    } else {
        let policy = network_policy(training, actor);
        let trial = task.monte_carlo(success.episodes, "without contact", env_steps);
        trial.estimate(&task.drivers(&policy)[..1], &task.states).count
    };
    TrainingPoint { env_steps, mean_return, success, without_contact }
}

fn scenario(task: &LearningTask<'_>, training: &NetworkTraining<'_>) -> Scenario {
    Scenario {
        world: task.world.clone(),
        simulator: task.conditions.simulator.fork(),
        noise: task.conditions.noise.clone(),
        links: Arc::new([Link::new(Arc::clone(task.option), task.next.cloned())]),
        interface: training.interface,
        reward: Arc::clone(&training.reward),
        horizon_share: 1.0,
        ends_at_standstill: training.ends_at_standstill,
        start: RobotState::at_rest(task.option.guide.start()),
    }
}

//! Training the network of one option by whatever [`Learner`] is at hand.

use std::ops::ControlFlow;
use std::sync::Arc;

use sharp_drive::{Link, NetworkPolicy, OptionPolicy, OptionTask, PolicyInterface, Scenario, SingleOption};
use sharp_guide::Reward;
use sharp_rl::{Environment, Learner, Progress};
use sharp_sim::RobotState;

use super::{LearnFailure, LearningMonitor, LearningTask, LearntPolicy};

/// How a network is trained.
#[derive(Clone, Debug)]
pub(crate) struct NetworkTraining<'a> {
    pub(crate) interface: PolicyInterface,
    pub(crate) reward: Arc<dyn Reward>,
    pub(crate) learner: &'a dyn Learner,
    /// Environments that are stepped in turn.
    pub(crate) environments: u64,
}

/// Trains a network on the option of `task` and estimates how often it succeeds.
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
    let mut observer = |progress: &Progress<'_>| {
        monitor.trained(progress);
        if monitor.should_stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut rng = task.seed.stream("sac", 0);
    let trained = training.learner.learn(&mut environments, &mut rng, &mut observer);
    let trained = trained.map_err(LearnFailure::Broken)?;
    if monitor.should_stop() {
        return Err(LearnFailure::Stopped);
    }
    let network = NetworkPolicy::new(training.interface, Arc::new(trained.actor));
    let policy = OptionPolicy::Network(network);
    let estimate = task.estimate(&policy);
    Ok(LearntPolicy { policy, estimate, env_steps: trained.env_steps, gradient_steps: trained.updates })
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
        start: RobotState::at_rest(task.option.guide.start()),
    }
}

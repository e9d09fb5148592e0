//! The losses of soft actor-critic through burn's autodiff: an independent check of [`FusedSac`].
//!
//! [`FusedSac`]: crate::fused::FusedSac

use burn::prelude::{Device, Tensor, TensorData};
use burn::tensor::activation::relu;

use crate::actor::{Actor, LOG_STD_MAX, LOG_STD_MIN};
use crate::buffer::Batch;
use crate::gradients::{ActorLoss, CriticLoss, SacGradients};
use crate::network::Mlp;
use crate::sac_state::SacState;

/// [`SacGradients`] by burn's autodiff on its flex backend.
///
/// Parameters are copied to burn for each pass and gradients are copied back. Noise and initial
/// weights come from the caller, so burn's own generator is never used.
#[derive(Debug)]
pub(crate) struct BurnSac {
    plain: Device,
    tracked: Device,
}

impl BurnSac {
    /// On the CPU.
    pub(crate) fn new() -> Self {
        Self { plain: Device::flex(), tracked: Device::flex().autodiff() }
    }

    fn tensor(&self, data: &[f32], rows: usize) -> Tensor<2> {
        matrix(data, rows, &self.plain)
    }
}

impl SacGradients for BurnSac {
    fn targets(&mut self, state: &SacState, batch: &Batch, targets: &mut [f32]) {
        let next = self.tensor(&batch.next_observations, batch.len);
        let actor = BurnMlp::constant(state.actor.network(), &self.plain);
        let policy = sample(&state.actor, &actor, next.clone(), self.tensor(&batch.next_noise, batch.len));
        let inputs = Tensor::cat(vec![next, policy.actions], 1);
        let [first, second] =
            state.targets.each_ref().map(|q| BurnMlp::constant(q, &self.plain).forward(inputs.clone()));
        let value = first.min_pair(second) - policy.log_probabilities * state.alpha();
        let y = self.tensor(&batch.rewards, batch.len) + self.tensor(&batch.discounts, batch.len) * value;
        targets.copy_from_slice(&values(y));
    }

    fn critic_gradients(
        &mut self,
        state: &SacState,
        batch: &Batch,
        targets: &[f32],
        gradients: &mut [Vec<f32>; 2],
    ) -> CriticLoss {
        let observations = self.tensor(&batch.observations, batch.len);
        let inputs = Tensor::cat(vec![observations, self.tensor(&batch.actions, batch.len)], 1);
        let y = self.tensor(targets, batch.len);
        let critics = state.critics.each_ref().map(|q| BurnMlp::tracked(q, &self.tracked));
        let outputs = critics.each_ref().map(|q| q.forward(inputs.clone()));
        let mean_q = scalar(outputs[0].clone().mean());
        let [first, second] = outputs.map(|q| (q - y.clone()).square().mean() * 0.5);
        let loss = first + second;
        let found = loss.backward();
        for (critic, gradient) in critics.iter().zip(gradients) {
            critic.gather(&found, gradient);
        }
        CriticLoss { loss: scalar(loss), mean_q }
    }

    fn actor_gradient(&mut self, state: &SacState, batch: &Batch, gradient: &mut [f32]) -> ActorLoss {
        let observations = self.tensor(&batch.observations, batch.len);
        let actor = BurnMlp::tracked(state.actor.network(), &self.tracked);
        let policy = sample(&state.actor, &actor, observations.clone(), self.tensor(&batch.noise, batch.len));
        let inputs = Tensor::cat(vec![observations, policy.actions], 1);
        // The critics are constants here, because their weight gradients are not needed.
        let [first, second] =
            state.critics.each_ref().map(|q| BurnMlp::constant(q, &self.plain).forward(inputs.clone()));
        let loss = (policy.log_probabilities.clone() * state.alpha() - first.min_pair(second)).mean();
        actor.gather(&loss.backward(), gradient);
        let mean_log_probability = scalar(policy.log_probabilities.mean());
        ActorLoss { loss: scalar(loss), mean_log_probability }
    }
}

/// A network as tensors. For each layer: weights (outputs x inputs) and bias (1 x outputs).
struct BurnMlp(Vec<(Tensor<2>, Tensor<2>)>);

impl BurnMlp {
    fn constant(network: &Mlp, device: &Device) -> Self {
        let layers = (0..network.layer_count()).map(|index| {
            let layer = network.layer(index);
            (matrix(layer.weights, layer.bias.len(), device), matrix(layer.bias, 1, device))
        });
        Self(layers.collect())
    }

    fn tracked(network: &Mlp, device: &Device) -> Self {
        let layers = Self::constant(network, device).0.into_iter();
        Self(layers.map(|(w, b)| (w.require_grad(), b.require_grad())).collect())
    }

    /// Batch x inputs to batch x outputs.
    fn forward(&self, mut x: Tensor<2>) -> Tensor<2> {
        for (index, (weights, bias)) in self.0.iter().enumerate() {
            x = x.matmul(weights.clone().transpose()) + bias.clone();
            if index + 1 < self.0.len() {
                x = relu(x);
            }
        }
        x
    }

    /// Writes this network's gradients in the order of [`Mlp::parameters`].
    fn gather(&self, found: &burn::tensor::Gradients, gradient: &mut [f32]) {
        let tensors = self.0.iter().flat_map(|(weights, bias)| [weights, bias]);
        let mut rest = gradient;
        for tensor in tensors {
            let part = values(tensor.grad(found).expect("every layer takes part in the loss"));
            let (head, tail) = rest.split_at_mut(part.len());
            head.copy_from_slice(&part);
            rest = tail;
        }
    }
}

struct PolicyTensors {
    /// Batch x action.
    actions: Tensor<2>,
    /// Batch x 1.
    log_probabilities: Tensor<2>,
}

/// Draws actions at normalised observations, with the formulas of the hand-written version.
fn sample(actor: &Actor, network: &BurnMlp, observations: Tensor<2>, noise: Tensor<2>) -> PolicyTensors {
    let action_len = actor.spec().action_len;
    let outputs = network.forward(observations);
    let means = outputs.clone().narrow(1, 0, action_len);
    let log_stds = outputs.narrow(1, action_len, action_len).clamp(LOG_STD_MIN, LOG_STD_MAX);
    let u = means + log_stds.clone().exp() * noise.clone();
    // softplus(-2u) in a form that cannot overflow.
    let softplus = relu(u.clone() * -2.0) + (u.clone().abs() * -2.0).exp().log1p();
    let squash = (u.clone() + softplus) * 2.0 - 2.0 * std::f32::consts::LN_2;
    let gauss = noise.square() * -0.5 - 0.5 * std::f32::consts::TAU.ln();
    let log_probabilities = (gauss - log_stds + squash).sum_dim(1);
    PolicyTensors { actions: u.tanh(), log_probabilities }
}

fn matrix(data: &[f32], rows: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(data.to_vec(), [rows, data.len() / rows]), device)
}

fn values(tensor: Tensor<2>) -> Vec<f32> {
    tensor.into_data().try_to_vec().expect("tensors here hold f32")
}

fn scalar(tensor: Tensor<1>) -> f32 {
    tensor.into_scalar::<f32>()
}

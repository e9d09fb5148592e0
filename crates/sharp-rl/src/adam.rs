//! The Adam optimiser (Kingma and Ba, 2015) over a parameter vector, as one loop.

/// Moment estimates of one parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Running mean of the gradient.
    pub first: Vec<f32>,
    /// Running mean of its square.
    pub second: Vec<f32>,
    /// Steps taken.
    pub steps: u64,
}

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
/// `PyTorch`'s value; burn's own default is 1e-5.
const EPSILON: f32 = 1e-8;
/// A moment below is zero: it moves no parameter that is not as small itself. Those of units that are silent would decay into
/// subnormal numbers, with which processors compute a hundred times as slowly: a fifth of a long training went into that.
const NOTHING: f32 = 1e-30;

impl Adam {
    /// Moments of `len` parameters before the first step.
    #[must_use]
    pub fn new(len: usize) -> Self {
        Self { first: vec![0.0; len], second: vec![0.0; len], steps: 0 }
    }

    /// Moves `parameters` against `gradient`.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn step(&mut self, learning_rate: f32, parameters: &mut [f32], gradient: &[f32]) {
        assert_eq!(parameters.len(), self.first.len(), "parameters of another network");
        assert_eq!(gradient.len(), self.first.len(), "gradient of another network");
        self.steps += 1;
        let steps = self.steps.min(1 << 24) as i32; // Long before, both corrections are 1.
        let step_size = learning_rate / (1.0 - f64::from(BETA_1).powi(steps)) as f32;
        let root_correction = (1.0 - f64::from(BETA_2).powi(steps)).sqrt().recip() as f32;
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((parameter, g), (first, second)) in parameters.iter_mut().zip(gradient).zip(moments) {
            *first = or_zero(*first + (1.0 - BETA_1) * (g - *first));
            *second = or_zero(*second + (1.0 - BETA_2) * (g * g - *second));
            *parameter -= step_size * *first / (second.sqrt() * root_correction + EPSILON);
        }
    }
}

/// `moment`, or zero if it is next to nothing; NaN stays.
fn or_zero(moment: f32) -> f32 {
    if moment.abs() < NOTHING { 0.0 } else { moment }
}

#[cfg(test)]
mod tests {
    use burn::module::Param;
    use burn::nn::Linear;
    use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
    use burn::prelude::{Device, Tensor};

    use super::*;

    #[test]
    fn the_first_step_has_the_length_of_the_learning_rate() {
        let mut parameters = [1.0, 1.0, 1.0];
        Adam::new(3).step(0.1, &mut parameters, &[5.0, -0.01, 0.0]);
        for (value, expected) in parameters.iter().zip([0.9, 1.1, 1.0]) {
            assert!((value - expected).abs() < 1e-5, "{value}, expected {expected}");
        }
    }

    #[test]
    fn moments_of_a_silent_unit_become_zero_and_never_subnormal() {
        let (mut adam, mut parameters) = (Adam::new(1), [0.5]);
        adam.step(0.01, &mut parameters, &[1e-3]);
        for _ in 0..100_000 {
            adam.step(0.01, &mut parameters, &[0.0]);
            let is_sound = |moment: f32| moment == 0.0 || moment.is_normal();
            assert!(is_sound(adam.first[0]) && is_sound(adam.second[0]), "{adam:?}");
        }
        assert_eq!((adam.first[0], adam.second[0]), (0.0, 0.0));
    }

    #[test]
    fn steps_agree_with_burns_adam() {
        let device = Device::flex().autodiff();
        let gradient_at = |step: i32| [(step as f32).sin(), 1e-3 * step as f32, -2.0];
        let weight = Param::from_tensor(Tensor::<2>::from_floats([[0.3, -0.2, 0.1]], &device));
        let mut module = Linear { weight, bias: None };
        let mut optimiser: ModuleOptimizer = AdamConfig::new().with_epsilon(EPSILON).init();
        let (mut adam, mut parameters) = (Adam::new(3), [0.3, -0.2, 0.1]);
        for step in 1..=30 {
            let gradient = gradient_at(step);
            adam.step(0.01, &mut parameters, &gradient);
            let loss = (module.weight.val() * Tensor::<2>::from_floats([gradient], &device)).sum();
            let found = GradientsParams::from_grads(loss.backward(), &module);
            module = optimiser.step(0.01, module, found);
        }
        let burns: Vec<f32> = module.weight.val().into_data().try_to_vec().expect("f32");
        for (own, burns) in parameters.iter().zip(&burns) {
            assert!((own - burns).abs() < 1e-5, "{own} here, {burns} in burn");
        }
    }
}

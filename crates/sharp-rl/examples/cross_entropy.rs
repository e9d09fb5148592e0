//! A learner of one's own: the cross-entropy method over the weights of a policy (de Boer et al. 2005).
//!
//! Each generation draws candidates around a mean and moves the mean to the best of them.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use sharp_rl::conformance::check_learner;
use sharp_rl::{Actor, Environment, EnvironmentSpec, Learner, Observer, Progress, StopReason, Stream};
use sharp_rl::{TrainError, Trained, evaluate};

#[derive(Debug)]
struct CrossEntropy {
    generations: u32,
    population: usize,
    elites: usize,
}

impl Learner for CrossEntropy {
    fn learn(
        &self,
        environments: &mut [Box<dyn Environment>],
        rng: &mut Stream,
        observer: &mut Observer<'_>,
    ) -> Result<Trained, TrainError> {
        let mut actor = Actor::new(EnvironmentSpec::common(environments)?, &[4], rng);
        let (mut mean, mut deviation) = (actor.parameters().to_vec(), vec![0.5; actor.parameters().len()]);
        let (mut env_steps, mut stop) = (0, StopReason::Steps);
        for _ in 0..self.generations {
            let episodes = Stream::from_rng(rng); // The same episodes for every candidate.
            let mut candidates = Vec::new();
            for _ in 0..self.population {
                let mut draw = |(m, d): (&f32, &f32)| m + d * rng.sample::<f32, _>(StandardNormal);
                let weights: Vec<f32> = mean.iter().zip(&deviation).map(&mut draw).collect();
                actor.set_parameters(&weights)?;
                let found = evaluate(environments, &actor, 4, &mut episodes.clone())?;
                env_steps += found.steps();
                candidates.push((found.mean_return, weights));
            }
            candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
            for index in 0..mean.len() {
                let elite = || candidates[..self.elites].iter().map(|(_, weights)| weights[index]);
                mean[index] = elite().sum::<f32>() / self.elites as f32;
                deviation[index] = elite().map(|w| (w - mean[index]).abs()).sum::<f32>() / self.elites as f32;
            }
            actor.set_parameters(&mean)?;
            if observer(&Progress::new(&actor, env_steps)).is_break() {
                stop = StopReason::Observer;
                break;
            }
        }
        let evaluation = evaluate(environments, &actor, 20, rng)?;
        Ok(Trained::new(actor, evaluation, stop, env_steps))
    }
}

fn main() {
    let learner = CrossEntropy { generations: 40, population: 30, elites: 6 };
    assert_eq!(check_learner(&learner, &mut Stream::seed_from_u64(1)), Ok(()));
}

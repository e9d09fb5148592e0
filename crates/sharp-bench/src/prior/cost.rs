//! How the cost model of a prior is fitted and scored: drives on generated maps, and a small network.

use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;
use sharp_drive::{CostModel, DriveRow, Prior, RiskSamples, SuccessEstimate, TimeSamples};
use sharp_plan::TrainingRoute;
use sharp_rl::{FitError, FitSettings, Mlp, StoreError, fit};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::Seed;
use thiserror::Error;

use super::courses::PriorCourses;

/// How a cost model is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct CostRecipe {
    /// Generated maps.
    pub map_count: u32,
    /// Times that each route is driven, each time under another noise and at another caution.
    pub drives: u64,
    /// Episodes of such a drive.
    pub episodes: u32,
    /// Widths of the hidden layers, of the network of times and of that of risks.
    pub hidden: [usize; 2],
    /// How the network of times is fitted.
    pub time_fit: FitSettings,
    /// How the network of risks is fitted.
    pub risk_fit: FitSettings,
}

impl CostRecipe {
    /// The recipe of the shipped models: a few minutes of one core.
    #[must_use]
    pub const fn shipped() -> Self {
        Self {
            map_count: 480,
            drives: 16,
            episodes: 12,
            hidden: [64, 64],
            time_fit: FitSettings { epochs: 4, minibatch: 1024, learning_rate: 2e-3 },
            risk_fit: FitSettings { epochs: 16, minibatch: 1024, learning_rate: 2e-3 },
        }
    }

    /// A few seconds: right to a tenth or two.
    #[must_use]
    pub const fn tiny() -> Self {
        Self {
            map_count: 24,
            drives: 6,
            episodes: 8,
            hidden: [32, 32],
            time_fit: FitSettings { epochs: 8, minibatch: 256, learning_rate: 3e-3 },
            risk_fit: FitSettings { epochs: 8, minibatch: 256, learning_rate: 3e-3 },
        }
    }
}

/// Why no cost model came out.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CostError {
    /// The network cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The network is no cost model.
    #[error(transparent)]
    Model(#[from] StoreError),
}

/// A cost model and what it was fitted to.
#[derive(Debug)]
pub struct FittedCost {
    /// The model.
    pub model: CostModel,
    /// Rows: places under one noise and caution.
    pub rows: usize,
    /// Failures among them.
    pub failures: f64,
    /// The mean loss of each epoch of the risks.
    pub losses: Vec<f64>,
}

/// Fits the cost model of `prior` for `robot`. Equal recipes and seeds give equal bytes on one kind of processor.
/// `on_map` is called after each map.
///
/// # Errors
/// If there is nothing to drive on, or the fit diverges.
pub fn fit_cost(
    (robot, prior, recipe, seed): (&RobotModel, &Prior, &CostRecipe, Seed),
    on_map: &(dyn Fn() + Sync),
) -> Result<FittedCost, CostError> {
    let seed = seed.child("cost", 0);
    let routes = PriorCourses::training(robot, seed).routes(recipe.map_count, on_map);
    let rows = drive_all((&routes, prior), (recipe.drives, recipe.episodes), seed);
    let rng = &mut seed.stream("fit", 0);
    let [first, second] = recipe.hidden;
    // Each on its own: failures are rare, and what is common would drown them.
    let mut time = Mlp::new(&[CostModel::INPUTS, first, second, 1], rng);
    fit(&mut time, &TimeSamples(&rows), &recipe.time_fit, rng)?;
    let mut risk = Mlp::new(&[CostModel::INPUTS, first, second, 1], rng);
    let losses = fit(&mut risk, &RiskSamples(&rows), &recipe.risk_fit, rng)?;
    let network = time.beside(&risk).expect("both have the same inputs and as many layers");
    let failures = rows.iter().map(|row| f64::from(row.failures)).sum();
    Ok(FittedCost { model: CostModel::new(network)?, rows: rows.len(), failures, losses })
}

/// Drives each of `routes` so many times under drawn noises, so many episodes each.
fn drive_all(
    (routes, prior): (&[TrainingRoute], &Prior),
    (drives, episodes): (u64, u32),
    seed: Seed,
) -> Vec<DriveRow> {
    let drive = |(index, route): (usize, &TrainingRoute)| {
        let mut rows = Vec::new();
        for number in 0..drives {
            let seed = seed.child("route", index as u64).child("drive", number);
            drive_once((route, prior), episodes, seed, &mut rows);
        }
        rows
    };
    let rows: Vec<Vec<DriveRow>> = routes.par_iter().enumerate().map(drive).collect();
    rows.into_iter().flatten().collect()
}

/// Drives `route` under a noise, at a caution and from an option that `seed` draws.
fn drive_once((route, prior): (&TrainingRoute, &Prior), episodes: u32, seed: Seed, rows: &mut Vec<DriveRow>) {
    let rng = &mut seed.stream("draw", 0);
    let noises = [NoiseModel::nominal(), NoiseModel::harsh(), NoiseModel::biased()];
    // Nominal noise twice as often: most drive under it, and few fail.
    let noise = &noises[[0, 0, 1, 2][rng.random_range(0..4)]];
    let noise = noise.scaled(rng.random_range(0.6..1.15));
    let first = if rng.random() { 0 } else { rng.random_range(0..route.len()) };
    let caution = if rng.random() { 1.0 } else { rng.random() };
    route.drive_rows((prior, first, caution), &noise, (episodes, seed), rows);
}

/// How well a cost model predicts, over options that it was not fitted to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CostScore {
    /// Options.
    pub options: usize,
    /// Mean measured time of the successful episodes, seconds.
    pub time_s: f64,
    /// Mean predicted time, seconds.
    pub predicted_time_s: f64,
    /// Share of the options whose predicted time lies within a tenth of the measured.
    pub time_within_tenth: f64,
    /// Mean measured share of failures.
    pub failure: f64,
    /// Mean predicted share of failures.
    pub predicted_failure: f64,
    /// Correlation of predicted and measured shares of failures.
    pub failure_correlation: f64,
    /// Predicted and measured share of failures of each tenth of the options, those that are predicted to fail most
    /// first.
    pub failure_by_tenth: Vec<[f64; 2]>,
}

/// Compares what `model` says with `episodes` of each option of `routes`.
#[must_use]
pub fn score_cost(
    (model, prior): (&CostModel, &Prior),
    (routes, robot): (&[TrainingRoute], &RobotModel),
    (noise, caution): (&NoiseModel, f32),
    (episodes, seed): (u32, Seed),
) -> CostScore {
    let policy = prior.at(caution, robot, noise);
    let of_route = |route: &TrainingRoute| -> Vec<(SuccessEstimate, f64, f64)> {
        let predicted = route.predict(model, noise, caution);
        let measured = route.estimate(&policy, noise, episodes, seed);
        let pairs = measured.into_iter().zip(predicted);
        pairs.map(|(measured, cost)| (measured, cost.time_s, 1.0 - cost.success())).collect()
    };
    let all: Vec<_> = routes.par_iter().flat_map(of_route).collect();
    let mut rows: Vec<[f64; 4]> = all
        .into_iter()
        .filter(|(measured, ..)| measured.mean_time_s.is_finite())
        .map(|(measured, time_s, failure)| {
            [measured.mean_time_s, time_s, 1.0 - measured.count.rate(), failure]
        })
        .collect();
    if rows.is_empty() {
        return CostScore::default();
    }
    rows.sort_by(|a, b| b[3].total_cmp(&a[3]));
    let mean = |rows: &[[f64; 4]], column: usize| {
        rows.iter().map(|row| row[column]).sum::<f64>() / rows.len() as f64
    };
    let within = rows.iter().filter(|row| (row[1] / row[0] - 1.0).abs() <= 0.1).count();
    CostScore {
        options: rows.len(),
        time_s: mean(&rows, 0),
        predicted_time_s: mean(&rows, 1),
        time_within_tenth: within as f64 / rows.len() as f64,
        failure: mean(&rows, 2),
        predicted_failure: mean(&rows, 3),
        failure_correlation: correlation(&rows),
        failure_by_tenth: rows.chunks(rows.len().div_ceil(10)).map(|r| [mean(r, 3), mean(r, 2)]).collect(),
    }
}

/// Of the last two columns.
fn correlation(rows: &[[f64; 4]]) -> f64 {
    let count = rows.len() as f64;
    let mean = |column: usize| rows.iter().map(|row| row[column]).sum::<f64>() / count;
    let (x, y) = (mean(2), mean(3));
    let sum = |f: fn(f64, f64) -> f64| rows.iter().map(|row| f(row[2] - x, row[3] - y)).sum::<f64>();
    let (xy, xx, yy) = (sum(|a, b| a * b), sum(|a, _| a * a), sum(|_, b| b * b));
    if xx * yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_fit_knows_times_and_equal_seeds_give_equal_bytes() {
        let robot = RobotModel::husky();
        let prior = Prior::shipped(&robot);
        let recipe = CostRecipe { map_count: 8, drives: 3, episodes: 4, ..CostRecipe::tiny() };
        let fitted = || fit_cost((&robot, prior, &recipe, Seed(1)), &|| ()).expect("there are routes");
        let (first, second) = (fitted(), fitted());
        assert_eq!(first.model.to_bytes(), second.model.to_bytes(), "equal seeds");
        assert!(first.rows > 1000 && first.losses.is_sorted_by(|a, b| a >= b), "{:?}", first.losses);
        let routes = PriorCourses::held_out(&robot, Seed(1)).routes(4, &|| ());
        let noise = NoiseModel::nominal();
        let score = score_cost((&first.model, prior), (&routes, &robot), (&noise, 1.0), (20, Seed(2)));
        assert!((score.predicted_time_s / score.time_s - 1.0).abs() < 0.3, "{score:?}");
    }
}

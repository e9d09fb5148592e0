//! Learning curves for TensorBoard, under the names that Stable-Baselines3 gives them, so that its
//! dashboards show ours beside theirs.

#![allow(clippy::disallowed_methods, reason = "a curve has the steps a second of wall time")]

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use sharp_rl::Progress;

use crate::tensorboard::EventFile;

/// Environment steps between two points of a curve.
const EVERY_STEPS: u64 = 1000;

/// The curves of one training: a folder with an event file.
#[derive(Debug)]
struct Curves {
    events: EventFile,
    begun: Instant,
    /// Environment steps of the first call: what an interrupted run had behind it.
    first: Option<u64>,
    /// Environment steps of the last call.
    last: u64,
}

impl Curves {
    fn create(folder: &Path) -> io::Result<Self> {
        Ok(Self { events: EventFile::create(folder)?, begun: Instant::now(), first: None, last: 0 })
    }

    /// Notes a step of training; writes when a point is due, and after every evaluation.
    fn note(&mut self, progress: &Progress<'_>) -> io::Result<()> {
        let steps = progress.env_steps;
        let first = *self.first.get_or_insert(steps);
        let is_due = steps / EVERY_STEPS > self.last / EVERY_STEPS || progress.evaluation.is_some();
        self.last = steps;
        if !is_due {
            return Ok(());
        }
        let spent_s = self.begun.elapsed().as_secs_f64().max(1e-9);
        self.events.scalars(steps, &scalars(progress, (steps - first) as f64 / spent_s))
    }
}

/// Everything that is known at one step; what has no value yet is left out.
fn scalars(progress: &Progress<'_>, fps: f64) -> Vec<(String, f64)> {
    let mut values = Vec::new();
    let mut add = |name: &str, value| values.push((name.to_owned(), value));
    add("time/fps", fps);
    add("time/total_timesteps", progress.env_steps as f64);
    if progress.episodes > 0 {
        add("rollout/ep_rew_mean", progress.recent_return);
        add("rollout/ep_len_mean", progress.recent_steps);
        add("rollout/success_rate", progress.recent_success_rate);
    }
    for (name, value) in progress.metrics {
        add(&format!("train/{name}"), *value);
    }
    if progress.updates > 0 {
        add("train/n_updates", progress.updates as f64);
    }
    if progress.began_at > 0 {
        add("train/began_at", progress.began_at as f64);
    }
    if let Some(evaluation) = progress.evaluation {
        add("eval/mean_reward", evaluation.mean_return);
        add("eval/mean_ep_length", evaluation.mean_steps);
        add("eval/success_rate", evaluation.success_rate());
    }
    values
}

/// The curves of many trainings, each in a folder of its own below one root.
#[derive(Debug)]
pub struct CurveFolder {
    root: PathBuf,
    running: BTreeMap<String, Curves>,
    /// How many trainings of each name there were.
    counts: BTreeMap<String, u32>,
    /// Why a file could not be written: no more are tried, and learning goes on.
    failure: Option<io::Error>,
}

impl CurveFolder {
    /// Curves below the folder `root`, which is made when the first one is written.
    #[must_use]
    pub fn new(root: &Path) -> Self {
        Self { root: root.to_owned(), running: BTreeMap::new(), counts: BTreeMap::new(), failure: None }
    }

    /// Why curves could not be written, if so.
    #[must_use]
    pub const fn failure(&self) -> Option<&io::Error> {
        self.failure.as_ref()
    }

    /// Notes a step of the training called `name`. After a file could not be written it does nothing.
    pub fn note(&mut self, name: &str, progress: &Progress<'_>) {
        if self.failure.is_none() {
            self.failure = self.try_note(name, progress).err();
        }
    }

    fn try_note(&mut self, name: &str, progress: &Progress<'_>) -> io::Result<()> {
        // Fewer steps than before: it is trained a second time.
        if self.running.get(name).is_none_or(|curves| progress.env_steps < curves.last) {
            let count = self.counts.entry(name.to_owned()).or_insert(0);
            *count += 1;
            let folder = if *count == 1 { name.to_owned() } else { format!("{name}-{count}") };
            self.running.insert(name.to_owned(), Curves::create(&self.root.join(folder))?);
        }
        let curves = self.running.get_mut(name).expect("it was just put there");
        curves.note(progress)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use sharp_rl::{StopRule, TrainSettings, toy, train};
    use sharp_space::Seed;

    use super::*;

    fn note_training(folder: &mut CurveFolder, name: &str) {
        let settings = TrainSettings::fast().with(|train| {
            train.sac.hidden = vec![8];
            train.sac.warmup_steps = 100;
            train.sac.batch = 8;
            train.max_env_steps = 2100;
            train.evaluate_every = 1500;
            train.evaluation_episodes = 2;
            train.stop = StopRule::Never;
        });
        let mut observer = |progress: &Progress<'_>| {
            folder.note(name, progress);
            ControlFlow::Continue(())
        };
        let mut task = [toy::Identity::new(2)];
        train(&mut task, &settings, &mut Seed(1).stream("toy", 0), &mut observer).expect("a sound task");
    }

    fn bytes(folder: &Path) -> Vec<u8> {
        let files: Vec<_> = std::fs::read_dir(folder).expect("a folder").collect();
        assert_eq!(files.len(), 1, "one event file in {}", folder.display());
        std::fs::read(files[0].as_ref().expect("an entry").path()).expect("a file")
    }

    #[test]
    fn every_name_of_stable_baselines3_is_written() {
        let root = tempfile::tempdir().expect("a folder");
        let mut folder = CurveFolder::new(root.path());
        note_training(&mut folder, "c_0-1");
        let written = bytes(&root.path().join("c_0-1"));
        let count = |name: &str| written.windows(name.len()).filter(|part| *part == name.as_bytes()).count();
        for (name, times) in [
            ("time/fps", 3),
            ("time/total_timesteps", 3),
            ("rollout/ep_rew_mean", 3),
            ("rollout/ep_len_mean", 3),
            ("rollout/success_rate", 3),
            ("train/actor_loss", 3),
            ("train/critic_loss", 3),
            ("train/ent_coef_loss", 3),
            ("train/learning_rate", 3),
            ("train/n_updates", 3),
            ("eval/mean_reward", 1),
            ("eval/mean_ep_length", 1),
            ("eval/success_rate", 1),
        ] {
            assert_eq!(count(name), times, "{name}: at 1000 and 2000 steps, and at the evaluation");
        }
        assert!(folder.failure().is_none(), "nothing went wrong");
    }

    #[test]
    fn a_second_training_has_a_folder_of_its_own() {
        let root = tempfile::tempdir().expect("a folder");
        let mut folder = CurveFolder::new(root.path());
        note_training(&mut folder, "first");
        note_training(&mut folder, "first");
        assert!(!bytes(&root.path().join("first")).is_empty());
        assert!(!bytes(&root.path().join("first-2")).is_empty());
    }

    #[test]
    fn a_folder_that_cannot_be_written_stops_the_curves_only() {
        let root = tempfile::tempdir().expect("a folder");
        std::fs::write(root.path().join("file"), "").expect("a file");
        let mut folder = CurveFolder::new(&root.path().join("file"));
        note_training(&mut folder, "first");
        assert!(folder.failure().is_some(), "there is no folder below a file");
    }
}

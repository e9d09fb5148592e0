//! How a policy was trained, and trainings on disk: whoever is killed in the middle of one goes on where it was.
//!
//! A training is a function of its task: the file of one is named after everything that decides it. So a solve that begins anew
//! asks for the same trainings as before, and finds those that were finished, and those that had begun.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use sharp_drive::{NetworkPolicy, OptionPolicy, PolicyInterface, SuccessCount, SuccessEstimate};
use sharp_guide::LegId;
use sharp_rl::{Actor, StopReason};

use super::LearntPolicy;
use crate::files::{self, FileError};

/// Raised whenever the files change their meaning.
const FORMAT: u32 = 1;

/// How a policy was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// Why it ended.
    pub stop: StopReason,
    /// Mean return of the policy that was kept, when it was evaluated.
    pub mean_return: f64,
    /// The evaluations on the way.
    pub points: Vec<TrainingPoint>,
    /// Trainings of the same option in earlier problems, none of which led to a single success.
    #[serde(default, skip_serializing_if = "files::is_zero")]
    pub failed_before: u32,
}

/// What one evaluation in the course of a training showed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingPoint {
    /// Environment steps of training before it.
    pub env_steps: u64,
    /// Mean return.
    pub mean_return: f64,
    /// Episodes that succeeded, by the training's own rule for contacts.
    pub success: SuccessCount,
    /// The same of as many fresh episodes in which a contact is a failure.
    pub without_contact: SuccessCount,
}

/// The file of one training while a problem is solved.
#[derive(Debug)]
pub struct TrainingFile {
    path: PathBuf,
    /// Of everything that decides the training.
    fingerprint: String,
    /// Why it could not be written.
    failure: Mutex<Option<FileError>>,
}

/// A training that was interrupted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InterruptedTraining {
    /// What its learner continues from.
    pub checkpoint: Vec<u8>,
    /// The evaluations until then.
    pub points: Vec<TrainingPoint>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrainingHeader {
    format: u32,
    fingerprint: String,
    state: TrainingState,
}

/// How far a training is. The bytes behind it are those of the learner, or the weights.
#[derive(Serialize, Deserialize)]
enum TrainingState {
    Running(Vec<TrainingPoint>),
    Finished {
        interface: PolicyInterface,
        verified: SuccessCount,
        mean_time_s: f64,
        env_steps: u64,
        gradient_steps: u64,
        training: Option<Training>,
    },
}

impl TrainingFile {
    /// The file in `folder` of the training of `leg` that `decisive` describes whole: equal texts, equal trainings.
    pub(crate) fn new(folder: &Path, leg: LegId, decisive: &str) -> Self {
        let fingerprint = files::hash(decisive.as_bytes());
        let leg = leg.to_string().replace(':', "_");
        let path = folder.join(format!("{leg}-{}.training", &fingerprint[..16]));
        Self { path, fingerprint, failure: Mutex::new(None) }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// What was learnt, if the training was finished.
    pub(crate) fn finished(&self) -> Result<Option<LearntPolicy>, FileError> {
        let Some((state, bytes)) = self.read()? else { return Ok(None) };
        let TrainingState::Finished { interface, verified, mean_time_s, env_steps, gradient_steps, training } =
            state
        else {
            return Ok(None);
        };
        let (actor, _) = Actor::from_bytes(&bytes).map_err(|error| FileError::content(&self.path, error))?;
        Ok(Some(LearntPolicy {
            policy: OptionPolicy::Network(NetworkPolicy::new(interface, actor.into())),
            estimate: SuccessEstimate { count: verified, mean_time_s },
            env_steps,
            gradient_steps,
            training,
        }))
    }

    /// Where the training was when it was saved last; `None` if it has not begun.
    ///
    /// # Errors
    /// Names the file if it is damaged.
    pub fn interrupted(&self) -> Result<Option<InterruptedTraining>, FileError> {
        Ok(match self.read()? {
            Some((TrainingState::Running(points), checkpoint)) => {
                Some(InterruptedTraining { checkpoint, points })
            }
            _ => None,
        })
    }

    /// Keeps where the training is. If that cannot be written, [`has_failed`](Self::has_failed) is true from then on.
    pub fn save(&self, checkpoint: &[u8], points: &[TrainingPoint]) {
        if let Err(error) = self.write(TrainingState::Running(points.to_vec()), checkpoint) {
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }

    /// Keeps what was learnt, where it is a network.
    pub(crate) fn finish(&self, learnt: &LearntPolicy) -> Result<(), FileError> {
        let OptionPolicy::Network(network) = &learnt.policy else { return Ok(()) };
        let state = TrainingState::Finished {
            interface: network.interface,
            verified: learnt.estimate.count,
            mean_time_s: learnt.estimate.mean_time_s,
            env_steps: learnt.env_steps,
            gradient_steps: learnt.gradient_steps,
            training: learnt.training.clone(),
        };
        self.write(state, &network.actor.to_bytes(&std::collections::BTreeMap::new()))
    }

    /// Whether the training cannot be kept.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Why it could not be kept, if so.
    pub(crate) fn into_failure(self) -> Option<FileError> {
        self.failure.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self, state: TrainingState, rest: &[u8]) -> Result<(), FileError> {
        let header = TrainingHeader { format: FORMAT, fingerprint: self.fingerprint.clone(), state };
        let text = ron::to_string(&header).map_err(|error| FileError::content(&self.path, error))?;
        files::write_under_checksum(&self.path, &[text.as_bytes(), b"\n", rest].concat())
    }

    fn read(&self) -> Result<Option<(TrainingState, Vec<u8>)>, FileError> {
        if !self.path.exists() {
            return Ok(None);
        }
        let bytes = files::read_under_checksum(&self.path)?;
        let broken = |problem: &str| FileError::content(&self.path, problem);
        let end = bytes.iter().position(|&byte| byte == b'\n').ok_or_else(|| broken("has no header"))?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|error| broken(&error.to_string()))?;
        let header: TrainingHeader = ron::from_str(text).map_err(|error| broken(&error.to_string()))?;
        if header.format != FORMAT {
            return Err(broken(&format!("format is {}, expected {FORMAT}", header.format)));
        }
        if header.fingerprint != self.fingerprint {
            return Err(broken("belongs to another training"));
        }
        Ok(Some((header.state, bytes[end + 1..].to_vec())))
    }
}

#[cfg(test)]
mod tests {
    use sharp_rl::EnvironmentSpec;
    use sharp_space::Seed;

    use super::*;

    #[test]
    fn a_training_is_found_again_as_far_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let file = |decisive| TrainingFile::new(folder.path(), LegId::First(3), decisive);
        assert_eq!(file("this").interrupted().unwrap(), None, "it has not begun");
        let count = SuccessCount { episodes: 20, successes: 5 };
        let point =
            TrainingPoint { env_steps: 10_000, mean_return: -1.5, success: count, without_contact: count };
        file("this").save(b"the state", &[point]);
        let found = file("this").interrupted().unwrap().expect("it was saved");
        assert_eq!(found, InterruptedTraining { checkpoint: b"the state".to_vec(), points: vec![point] });
        assert_eq!(file("that").interrupted().unwrap(), None, "another training has another file");
        assert!(file("this").finished().unwrap().is_none(), "it is under way");

        let interface = PolicyInterface::Absolute { reach_m: 0.5 };
        let spec = EnvironmentSpec { observation_len: interface.observation_len(), action_len: 2 };
        let actor = Actor::new(spec, &[8], &mut Seed(1).stream("actor", 0));
        let policy = OptionPolicy::Network(NetworkPolicy::new(interface, actor.clone().into()));
        let training =
            Training { stop: StopReason::Rule, mean_return: 812.0, points: vec![point], failed_before: 1 };
        let estimate = SuccessEstimate { count, mean_time_s: f64::INFINITY };
        let learnt = LearntPolicy {
            env_steps: 20_000,
            training: Some(training),
            ..LearntPolicy::untrained(policy, estimate)
        };
        file("this").finish(&learnt).unwrap();
        let found = file("this").finished().unwrap().expect("it is finished");
        assert_eq!((found.estimate, found.env_steps), (learnt.estimate, 20_000));
        assert_eq!(found.training, learnt.training);
        let OptionPolicy::Network(network) = found.policy else { panic!("a network") };
        assert_eq!(*network.actor, actor);
        assert_eq!(file("this").interrupted().unwrap(), None, "nothing is left to do");

        let path = file("this").path().to_owned();
        let mut bytes = std::fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let error = file("this").finished().unwrap_err().to_string();
        assert!(error.contains("first_3-") && error.contains("damaged"), "{error}");
    }
}

//! Progress of a solve for Python, which may also stop it.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use sharp_guide::GuidedOption;
use sharp_plan::{LearntPolicy, Monitor, Phase};

/// Calls a Python function with `(phase, message)` for each step; stops the solve when it raises, and at Ctrl-C.
pub(crate) struct PyMonitor {
    callback: Option<Py<PyAny>>,
    raised: Mutex<Option<PyErr>>,
}

impl PyMonitor {
    pub(crate) const fn new(callback: Option<Py<PyAny>>) -> Self {
        Self { callback, raised: Mutex::new(None) }
    }

    /// What the callback raised, if it did.
    pub(crate) fn into_raised(self) -> Option<PyErr> {
        self.raised.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, phase: &str, message: &str) {
        let Some(callback) = &self.callback else { return };
        self.keep(Python::attach(|py| callback.call1(py, (phase, message)).map(|_| ())));
    }

    fn keep(&self, result: PyResult<()>) {
        if let Err(error) = result {
            self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }
}

impl Monitor for PyMonitor {
    fn phase(&self, phase: Phase) {
        match phase {
            Phase::Regions => self.tell("regions", "predicting critical regions"),
            Phase::Abstraction => self.tell("abstraction", "building the abstraction"),
            Phase::Search => self.tell("search", "searching"),
            Phase::Guide => self.tell("guide", "planning guides"),
            Phase::Learn(options) => self.tell("learn", &format!("learning {options} policies")),
            Phase::Verify => self.tell("verify", "running the whole plan"),
            _ => {}
        }
    }

    fn learnt(&self, option: &GuidedOption, learnt: &LearntPolicy) {
        let count = learnt.estimate.count;
        let message = format!("{} succeeds {} of {} times", option.id, count.successes, count.episodes);
        self.tell("learnt", &message);
    }

    fn should_stop(&self) -> bool {
        // Signals are for the main thread; elsewhere Python says that there are none.
        self.keep(Python::attach(|py| py.check_signals()));
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }
}

//! Errors as the exception `sharp.SharpError`, with a code for programs.

use std::fmt::Display;

use pyo3::prelude::*;
use pyo3::types::PyModule;
use sharp_bench::{BenchError, InputError};
use sharp_maps::MapError;
use sharp_plan::FileError;

/// The exception with this code, as in `GOAL_OCCUPIED`, and this message.
pub(crate) fn exception(code: &str, message: impl Display) -> PyErr {
    Python::attach(|py| {
        let make =
            || PyModule::import(py, "sharp._errors")?.getattr("make")?.call1((code, message.to_string()));
        make().map_or_else(|error| error, PyErr::from_value)
    })
}

/// Anything that became wrong, with its code.
pub(crate) struct Raised(PyErr);

impl From<Raised> for PyErr {
    fn from(raised: Raised) -> Self {
        raised.0
    }
}

impl From<BenchError> for Raised {
    fn from(error: BenchError) -> Self {
        Self(exception(error.code(), error))
    }
}

impl From<InputError> for Raised {
    fn from(error: InputError) -> Self {
        Self(exception(error.code(), error))
    }
}

impl From<MapError> for Raised {
    fn from(error: MapError) -> Self {
        Self(exception(error.code(), error))
    }
}

impl From<FileError> for Raised {
    fn from(error: FileError) -> Self {
        Self(exception("FILE_INVALID", error))
    }
}

impl Raised {
    /// A raised with this code and message.
    pub(crate) fn new(code: &str, message: impl Display) -> Self {
        Self(exception(code, message))
    }
}

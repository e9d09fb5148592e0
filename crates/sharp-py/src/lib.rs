//! SHARP for Python: the native half of the package `sharp`.
//!
//! Arrays travel as bytes, reports as JSON text, errors as an exception with a code. The Python half, in `python/sharp`,
//! gives them their types. Nothing here plans or learns: each function is a few calls of the crates below.

mod environment;
mod error;
mod map;
mod monitor;
mod plan;
mod policy;
mod solve;

use pyo3::prelude::*;

/// The native half of the package `sharp`.
#[pymodule(name = "_core")]
fn core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<map::PyMap>()?;
    module.add_class::<map::PyRobot>()?;
    module.add_class::<plan::PyPlan>()?;
    module.add_class::<policy::PyPolicy>()?;
    module.add_class::<policy::PyDriver>()?;
    module.add_class::<environment::Tasks>()?;
    module.add_function(wrap_pyfunction!(solve::solve, module)?)?;
    Ok(())
}

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
    module.add_class::<map::Map>()?;
    module.add_class::<map::Robot>()?;
    module.add_class::<plan::Plan>()?;
    module.add_class::<policy::Policy>()?;
    module.add_class::<policy::Driver>()?;
    module.add_class::<environment::Tasks>()?;
    module.add_function(wrap_pyfunction!(solve::solve, module)?)?;
    Ok(())
}

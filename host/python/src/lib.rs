//! The Python door: it converts, and computes nothing. What Python can do here the command can do too.
//!
//! All work runs with the interpreter released. Arrays go out as the memory that Rust filled; where a signal comes in, it is read once.
//! Nothing writes into a campaign file, and no device can be opened: what moves a hammer stays with the command.

#![allow(clippy::needless_pass_by_value, reason = "Python hands arguments over by value")]

mod analysis;
mod frf;
mod identify;
mod interruptible;
mod lab;
mod raised;
mod record;
mod signals;

use pyo3::prelude::*;
use std::process;
use std::sync::OnceLock;

/// The process that loaded this module.
static LOADED_IN: OnceLock<u32> = OnceLock::new();

/// Refuses to compute after a fork: the threads of the pool did not come along, and waiting for them would never end.
fn in_the_process_that_loaded_this(py: Python<'_>) -> PyResult<()> {
    if LOADED_IN.get().is_none_or(|loaded| *loaded == process::id()) {
        return Ok(());
    }
    Err(raised::refused(
        py,
        "this process was forked after jointrig was imported, and its threads did not come along: \
         use multiprocessing.get_context(\"spawn\"), or import jointrig in the child",
    ))
}

/// A JSON text as Python's own values.
fn values<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// jointrig's native part; `jointrig` itself is what to import.
#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    LOADED_IN.get_or_init(process::id);
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<lab::Lab>()?;
    module.add_class::<record::Record>()?;
    module.add_class::<frf::Frf>()?;
    module.add_class::<analysis::Analysis>()?;
    module.add_function(wrap_pyfunction!(signals::frf, module)?)?;
    module.add_function(wrap_pyfunction!(identify::identify, module)?)?;
    module.add_function(wrap_pyfunction!(signals::hysteresis, module)?)?;
    Ok(())
}

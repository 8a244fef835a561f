//! The Python interface: it converts, and computes nothing. The command can do everything that is
//! possible here.
//!
//! All work runs with the interpreter released. Returned arrays are the memory that Rust filled,
//! without a copy; an input signal is read once. Hits and levels are added to a campaign file by
//! the same functions as the command's. No device can be opened: only the command moves a hammer.

#![allow(clippy::needless_pass_by_value, reason = "Python hands arguments over by value")]

mod frf;
mod interruptible;
mod lab;
mod raised;
mod record;
mod signals;
mod writing;

use pyo3::prelude::*;
use std::process;
use std::sync::OnceLock;

/// The process that loaded this module.
static LOADED_IN: OnceLock<u32> = OnceLock::new();

/// Refuses to compute after a fork: the threads of the pool are not forked, so waiting for them
/// would never end.
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

/// A JSON text as native Python values.
fn values<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// jointrig's native part; import `jointrig` instead.
#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    LOADED_IN.get_or_init(process::id);
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<lab::Lab>()?;
    module.add_class::<record::Record>()?;
    module.add_class::<frf::Frf>()?;
    module.add_class::<lab::Analysis>()?;
    module.add_function(wrap_pyfunction!(lab::new, module)?)?;
    module.add_function(wrap_pyfunction!(signals::frf, module)?)?;
    module.add_function(wrap_pyfunction!(signals::identify, module)?)?;
    module.add_function(wrap_pyfunction!(signals::modes, module)?)?;
    module.add_function(wrap_pyfunction!(signals::hysteresis, module)?)?;
    Ok(())
}

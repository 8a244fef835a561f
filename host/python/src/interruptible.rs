//! Long computations: with the interpreter released, and interruptible by Ctrl-C.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::raised;

/// Polling interval for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Whether the caller has stopped waiting for the work.
#[derive(Clone, Default)]
pub struct Stopped(Arc<AtomicBool>);

impl Stopped {
    /// Ends the work here if its result is not needed any more. Unwinding is safe, because the
    /// analysis only reads and leaves nothing half written; it has no other way to end early.
    pub fn end_here_if_so(&self) {
        if self.0.load(Ordering::Relaxed) {
            // without the message that a panic prints
            resume_unwind(Box::new("nobody waits for it"));
        }
    }
}

/// Returns the result of `work`. It runs on a separate thread; Ctrl-C ends the wait within 50 ms,
/// and the work at its next step.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Stopped) -> T + Send + 'static,
) -> PyResult<T> {
    let stopped = Stopped::default();
    let own = stopped.clone();
    let (done, mut ready) = channel();
    let begun = thread::Builder::new().name("jointrig".into()).spawn(move || {
        // sending fails if the receiver is gone, that is, if the result is not needed
        let _ = done.send(catch_unwind(AssertUnwindSafe(|| work(&own))));
    });
    if let Err(error) = begun {
        return Err(raised::refused(py, &format!("no thread can be started: {error}")));
    }
    loop {
        let got;
        (ready, got) = py.detach(move || {
            let got = ready.recv_timeout(LOOK);
            (ready, got)
        });
        match got {
            Ok(Ok(found)) => return Ok(found),
            Ok(Err(panic)) => return Err(raised::panicked(py, &told(&*panic))),
            Err(RecvTimeoutError::Disconnected) => return Err(raised::panicked(py, "its thread has ended")),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(interrupt) = py.check_signals() {
                    stopped.0.store(true, Ordering::Relaxed);
                    return Err(interrupt);
                }
            }
        }
    }
}

fn told(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic".into())
}

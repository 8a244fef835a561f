//! Runs the tasks with embassy's executor, and passes the turn to the simulator when all of them
//! wait.

use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_executor::Spawner;
use embassy_executor::raw::Executor;
use static_cell::StaticCell;

use crate::{port, time};

static WOKEN: AtomicBool = AtomicBool::new(false);

/// Called by embassy's executor when one of its tasks was woken.
// SAFETY: this is the only definition of the symbol in the image; embassy declares it with this
// signature.
#[unsafe(export_name = "__pender")]
fn pender(_context: *mut ()) {
    WOKEN.store(true, Ordering::Release);
}

/// Creates the tasks and runs them forever.
pub fn run(tasks: impl FnOnce(Spawner)) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let executor: &'static Executor = EXECUTOR.init(Executor::new(ptr::null_mut()));
    tasks(executor.spawner());
    loop {
        while WOKEN.swap(false, Ordering::AcqRel) {
            // SAFETY: this is the only place that polls the only executor, and no task can reach
            // it.
            unsafe { executor.poll() }
        }
        let alarm_us = time::next_alarm();
        if !WOKEN.load(Ordering::Acquire) {
            port::idle(alarm_us);
        }
    }
}

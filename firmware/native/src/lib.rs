//! Runs the firmware's tasks as a thread of a PC program: the simulator's boards in virtual time,
//! the bridge's boards by the clock.
//!
//! [`executor`] has the clock and polls the tasks, [`link`] carries the bytes between the device's
//! thread and the host, and [`tasks`] joins the four functions of the firmware over a board's
//! parts. One board is one thread.

pub mod executor;
pub mod link;
pub mod tasks;

/// Target triple of this build, as a board reports it.
pub const TARGET: &str = env!("JOINTRIG_TARGET");

/// Locks and flags between the device's thread and the host's: the standard library's, or those of
/// a model checker that tries every interleaving of two threads (`tests/wakes.rs`).
mod sync {
    #[cfg(every_order)]
    pub use loom::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};
    #[cfg(not(every_order))]
    pub use std::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};
}

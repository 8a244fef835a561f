//! Locks and flags between the device's thread and the host's: the standard library's, or those of
//! a model checker that tries every interleaving of two threads (`tests/wakes.rs`).

#[cfg(every_order)]
pub use loom::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};
#[cfg(not(every_order))]
pub use std::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};

//! The friction rig in software, and the virtual board that runs the real firmware over it.
//!
//! [`rig`] is the physics: structure, contact, hammer and sensors, one converter code per channel
//! and scan. [`board`] runs the firmware library over it in virtual time ([`executor`]) with a
//! [`link`], which [`serve`] can connect to a pseudo-terminal or a socket. The simulator replaces
//! the voltages, not the code: it never imports the host, and the host can distinguish it from a
//! rig only by its name.

pub mod board;
pub mod console;
pub mod executor;
pub mod link;
pub mod rig;
pub mod serve;

/// Locks and flags between the device's thread and the host's: the standard library's, or those of
/// a model checker that tries every interleaving of two threads (`tests/wakes.rs`).
mod sync {
    #[cfg(every_order)]
    pub use loom::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};
    #[cfg(not(every_order))]
    pub use std::sync::{Condvar, Mutex, MutexGuard, atomic::AtomicBool};
}

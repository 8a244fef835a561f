//! The friction rig in software, and the virtual board that runs the real firmware over it.
//!
//! [`rig`] is the physics: structure, contact, hammer and sensors, one converter code per channel
//! and scan. [`board`] runs the firmware library over it in virtual time ([`executor`]) with a
//! [`link`], which [`serve`] can connect to a pseudo-terminal or a socket. The simulator replaces
//! the voltages, not the code: it never imports the host, and the host can distinguish it from a
//! rig only by its name.

pub mod board;
pub mod console;
pub mod play;
pub mod rig;
pub mod serve;

pub use jointrig_native::{executor, link};

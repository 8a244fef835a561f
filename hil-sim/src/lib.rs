//! The friction rig in software, and the virtual board that runs the real firmware over it.
//!
//! [`rig`] is the physics: structure, contact, hammer and sensors, one converter code per channel and scan.
//! [`board`] runs the firmware library over it in virtual time ([`executor`]) behind a [`link`], which
//! [`serve`] can put behind a pseudo-terminal or a socket. The simulator replaces volts, not code: it never
//! imports the host, and the host cannot tell it from a rig except by its name.

pub mod board;
pub mod desk;
pub mod executor;
pub mod link;
pub mod rig;
pub mod serve;
mod sync;

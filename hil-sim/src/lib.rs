//! The friction rig in software.
//!
//! [`rig`] is the physics: structure, contact, hammer and sensors, one converter code per channel and scan.

pub mod rig;

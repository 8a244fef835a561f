//! Stiffness of joints from measurements: impact spectra, frequency-based substructuring, hysteresis loops.
//!
//! Arrays and geometry in, numbers out: nothing here knows of devices, files or screens.
#![forbid(unsafe_code)]

pub mod hysteresis;
pub mod spectra;
pub mod substructuring;

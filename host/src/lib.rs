//! The host side of jointrig: device sessions, campaigns, spectra, substructuring, hysteresis,
//! report.
//!
//! Data flows one way: [`device`] sessions deliver records, [`campaign`] stores them, [`spectra`]
//! computes FRFs from them, and [`substructuring`] and [`hysteresis`] compute the joint's stiffness
//! from those. [`analyse`] runs these steps for a campaign and returns findings; [`report`] turns
//! the findings into the document [`results`] and shows it. The analysis modules do not depend on
//! devices, files or screens: they take arrays and geometry and return numbers.
#![forbid(unsafe_code)]

pub use jointrig_analysis::{
    contact, frf, friction, hysteresis, identified, median, modes, spectra, structure, study, substructuring,
};

mod advice;
pub mod analyse;
pub mod campaign;
pub mod cli;
#[cfg(feature = "dashboard")]
pub mod dashboard;
pub mod device;
pub mod exchange;
#[cfg(feature = "dashboard")]
pub mod live;
pub mod report;
pub mod results;
mod untrusted_input;
mod untrusted_text;

//! The host side of jointrig: device sessions, campaigns, spectra, substructuring, hysteresis, report.
//!
//! Data flows one way: records come from [`device`] sessions, [`campaign`] keeps them, [`spectra`]
//! turns them into FRFs, [`substructuring`] and [`hysteresis`] turn those into the joint's stiffness. [`analyse`] calls
//! them for a campaign and returns findings, [`report`] makes the document [`results`] of those and shows it. The analysis
//! rooms know nothing of devices, files or screens: arrays and geometry in, numbers out.
#![forbid(unsafe_code)]

pub use jointrig_analysis::{
    contact, frf, hysteresis, identified, median, spectra, structure, substructuring,
};

mod advice;
pub mod analyse;
pub mod campaign;
pub mod cli;
#[cfg(feature = "dashboard")]
pub mod dashboard;
pub mod device;
pub mod exchange;
mod foreign;
#[cfg(feature = "dashboard")]
pub mod live;
mod outside;
pub mod report;
pub mod results;

//! Measurements for the tables of docs/performance.md.
#![cfg(feature = "table")]
#![allow(clippy::missing_panics_doc, reason = "a benchmark that cannot go on stops")]

pub mod campaign;
pub mod frames;
pub mod growth;
pub mod loops;
mod noise;
pub mod peers;
pub mod row;
pub mod simulator;
pub mod spectra;
pub mod substructuring;
pub mod universal;

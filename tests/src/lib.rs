//! Whole-system scenarios across all components: plan, runner, session, link, firmware, rig, file,
//! analysis.
//!
//! The scenarios are in `tests/tests/`; what they share is here. They run the binaries where they
//! test the command, and the libraries where they inspect internals.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a scenario that cannot go on has failed")]

pub mod browser;
pub mod campaign;
pub mod command;
pub mod coverage;
pub mod drawn_campaigns;
pub mod live;
pub mod origins;
pub mod own_plan;
pub mod rigs;
pub mod slip_truth;

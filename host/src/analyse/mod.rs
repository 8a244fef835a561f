//! From a campaign to findings: everything is computed from the campaign file alone.
//!
//! The way through the room: [`analyse`] opens the file ([`Measurements`] is what the stages ask of it), and the stages follow one
//! another as `campaign.rs` calls them: cells, configurations, what the FRFs say, the estimates to quote, the fit, the contact.
//! Each returns what it found in a type of its own; together they are the [`Findings`].
//!
//! Cells are read one at a time on each thread and averaged at once, so that memory holds the signals of a few
//! cells, never of a campaign. What is missing is told in [`Findings::missing`] and done without: hysteresis needs the
//! assembly only, substructuring needs all three configurations.

mod analyse_error;
mod arm_from_hits;
mod assemble;
mod averages;
mod campaign;
mod cell;
mod cells_stage;
pub mod checks;
mod chosen;
mod configuration_stage;
mod contact_answer;
mod contact_stage;
mod file_source;
mod findings;
mod fits;
mod from_frfs;
mod from_store;
mod hammer_slip;
mod heard;
mod hit_counts;
mod hit_spectra;
mod impact_loops;
mod imported;
mod level_stiffness;
mod measured_frfs;
mod missing;
mod plan_geometry;
mod question;
mod recommended;
#[cfg(test)]
mod rig_tests;
mod shaker_levels;
#[cfg(test)]
mod shaker_levels_tests;
mod specimen_curves;
mod wanted;

pub use analyse_error::AnalyseError;
pub use averages::LINES_HZ;
pub use campaign::analyse_measurements;
pub use cell::{Cell, CellName, ContactDelays, ContactSignals, Hit, KnownContact, Measurements, ShakerLevel};
pub use contact_stage::Contact;
pub use findings::{ConfigurationFindings, Findings, ImportedFrom, Settings};
pub use fits::{Fit, NoFit, fits};
pub use from_frfs::{Row, Substructured};
pub use from_store::{AnalysedLength, CampaignFile, analyse};
pub use impact_loops::{ImpactLoops, SlopeIs};
pub use level_stiffness::NoLevelStiffness;
pub use missing::Missing;
pub use plan_geometry::{geometry, geometry_as_planned, places};
pub use question::{Asked, IdmSets, Question, QuestionError};
pub use shaker_levels::RecordLoops;
pub use wanted::{BANDS, Progress, Wanted};

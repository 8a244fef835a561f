//! From a campaign to findings: everything is computed from the campaign file alone.
//!
//! [`analyse`] opens the file ([`Measurements`] is the interface that the stages use), and
//! [`analyse_measurements`] in `campaign.rs` is the whole analysis from top to bottom: cells,
//! configurations, results from the FRFs, the estimates to quote, the fit, the contact. Each stage
//! returns its results in a separate type; together they form the [`Findings`].
//!
//! Cells are read one at a time on each thread and averaged immediately, so that memory holds the
//! signals of a few cells, never of a whole campaign. Missing data are reported in
//! [`Findings::missing`], and the analysis continues without them: hysteresis needs only the
//! assembly, substructuring needs all three configurations.

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
#[cfg(feature = "sim")]
pub mod expected;
mod findings;
mod first_mode;
mod from_frfs;
mod from_store;
mod impact_loops;
mod missing;
mod modal;
pub mod next_cell;
mod plan_geometry;
mod question;
#[cfg(test)]
mod rig_tests;
mod separate_cells;
mod shaker_levels;
#[cfg(test)]
mod shaker_levels_tests;
pub mod wear;

pub use averages::LINES_HZ;
pub use campaign::analyse_measurements;
pub use cell::{BANDS, Progress, Wanted};
pub use cell::{
    Cell, CellName, ContactDelays, ContactSignals, Hit, KnownContact, LoadCellSignal, Measurements,
    SensorMass, ShakerLevel,
};
pub use contact_stage::Contact;
pub use findings::{ConfigurationFindings, Findings, ImportedFrom, Settings};
pub use from_frfs::{Fit, NoFit, fits};
pub use from_frfs::{Row, Substructured};
pub use from_store::AnalyseError;
pub use from_store::{AnalysedLength, CampaignFile, analyse, before_the_hit};
pub use impact_loops::{ImpactLoops, SlopeIs};
pub use missing::Missing;
pub use modal::{FRF_ERROR, FoundModes, MODES_HZ, NoModes};
pub use plan_geometry::{geometry, geometry_as_planned, places};
pub use question::{Asked, IdmSets, Question, QuestionError};
pub use shaker_levels::NoLevelStiffness;
pub use shaker_levels::RecordLoops;

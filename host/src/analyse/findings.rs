//! Findings: the results of the analysis stages, each in its own type and without text.
//!
//! [`crate::report::document()`] converts them to `results.json`. The stages pass data to later
//! stages as arguments; none reads what another stored here.

use super::chosen::DataQuality;
use super::contact_stage::Contact;
use super::from_frfs::Fit;
use super::from_frfs::Substructured;
use super::missing::Missing;
use super::modal::FoundModes;
use super::shaker_levels::RecordLoops;
use crate::contact::{ContactError, Stiffness};
use crate::results::{
    Bootstrap, Cells, Completeness, FirstMode, FrfCurve, HitRow, NoiseFloor, Place, Source, UsableBand,
    WearRuns,
};
use crate::spectra::Windowing;
use crate::structure::Structure;
use crate::substructuring::Frf;
use crate::substructuring::averaged::{Averaged, Priors};
use crate::substructuring::between_arms::{BetweenArms, NoStiffness};

/// All findings of the stages that were run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Findings {
    /// Provenance.
    pub source: Source,
    /// How records were converted to FRFs; `None` if no records of hits were read.
    pub settings: Option<Settings>,
    /// Kept and refused hits.
    pub completeness: Vec<Completeness>,
    /// Positions of hammer and vibrometer.
    pub geometry: Vec<Place>,
    /// Data quality of every cell.
    pub data_quality: DataQuality,
    /// Every cell of a campaign's plan, with its data quality.
    pub cells: Option<Cells>,
    /// All firings of the hammer.
    pub hits: Vec<HitRow>,
    /// Results for each configuration.
    pub configurations: Vec<ConfigurationFindings>,
    /// The FRFs between all channels and impacts of the geometry, measured or not, if requested:
    /// for each configuration with a kept hit, at the lines of the settings.
    pub frfs: Vec<(Structure, Frf)>,
    /// Joint and interface, line by line.
    pub substructured: Option<Substructured>,
    /// The fits that were requested.
    pub fits: Vec<Fit>,
    /// Assumed uncertainties of positions and angles, if an estimate with an interval was attempted
    /// in a campaign.
    pub priors: Option<Priors>,
    /// The estimates to quote.
    pub recommended: Vec<Averaged>,
    /// The bootstrap over hits.
    pub bootstrap: Option<Bootstrap>,
    /// Results from the contact's signals in a campaign.
    pub contact: Option<Contact>,
    /// The contact stiffness, in a campaign.
    pub own_stiffness: Option<Result<Stiffness, ContactError>>,
    /// The stiffness between the arms, in a campaign.
    pub between_arms: Option<Result<BetweenArms, NoStiffness>>,
    /// The modes of each structure.
    pub modes: Vec<FoundModes>,
    /// The assembly's first mode in every hit.
    pub first_mode: Option<FirstMode>,
    /// The loops of a single record.
    pub record: Option<RecordLoops>,
    /// The wear runs of a campaign.
    pub wear: Option<WearRuns>,
    /// Missing data, in the order in which they were noticed.
    pub missing: Vec<Missing>,
}

/// Settings for converting records to FRFs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The windows.
    pub windowing: Windowing,
    /// First and last line, Hz.
    pub lines_hz: [f64; 2],
}

/// Results for one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigurationFindings {
    /// The configuration.
    pub configuration: Structure,
    /// Ids of the records used.
    pub records: Vec<i64>,
    /// The band excited by the hammer.
    pub usable_band: Option<UsableBand>,
    /// Example FRFs.
    pub frfs: Vec<FrfCurve>,
    /// One FRF compared with its noise.
    pub noise_floor: Option<NoiseFloor>,
    /// Source of its FRFs, if they were imported.
    pub imported: Option<ImportedFrom>,
}

/// Source of imported FRFs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportedFrom {
    /// The file.
    pub file: String,
    /// When they were imported, RFC 3339.
    pub utc: String,
    /// Whether their variance came with them.
    pub with_variance: bool,
}

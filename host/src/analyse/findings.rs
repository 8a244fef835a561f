//! Findings: what the stages of an analysis found, each in its own type and without a word of prose.
//!
//! [`crate::report::document()`] makes `results.json` of them. The stages hand on what the next ones need as arguments; none reads
//! what another wrote here.

use super::contact_stage::Contact;
use super::fits::Fit;
use super::from_frfs::Substructured;
use super::heard::Heard;
use super::missing::Missing;
use super::shaker_levels::RecordLoops;
use crate::contact::{ContactError, Stiffness};
use crate::results::{
    Bootstrap, Cells, Completeness, FrfCurve, HitRow, NoiseFloor, Place, Source, UsableBand,
};
use crate::spectra::Windowing;
use crate::structure::Structure;
use crate::substructuring::Frf;
use crate::substructuring::averaged::{Averaged, Priors};
use crate::substructuring::between_arms::{BetweenArms, NoStiffness};

/// All that was found, as far as it was looked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Findings {
    /// What it was found from.
    pub source: Source,
    /// How records became FRFs; none where no records of hits were read.
    pub settings: Option<Settings>,
    /// Kept and refused hits.
    pub completeness: Vec<Completeness>,
    /// Where hammer and vibrometer went.
    pub geometry: Vec<Place>,
    /// How every cell was heard.
    pub heard: Heard,
    /// Every cell of a campaign's plan, with how it was heard.
    pub cells: Option<Cells>,
    /// Every firing of the hammer.
    pub hits: Vec<HitRow>,
    /// What each configuration gave.
    pub configurations: Vec<ConfigurationFindings>,
    /// The FRFs between all channels and impacts of the geometry, measured or not, where they are wanted: of each configuration with a
    /// kept hit, at the lines of the settings.
    pub frfs: Vec<(Structure, Frf)>,
    /// Joint and interface, line by line.
    pub substructured: Option<Substructured>,
    /// The fits that were asked for.
    pub fits: Vec<Fit>,
    /// What is assumed of positions and angles, where an estimate with an interval was tried in a campaign.
    pub priors: Option<Priors>,
    /// The estimates to quote.
    pub recommended: Vec<Averaged>,
    /// Hits drawn anew.
    pub bootstrap: Option<Bootstrap>,
    /// What the contact's own signals say in a campaign.
    pub contact: Option<Contact>,
    /// The contact's own stiffness, in a campaign.
    pub own_stiffness: Option<Result<Stiffness, ContactError>>,
    /// The stiffness between the arms, in a campaign.
    pub between_arms: Option<Result<BetweenArms, NoStiffness>>,
    /// The loops of a record of its own.
    pub record: Option<RecordLoops>,
    /// What had to be done without, in the order it was noticed.
    pub missing: Vec<Missing>,
}

/// How records became FRFs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The windows.
    pub windowing: Windowing,
    /// First and last line, Hz.
    pub lines_hz: [f64; 2],
}

/// What a configuration gave.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigurationFindings {
    /// Which.
    pub configuration: Structure,
    /// Ids of the records used.
    pub records: Vec<i64>,
    /// Where the hammer's force reaches.
    pub usable_band: Option<UsableBand>,
    /// FRFs to look at.
    pub frfs: Vec<FrfCurve>,
    /// One FRF against its noise.
    pub noise_floor: Option<NoiseFloor>,
    /// Where its FRFs came from, if they were measured elsewhere.
    pub imported: Option<ImportedFrom>,
}

/// Where FRFs came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportedFrom {
    /// The file.
    pub file: String,
    /// When they were imported, RFC 3339.
    pub utc: String,
    /// Whether their variance came with them.
    pub with_variance: bool,
}

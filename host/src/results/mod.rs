//! Results: one document with everything that was found, and what it was found from.
//!
//! [`Results`] is `results.json`, field for field, with SI units in the names: data, and nothing that computes.
//! [`crate::report::document()`] makes it of what an analysis found; the report and the terminal show it and add
//! nothing. A value that is not known is null, never NaN. Every document carries its [`Source`]: file, record ids, settings, version.

mod answer;
mod check;
mod compared;
mod completeness;
mod curves;
#[cfg(test)]
pub(crate) mod example_tests;
mod interface_quality;
mod joint_rows;
mod loop_rows;
mod measured;
mod reconstruction;
mod side_by_side;
mod source;

pub use crate::hysteresis::static_arm::Identified;
pub use crate::hysteresis::{Kind as Excitation, OverCycles, Shape};
pub use crate::substructuring::averaged::Averaged;
pub use crate::substructuring::joint_over_bands::BandStatistic as Statistics;
pub use answer::{Answer, Basis, BetweenArms, Clamp, ContactAnswer, Slip};
pub use check::{
    BACK_COUPLING, Check, HAMMER_SLIP, HIDDEN_RESONANCE, INTERFACE_MODES, INTERNALS, ONE_STRUCTURE,
    SAME_IN_ALL, SERIES_COMPLIANCE, UNCHANGED,
};
pub use compared::{Compared, Difference};
pub use completeness::Completeness;
pub use curves::{FrfCurve, Role, UsableBand, rounded};
pub use interface_quality::{Bootstrap, InterfaceModes, VirtualPoint};
pub use joint_rows::{DIRECT, Goodness, Joint, JointSpectrum, Refusal, SpectrumCurve, headline_rank};
pub use loop_rows::{Backbone, DecayStep, Force, Hysteresis, ImpactSlope, LoopCurve, ShakerLoop};
pub use measured::{CellRow, Cells, HitRow, NoiseFloor, Place};
pub use reconstruction::Reconstruction;
pub use side_by_side::SideBySide;
pub use source::{BESIDE_THE_CONTACT, Calibrated, RECORD, Software, Source, ranges};

use crate::substructuring::Band;
use serde::Serialize;

/// The shape's version: 1.
pub const VERSION: u32 = 1;

/// The band the headline is read from (the paper's Table 2).
pub const MAIN_BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };

/// All that was found. The first six fields are the contract that scripts rely on; the others are there for
/// the report and may grow.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Results {
    /// Version of this shape.
    pub version: u32,
    /// Where it comes from.
    pub source: Source,
    /// What the campaign was measured for; absent where no campaign was analysed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
    /// The joint by substructuring: method × IDM set × band.
    pub joint: Vec<Joint>,
    /// The estimates to quote, each with its interval, by band; needs six motions of both virtual points in the assembly.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recommended: Vec<Averaged>,
    /// The same by drawing hits anew, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<Bootstrap>,
    /// Quality of the virtual points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub virtual_points: Vec<VirtualPoint>,
    /// Which motions coupling adds, and the set of modes that suggests.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interface_modes: Option<InterfaceModes>,
    /// The same line by line; absent where nothing was identified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_spectrum: Option<JointSpectrum>,
    /// The contact by loops.
    pub hysteresis: Vec<Hysteresis>,
    /// Whether the numbers may be believed.
    pub checks: Vec<Check>,
    /// Every kind of stiffness that was found along the sliding direction, with what it is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub side_by_side: Vec<SideBySide>,
    /// Methods that were refused, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refusal>,
    /// What the analysis had to do without, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Kept and refused hits per configuration.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub completeness: Vec<Completeness>,
    /// Where hammer and vibrometer went.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub geometry: Vec<Place>,
    /// Every cell: what was kept, and how well it was heard.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<Cells>,
    /// Every firing of the hammer.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// One FRF of the assembly against its noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_floor: Option<NoiseFloor>,
    /// A few FRFs to look at.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frfs: Vec<FrfCurve>,
    /// Where the hammer's force reaches.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub usable_bands: Vec<UsableBand>,
    /// One loop to look at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub example_loop: Option<LoopCurve>,
    /// What the corrected force was corrected by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_arm: Option<Identified>,
    /// A loop of the shaker at each frequency.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shaker_loops: Vec<ShakerLoop>,
    /// Where the contact slips: how it goes with amplitude, at each frequency with enough levels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub backbones: Vec<Backbone>,
    /// The specimens' decay put together from two sinusoids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reconstruction: Option<Reconstruction>,
    /// The slope of every impact that counts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impact_slopes: Vec<ImpactSlope>,
}

impl Results {
    /// An empty document about `source`.
    pub fn new(source: Source) -> Self {
        Results { version: VERSION, source, ..Results::default() }
    }

    /// The substructuring result that the headline quotes: `internal` with the most IDMs over the main band,
    /// or the nearest thing to it that could be identified.
    pub fn headline_joint(&self) -> Option<&Joint> {
        self.joint
            .iter()
            .filter(|j| j.band_hz == MAIN_BAND && j.sliding_stiffness().is_some())
            .max_by_key(|j| headline_rank(&j.method, j.idms))
    }

    /// The estimate to quote over the main band, if it was made; whether it identified a degree of freedom is said there.
    pub fn quoted(&self) -> Option<&Averaged> {
        self.recommended.iter().find(|r| r.band_hz == MAIN_BAND)
    }

    /// The loops of the impacts, drawn with the raw force.
    pub fn impact_loops(&self) -> Option<&Hysteresis> {
        self.hysteresis.iter().find(|h| h.kind == Excitation::Impact && h.force == Force::Raw)
    }

    /// The check of this name.
    pub fn check(&self, name: &str) -> Option<&Check> {
        self.checks.iter().find(|c| c.name == name)
    }

    /// The document as text, for `results.json` and `--json`.
    ///
    /// # Errors
    /// Only if serialisation itself fails; numbers that are not finite are written as null.
    pub fn to_json(&self) -> serde_json::Result<String> {
        let mut text = serde_json::to_string(self)?;
        text.push('\n');
        Ok(text)
    }
}

#[cfg(test)]
mod shape_tests;

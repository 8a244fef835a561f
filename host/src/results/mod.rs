//! Results: one document with everything that was found, and its provenance.
//!
//! [`Results`] is `results.json`, field for field, with SI units in the names. It holds data only
//! and computes nothing. [`crate::report::document()`] builds it from the findings of an analysis;
//! the report and the terminal show it and add nothing. A value that is not known is null, never
//! NaN. Every document contains its [`Source`]: file, record ids, settings, version.

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

/// Version of the format: 1.
pub const VERSION: u32 = 1;

/// The band over which the headline is computed (the paper's Table 2).
pub const MAIN_BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };

/// All results. Scripts may rely on the first six fields; the others serve the report and may
/// change.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Results {
    /// Version of this format.
    pub version: u32,
    /// Provenance.
    pub source: Source,
    /// The result for which the campaign was measured; absent if no campaign was analysed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
    /// The joint by substructuring: method × IDM set × band.
    pub joint: Vec<Joint>,
    /// The estimates to quote, each with its interval, by band; they need six motions of both
    /// virtual points in the assembly.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recommended: Vec<Averaged>,
    /// The same estimates by bootstrap over hits, if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<Bootstrap>,
    /// Quality of the virtual points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub virtual_points: Vec<VirtualPoint>,
    /// The motions added by coupling, and the set of modes that they suggest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interface_modes: Option<InterfaceModes>,
    /// The joint line by line; absent if nothing was identified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_spectrum: Option<JointSpectrum>,
    /// The contact by loops.
    pub hysteresis: Vec<Hysteresis>,
    /// Whether the numbers are credible.
    pub checks: Vec<Check>,
    /// Every type of stiffness that was found along the sliding direction, with its meaning.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub side_by_side: Vec<SideBySide>,
    /// Methods that were refused, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refusal>,
    /// Data that were missing in the analysis, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Kept and refused hits per configuration.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub completeness: Vec<Completeness>,
    /// Positions of hammer and vibrometer.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub geometry: Vec<Place>,
    /// Every cell: hits kept, and its data quality.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<Cells>,
    /// All firings of the hammer.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// One FRF of the assembly compared with its noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_floor: Option<NoiseFloor>,
    /// A few example FRFs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frfs: Vec<FrfCurve>,
    /// The bands excited by the hammer.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub usable_bands: Vec<UsableBand>,
    /// One example loop.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub example_loop: Option<LoopCurve>,
    /// The parameters of the force correction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_arm: Option<Identified>,
    /// One loop of the shaker at each frequency.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shaker_loops: Vec<ShakerLoop>,
    /// For a slipping contact: its dependence on amplitude, at each frequency with enough levels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub backbones: Vec<Backbone>,
    /// The specimens' decay reconstructed from two sinusoids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reconstruction: Option<Reconstruction>,
    /// The slope of every impact that is used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impact_slopes: Vec<ImpactSlope>,
}

impl Results {
    /// An empty document with this `source`.
    pub fn new(source: Source) -> Self {
        Results { version: VERSION, source, ..Results::default() }
    }

    /// The substructuring result that the headline quotes: `internal` with the most IDMs over the
    /// main band, or the closest alternative that could be identified.
    pub fn headline_joint(&self) -> Option<&Joint> {
        self.joint
            .iter()
            .filter(|j| j.band_hz == MAIN_BAND && j.sliding_stiffness().is_some())
            .max_by_key(|j| headline_rank(&j.method, j.idms))
    }

    /// The estimate to quote over the main band, if there is one; it states which degrees of
    /// freedom are identified.
    pub fn quoted(&self) -> Option<&Averaged> {
        self.recommended.iter().find(|r| r.band_hz == MAIN_BAND)
    }

    /// The loops of the impacts with the raw force.
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

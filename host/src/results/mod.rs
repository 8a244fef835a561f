//! Results: one document with everything that was found, and its provenance.
//!
//! [`Results`] is `results.json`, field for field, with SI units in the names. It holds data only
//! and computes nothing. [`crate::report::document()`] builds it from the findings of an analysis;
//! the report and the terminal show it and add nothing. A value that is not known is null, never
//! NaN. Every document contains its [`Source`]: file, record ids, settings, version.
//!
//! Here: the answer, the checks, the comparison of two campaigns and the provenance. `joint`: the
//! joint by substructuring; `loops`: the contact by loops; `measured`: what was measured; `modal`:
//! the modes; `trend`: a quantity of several campaigns; `wear`: the wear runs.

use crate::campaign::store::SimulatedTruth;
use crate::contact::{Contradiction, Diagnosis, Doubt, HeldOut, Interval, OfFrequency};
use crate::substructuring::Band;
use serde::Serialize;
use std::collections::BTreeMap;

pub use crate::hysteresis::static_arm::Identified;
pub use crate::hysteresis::{Kind as Excitation, OverCycles, Shape};
pub use crate::substructuring::averaged::Averaged;
pub use crate::substructuring::joint_over_bands::BandStatistic as Statistics;

pub use joint::{
    Bootstrap, DIRECT, Goodness, InterfaceModes, Joint, JointSpectrum, Refusal, SpectrumCurve, VirtualPoint,
    headline_rank,
};
pub use loops::{Backbone, DecayStep, Force, Hysteresis, ImpactSlope, LoopCurve, Reconstruction, ShakerLoop};
pub use measured::{CellRow, Cells, FrfCurve, HitRow, NoiseFloor, Place, Role, UsableBand};
pub use modal::{
    ChartPoles, FirstMode, HitFrequency, ModalFit, ModeRow, Moving, PoleOnly, SensorPlace, SessionFrequency,
};
pub use trend::{
    CampaignOfStudy, FittedForm, FittedPoint, FoundByCampaign, StudiedQuantity, TrendOverCampaigns,
};
pub use wear::{WearMeans, WearRuns};

#[cfg(test)]
pub(crate) mod example_tests;
mod joint;
mod loops;
mod measured;
mod modal;
mod trend;
mod wear;

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
    /// The modes of all structures, by rising frequency.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<ModeRow>,
    /// How the modes of each structure were identified, with its stabilisation chart.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modal: Vec<ModalFit>,
    /// The assembly's first mode in every hit of a campaign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_mode: Option<FirstMode>,
    /// The contact by loops.
    pub hysteresis: Vec<Hysteresis>,
    /// The wear runs of a campaign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear: Option<WearRuns>,
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

/// The result for which the campaign was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The contact's own stiffness.
    pub contact: ContactAnswer,
    /// The stiffness between the arms by substructuring.
    pub between_arms: BetweenArms,
    /// The compliance between the arms in addition to the contact; null if either stiffness is not
    /// known, or if the additional compliance is not significant.
    pub clamp: Option<Clamp>,
    /// Whether the contact slips under the hammer.
    pub slip: Slip,
    /// The true values that an ideal measurement would find: only for a simulated rig, from its
    /// parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<SimulatedTruth>,
}

/// k_T and c_T of the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAnswer {
    /// k_T, N/m; null if it is not identified.
    pub k_t_n_per_m: Option<Interval>,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Option<Interval>,
    /// Data on which it is based.
    pub basis: Basis,
    /// The frequencies used, Hz.
    pub band_hz: Option<[f64; 2]>,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<&'static str, f64>,
    /// Explanation in one sentence.
    pub why: String,
    /// k_T bin by bin.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub of_frequency: Vec<OfFrequency>,
    /// Cells of the assembly predicted without their own signals.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub held_out: Vec<HeldOut>,
    /// How well the assumptions are satisfied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<Diagnosis>,
    /// Stated quantities that the data contradict; the interval allows for their errors.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contradictions: Vec<Contradiction>,
    /// Assumptions that are violated; then no k_T is reported.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// Data on which k_T is based.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// The specimen's rotation from points on it.
    SpecimenPoints,
    /// The same, and the shaker's levels that it corrects.
    Joint,
    /// None: there is no k_T.
    None,
}

/// The stiffness between the arms along the sliding direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BetweenArms {
    /// The stiffness, N/m; null if it is not identified.
    pub k_n_per_m: Option<Interval>,
    /// The estimate it is taken from: `fit`, `recommended` or `none`.
    pub basis: &'static str,
    /// Why this one, or why none.
    pub why: String,
}

/// The compliance between the arms in addition to the contact: clamps and specimens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clamp {
    /// Its stiffness in series with the contact, N/m.
    pub k_n_per_m: Interval,
}

/// Whether the contact slips under the hammer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slip {
    /// Whether it does; null if the hits do not allow a verdict.
    pub found: Option<bool>,
    /// The evidence.
    pub why: String,
}

/// Name of the check on the compliance between the arms in addition to the contact.
pub const SERIES_COMPLIANCE: &str = "series-compliance";
/// Name of the check on resonances of one specimen.
pub const HIDDEN_RESONANCE: &str = "hidden-resonance";
/// Name of the check on slip under the hammer.
pub const HAMMER_SLIP: &str = "hammer-slip";
/// Name of the check that the contact is the same in all hits.
pub const STEADY: &str = "contact-steady";
/// Name of the check that the fit of the contact predicts cells that it has not seen.
pub const PREDICTED: &str = "cells-predicted";
/// Name of the check that the data do not contradict what the plan states.
pub const AS_STATED: &str = "plan-as-stated";
/// Name of the check on wear.
pub const UNCHANGED: &str = "contact-unchanged";
/// Name of the check on the masses of fixed sensors.
pub const SENSOR_MASSES: &str = "sensor-masses";
/// Name of the check on the rigid motions added by coupling.
pub const INTERFACE_MODES: &str = "interface-modes";
/// Name of the check that compares n_i with n_c.
pub const INTERNALS: &str = "internals";
/// Name of the check that all records are of one structure.
pub const ONE_STRUCTURE: &str = "one-structure";
/// Name of the check that A and B are the same structures in all configurations.
pub const SAME_IN_ALL: &str = "same-in-all-configurations";
/// Name of the check that A and B, coupled by the joint found, reproduce the measured assembly.
pub const BACK_COUPLING: &str = "back-coupling";

/// One check of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Its name, which does not change, because scripts look it up.
    pub name: String,
    /// Passed, failed, or (null) undecided by the data.
    pub ok: Option<bool>,
    /// The frequency concerned, Hz, if it is a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// Its meaning for the reader, in one or two sentences.
    pub meaning: String,
    /// Its figures, by name with unit.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Check {
    /// A check without figures.
    pub fn new(name: &str, ok: Option<bool>, meaning: impl Into<String>) -> Self {
        Check { name: name.into(), ok, frequency_hz: None, meaning: meaning.into(), values: BTreeMap::new() }
    }

    /// The same check at this frequency, Hz.
    #[must_use]
    pub fn at(mut self, frequency_hz: f64) -> Self {
        self.frequency_hz = Some(frequency_hz);
        self
    }

    /// The same check with one more figure; values that are not finite are omitted.
    #[must_use]
    pub fn with(mut self, name: &str, value: f64) -> Self {
        if value.is_finite() {
            self.values.insert(name.into(), value);
        }
        self
    }
}

/// Comparison of two campaigns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// Version of this format.
    pub version: u32,
    /// Sources of both campaigns, A first.
    pub sources: [Source; 2],
    /// Whether the contacts differ, decided by k_T, or by the stiffness between the arms if there
    /// is none; null if neither is known in both.
    pub differ: Option<bool>,
    /// The verdict in a sentence.
    pub verdict: String,
    /// All quantities that both have.
    pub differences: Vec<Difference>,
    /// Quantities that only one of them has, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
}

/// One quantity of both campaigns, SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Its name.
    pub quantity: String,
    /// Its unit: `N/m` or `N s/m`.
    pub unit: &'static str,
    /// Value in the first campaign.
    pub a: Interval,
    /// Value in the second campaign.
    pub b: Interval,
    /// The second minus the first.
    pub b_minus_a: Interval,
    /// Whether the interval of the difference excludes zero.
    pub differ: bool,
}

/// Hits of one configuration.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Completeness {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// Cells of the plan.
    pub cells: usize,
    /// Cells with all planned hits.
    pub cells_complete: usize,
    /// Number of hits planned to be kept.
    pub wanted: usize,
    /// Hits kept.
    pub kept: usize,
    /// Hits refused, by verdict.
    pub refused: BTreeMap<String, usize>,
}

/// Rounds to `digits` significant decimal digits, which keeps files small without visible effect in
/// a figure.
pub fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let exponent = digits - 1 - value.abs().log10().floor() as i32;
    if exponent.abs() > 300 {
        return value;
    }
    let scale = 10f64.powi(exponent.abs());
    if exponent >= 0 { (value * scale).round() / scale } else { (value / scale).round() * scale }
}

/// One type of stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideBySide {
    /// The method.
    pub found: String,
    /// Mean, N/m.
    pub mean_n_per_m: f64,
    /// Its scatter or standard deviation, N/m.
    pub std_n_per_m: f64,
    /// Its meaning, and what it may be used for.
    pub meaning: String,
}

/// [`Source::kind`] of a single time record.
pub const RECORD: &str = "record";

/// The setting of a [`RECORD`] which states that its signals are not those of the contact itself:
/// the slope of its loops then includes everything between the measured points.
pub const BESIDE_THE_CONTACT: &str = "measured";

/// Provenance: enough to compute the same result again from the campaign file alone.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Source {
    /// The file analysed (its name without the folder).
    pub file: String,
    /// What was analysed: `campaign`, `frf` or `record`.
    pub kind: String,
    /// Whether the device was simulated.
    pub simulated: bool,
    /// The software that computed the results.
    pub software: Software,
    /// When the campaign was started according to its file, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<String>,
    /// The device's self-description: name, firmware, schema.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub device: BTreeMap<String, String>,
    /// Calibrations entered in addition to those of device and plan, in the order of entry; the
    /// last one of a channel applies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibrations: Vec<Calibrated>,
    /// Evidence of each change of structure that was accepted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub structure_changes: Vec<String>,
    /// What was measured again after the hits, for each time that it was entered: places,
    /// directions, and what is known beforehand.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured_again: Vec<String>,
    /// The specimen's temperature measured by the controller: minimum, mean and maximum over all
    /// sessions, °C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 3]>,
    /// Settings of the analysis, by name with unit: windows, lines, virtual points.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Ids of the records used, per configuration, as closed ranges.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub records: BTreeMap<String, Vec<[i64; 2]>>,
    /// Counters of the link between device and host over the whole campaign.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub link: BTreeMap<String, u64>,
}

/// A change of a channel's calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibrated {
    /// When it was entered, RFC 3339.
    pub utc: String,
    /// The first session to which it applies.
    pub from_session: i64,
    /// The channel.
    pub channel: String,
    /// The unit of the measured quantity.
    pub unit: String,
    /// Sensitivity before and after, V per unit, with the sign.
    pub sensitivity_v: [f64; 2],
    /// Delay before and after, s.
    pub delay_s: [f64; 2],
    /// Relative standard uncertainty of the sensitivity.
    pub uncertainty: Option<f64>,
    /// The sensor: model, serial number, date of calibration, if stated.
    pub sensor: Vec<String>,
    /// Why it was entered.
    pub reason: String,
}

/// A program and its version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Software {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
}

impl Default for Software {
    /// Describes this program.
    fn default() -> Self {
        Software { name: "jointrig".into(), version: env!("CARGO_PKG_VERSION").into() }
    }
}

/// Ids as closed ranges: 1, 2, 3, 7 becomes 1…3, 7…7. The ids need not be sorted.
pub fn ranges(ids: impl IntoIterator<Item = i64>) -> Vec<[i64; 2]> {
    let mut ids: Vec<i64> = ids.into_iter().collect();
    ids.sort_unstable();
    ids.dedup();
    let mut ranges: Vec<[i64; 2]> = Vec::new();
    for id in ids {
        match ranges.last_mut() {
            Some(last) if last[1].checked_add(1) == Some(id) => last[1] = id,
            _ => ranges.push([id, id]),
        }
    }
    ranges
}

#[cfg(test)]
mod shape_tests;

#[cfg(test)]
mod curves_tests {
    use super::rounded;

    #[test]
    fn rounding_keeps_significant_digits() {
        assert_eq!(rounded(1.234_567_8e-8, 4).to_string().len(), "0.00000001235".len());
        assert_eq!(rounded(-26_843_211.0, 3), -26_800_000.0);
        assert_eq!(rounded(0.0, 3), 0.0);
        assert!(rounded(f64::NAN, 3).is_nan());
    }
}

#[cfg(test)]
mod source_tests {
    use super::*;

    #[test]
    fn ids_become_closed_ranges() {
        assert_eq!(ranges([3, 1, 2, 7, 7, i64::MAX]), [[1, 3], [7, 7], [i64::MAX, i64::MAX]]);
        assert!(ranges([]).is_empty());
    }
}

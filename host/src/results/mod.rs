//! Results: one document with everything that was found, and its provenance.
//!
//! [`Results`] is `results.json`, field for field, with SI units in the names. It holds data only
//! and computes nothing. [`crate::report::document()`] builds it from the findings of an analysis;
//! the report and the terminal show it and add nothing. A value that is not known is null, never
//! NaN. Every document contains its [`Source`]: file, record ids, settings, version.
//!
//! The answer: the main results, each with its interval or the reason why there is none.
//!
//! Checks: whether a number is credible.
//!
//! Comparison of two campaigns: differences with their intervals, and whether they are significant.
//!
//! Progress of the plan: kept and refused hits per configuration.
//!
//! Curves for the figures: a few FRFs with their coherence.
//!
//! Quality of the interface: how well the virtual points reproduce it, and which motions coupling
//! adds.
//!
//! The joint by substructuring: values over bands, and the spectra from which they are computed.
//!
//! The contact by hysteresis loops: values per type of excitation, and one example loop.
//!
//! Details of what was measured: places, cells, hits; with the data quality of each cell.
//!
//! The specimens' decay after one hit: measured, and reconstructed from two sinusoids (the paper's
//! Fig. 9).
//!
//! FBS and loops side by side (the paper's Tables 2 and 3).
//!
//! Provenance of a result: file, records, settings, software, link.

use crate::campaign::store::SimulatedTruth;
use crate::contact::{Diagnosis, Doubt, Interval, OfFrequency, Shares};
use crate::hysteresis::backbone::Law;
use crate::hysteresis::impact::DecayCycle;
use crate::hysteresis::{LoopFinding, ShapeEvidence};
use crate::identified::SCATTER_OF_LINES;
use crate::substructuring::averaged::{DofEstimate, Replicates};
use crate::substructuring::{Band, Dof};
use serde::Serialize;
use std::collections::BTreeMap;

pub use crate::hysteresis::static_arm::Identified;
pub use crate::hysteresis::{Kind as Excitation, OverCycles, Shape};
pub use crate::substructuring::averaged::Averaged;
pub use crate::substructuring::joint_over_bands::BandStatistic as Statistics;

#[cfg(test)]
pub(crate) mod example_tests;

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
    /// How well the assumptions are satisfied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<Diagnosis>,
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
/// Name of the check on wear.
pub const UNCHANGED: &str = "contact-unchanged";
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

/// What an FRF shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Response nearest to the impact, same direction.
    DrivingPoint,
    /// Response far from the impact (in AJB: across the joint).
    Transfer,
    /// The vibrometer on specimen A.
    SpecimenA,
    /// The vibrometer on specimen B.
    SpecimenB,
    /// Specimen A minus specimen B: Δx.
    Relative,
    /// The load cells' sum T, newton per newton of the hammer.
    Force,
    /// A point on the arm of A, from the same impact as the specimens' curves.
    ArmA,
    /// A point on the arm of B, from the same impact.
    ArmB,
}

/// One FRF: receptance with coherence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrfCurve {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// What it shows.
    pub role: Role,
    /// The response channel.
    pub output: String,
    /// The impact.
    pub input: String,
    /// Hits averaged.
    pub hits: usize,
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Magnitude of the receptance, m/N (of `force`: N/N), line by line.
    pub magnitude_m_per_n: Vec<f64>,
    /// Phase, degrees, −180…180.
    pub phase_deg: Vec<f64>,
    /// Coherence, 0…1; empty for fewer than two hits.
    pub coherence: Vec<f64>,
}

impl FrfCurve {
    /// Frequency of a line, Hz.
    pub fn frequency_hz(&self, line: usize) -> f64 {
        self.first_hz + self.step_hz * line as f64
    }
}

/// The band in which the hammer's force was sufficient, per configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UsableBand {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// Band in which the force's auto-spectrum is within 6 dB of its level at low frequency, Hz.
    pub band_hz: Band,
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

/// Quality of one virtual point with one set of modes, on the substructure alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPoint {
    /// `A` or `B`.
    pub substructure: String,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The modes.
    pub modes: Vec<Dof>,
    /// Condition number of the sensors' R, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of the impacts' R.
    pub condition_impacts: f64,
    /// Fraction of the measured motion that the modes reproduce, 0…1, mean over the main band (over
    /// all lines if there are none in it).
    pub overall_sensor: f64,
    /// Fraction of the measured force that they reproduce.
    pub overall_impact: f64,
    /// Specific consistency by channel, 0…1.
    pub sensors: BTreeMap<String, f64>,
    /// Specific consistency by impact, 0…1.
    pub impacts: BTreeMap<String, f64>,
    /// Fraction of the lines with a passive driving point, by mode.
    pub passivity: BTreeMap<Dof, f64>,
    /// Agreement between Y_ij and Y_ji, 0…1; null with one mode.
    pub reciprocity: f64,
}

/// The CMIF of Eq. (B.1), and the set of modes it suggests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InterfaceModes {
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// The largest singular values, \[curve\]\[line\], m/N.
    pub singular_values_m_per_n: Vec<Vec<f64>>,
    /// Participation of each of x, y, z, rx, ry, rz in each curve, 0…1: mean over the main band
    /// (over all lines if there are none in it).
    pub participation: Vec<[f64; 6]>,
    /// Fraction of the motion added by coupling that 2, 4 and 6 modes explain, 0…1.
    pub explained: BTreeMap<usize, f64>,
    /// Number of modes suggested.
    pub suggested: usize,
    /// Reason for the suggestion.
    pub reason: String,
}

/// Bootstrap: the hits of every interface cell are resampled repeatedly.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bootstrap {
    /// The band, Hz.
    pub band_hz: Band,
    /// Number of replicates.
    pub replicates: usize,
    /// Seed of the random numbers; the same seed gives the same figures.
    pub seed: u64,
    /// Result of the replicates, i.e. the scatter of the hits only. N/m; N m/rad for rotations.
    pub hits: BTreeMap<Dof, Replicates>,
    /// The recommended estimate with that scatter instead of the propagated noise.
    pub joint: BTreeMap<Dof, DofEstimate>,
}

/// Method name of T/Δx at the specimens.
pub const DIRECT: &str = "direct";

/// Rank of a row: the headline quotes the row of the main band with the largest rank.
pub fn headline_rank(method: &str, idms: usize) -> (bool, bool, usize) {
    (method == "internal", method == "internal-printed", idms)
}

/// One method, one set of interface deformation modes, one band.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Joint {
    /// The method's name, as on the command line.
    pub method: String,
    /// Interface deformation modes of each virtual point: 2, 4, 6, or another choice.
    pub idms: usize,
    /// The modes; empty if no virtual point is used.
    pub modes: Vec<Dof>,
    /// The band, ends included, Hz.
    pub band_hz: Band,
    /// Stiffness of the translations by direction (`x`, `y`, `z`), N/m.
    pub stiffness_n_per_m: BTreeMap<String, Statistics>,
    /// Damping of the translations by direction, N s/m.
    pub damping_n_s_per_m: BTreeMap<String, Statistics>,
    /// Stiffness of the rotations (`rx`, `ry`, `rz`), N m/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub stiffness_n_m_per_rad: BTreeMap<String, Statistics>,
    /// Damping of the rotations, N m s/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub damping_n_m_s_per_rad: BTreeMap<String, Statistics>,
    /// Stiffness of flexible interface modes by name: N m for extensions, N m² for the others.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub stiffness_flexible_si: BTreeMap<String, Statistics>,
    /// Stiffness between two degrees of freedom (`y-z`, `z-rx`, …): N/m, N/rad or N m/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub coupling_si: BTreeMap<String, Statistics>,
    /// Damping between them, in the same units times seconds.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub coupling_damping_si: BTreeMap<String, Statistics>,
    /// Standard deviation of the stiffness of one line due to the FRFs' noise alone, N/m by
    /// direction: by linear propagation through virtual points and method, median over the band.
    /// Absent where a variance is not known.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub noise_n_per_m: BTreeMap<String, f64>,
    /// Lines of the band that were used.
    pub lines: usize,
    /// For `fit`: how well the model describes the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goodness: Option<Goodness>,
    /// Warnings that a reader must know before using these numbers.
    pub warnings: Vec<String>,
}

impl Joint {
    /// Stiffness along the sliding direction z, N/m.
    pub fn sliding_stiffness(&self) -> Option<&Statistics> {
        self.stiffness_n_per_m.get("z")
    }

    /// Whether the sliding stiffness is positive and reliable enough to be quoted alone: the
    /// scatter of its lines is within `SCATTER_OF_LINES` times the mean, and their noise within
    /// the mean.
    pub fn identified(&self) -> bool {
        let noise = self.noise_n_per_m.get("z").copied().unwrap_or(0.0);
        self.sliding_stiffness()
            .is_some_and(|k| k.mean > 0.0 && k.std <= SCATTER_OF_LINES * k.mean && noise <= k.mean)
    }
}

/// How well a model with K and C describes all cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goodness {
    /// χ² per degree of freedom; about 0.8 to 1 if model, noise and assumed geometry errors
    /// describe the data.
    pub chi_square_per_dof: f64,
    /// The largest geometry error in the fit, in assumed standard deviations.
    pub largest_error: f64,
    /// Whether the search converged.
    pub settled: bool,
}

/// A method that could not be applied, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refusal {
    /// The method's name.
    pub method: String,
    /// Interface deformation modes of each virtual point.
    pub idms: usize,
    /// The reason given by the method.
    pub reason: String,
}

/// Stiffness and damping line by line.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct JointSpectrum {
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// One curve for each method, IDM set and direction.
    pub curves: Vec<SpectrumCurve>,
}

/// One diagonal term of the joint over frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpectrumCurve {
    /// The method's name.
    pub method: String,
    /// Interface deformation modes of each virtual point.
    pub idms: usize,
    /// Direction: `x`, `y` or `z`.
    pub dof: String,
    /// Re Z, N/m; null if there is no value for the line.
    pub stiffness_n_per_m: Vec<Option<f64>>,
    /// Standard deviation of the stiffness from the FRFs' noise alone, N/m; empty where their
    /// variance is not known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stiffness_noise_n_per_m: Vec<Option<f64>>,
    /// Damping, N s/m; null if there is no value for the line.
    pub damping_n_s_per_m: Vec<Option<f64>>,
}

/// The force used for the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Force {
    /// The uncorrected sum of the load cells.
    Raw,
    /// Corrected for the static arm's inertia and the parallel path to ground.
    Corrected,
}

/// Results of loops of one type.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hysteresis {
    /// The force used.
    pub force: Force,
    /// The excitation of the contact.
    pub kind: Excitation,
    /// Frequency of the excitation (shaker) or of the cycle (impact), Hz.
    pub frequency_hz: Option<f64>,
    /// Half the swing of Δx, m (mean over cycles).
    pub amplitude_m: Option<f64>,
    /// The most frequent shape of the cycles.
    pub shape: Shape,
    /// k_T, N/m. For a record whose signals are declared to be those of the contact: slope of the
    /// stick part. In a campaign the signals are those of points near the contact and of load cells
    /// behind an arm; there it is given for a steady level whose force and Δx at the contact are
    /// known from the hits, with an interval that includes all contributions (`std` is the scatter
    /// over stretches of its record). Null otherwise.
    pub k_t_n_per_m: Option<OverCycles>,
    /// The corresponding c_T in a campaign, N s/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c_t_n_s_per_m: Option<Interval>,
    /// Relative standard deviation of this k_T by cause.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_t_budget: Option<Shares>,
    /// For a level of a campaign: the data on which k_T is based, or why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_t_why: Option<String>,
    /// The corresponding slope in a campaign, N/m: between the measured points, including
    /// everything else between them; null if the loop has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_between_spots_n_per_m: Option<OverCycles>,
    /// The part of the force's swing after each reversal in which it was fitted; only if something
    /// slips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stick_part: Option<[f64; 2]>,
    /// Slope of T on Δx over the whole loop, N/m.
    pub k_eq_n_per_m: Option<OverCycles>,
    /// Peak secant of the averaged loop, N/m. Near a hidden resonance it differs from the slopes,
    /// so it has its own name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_secant_n_per_m: Option<f64>,
    /// Magnitude of the ratio of fundamentals T₁/Δx₁, N/m; the remark on the secant applies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_fundamental_n_per_m: Option<f64>,
    /// Area of the closed loop, J.
    pub energy_j: Option<OverCycles>,
    /// Friction limit μN from the plateau's median, N; only in gross slip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_limit_n: Option<f64>,
    /// Friction limit over normal load; null if the contact did not slip or the load is not known.
    pub friction_coefficient: Option<f64>,
    /// Phase by which Δx lags T, degrees; for impacts over the first cycle, mean over hits.
    pub phase_deg: Option<f64>,
    /// Evidence for the shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape_evidence: Option<ShapeEvidence>,
    /// Every cycle of one record's decay.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub decay_cycles: Vec<DecayCycle>,
    /// The decay's cycles over all hits, from the first one on.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub decay: Vec<DecayStep>,
    /// Id of the shaker's level in the campaign file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<i64>,
    /// Before or after the hammer's cells, for a level of a campaign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moment: Option<&'static str>,
    /// Ids of the records used, as closed ranges.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<[i64; 2]>,
    /// Faults of the loops and corrections made, each with its magnitude.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<LoopFinding>,
    /// Warnings that a reader must know before using these numbers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Hysteresis {
    /// Slope of the stick part, under either name. The k_T of a level is excluded: it is not read
    /// from the loop of this row.
    pub fn stick_slope(&self) -> Option<OverCycles> {
        let read_off = self.k_t_n_per_m.filter(|_| self.k_t_budget.is_none());
        self.slope_between_spots_n_per_m.or(read_off)
    }

    /// k_T of a level of a campaign, with its interval.
    pub fn own_k_t(&self) -> Option<Interval> {
        let k = self.k_t_n_per_m.filter(|_| self.k_t_budget.is_some())?;
        Some(Interval { mean: k.mean, ci95: k.ci95? })
    }

    /// Moves the stick slope to the slope between the measured points, since in a campaign the
    /// slope of a loop is never k_T.
    #[must_use]
    pub fn between_spots(self) -> Self {
        Hysteresis { k_t_n_per_m: None, slope_between_spots_n_per_m: self.stick_slope(), ..self }
    }
}

/// Dependence of a slipping contact on amplitude: the law fitted to the shaker's levels of one
/// frequency, raw force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Backbone {
    /// Frequency of the levels, Hz.
    pub frequency_hz: f64,
    /// Before or after the hammer's cells.
    pub moment: Option<&'static str>,
    /// Ids of the levels, by amplitude.
    pub levels: Vec<i64>,
    /// The law.
    #[serde(flatten)]
    pub law: Law,
}

/// One cycle of the decay over all hits used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DecayStep {
    /// Number of the cycle, from 1.
    pub cycle: usize,
    /// Least-squares slope of T on Δx over it, N/m; `cycles` counts the hits.
    pub k_eq_n_per_m: OverCycles,
    /// Phase by which Δx lags T, degrees (mean over hits).
    pub phase_deg: f64,
    /// Half the swing of Δx, m (mean over hits).
    pub amplitude_m: f64,
}

/// The samples of the decay for the loop figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopCurve {
    /// The record.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Seconds between samples.
    pub step_s: f64,
    /// Relative displacement x_A − x_B, m.
    pub displacement_m: Vec<f64>,
    /// Displacement of specimen A, m.
    pub displacement_a_m: Vec<f64>,
    /// Displacement of specimen B, m.
    pub displacement_b_m: Vec<f64>,
    /// Sum of the load cells, N.
    pub force_n: Vec<f64>,
    /// Range of samples that is the first cycle.
    pub cycle: [usize; 2],
    /// Ranges of samples of the first cycle and the following ones that are shown.
    pub cycles: Vec<[usize; 2]>,
    /// The fitted slope, N/m.
    pub slope_n_per_m: f64,
}

/// The slope from one impact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImpactSlope {
    /// The record.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Least-squares slope of T on Δx over the first cycle, N/m.
    pub k_eq_n_per_m: f64,
}

/// One cycle of a level of the shaker, averaged over its record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShakerLoop {
    /// The level's id in the campaign file.
    pub level: i64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Before or after the hammer's cells.
    pub moment: &'static str,
    /// Its shape.
    pub shape: Shape,
    /// Least-squares slope over the whole loop, N/m.
    pub slope_n_per_m: f64,
    /// Δx over one cycle, equally spaced in time, m.
    pub displacement_m: Vec<f64>,
    /// T at the same points, N.
    pub force_n: Vec<f64>,
    /// Displacement of specimen A over the record's first cycle, m.
    pub displacement_a_m: Vec<f64>,
    /// Displacement of specimen B over the same cycle, m.
    pub displacement_b_m: Vec<f64>,
}

/// A place of the plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Its name.
    pub name: String,
    /// `impact` or `response`.
    pub kind: &'static str,
    /// Its body: 1 interface of A, 2 of B, 3 internal of A, 4 of B, 5 specimen A, 6 specimen B.
    pub grouping: u8,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// The hammer's direction; absent for a response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

/// One cell: hits planned and kept, and its data quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellRow {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// The impact's name.
    pub impact: String,
    /// The response location's name.
    pub response: String,
    /// Number of hits planned.
    pub wanted: usize,
    /// Number of hits kept.
    pub kept: usize,
    /// Number of hits refused, by verdict.
    pub refused: BTreeMap<String, usize>,
    /// Coherence of the response along the hit's own direction, 0…1, at the frequencies of
    /// [`Cells`]; empty for fewer than two hits.
    pub coherence: Vec<f64>,
    /// Relative random error of that FRF: √((1 − γ²)/(2nγ²)), median over the main band.
    pub random_error: Option<f64>,
}

/// All cells.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Cells {
    /// Frequencies of the coherence values, Hz: the lines nearest to a logarithmically spaced grid.
    pub frequency_hz: Vec<f64>,
    /// The cells, in the order of the plan.
    pub cells: Vec<CellRow>,
}

/// One firing of the hammer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HitRow {
    /// The record.
    pub record: i64,
    /// Peak of the force, N.
    pub peak_n: f64,
    /// Duration of the coil's pulse, µs.
    pub pulse_us: u32,
    /// The final verdict.
    pub verdict: String,
    /// Whether analysis uses it.
    pub kept: bool,
}

/// One FRF compared with its own noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// Configuration.
    pub configuration: String,
    /// The response channel.
    pub output: String,
    /// The impact.
    pub input: String,
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Magnitude of the receptance, m/N.
    pub magnitude_m_per_n: Vec<f64>,
    /// Its standard deviation from noise, m/N.
    pub noise_m_per_n: Vec<f64>,
    /// Magnitude of its inverse, the dynamic stiffness at this point, N/m.
    pub dynamic_stiffness_n_per_m: Vec<f64>,
}

/// One hit's decay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reconstruction {
    /// The record.
    pub record: i64,
    /// The resonance that only one specimen has, Hz.
    pub hidden_hz: f64,
    /// The mode common to all signals, Hz.
    pub common_hz: f64,
    /// Seconds between samples.
    pub step_s: f64,
    /// Measured displacement of specimen A, m.
    pub displacement_a_m: Vec<f64>,
    /// Measured displacement of specimen B, m.
    pub displacement_b_m: Vec<f64>,
    /// Displacement of A reconstructed from both sinusoids, m.
    pub rebuilt_a_m: Vec<f64>,
    /// Displacement of B reconstructed from the common one only, m.
    pub rebuilt_b_m: Vec<f64>,
    /// Fraction of A's variance explained by both, and by the common one only.
    pub explained_a: [f64; 2],
    /// Fraction of B's variance explained by the common one.
    pub explained_b: f64,
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

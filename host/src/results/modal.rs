//! The modes of the structures, and how they were identified.

use crate::contact::Interval;
use crate::modes::OutputPoint;
use crate::substructuring::Band;
use serde::Serialize;

/// One mode of a structure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeRow {
    /// `A`, `B` or `AJB`; absent for FRFs of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// Natural frequency |λ|/2π, Hz.
    pub frequency_hz: Interval,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: Interval,
    /// The pole λ, 1/s: real and imaginary part.
    pub pole_per_s: [f64; 2],
    /// `unit-modal-a`: modal A is one, shape and participation are in √(m/(N s));
    /// `largest-output-is-one`: the participation has the unit of the residue, m/(N s).
    pub scaling: &'static str,
    /// The shape at each output.
    pub shape: Vec<Moving>,
    /// The participation of each input.
    pub participation: Vec<Moving>,
    /// Modal phase collinearity: 1 if all points move in phase or in opposite phase.
    pub phase_collinearity: f64,
    /// The output that moves most.
    pub largest: String,
    /// By how much χ² would rise without this mode, in units of the noise.
    pub evidence: f64,
}

/// The complex component of a shape or a participation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moving {
    /// The output or input.
    pub name: String,
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// Standard deviations of the real and imaginary part.
    pub std: [f64; 2],
}

/// How the modes of one structure were identified.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModalFit {
    /// `A`, `B` or `AJB`; absent for FRFs of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// The band, Hz.
    pub band_hz: Band,
    /// Place and direction of each output, in the order of the shapes.
    pub outputs: Vec<OutputPoint>,
    /// The inputs, in the order of the participations.
    pub inputs: Vec<String>,
    /// Error of the FRFs in addition to their noise, as a fraction; the intervals contain it.
    pub frf_error: f64,
    /// χ² per degree of freedom, near 1 if the modes explain the FRFs within their noise; null if
    /// the noise is not known.
    pub chi2_per_dof: Option<f64>,
    /// Number of real values minus that of parameters.
    pub degrees_of_freedom: f64,
    /// Powers of s of the residual terms, which describe modes outside the band.
    pub residual_powers: Vec<i32>,
    /// Poles of the model that are not modes: outside the band, too near to its ends, or damped
    /// beyond the limit.
    pub background: Vec<PoleOnly>,
    /// What limits the use of these modes, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The sensors whose places are known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<SensorPlace>,
    /// The poles of rising model orders, by how stable they are, for the stabilisation chart.
    pub chart: Vec<ChartPoles>,
}

/// Frequency and damping of a pole that is not a mode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoleOnly {
    /// |λ|/2π, Hz.
    pub frequency_hz: f64,
    /// −Re λ/|λ|.
    pub damping_ratio: f64,
}

/// A sensor's place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorPlace {
    /// Its name.
    pub name: String,
    /// Its position, m.
    pub position_m: [f64; 3],
}

/// Poles of the stabilisation chart. A pole is stable in frequency, damping or shape if it is near
/// a pole of the order below.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChartPoles {
    /// 0 new, 1 stable in frequency, 2 also in damping or in shape, 3 also in both.
    pub stable: u8,
    /// Number of poles of the model that each belongs to.
    pub order: Vec<usize>,
    /// Their natural frequencies, Hz.
    pub frequency_hz: Vec<f64>,
}

/// The lowest mode of the assembly that the hits show, hit by hit: whether it changed over the
/// campaign.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstMode {
    /// The mode's natural frequency from all FRFs, Hz.
    pub mode_hz: f64,
    /// Hits that were tried; those without enough signal are not listed.
    pub hits_tried: usize,
    /// Change of its frequency from the first hit to the last, Hz; null with too few cells, or if
    /// it is not small against the distance to the nearest other mode.
    pub change_hz: Option<Interval>,
    /// Whether it changed; null if that is not clear.
    pub drifts: Option<bool>,
    /// What this means, in a sentence.
    pub meaning: String,
    /// Each session.
    pub sessions: Vec<SessionFrequency>,
    /// Each hit, in the order of the records.
    pub hits: Vec<HitFrequency>,
}

/// Frequency of a mode in one session; differences between places of impact are removed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionFrequency {
    /// The session.
    pub session: i64,
    /// Number of its hits.
    pub hits: usize,
    /// Mean frequency, Hz.
    pub frequency_hz: f64,
    /// Its 95 % interval from the scatter of the hits; null for a single hit.
    pub ci95: Option<[f64; 2]>,
}

/// Frequency of a mode in one hit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HitFrequency {
    /// The record.
    pub record: i64,
    /// Its session.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<i64>,
    /// The place of impact.
    pub impact: String,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its 95 % interval, from what the fit leaves of this hit.
    pub ci95: [f64; 2],
}

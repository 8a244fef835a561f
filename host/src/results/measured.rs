//! What was measured: places, cells and hits with the data quality of each cell, a few FRFs with
//! their coherence for the figures, and an FRF compared with its noise.

use crate::substructuring::Band;
use serde::Serialize;
use std::collections::BTreeMap;

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

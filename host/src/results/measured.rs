//! Details of what was measured: places, cells, hits; with the data quality of each cell.

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

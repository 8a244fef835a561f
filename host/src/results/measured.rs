//! What was measured, one by one: places, cells, hits; and how well each was heard.

use serde::Serialize;
use std::collections::BTreeMap;

/// A place of the plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Its name.
    pub name: String,
    /// `impact` or `response`.
    pub kind: &'static str,
    /// What it lies on: 1 interface of A, 2 of B, 3 internal of A, 4 of B, 5 specimen A, 6 specimen B.
    pub grouping: u8,
    /// Where, m.
    pub position_m: [f64; 3],
    /// The hammer's direction; none for a response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

/// One cell: what was wanted and kept, and how well it was heard.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellRow {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// The impact's name.
    pub impact: String,
    /// The response location's name.
    pub response: String,
    /// Hits wanted.
    pub wanted: usize,
    /// Hits kept.
    pub kept: usize,
    /// Hits refused, by verdict.
    pub refused: BTreeMap<String, usize>,
    /// Coherence of the response along the hit's own direction, 0…1, at the frequencies of [`Cells`]; empty for fewer than two hits.
    pub coherence: Vec<f64>,
    /// Random error of that FRF, as a part of it: √((1 − γ²)/(2nγ²)), median over the main band.
    pub random_error: Option<f64>,
}

/// All cells.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Cells {
    /// Where coherence is given, Hz: lines nearest to places evenly spread over the logarithm.
    pub frequency_hz: Vec<f64>,
    /// In the order of the plan.
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
    /// The verdict that counts.
    pub verdict: String,
    /// Whether analysis uses it.
    pub kept: bool,
}

/// One FRF against its own noise.
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
    /// Distance of lines, Hz.
    pub step_hz: f64,
    /// Magnitude of the receptance, m/N.
    pub magnitude_m_per_n: Vec<f64>,
    /// Its standard deviation from noise, m/N.
    pub noise_m_per_n: Vec<f64>,
    /// Magnitude of its inverse, the dynamic stiffness seen at this point, N/m.
    pub dynamic_stiffness_n_per_m: Vec<f64>,
}

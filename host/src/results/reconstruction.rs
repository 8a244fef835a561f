//! The specimens' decay after one hit: measured, and reconstructed from two sinusoids (the paper's
//! Fig. 9).

use serde::Serialize;

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

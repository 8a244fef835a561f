//! The specimens' decay after one hit, measured, and put together from two sinusoids (the paper's Fig. 9).

use serde::Serialize;

/// One hit's decay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reconstruction {
    /// The record it is from.
    pub record: i64,
    /// The resonance that only one specimen has, Hz.
    pub hidden_hz: f64,
    /// The mode that all share, Hz.
    pub common_hz: f64,
    /// Seconds between samples.
    pub step_s: f64,
    /// Measured displacement of specimen A, m.
    pub displacement_a_m: Vec<f64>,
    /// Measured displacement of specimen B, m.
    pub displacement_b_m: Vec<f64>,
    /// Of A, from both sinusoids, m.
    pub rebuilt_a_m: Vec<f64>,
    /// Of B, from the common one alone, m.
    pub rebuilt_b_m: Vec<f64>,
    /// Part of A's variance that both explain, and that the common one alone does.
    pub explained_a: [f64; 2],
    /// Part of B's variance that the common one explains.
    pub explained_b: f64,
}

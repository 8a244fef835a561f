//! Result of the analysis of a record's loops.

use super::finding::LoopFinding;
use super::impact::DecayCycle;
use super::loops::OverCycles;
use super::shape::{Shape, ShapeEvidence};
use num_complex::Complex;
use serde::Serialize;

/// How the contact was moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Steadily, at one frequency.
    Shaker,
    /// By one hit, decaying.
    Impact,
}

/// Full result for a record's loops. The loop of a shaker record is periodic; those of an impact
/// are its first cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopAnalysis {
    /// How the contact was moved.
    pub kind: Kind,
    /// Excitation frequency, or the dominant mode of the decay, Hz.
    pub frequency_hz: f64,
    /// Half the swing of Δx (averaged loop; first cycle of a decay), m.
    pub amplitude_m: f64,
    /// Half the swing of T in the same loop, N.
    pub force_amplitude_n: f64,
    /// The loop's shape.
    pub shape: Shape,
    /// Evidence for the shape; `None` for a decay, where the shape follows from the drop in
    /// frequency at large amplitude.
    pub shape_evidence: Option<ShapeEvidence>,
    /// k_T: slope of the stick part, N/m. `None` for an ellipse.
    pub k_t_n_per_m: Option<OverCycles>,
    /// The fraction of the force's swing after each reversal over which k_T was fitted; only if
    /// something slips.
    pub stick_part: Option<[f64; 2]>,
    /// k_eq: least-squares slope over the whole loop, N/m.
    pub k_eq_n_per_m: OverCycles,
    /// Loop area per cycle, J. `None` for a decay, whose loops do not close.
    pub energy_j: Option<OverCycles>,
    /// Peak secant of the averaged loop, N/m.
    pub k_secant_n_per_m: Option<f64>,
    /// T₁/Δx₁ of the averaged loop, N/m (complex: real part, imaginary part).
    pub k_fundamental_n_per_m: Option<Complex<f64>>,
    /// μN from the plateau's median, N; only in gross slip.
    pub friction_limit_n: Option<f64>,
    /// μ; only if the normal load is known.
    pub friction_coefficient: Option<f64>,
    /// Phase by which Δx lags T at the fundamental, degrees.
    pub phase_deg: f64,
    /// Δx of the loop for plotting, m: the averaged cycle, or the first cycles of a decay.
    pub loop_displacement_m: Vec<f64>,
    /// T of the same points, N.
    pub loop_force_n: Vec<f64>,
    /// Every cycle of a decay; empty for a shaker.
    pub decay_cycles: Vec<DecayCycle>,
    /// Faults of the loop and corrections made, each with its magnitude.
    pub findings: Vec<LoopFinding>,
    /// Warnings for the reader.
    pub warnings: Vec<String>,
}

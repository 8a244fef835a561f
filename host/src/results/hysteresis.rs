//! The contact by hysteresis loops: numbers per kind of excitation, and one loop to look at.

use super::statistics::OverCycles;
use serde::{Deserialize, Serialize};

/// Which force the loop was drawn with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Force {
    /// The sum of the load cells as it is.
    Raw,
    /// Corrected for the static arm's inertia and the parallel path to ground.
    Corrected,
}

/// What moved the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Excitation {
    /// A sine at one frequency.
    Shaker,
    /// A hammer hit: the first cycle of the decay.
    Impact,
}

/// What the loop looks like, and so what its slope means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A straight line: the slope is k_T.
    Stuck,
    /// An ellipse: force and displacement out of phase; the slope is k_eq only.
    Elliptical,
    /// Slightly open, steeper after reversal: part of the contact slides.
    Microslip,
    /// A plateau: the whole contact slides.
    GrossSlip,
}

impl Shape {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Shape::Stuck => "stuck",
            Shape::Elliptical => "elliptical",
            Shape::Microslip => "microslip",
            Shape::GrossSlip => "gross-slip",
        }
    }
}

/// Loops of one kind, together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hysteresis {
    /// Which force.
    pub force: Force,
    /// What moved the contact.
    pub kind: Excitation,
    /// Frequency of the excitation (shaker) or of the cycle (impact), Hz.
    pub frequency_hz: Option<f64>,
    /// Half the swing of Δx, m (mean over cycles).
    pub amplitude_m: Option<f64>,
    /// The shape that most cycles have.
    pub shape: Shape,
    /// Slope of T on Δx over the stick part, N/m; null where the loop has none.
    pub k_t_n_per_m: Option<OverCycles>,
    /// Slope of T on Δx over the whole loop, N/m.
    pub k_eq_n_per_m: Option<OverCycles>,
    /// Area of the closed loop, J.
    pub energy_j: Option<OverCycles>,
    /// Friction limit over normal load; null where the contact did not slip or the load is not known.
    pub friction_coefficient: Option<f64>,
    /// Phase of T against Δx, degrees.
    pub phase_deg: Option<f64>,
    /// Ids of the records used, as closed ranges.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<[i64; 2]>,
    /// What a reader must know before using these numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// One cycle, sample by sample: what the loop figure shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoopCurve {
    /// The record it is from.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Seconds between samples.
    pub step_s: f64,
    /// Relative displacement x_A − x_B, m.
    pub displacement_m: Vec<f64>,
    /// Displacement of specimen A, m.
    #[serde(default)]
    pub displacement_a_m: Vec<f64>,
    /// Displacement of specimen B, m.
    #[serde(default)]
    pub displacement_b_m: Vec<f64>,
    /// Sum of the load cells, N.
    pub force_n: Vec<f64>,
    /// Range of samples that is the first cycle.
    pub cycle: [usize; 2],
    /// The fitted slope, N/m.
    pub slope_n_per_m: f64,
}

/// The slope that one impact gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImpactSlope {
    /// The record.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Slope of the first cycle, N/m.
    pub k_t_n_per_m: f64,
}

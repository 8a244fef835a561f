//! The contact by hysteresis loops: values per type of excitation, the decay after a hit, one
//! example loop, and the decay reconstructed from two sinusoids (the paper's Fig. 9).

use super::{Excitation, OverCycles, Shape};
use crate::contact::{Interval, Shares};
use crate::hysteresis::backbone::Law;
use crate::hysteresis::impact::DecayCycle;
use crate::hysteresis::{LoopFinding, ShapeEvidence};
use serde::Serialize;

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
    /// 95 % interval of the friction limit from its scatter over the cycles, N; from four cycles
    /// on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_limit_ci95_n: Option<[f64; 2]>,
    /// Friction limit over normal load; null if the contact did not slip or the load is not known.
    pub friction_coefficient: Option<f64>,
    /// The same over the normal load. Gains and the load count as exact: it is no interval of μ
    /// itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_coefficient_ci95: Option<[f64; 2]>,
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

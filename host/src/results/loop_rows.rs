//! The contact by hysteresis loops: numbers per kind of excitation, and one loop to look at.

use crate::contact::{Interval, Shares};
use crate::hysteresis::backbone::Law;
use crate::hysteresis::impact::DecayCycle;
use crate::hysteresis::{Kind as Excitation, LoopFinding, OverCycles, Shape, ShapeEvidence};
use serde::Serialize;

/// Which force the loop was drawn with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Force {
    /// The sum of the load cells as it is.
    Raw,
    /// Corrected for the static arm's inertia and the parallel path to ground.
    Corrected,
}

/// Loops of one kind, together.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// k_T, N/m. Of a record whose signals are said to be those of the contact: slope of the stick part. In a campaign, where they are those of
    /// spots beside it and of load cells behind an arm: of a steady level whose force and Δx at the contact are known from the hits, with the
    /// interval of all that it rests on (`std` is the scatter over stretches of its record); null otherwise.
    pub k_t_n_per_m: Option<OverCycles>,
    /// c_T beside it in a campaign, N s/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c_t_n_s_per_m: Option<Interval>,
    /// Relative standard deviation of this k_T by what it comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_t_budget: Option<Shares>,
    /// Of a level of a campaign: what k_T rests on, or why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_t_why: Option<String>,
    /// The same slope in a campaign, N/m: between the spots, with whatever else lies there; null where the loop has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_between_spots_n_per_m: Option<OverCycles>,
    /// The part of the force's swing after each reversal in which it was read; only where something slips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stick_part: Option<[f64; 2]>,
    /// Slope of T on Δx over the whole loop, N/m.
    pub k_eq_n_per_m: Option<OverCycles>,
    /// Peak secant of the averaged loop, N/m: another quantity beside a hidden resonance, under its own name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_secant_n_per_m: Option<f64>,
    /// Magnitude of the ratio of fundamentals T₁/Δx₁, N/m: as the secant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_fundamental_n_per_m: Option<f64>,
    /// Area of the closed loop, J.
    pub energy_j: Option<OverCycles>,
    /// Friction limit μN from the plateau's median, N; only in gross slip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_limit_n: Option<f64>,
    /// Friction limit over normal load; null where the contact did not slip or the load is not known.
    pub friction_coefficient: Option<f64>,
    /// Phase by which Δx lags T, degrees; of impacts over the first cycle, mean over hits.
    pub phase_deg: Option<f64>,
    /// What the shape was told from.
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
    /// What is wrong with the loops or was put right, with its measure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<LoopFinding>,
    /// What a reader must know before using these numbers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Hysteresis {
    /// Slope of the stick part, whatever it may be called. A level's k_T is none: it is not read off the loop that the row is about.
    pub fn stick_slope(&self) -> Option<OverCycles> {
        let read_off = self.k_t_n_per_m.filter(|_| self.k_t_budget.is_none());
        self.slope_between_spots_n_per_m.or(read_off)
    }

    /// k_T of a level of a campaign, with its interval.
    pub fn own_k_t(&self) -> Option<Interval> {
        let k = self.k_t_n_per_m.filter(|_| self.k_t_budget.is_some())?;
        Some(Interval { mean: k.mean, ci95: k.ci95? })
    }

    /// In a campaign no slope of a loop is k_T.
    #[must_use]
    pub fn between_spots(self) -> Self {
        Hysteresis { k_t_n_per_m: None, slope_between_spots_n_per_m: self.stick_slope(), ..self }
    }
}

/// How a slipping contact goes with amplitude: the law through the shaker's levels of one frequency, raw force.
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

/// One cycle of the decay over all hits that count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DecayStep {
    /// Which cycle, from 1.
    pub cycle: usize,
    /// Least-squares slope of T on Δx over it, N/m; `cycles` counts the hits.
    pub k_eq_n_per_m: OverCycles,
    /// Phase by which Δx lags T, degrees (mean over hits).
    pub phase_deg: f64,
    /// Half the swing of Δx, m (mean over hits).
    pub amplitude_m: f64,
}

/// One cycle, sample by sample: what the loop figure shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    pub displacement_a_m: Vec<f64>,
    /// Displacement of specimen B, m.
    pub displacement_b_m: Vec<f64>,
    /// Sum of the load cells, N.
    pub force_n: Vec<f64>,
    /// Range of samples that is the first cycle.
    pub cycle: [usize; 2],
    /// Ranges of samples of the first cycle and the next ones, as far as they are shown.
    pub cycles: Vec<[usize; 2]>,
    /// The fitted slope, N/m.
    pub slope_n_per_m: f64,
}

/// The slope that one impact gave.
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
    /// Δx over one cycle, equidistant in time, m.
    pub displacement_m: Vec<f64>,
    /// T of the same points, N.
    pub force_n: Vec<f64>,
    /// Displacement of specimen A over the record's first cycle, m.
    pub displacement_a_m: Vec<f64>,
    /// Displacement of specimen B over the same, m.
    pub displacement_b_m: Vec<f64>,
}

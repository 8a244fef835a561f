//! The answer: the main results, each with its interval or the reason why there is none.

use crate::campaign::store::simulated::SimulatedTruth;
use crate::contact::{Diagnosis, Doubt, Interval, OfFrequency};
use serde::Serialize;
use std::collections::BTreeMap;

/// The result for which the campaign was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The contact's own stiffness.
    pub contact: ContactAnswer,
    /// The stiffness between the arms by substructuring.
    pub between_arms: BetweenArms,
    /// The compliance between the arms in addition to the contact; null if either stiffness is not
    /// known, or if the additional compliance is not significant.
    pub clamp: Option<Clamp>,
    /// Whether the contact slips under the hammer.
    pub slip: Slip,
    /// The true values that an ideal measurement would find: only for a simulated rig, from its
    /// parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<SimulatedTruth>,
}

/// k_T and c_T of the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAnswer {
    /// k_T, N/m; null if it is not identified.
    pub k_t_n_per_m: Option<Interval>,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Option<Interval>,
    /// Data on which it is based.
    pub basis: Basis,
    /// The frequencies used, Hz.
    pub band_hz: Option<[f64; 2]>,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<&'static str, f64>,
    /// Explanation in one sentence.
    pub why: String,
    /// k_T bin by bin.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub of_frequency: Vec<OfFrequency>,
    /// How well the assumptions are satisfied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<Diagnosis>,
    /// Assumptions that are violated; then no k_T is reported.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// Data on which k_T is based.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// The specimen's rotation from points on it.
    SpecimenPoints,
    /// The same, and the shaker's levels that it corrects.
    Joint,
    /// None: there is no k_T.
    None,
}

/// The stiffness between the arms along the sliding direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BetweenArms {
    /// The stiffness, N/m; null if it is not identified.
    pub k_n_per_m: Option<Interval>,
    /// The estimate it is taken from: `fit`, `recommended` or `none`.
    pub basis: &'static str,
    /// Why this one, or why none.
    pub why: String,
}

/// The compliance between the arms in addition to the contact: clamps and specimens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clamp {
    /// Its stiffness in series with the contact, N/m.
    pub k_n_per_m: Interval,
}

/// Whether the contact slips under the hammer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slip {
    /// Whether it does; null if the hits do not allow a verdict.
    pub found: Option<bool>,
    /// The evidence.
    pub why: String,
}

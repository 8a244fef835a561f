//! The answer: the numbers that the user came for, each with its interval or the reason why there is none.

use crate::campaign::store::simulated::SimulatedTruth;
use crate::contact::{Diagnosis, Doubt, Interval, OfFrequency};
use serde::Serialize;
use std::collections::BTreeMap;

/// What the campaign was measured for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The contact's own stiffness.
    pub contact: ContactAnswer,
    /// What substructuring sees between the arms.
    pub between_arms: BetweenArms,
    /// What lies between the arms beside the contact; null where either is not known, or nothing soft is there.
    pub clamp: Option<Clamp>,
    /// Whether the contact slips under the hammer.
    pub slip: Slip,
    /// What an ideal measurement would find: only of a simulated rig, from its own parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<SimulatedTruth>,
}

/// k_T and c_T of the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAnswer {
    /// k_T, N/m; null where it is not identified.
    pub k_t_n_per_m: Option<Interval>,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Option<Interval>,
    /// What it rests on.
    pub basis: Basis,
    /// The frequencies used, Hz.
    pub band_hz: Option<[f64; 2]>,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<&'static str, f64>,
    /// The sentence that a colleague would say.
    pub why: String,
    /// k_T bin by bin.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub of_frequency: Vec<OfFrequency>,
    /// How well the assumptions hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<Diagnosis>,
    /// Assumptions that do not hold: then no k_T is given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// What k_T rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// The specimen's rotation from points on it.
    SpecimenPoints,
    /// The same, and the shaker's levels that it corrects.
    Joint,
    /// Nothing: there is no k_T.
    None,
}

/// The stiffness between the arms along the sliding direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BetweenArms {
    /// The stiffness, N/m; null where it is not identified.
    pub k_n_per_m: Option<Interval>,
    /// The estimate it is taken from: `fit`, `recommended` or `none`.
    pub basis: &'static str,
    /// Why this one, or why none.
    pub why: String,
}

/// What gives way between the arms beside the contact: clamps and specimens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clamp {
    /// Its stiffness in series with the contact, N/m.
    pub k_n_per_m: Interval,
}

/// Whether the contact slips under the hammer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slip {
    /// Whether it does; null where the hits do not tell.
    pub found: Option<bool>,
    /// The measure.
    pub why: String,
}

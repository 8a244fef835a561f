//! Comparison of two campaigns: differences with their intervals, and whether they are significant.

use super::Source;
use crate::contact::Interval;
use serde::Serialize;

/// Comparison of two campaigns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// Version of this format.
    pub version: u32,
    /// Sources of both campaigns, A first.
    pub sources: [Source; 2],
    /// Whether the contacts differ, decided by k_T, or by the stiffness between the arms if there
    /// is none; null if neither is known in both.
    pub differ: Option<bool>,
    /// The verdict in a sentence.
    pub verdict: String,
    /// All quantities that both have.
    pub differences: Vec<Difference>,
    /// Quantities that only one of them has, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
}

/// One quantity of both campaigns, SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Its name.
    pub quantity: String,
    /// Its unit: `N/m` or `N s/m`.
    pub unit: &'static str,
    /// Value in the first campaign.
    pub a: Interval,
    /// Value in the second campaign.
    pub b: Interval,
    /// The second minus the first.
    pub b_minus_a: Interval,
    /// Whether the interval of the difference excludes zero.
    pub differ: bool,
}

//! Two campaigns against each other: differences with their intervals, and whether they differ.

use super::Source;
use crate::contact::Interval;
use serde::Serialize;

/// Two campaigns against each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// Version of this shape.
    pub version: u32,
    /// Where each comes from, A first.
    pub sources: [Source; 2],
    /// Whether the contacts differ: told from k_T, or from what lies between the arms where there is none; null where neither is known in
    /// both.
    pub differ: Option<bool>,
    /// The verdict in a sentence.
    pub verdict: String,
    /// Every quantity that both have.
    pub differences: Vec<Difference>,
    /// What only one of them has, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
}

/// One quantity of both campaigns, SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// What it is.
    pub quantity: String,
    /// Its unit: `N/m` or `N s/m`.
    pub unit: &'static str,
    /// Of the first campaign.
    pub a: Interval,
    /// Of the second.
    pub b: Interval,
    /// The second minus the first.
    pub b_minus_a: Interval,
    /// Whether the interval of the difference leaves out zero.
    pub differ: bool,
}

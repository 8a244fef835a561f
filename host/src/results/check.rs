//! Checks: whether a number is credible.

use serde::Serialize;
use std::collections::BTreeMap;

/// Name of the check on the compliance between the arms in addition to the contact.
pub const SERIES_COMPLIANCE: &str = "series-compliance";
/// Name of the check on resonances of one specimen.
pub const HIDDEN_RESONANCE: &str = "hidden-resonance";
/// Name of the check on slip under the hammer.
pub const HAMMER_SLIP: &str = "hammer-slip";
/// Name of the check on wear.
pub const UNCHANGED: &str = "contact-unchanged";
/// Name of the check on the rigid motions added by coupling.
pub const INTERFACE_MODES: &str = "interface-modes";
/// Name of the check that compares n_i with n_c.
pub const INTERNALS: &str = "internals";
/// Name of the check that all records are of one structure.
pub const ONE_STRUCTURE: &str = "one-structure";
/// Name of the check that A and B are the same structures in all configurations.
pub const SAME_IN_ALL: &str = "same-in-all-configurations";
/// Name of the check that A and B, coupled by the joint found, reproduce the measured assembly.
pub const BACK_COUPLING: &str = "back-coupling";

/// One check of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Its name, which does not change, because scripts look it up.
    pub name: String,
    /// Passed, failed, or (null) undecided by the data.
    pub ok: Option<bool>,
    /// The frequency concerned, Hz, if it is a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// Its meaning for the reader, in one or two sentences.
    pub meaning: String,
    /// Its figures, by name with unit.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Check {
    /// A check without figures.
    pub fn new(name: &str, ok: Option<bool>, meaning: impl Into<String>) -> Self {
        Check { name: name.into(), ok, frequency_hz: None, meaning: meaning.into(), values: BTreeMap::new() }
    }

    /// The same check at this frequency, Hz.
    #[must_use]
    pub fn at(mut self, frequency_hz: f64) -> Self {
        self.frequency_hz = Some(frequency_hz);
        self
    }

    /// The same check with one more figure; values that are not finite are omitted.
    #[must_use]
    pub fn with(mut self, name: &str, value: f64) -> Self {
        if value.is_finite() {
            self.values.insert(name.into(), value);
        }
        self
    }
}

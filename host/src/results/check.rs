//! Checks: sentences about whether a number may be believed.

use serde::Serialize;
use std::collections::BTreeMap;

/// Name of the check on what lies between the arms and the contact.
pub const SERIES_COMPLIANCE: &str = "series-compliance";
/// Name of the check on resonances of one specimen alone.
pub const HIDDEN_RESONANCE: &str = "hidden-resonance";
/// Name of the check on slip under the hammer.
pub const HAMMER_SLIP: &str = "hammer-slip";
/// Name of the check on wear.
pub const UNCHANGED: &str = "contact-unchanged";
/// Name of the check on which rigid motions coupling adds.
pub const INTERFACE_MODES: &str = "interface-modes";
/// Name of the check on n_i against n_c.
pub const INTERNALS: &str = "internals";
/// Name of the check on records of one structure only.
pub const ONE_STRUCTURE: &str = "one-structure";
/// Name of the check on A and B being the same structures in all configurations.
pub const SAME_IN_ALL: &str = "same-in-all-configurations";
/// Name of the check whether A and B, coupled by the joint found, are the measured assembly.
pub const BACK_COUPLING: &str = "back-coupling";

/// One question that was put to the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Its name, fixed: scripts look for it.
    pub name: String,
    /// Passed, failed, or (null) the data cannot say.
    pub ok: Option<bool>,
    /// Where in the spectrum, Hz, if at one place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// What it means for the reader, one or two sentences.
    pub meaning: String,
    /// The figures behind it, by name with unit.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Check {
    /// A check without figures.
    pub fn new(name: &str, ok: Option<bool>, meaning: impl Into<String>) -> Self {
        Check { name: name.into(), ok, frequency_hz: None, meaning: meaning.into(), values: BTreeMap::new() }
    }

    /// The same at this frequency, Hz.
    #[must_use]
    pub fn at(mut self, frequency_hz: f64) -> Self {
        self.frequency_hz = Some(frequency_hz);
        self
    }

    /// The same with one more figure; one that is not finite is left out.
    #[must_use]
    pub fn with(mut self, name: &str, value: f64) -> Self {
        if value.is_finite() {
            self.values.insert(name.into(), value);
        }
        self
    }
}

//! Checks: sentences about whether a number may be believed.

use serde::Serialize;
use std::collections::BTreeMap;

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

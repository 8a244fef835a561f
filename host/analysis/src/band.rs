//! A band of frequencies.

use serde::Serialize;

/// A frequency band, Hz, both ends included. In files it is `[low, high]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[serde(into = "[f64; 2]")]
pub struct Band {
    /// Lowest frequency, Hz.
    pub low_hz: f64,
    /// Highest frequency, Hz.
    pub high_hz: f64,
}

impl Band {
    /// Whether the line is in the band.
    pub fn contains(&self, frequency_hz: f64) -> bool {
        (self.low_hz..=self.high_hz).contains(&frequency_hz)
    }
}

impl From<[f64; 2]> for Band {
    fn from([low_hz, high_hz]: [f64; 2]) -> Band {
        Band { low_hz, high_hz }
    }
}

impl From<Band> for [f64; 2] {
    fn from(band: Band) -> [f64; 2] {
        [band.low_hz, band.high_hz]
    }
}

//! Curves for the figures: a few FRFs with their coherence.

use crate::substructuring::Band;
use serde::Serialize;

/// What an FRF shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Response nearest to the impact, same direction.
    DrivingPoint,
    /// Response far from the impact (in AJB: across the joint).
    Transfer,
    /// The vibrometer on specimen A.
    SpecimenA,
    /// The vibrometer on specimen B.
    SpecimenB,
    /// Specimen A minus specimen B: Δx.
    Relative,
    /// The load cells' sum T, newton per newton of the hammer.
    Force,
    /// A point on the arm of A, from the same impact as the specimens' curves.
    ArmA,
    /// A point on the arm of B, from the same impact.
    ArmB,
}

/// One FRF: receptance with coherence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrfCurve {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// What it shows.
    pub role: Role,
    /// The response channel.
    pub output: String,
    /// The impact.
    pub input: String,
    /// Hits averaged.
    pub hits: usize,
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Magnitude of the receptance, m/N (of `force`: N/N), line by line.
    pub magnitude_m_per_n: Vec<f64>,
    /// Phase, degrees, −180…180.
    pub phase_deg: Vec<f64>,
    /// Coherence, 0…1; empty for fewer than two hits.
    pub coherence: Vec<f64>,
}

impl FrfCurve {
    /// Frequency of a line, Hz.
    pub fn frequency_hz(&self, line: usize) -> f64 {
        self.first_hz + self.step_hz * line as f64
    }
}

/// The band in which the hammer's force was sufficient, per configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UsableBand {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// Band in which the force's auto-spectrum is within 6 dB of its level at low frequency, Hz.
    pub band_hz: Band,
}

/// Rounds to `digits` significant decimal digits, which keeps files small without visible effect in
/// a figure.
pub fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let exponent = digits - 1 - value.abs().log10().floor() as i32;
    if exponent.abs() > 300 {
        return value;
    }
    let scale = 10f64.powi(exponent.abs());
    if exponent >= 0 { (value * scale).round() / scale } else { (value / scale).round() * scale }
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn rounding_keeps_significant_digits() {
        assert_eq!(rounded(1.234_567_8e-8, 4).to_string().len(), "0.00000001235".len());
        assert_eq!(rounded(-26_843_211.0, 3), -26_800_000.0);
        assert_eq!(rounded(0.0, 3), 0.0);
        assert!(rounded(f64::NAN, 3).is_nan());
    }
}

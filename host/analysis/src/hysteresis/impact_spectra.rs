//! The contact's compliance from hits: with the hammer's force as the instrument.

use super::compliance::ContactCompliance;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Spectra of the contact's signals after hits at one place, summed over the hits, \[line\].
#[derive(Debug, Clone, Copy)]
pub struct ImpactSpectra<'a> {
    /// Auto-spectrum of the hammer's force, N² s².
    pub force: &'a [f64],
    /// Cross-spectra with that force of v_A and v_B, N m s, and of T, N² s².
    pub cross: [&'a [Complex<f64>]; 3],
}

impl ContactCompliance {
    /// From the hits at every place, all on the lines `frequency_hz` (Hz) and on s = σ + iω; none without any.
    ///
    /// T and Δx are both noisy, so neither may stand in the denominator as an auto-spectrum: the hammer's force is
    /// the instrument, D = Σ S_ΔF S_TF* / Σ |S_TF|² over the impacts.
    pub fn of_impacts(frequency_hz: &[f64], sigma_per_s: f64, impacts: &[ImpactSpectra<'_>]) -> Option<Self> {
        if impacts.is_empty() {
            return None;
        }
        let compliance_m_per_n = frequency_hz
            .iter()
            .enumerate()
            .map(|(l, f)| {
                let s = Complex::new(sigma_per_s, TAU * f);
                let (mut numerator, mut denominator) = (Complex::default(), 0.0);
                for impact in impacts {
                    // per unit of force, so that a position hit more often does not count more
                    let scale = 1.0 / impact.force[l];
                    let relative = (impact.cross[0][l] - impact.cross[1][l]) * scale / s;
                    let tangential = impact.cross[2][l] * scale;
                    numerator += relative * tangential.conj();
                    denominator += tangential.norm_sqr();
                }
                numerator / denominator
            })
            .collect();
        Some(Self { frequency_hz: frequency_hz.to_vec(), compliance_m_per_n })
    }
}

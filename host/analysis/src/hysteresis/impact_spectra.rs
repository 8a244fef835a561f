//! The contact's compliance from hits, with the hammer's force as the instrumental variable.

use super::compliance::ContactCompliance;
use crate::spectra::CrossSpectra;
use num_complex::Complex;

impl ContactCompliance {
    /// From the spectra of v_A, v_B (m/s) and T (N) after the hits at each place, all on the lines
    /// of the first; `None` without any.
    ///
    /// T and Δx are both noisy, so the auto-spectrum of neither may be the denominator. The
    /// hammer's force is the instrumental variable: D = Σ S_ΔF S_TF* / Σ |S_TF|² over the impacts.
    pub fn of_impacts(impacts: &[&CrossSpectra]) -> Option<Self> {
        let first = impacts.first()?;
        let compliance_m_per_n = (0..first.lines())
            .map(|l| {
                let (mut numerator, mut denominator) = (Complex::default(), 0.0);
                for impact in impacts {
                    // normalised by force, so that a position with more hits does not weigh more
                    let relative = (impact.h1(l, 0) - impact.h1(l, 1)) / first.s(l);
                    let tangential = impact.h1(l, 2);
                    numerator += relative * tangential.conj();
                    denominator += tangential.norm_sqr();
                }
                numerator / denominator
            })
            .collect();
        Some(Self { frequency_hz: first.frequency_hz().to_vec(), compliance_m_per_n })
    }
}

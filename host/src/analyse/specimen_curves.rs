//! The FRFs of both specimens in the assembly, to look at.

use super::averages::ContactAverage;
use crate::results::{FrfCurve, Role, rounded};
use num_complex::Complex;
use std::f64::consts::TAU;

/// The two specimens' receptances from one impact, for the report; hit and response count positive along +z, so
/// `sign` is −1 for a hit towards −z.
pub fn specimen_curves(
    impact: &str,
    sign: f64,
    frequency_hz: &[f64],
    sigma_per_s: f64,
    average: &ContactAverage,
) -> [FrfCurve; 2] {
    let step_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    [(Role::SpecimenA, "x_A", 0), (Role::SpecimenB, "x_B", 1)].map(|(role, output, i)| {
        let receptance = frequency_hz
            .iter()
            .enumerate()
            .map(|(l, f)| sign * average.cross[i][l] / average.force[l] / Complex::new(sigma_per_s, TAU * f));
        let (magnitude_m_per_n, phase_deg) =
            receptance.map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5))).unzip();
        let coherence = if average.hits > 1 {
            (0..frequency_hz.len())
                .map(|l| average.cross[i][l].norm_sqr() / (average.force[l] * average.auto[i][l]))
                .map(|c| rounded(if c.is_finite() { c } else { 0.0 }, 5))
                .collect()
        } else {
            Vec::new()
        };
        FrfCurve {
            configuration: "AJB".into(),
            role,
            output: output.into(),
            input: impact.into(),
            hits: average.hits,
            first_hz: frequency_hz.first().copied().unwrap_or(0.0),
            step_hz,
            magnitude_m_per_n,
            phase_deg,
            coherence,
        }
    })
}

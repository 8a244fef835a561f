//! The FRFs of both specimens in the assembly, to look at.

use crate::results::{FrfCurve, Role, rounded};
use crate::spectra::CrossSpectra;
use crate::structure::Structure;

/// The two specimens' receptances from one impact, for the report; hit and response count positive along +z, so
/// `sign` is −1 for a hit towards −z.
pub fn specimen_curves(impact: &str, sign: f64, average: &CrossSpectra) -> [FrfCurve; 2] {
    let frequency_hz = average.frequency_hz();
    let step_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    [(Role::SpecimenA, "x_A", 0), (Role::SpecimenB, "x_B", 1)].map(|(role, output, i)| {
        let receptance = (0..average.lines()).map(|l| sign * average.h1(l, i) / average.s(l));
        let (magnitude_m_per_n, phase_deg) =
            receptance.map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5))).unzip();
        let several = average.hits() > 1;
        let coherence = (0..average.lines())
            .filter(|_| several)
            .map(|l| average.coherence(l, i))
            .map(|c| rounded(if c.is_finite() { c } else { 0.0 }, 5))
            .collect();
        FrfCurve {
            configuration: Structure::Ajb.into(),
            role,
            output: output.into(),
            input: impact.into(),
            hits: average.hits(),
            first_hz: frequency_hz.first().copied().unwrap_or(0.0),
            step_hz,
            magnitude_m_per_n,
            phase_deg,
            coherence,
        }
    })
}

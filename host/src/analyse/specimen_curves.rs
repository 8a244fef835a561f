//! The FRFs of both specimens in the assembly, for the report.

use crate::results::{FrfCurve, Role, rounded};
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use num_complex::Complex;

/// The two specimens' receptances from one impact, their difference, and the load cells' force; hit
/// and response are positive along +z, so `sign` is −1 for a hit towards −z.
pub fn specimen_curves(impact: &str, sign: f64, average: &CrossSpectra) -> [FrfCurve; 4] {
    let of = |output: usize, line: usize| sign * average.h1(line, output);
    let receptance = |output: usize| move |line: usize| of(output, line) / average.s(line);
    [
        curve(impact, average, (Role::SpecimenA, "x_A", Some(0)), receptance(0)),
        curve(impact, average, (Role::SpecimenB, "x_B", Some(1)), receptance(1)),
        curve(impact, average, (Role::Relative, "Δx", None), |line| {
            (of(0, line) - of(1, line)) / average.s(line)
        }),
        curve(impact, average, (Role::Force, "T", Some(2)), |line| of(2, line)),
    ]
}

/// One curve; its coherence is that of the measured output, if it is a measured one.
fn curve(
    impact: &str,
    average: &CrossSpectra,
    (role, output, measured): (Role, &str, Option<usize>),
    value: impl Fn(usize) -> Complex<f64>,
) -> FrfCurve {
    let frequency_hz = average.frequency_hz();
    let step_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    let (magnitude_m_per_n, phase_deg) = (0..average.lines())
        .map(value)
        .map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5)))
        .unzip();
    let coherence = measured.filter(|_| average.hits() > 1).map_or_else(Vec::new, |i| {
        (0..average.lines())
            .map(|l| average.coherence(l, i))
            .map(|c| rounded(if c.is_finite() { c } else { 0.0 }, 5))
            .collect()
    });
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
}

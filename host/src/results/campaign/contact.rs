//! The contact seen from the specimens, in frequency: Δx per newton of T, and the FRFs of both specimens.

use crate::hysteresis::compliance::ContactCompliance;
use crate::results::{FrfCurve, Joint, Role, rounded};
use crate::spectra::CrossSpectra;
use crate::substructuring::joint::{BandStatistic, stiffness_and_damping};
use num_complex::Complex;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Where T/Δx is read, Hz: above the specimens' resonance, below where Δx drowns in noise.
const DIRECT_HZ: [f64; 2] = [250.0, 400.0];
/// Lines averaged before a stiffness is read: 5 Hz at half-hertz lines.
const DIRECT_LINES: usize = 10;
/// Name of that method.
pub const DIRECT: &str = "direct";

/// From the averages of each impact; none without impacts.
///
/// T and Δx are both noisy, so neither may stand in the denominator as an auto-spectrum: the hammer's force is
/// the instrument, D = Σ S_ΔF S_TF* / Σ |S_TF|² over the impacts.
pub fn compliance(
    frequency_hz: &[f64],
    sigma_per_s: f64,
    impacts: &[&CrossSpectra],
) -> Option<ContactCompliance> {
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
                let relative = (impact.h1(l, 0) - impact.h1(l, 1)) / s;
                let tangential = impact.h1(l, 2);
                numerator += relative * tangential.conj();
                denominator += tangential.norm_sqr();
            }
            numerator / denominator
        })
        .collect();
    Some(ContactCompliance { frequency_hz: frequency_hz.to_vec(), compliance_m_per_n })
}

/// Z^J_z = T/Δx over 250–400 Hz as a row of its own: the contact itself, whatever the clamp does.
///
/// Δx is averaged over some lines before it is divided by, because 1/(D + n) falls where noise prevails. The band lies above
/// the specimen's resonance near 192 Hz and below where Δx drowns. T is the load cells' sum: the static arm's inertia adds
/// some per cent to it, growing with f².
pub fn direct(found: &ContactCompliance, sigma_per_s: f64) -> Option<Joint> {
    let inside: Vec<usize> = (0..found.frequency_hz.len())
        .filter(|&l| (DIRECT_HZ[0]..=DIRECT_HZ[1]).contains(&found.frequency_hz[l]))
        .collect();
    let (stiffness, damping): (Vec<f64>, Vec<f64>) = inside
        .chunks(DIRECT_LINES)
        .filter(|lines| lines.len() == DIRECT_LINES)
        .filter_map(|lines| {
            let n = lines.len() as f64;
            let d = lines.iter().map(|&l| found.compliance_m_per_n[l]).sum::<Complex<f64>>() / n;
            let f = lines.iter().map(|&l| found.frequency_hz[l]).sum::<f64>() / n;
            let z = d.inv();
            z.is_finite().then(|| stiffness_and_damping(z, Complex::new(sigma_per_s, TAU * f)))
        })
        .unzip();
    let (k, c) = (BandStatistic::of(&stiffness)?, BandStatistic::of(&damping)?);
    let along_z = |s| BTreeMap::from([("z".to_owned(), s)]);
    let mut warnings = vec![
        "T is the load cells' sum, not the force at the contact: the static arm's inertia adds some per cent, growing with the frequency's square".to_owned(),
    ];
    if k.std > 0.5 * k.mean.abs() {
        warnings.push("Δx is buried in noise here: no stiffness can be read from it".to_owned());
    }
    Some(Joint {
        method: DIRECT.into(),
        idms: 0,
        modes: Vec::new(),
        band_hz: DIRECT_HZ,
        stiffness_n_per_m: along_z(k),
        damping_n_s_per_m: along_z(c),
        stiffness_n_m_per_rad: BTreeMap::new(),
        damping_n_m_s_per_rad: BTreeMap::new(),
        stiffness_flexible_si: BTreeMap::new(),
        coupling_si: BTreeMap::new(),
        coupling_damping_si: BTreeMap::new(),
        lines: stiffness.len() * DIRECT_LINES,
        noise_n_per_m: BTreeMap::new(),
        goodness: None,
        warnings,
    })
}

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
            configuration: "AJB".into(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::cross_spectra::OutputSums;

    const SIGMA: f64 = 2.3;

    /// A contact of 180 N/µm with a resonance of strength `a` at 192 Hz between A and B, seen from one impact.
    fn seen(a: f64) -> (Vec<f64>, CrossSpectra) {
        let frequency_hz: Vec<f64> = (0..1981).map(|l| 10.0 + 0.5 * f64::from(l)).collect();
        let lines = frequency_hz.len();
        let s = |l: usize| Complex::new(SIGMA, TAU * frequency_hz[l]);
        let w = TAU * 192.0;
        let tangential: Vec<Complex<f64>> = (0..lines).map(|l| Complex::new(1.0, 0.2 * l as f64)).collect();
        let relative = |l: usize| {
            let d = 1.0 / 180e6 * (1.0 + a * w * w / (s(l) * s(l) + 0.02 * w * s(l) + w * w));
            d * tangential[l] * s(l)
        };
        let b: Vec<Complex<f64>> = (0..lines).map(|l| tangential[l] * 1e-8 * s(l)).collect();
        let outputs = [(0..lines).map(|l| b[l] + relative(l)).collect(), b.clone(), tangential.clone()]
            .map(|s_xf| OutputSums { s_xf, s_xx: vec![1.0; lines], delay_s: 0.0 });
        let average =
            CrossSpectra::new(1.0, frequency_hz.clone(), SIGMA, 1, vec![1.0; lines], outputs.to_vec());
        (frequency_hz, average.expect("one value for each line"))
    }

    #[test]
    fn a_resonance_of_one_specimen_is_found_where_it_is() {
        let (f, average) = seen(0.05);
        let peak = compliance(&f, SIGMA, &[&average]).and_then(|c| c.imaginary_peak()).expect("lines");
        assert!((peak.frequency_hz - 192.0).abs() < 1.5, "{peak:?}");
        // the resonance's tail above 250 Hz makes the contact look a little stiffer
        let direct = compliance(&f, SIGMA, &[&average]).and_then(|c| direct(&c, SIGMA)).expect("lines");
        let k = direct.sliding_stiffness().expect("z").mean;
        assert!((180e6..200e6).contains(&k), "{k}");
        assert!(peak.stands_out(), "{peak:?}");
    }

    #[test]
    fn without_one_nothing_stands_out() {
        let (f, average) = seen(0.0);
        let peak = compliance(&f, SIGMA, &[&average]).and_then(|c| c.imaginary_peak()).expect("lines");
        assert!(!peak.stands_out() && peak.over_level < 0.01, "{peak:?}");
        let direct = compliance(&f, SIGMA, &[&average]).and_then(|c| direct(&c, SIGMA)).expect("lines");
        // exact but for rounding
        assert!((direct.sliding_stiffness().expect("z").mean / 180e6 - 1.0).abs() < 1e-9);
        assert_eq!((direct.band_hz, direct.idms, direct.lines), ([250.0, 400.0], 0, 300));
        assert_eq!(compliance(&f, SIGMA, &[]), None);
    }
}

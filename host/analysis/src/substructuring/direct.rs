//! T/Δx at the specimens as a joint of its own: the contact itself, whatever the clamp does.

use super::joint_over_bands::{BandStatistic, stiffness_and_damping};
use crate::band::Band;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Where T/Δx is read: above the specimens' resonance near 192 Hz, below where Δx drowns in noise.
pub const BAND: Band = Band { low_hz: 250.0, high_hz: 400.0 };
/// Lines averaged before a stiffness is read: 5 Hz at half-hertz lines.
const LINES: usize = 10;
/// More scatter than this part of the mean is noise.
const DROWNED: f64 = 0.5;

/// Stiffness and damping of the contact along z over [`BAND`].
///
/// T is the load cells' sum: the static arm's inertia adds some per cent to it, growing with f².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direct {
    /// K, N/m.
    pub stiffness_n_per_m: BandStatistic,
    /// C, N s/m.
    pub damping_n_s_per_m: BandStatistic,
    /// Lines used.
    pub lines: usize,
}

impl Direct {
    /// Z^J_z = 1/D from the compliance D = Δx/T (m/N, \[line\]) at the lines `frequency_hz` (Hz) on s = σ + iω; none where the band
    /// holds too few lines.
    ///
    /// Δx is averaged over some lines before it is divided by, because 1/(D + n) falls where noise prevails.
    pub fn of(frequency_hz: &[f64], compliance_m_per_n: &[Complex<f64>], sigma_per_s: f64) -> Option<Self> {
        let inside: Vec<usize> =
            (0..frequency_hz.len()).filter(|&l| BAND.contains(frequency_hz[l])).collect();
        let (stiffness, damping): (Vec<f64>, Vec<f64>) = inside
            .chunks(LINES)
            .filter(|lines| lines.len() == LINES)
            .filter_map(|lines| {
                let n = lines.len() as f64;
                let d = lines.iter().map(|&l| compliance_m_per_n[l]).sum::<Complex<f64>>() / n;
                let f = lines.iter().map(|&l| frequency_hz[l]).sum::<f64>() / n;
                let z = d.inv();
                z.is_finite().then(|| stiffness_and_damping(z, Complex::new(sigma_per_s, TAU * f)))
            })
            .unzip();
        Some(Self {
            stiffness_n_per_m: BandStatistic::of(&stiffness)?,
            damping_n_s_per_m: BandStatistic::of(&damping)?,
            lines: stiffness.len() * LINES,
        })
    }

    /// Whether Δx is buried in noise, so that no stiffness can be read from it.
    pub fn is_drowned(&self) -> bool {
        self.stiffness_n_per_m.std > DROWNED * self.stiffness_n_per_m.mean.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hysteresis::compliance::ContactCompliance;
    use crate::spectra::CrossSpectra;
    use crate::spectra::cross_spectra::OutputSums;

    const SIGMA: f64 = 2.3;

    /// A contact of 180 N/µm with a resonance of strength `a` at 192 Hz between A and B, seen from one impact.
    fn seen(a: f64) -> ContactCompliance {
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
        let a: Vec<Complex<f64>> = (0..lines).map(|l| b[l] + relative(l)).collect();
        let sums = [a, b, tangential].map(|s_xf| OutputSums { s_xf, s_xx: vec![1.0; lines], delay_s: 0.0 });
        let impact = CrossSpectra::new(1.0, frequency_hz, SIGMA, 1, vec![1.0; lines], sums.to_vec());
        ContactCompliance::of_impacts(&[&impact.expect("one value for each line")]).expect("an impact")
    }

    fn direct(found: &ContactCompliance) -> Direct {
        Direct::of(&found.frequency_hz, &found.compliance_m_per_n, SIGMA).expect("lines")
    }

    #[test]
    fn a_resonance_of_one_specimen_is_found_where_it_is() {
        let found = seen(0.05);
        let peak = found.imaginary_peak().expect("lines");
        assert!((peak.frequency_hz - 192.0).abs() < 1.5, "{peak:?}");
        // the resonance's tail above 250 Hz makes the contact look a little stiffer
        let k = direct(&found).stiffness_n_per_m.mean;
        assert!((180e6..200e6).contains(&k), "{k}");
        assert!(peak.stands_out(), "{peak:?}");
    }

    #[test]
    fn without_one_nothing_stands_out() {
        let found = seen(0.0);
        let peak = found.imaginary_peak().expect("lines");
        assert!(!peak.stands_out() && peak.over_level < 0.01, "{peak:?}");
        let direct = direct(&found);
        // exact but for rounding
        assert!((direct.stiffness_n_per_m.mean / 180e6 - 1.0).abs() < 1e-9);
        assert_eq!((<[f64; 2]>::from(BAND), direct.lines), ([250.0, 400.0], 300));
        assert_eq!(ContactCompliance::of_impacts(&[]), None);
    }
}

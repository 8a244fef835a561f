//! T/Δx at the specimens as a separate joint estimate: the contact itself, without the clamp in
//! series.

use super::joint_over_bands::{BandStatistic, stiffness_and_damping};
use crate::band::Band;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Band in which T/Δx is evaluated: above the drift of hammer and windows, below the first bending
/// modes of the paper's arms.
const SEARCH: Band = Band { low_hz: 100.0, high_hz: 600.0 };
/// Width of the band that is averaged, Hz.
const WIDTH_HZ: f64 = 150.0;
/// Lines averaged before the stiffness is computed: 5 Hz at half-hertz lines.
const LINES: usize = 10;
/// Scatter relative to the mean above which the result is noise.
const DROWNED: f64 = 0.5;

/// Stiffness and damping of the contact along z.
///
/// The band is the flattest one: of all bands of 150 Hz between 100 and 600 Hz, the one in which
/// the stiffness scatters least relative to its mean. A local mode of a specimen, its tails, and
/// noise all increase the scatter, so none of them has to be known beforehand.
///
/// T is the load cells' sum: the static arm's inertia adds a few per cent to it, growing with f².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direct {
    /// K, N/m.
    pub stiffness_n_per_m: BandStatistic,
    /// C, N s/m.
    pub damping_n_s_per_m: BandStatistic,
    /// The band used, Hz.
    pub band_hz: Band,
    /// Lines used.
    pub lines: usize,
}

/// The mean of some neighbouring lines.
struct Piece {
    band_hz: Band,
    stiffness: f64,
    damping: f64,
}

impl Direct {
    /// Z^J_z = 1/D from the compliance D = Δx/T (m/N, \[line\]) at the lines `frequency_hz` (Hz) on
    /// s = σ + iω; none if the band holds too few lines.
    ///
    /// Δx is averaged over some lines before the division, because 1/(D + n) falls where noise
    /// prevails.
    pub fn of(frequency_hz: &[f64], compliance_m_per_n: &[Complex<f64>], sigma_per_s: f64) -> Option<Self> {
        let inside: Vec<usize> =
            (0..frequency_hz.len()).filter(|&l| SEARCH.contains(frequency_hz[l])).collect();
        let piece = |lines: &[usize]| {
            let n = lines.len() as f64;
            let d = lines.iter().map(|&l| compliance_m_per_n[l]).sum::<Complex<f64>>() / n;
            let f = lines.iter().map(|&l| frequency_hz[l]).sum::<f64>() / n;
            let z = d.inv();
            let band_hz =
                Band { low_hz: frequency_hz[lines[0]], high_hz: frequency_hz[lines[lines.len() - 1]] };
            z.is_finite().then(|| {
                let (stiffness, damping) = stiffness_and_damping(z, Complex::new(sigma_per_s, TAU * f));
                Piece { band_hz, stiffness, damping }
            })
        };
        let pieces: Vec<Piece> =
            inside.chunks(LINES).filter(|lines| lines.len() == LINES).filter_map(piece).collect();
        // number of pieces that spans the width of the band; all pieces if they span less
        let wide = |pieces: &[Piece]| match pieces {
            [first, .., last] => last.band_hz.high_hz - first.band_hz.low_hz >= WIDTH_HZ,
            _ => false,
        };
        let count = (1..pieces.len()).find(|count| wide(&pieces[..*count])).unwrap_or(pieces.len());
        let over = |pieces: &[Piece]| {
            let [Some(first), Some(last)] = [pieces.first(), pieces.last()] else { return None };
            Some(Self {
                stiffness_n_per_m: BandStatistic::of(&of(pieces, |piece| piece.stiffness))?,
                damping_n_s_per_m: BandStatistic::of(&of(pieces, |piece| piece.damping))?,
                band_hz: Band { low_hz: first.band_hz.low_hz, high_hz: last.band_hz.high_hz },
                lines: pieces.len() * LINES,
            })
        };
        pieces
            .windows(count.max(1))
            .filter_map(over)
            .min_by(|one, other| one.scatter().total_cmp(&other.scatter()))
    }

    /// Standard deviation of the stiffness divided by its mean.
    fn scatter(&self) -> f64 {
        self.stiffness_n_per_m.std / self.stiffness_n_per_m.mean.abs()
    }

    /// Whether noise in Δx is so large that no stiffness can be determined.
    pub fn is_drowned(&self) -> bool {
        self.scatter() > DROWNED
    }
}

fn of(pieces: &[Piece], what: fn(&Piece) -> f64) -> Vec<f64> {
    pieces.iter().map(what).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hysteresis::compliance::ContactCompliance;
    use crate::spectra::CrossSpectra;
    use crate::spectra::cross_spectra::OutputSums;

    const SIGMA: f64 = 2.3;

    /// A contact of 180 N/µm with a resonance of strength `a` at 192 Hz between A and B, measured
    /// from one impact.
    fn seen(a: f64) -> ContactCompliance {
        seen_at(a, 192.0)
    }

    /// The same at another frequency.
    fn seen_at(a: f64, resonance_hz: f64) -> ContactCompliance {
        let frequency_hz: Vec<f64> = (0..1981).map(|l| 10.0 + 0.5 * f64::from(l)).collect();
        let lines = frequency_hz.len();
        let s = |l: usize| Complex::new(SIGMA, TAU * frequency_hz[l]);
        let w = TAU * resonance_hz;
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
        // far above the resonance its tail makes the contact look slightly stiffer
        let k = direct(&found).stiffness_n_per_m.mean;
        assert!((180e6..184e6).contains(&k), "{k}");
        assert!(peak.stands_out(), "{peak:?}");
    }

    #[test]
    fn the_band_keeps_away_from_a_resonance_wherever_it_is() {
        for resonance_hz in [120.0, 192.0, 280.0, 330.0, 450.0, 560.0] {
            let found = direct(&seen_at(0.05, resonance_hz));
            let Band { low_hz, high_hz } = found.band_hz;
            assert!(
                high_hz < 0.8 * resonance_hz || low_hz > 1.25 * resonance_hz,
                "{resonance_hz}: {found:?}"
            );
            // 1 + 0.05 / (1 − r²): no nearer than r = 0.8, where it is 1.14
            let error = found.stiffness_n_per_m.mean / 180e6 - 1.0;
            assert!(error.abs() < 0.13, "{resonance_hz}: {error}");
            assert!(!found.is_drowned());
        }
    }

    #[test]
    fn without_one_nothing_stands_out() {
        let found = seen(0.0);
        let peak = found.imaginary_peak().expect("lines");
        assert!(!peak.stands_out() && peak.over_level < 0.01, "{peak:?}");
        let direct = direct(&found);
        // exact except for rounding
        assert!((direct.stiffness_n_per_m.mean / 180e6 - 1.0).abs() < 1e-9);
        assert_eq!(direct.lines, 310);
        assert_eq!(ContactCompliance::of_impacts(&[]), None);
    }
}

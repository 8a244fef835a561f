//! From Z^J per line to stiffness and damping over a band, with a realistic statement of their
//! scatter.

use super::idm::{Dof, IdmSet};
use crate::band::Band;
use crate::parallel::prelude::*;
use crate::student::student_95;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;
use std::collections::BTreeMap;

pub use crate::student::NORMAL_95;

/// Most blocks of the jackknife.
const MOST_BLOCKS: usize = 10;

/// One quantity over the lines of a band.
///
/// `ci95` is an interval for the *mean over this band*, by a delete-one-block jackknife over
/// contiguous sub-bands with Student's t: neighbouring lines share resonances and leakage, so that
/// treating them as independent would make the interval far too narrow. It covers scatter between
/// sub-bands only. It does not cover the bias of noise (Re Z → 0 when the noise exceeds the joint's
/// admittance), position errors or a flexible clamp.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BandStatistic {
    /// Mean over the lines.
    pub mean: f64,
    /// Population standard deviation over the lines.
    pub std: f64,
    /// Median over the lines.
    pub median: f64,
    /// 95 % interval of the mean; none with fewer than four lines.
    pub ci95: Option<[f64; 2]>,
}

impl BandStatistic {
    /// Statistics of the values of consecutive lines; none without lines.
    pub fn of(values: &[f64]) -> Option<BandStatistic> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        Some(BandStatistic { mean, std, median: median(values), ci95: block_jackknife(values, mean) })
    }
}

fn block_jackknife(values: &[f64], mean: f64) -> Option<[f64; 2]> {
    let n = values.len();
    if n < 4 {
        return None;
    }
    // about √n blocks of about √n lines
    let blocks = ((n as f64).sqrt().round() as usize).clamp(2, MOST_BLOCKS);
    let total: f64 = values.iter().sum();
    let without: Vec<f64> = (0..blocks)
        .map(|b| {
            let (from, to) = (b * n / blocks, (b + 1) * n / blocks);
            (total - values[from..to].iter().sum::<f64>()) / (n - (to - from)) as f64
        })
        .collect();
    let centre = without.iter().sum::<f64>() / blocks as f64;
    let spread: f64 = without.iter().map(|v| (v - centre).powi(2)).sum();
    let half = student_95(blocks - 1) * (spread * (blocks - 1) as f64 / blocks as f64).sqrt();
    Some([mean - half, mean + half])
}

/// The median; the mean of the two middle values of an even number.
pub fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    let lower =
        if n % 2 == 1 { *upper } else { below.iter().copied().max_by(f64::total_cmp).unwrap_or(*upper) };
    0.5 * (lower + *upper)
}

/// Stiffness and damping of one diagonal entry of Z^J on s = σ + iω: a spring–damper joint is Z =
/// K + sC, so C = Im Z / ω and K = Re Z − σ C.
pub fn stiffness_and_damping(z: Complex<f64>, s: Complex<f64>) -> (f64, f64) {
    let damping = z.im / s.im;
    (z.re - s.re * damping, damping)
}

/// The joint's diagonal over frequency, for figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointSpectrum {
    /// Name of the method.
    pub method: String,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The modes.
    pub modes: Vec<Dof>,
    /// Frequency of each line, Hz.
    pub frequency_hz: Vec<f64>,
    /// K per degree of freedom and line, N/m (N m/rad for rotations, N m for extensions, N m² for
    /// the other flexible modes).
    pub stiffness_n_per_m: BTreeMap<Dof, Vec<f64>>,
    /// C per degree of freedom and line, N s/m (N m s/rad for rotations).
    pub damping_n_s_per_m: BTreeMap<Dof, Vec<f64>>,
    /// K between two degrees of freedom (`y-z` and so on, each pair once, the mean of both entries)
    /// per line: N/m between translations, N/rad (N m/m) between a translation and a rotation, N
    /// m/rad between rotations.
    pub coupling_si: BTreeMap<String, Vec<f64>>,
    /// C between them, in the same units times seconds.
    pub coupling_damping_si: BTreeMap<String, Vec<f64>>,
}

impl JointSpectrum {
    /// The diagonal of Z^J (n_c × n_c per line) at the lines' s.
    pub fn of(
        method: &str,
        idms: IdmSet,
        frequency_hz: &[f64],
        sigma_per_s: f64,
        z: &[DMatrix<Complex<f64>>],
    ) -> JointSpectrum {
        // mean of the entry and its transpose, over all lines
        let entry = |i: usize, j: usize| -> (Vec<f64>, Vec<f64>) {
            let parts = z.iter().zip(frequency_hz).map(|(z, f)| {
                let s = Complex::new(sigma_per_s, std::f64::consts::TAU * f);
                stiffness_and_damping(0.5 * (z[(i, j)] + z[(j, i)]), s)
            });
            parts.unzip()
        };
        let dofs = idms.dofs();
        let (mut stiffness_n_per_m, mut damping_n_s_per_m) = (BTreeMap::new(), BTreeMap::new());
        let (mut coupling_si, mut coupling_damping_si) = (BTreeMap::new(), BTreeMap::new());
        for (i, one) in dofs.iter().enumerate() {
            let (k, c) = entry(i, i);
            stiffness_n_per_m.insert(*one, k);
            damping_n_s_per_m.insert(*one, c);
            for (j, other) in dofs.iter().enumerate().skip(i + 1) {
                let (k, c) = entry(i, j);
                coupling_si.insert(format!("{one}-{other}"), k);
                coupling_damping_si.insert(format!("{one}-{other}"), c);
            }
        }
        JointSpectrum {
            method: method.into(),
            idms: idms.count(),
            modes: dofs,
            frequency_hz: frequency_hz.to_vec(),
            stiffness_n_per_m,
            damping_n_s_per_m,
            coupling_si,
            coupling_damping_si,
        }
    }

    /// Statistics over a band; none if no line lies in it.
    pub fn over(&self, band: Band) -> Option<JointRow> {
        let lines: Vec<usize> =
            (0..self.frequency_hz.len()).filter(|&l| band.contains(self.frequency_hz[l])).collect();
        if lines.is_empty() {
            return None;
        }
        let stiffness_n_per_m = statistics(&self.stiffness_n_per_m, &lines);
        let warnings = stiffness_n_per_m.get(&Dof::Z).map(scatter_warnings).unwrap_or_default();
        Some(JointRow {
            method: self.method.clone(),
            idms: self.idms,
            modes: self.modes.clone(),
            band_hz: band,
            stiffness_n_per_m,
            damping_n_s_per_m: statistics(&self.damping_n_s_per_m, &lines),
            coupling_si: statistics(&self.coupling_si, &lines),
            coupling_damping_si: statistics(&self.coupling_damping_si, &lines),
            lines: lines.len(),
            warnings,
        })
    }
}

/// Statistics of each spectrum over these lines.
fn statistics<K: Ord + Clone + Send + Sync>(
    spectra: &BTreeMap<K, Vec<f64>>,
    lines: &[usize],
) -> BTreeMap<K, BandStatistic> {
    spectra
        .par_iter()
        .filter_map(|(key, values)| {
            let band: Vec<f64> = lines.iter().map(|&l| values[l]).collect();
            BandStatistic::of(&band).map(|s| (key.clone(), s))
        })
        .collect()
}

/// One row of `joint` in the results: a method, an IDM set, a band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointRow {
    /// Name of the method.
    pub method: String,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The modes.
    pub modes: Vec<Dof>,
    /// The band, Hz.
    pub band_hz: Band,
    /// K of each degree of freedom, N/m (N m/rad for rotations).
    pub stiffness_n_per_m: BTreeMap<Dof, BandStatistic>,
    /// C of each degree of freedom, N s/m (N m s/rad for rotations).
    pub damping_n_s_per_m: BTreeMap<Dof, BandStatistic>,
    /// K between each pair of degrees of freedom, as in [`JointSpectrum::coupling_si`].
    pub coupling_si: BTreeMap<String, BandStatistic>,
    /// C between them.
    pub coupling_damping_si: BTreeMap<String, BandStatistic>,
    /// Lines in the band.
    pub lines: usize,
    /// Warnings to read before using the values.
    pub warnings: Vec<String>,
}

/// Warnings that follow from the scatter of k_z relative to its mean.
fn scatter_warnings(k: &BandStatistic) -> Vec<String> {
    let mut warnings = Vec::new();
    if k.std > 0.5 * k.mean.abs() {
        warnings.push(format!(
            "k_z scatters by {:.0} % of its mean: noise larger than the joint's admittance biases the mean towards zero",
            100.0 * k.std / k.mean.abs()
        ));
    }
    if (k.mean - k.median).abs() > 0.2 * k.mean.abs().max(k.median.abs()) {
        warnings.push(format!(
            "mean {:.1} and median {:.1} N/µm of k_z disagree: single lines dominate the mean",
            k.mean * 1e-6,
            k.median * 1e-6
        ));
    }
    if k.mean < 0.0 {
        warnings.push("a joint cannot have a negative mean stiffness: the interface is described by too few IDMs, or noise dominates".into());
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn statistics_are_those_of_the_definitions() {
        let s = BandStatistic::of(&[1.0, 2.0, 3.0, 10.0]).expect("four lines");
        assert_eq!((s.mean, s.median), (4.0, 2.5));
        assert!((s.std - (50.0f64 / 4.0).sqrt()).abs() < 1e-15);
        assert!(s.ci95.is_some() && BandStatistic::of(&[1.0]).expect("one").ci95.is_none());
        assert!(BandStatistic::of(&[]).is_none());
    }

    #[test]
    fn a_slow_trend_widens_the_interval_where_independent_lines_would_not() {
        let trend: Vec<f64> = (0..100).map(|i| (i as f64 * 0.03).sin()).collect();
        let s = BandStatistic::of(&trend).expect("lines");
        let [low, high] = s.ci95.expect("enough lines");
        // σ/√n for independent lines would be ± 2 · 0.1 · std
        assert!(high - low > 2.0 * 0.4 * s.std, "half width {}", (high - low) / 2.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::default() })]

        /// K and C are recovered from K + sC on any s.
        #[test]
        fn spring_and_damper_come_back(k in 1e5..1e9f64, c in 0.0..1e4f64, f in 10.0..1000.0f64, sigma in 0.0..20.0f64) {
            let s = Complex::new(sigma, std::f64::consts::TAU * f);
            let (k2, c2) = stiffness_and_damping(k + s * c, s);
            // rounding: K and sC differ by at most four decades
            prop_assert!((k2 - k).abs() < 1e-11 * k.max(c * s.norm()));
            prop_assert!((c2 - c).abs() < 1e-11 * (c + k / s.norm()));
        }
    }
}

//! A measured loop: one cycle of displacement and force, and the noise of its points.
//!
//! A law must not be fed with a noisy displacement: near the ends of the stroke noise reverses the
//! direction, and every reversal takes the force off its plateau. The displacement is therefore
//! represented by its significant harmonics ([`MeasuredLoop::harmonics`]), whose own uncertainty
//! takes part in the fit.

use super::FrictionError;
use super::law::ends;
use crate::hysteresis::loops::swing;
use crate::median::noise_of;
use nalgebra::DMatrix;
use serde::Serialize;
use std::f64::consts::TAU;

/// Fewest points of a loop.
const FEWEST_POINTS: usize = 32;

/// Fewest cycles that tell their scatter.
const FEWEST_CYCLES: usize = 4;

/// A harmonic of the displacement is significant above this many standard deviations of its
/// amplitude: about 1e-4 of harmonics of noise alone exceed it.
const SIGNIFICANT: f64 = 4.3;

/// Highest harmonic of the displacement that is looked for: at most one in this many points …
const POINTS_PER_HARMONIC: usize = 8;

/// … and at most this one: each takes two unknowns of a fit.
const HIGHEST: usize = 40;

/// The noise is never taken to be smaller than this fraction of the swing: rounding.
const ROUNDING: f64 = 1e-9;

/// The noise of a loop's points. It is normally distributed; the displacement's is independent from
/// point to point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopNoise {
    /// Standard deviation of a displacement, m.
    pub displacement_m: f64,
    /// Standard deviation of a force, N.
    pub force_n: f64,
    /// Correlation of the force noise of neighbouring points, which falls as its powers with
    /// distance; 0 if it is independent.
    pub force_correlation: f64,
}

/// One closed cycle. The points are at equal times; the path from the last one leads back to the
/// first.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredLoop {
    displacement_m: Vec<f64>,
    force_n: Vec<f64>,
    noise: LoopNoise,
    /// Whether the noise is estimated from differences.
    noise_is_estimated: bool,
    harmonics: usize,
    /// Columns cos, sin of each significant harmonic at each point.
    basis: DMatrix<f64>,
    /// The displacement of the significant harmonics, m.
    smooth_m: Vec<f64>,
}

impl MeasuredLoop {
    /// From the displacement (m) and the force (N) of one cycle. Without a stated noise, it is
    /// estimated from third differences, which take it to be independent from point to point.
    ///
    /// # Errors
    /// Too few points, values that are not finite, no motion, or an impossible noise.
    pub fn new(
        displacement_m: Vec<f64>,
        force_n: Vec<f64>,
        noise: Option<LoopNoise>,
    ) -> Result<Self, FrictionError> {
        let (displacement, force) = (displacement_m.len(), force_n.len());
        if displacement != force || force < FEWEST_POINTS {
            return Err(FrictionError::Lengths { displacement, force, least: FEWEST_POINTS });
        }
        let finite = |(x, f): (&f64, &f64)| x.is_finite() && f.is_finite();
        if let Some(point) = displacement_m.iter().zip(&force_n).position(|point| !finite(point)) {
            return Err(FrictionError::NotFinite { point });
        }
        let (motion, swing_n) = (swing(&displacement_m), swing(&force_n));
        if motion <= 0.0 || swing_n <= 0.0 {
            return Err(FrictionError::NoMotion);
        }
        let noise_is_estimated = noise.is_none();
        let mut noise = noise.unwrap_or_else(|| LoopNoise {
            displacement_m: noise_of(&displacement_m),
            force_n: noise_of(&force_n),
            force_correlation: 0.0,
        });
        let LoopNoise { displacement_m: x, force_n: f, force_correlation: correlation } = noise;
        let possible = x >= 0.0 && f >= 0.0 && x.is_finite() && f.is_finite() && correlation.abs() < 1.0;
        if !possible {
            return Err(FrictionError::Noise { displacement_m: x, force_n: f, correlation });
        }
        noise.force_n = f.max(ROUNDING * swing_n);
        noise.displacement_m = x.max(ROUNDING * motion);
        let basis = basis(displacement, (displacement / POINTS_PER_HARMONIC).min(HIGHEST));
        let scale = 2.0 / displacement as f64;
        let amplitudes: Vec<f64> =
            basis.column_iter().map(|column| scale * dot(column.iter(), displacement_m.iter())).collect();
        let std = noise.displacement_m * scale.sqrt();
        let harmonics = amplitudes
            .chunks_exact(2)
            .rposition(|pair| pair[0].hypot(pair[1]) > SIGNIFICANT * std)
            .map_or(1, |last| last + 1);
        let mean = displacement_m.iter().sum::<f64>() / displacement as f64;
        let basis = basis.columns(0, 2 * harmonics).into_owned();
        let smooth_m = basis.row_iter().map(|row| mean + dot(row.iter(), amplitudes.iter())).collect();
        Ok(Self { displacement_m, force_n, noise, noise_is_estimated, harmonics, basis, smooth_m })
    }

    /// As [`Self::new`] without a stated noise, from the means of neighbouring points where there
    /// are more than `most`: a fit takes time in proportion to the points.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn thinned(displacement_m: &[f64], force_n: &[f64], most: usize) -> Result<Self, FrictionError> {
        let thin = |signal: &[f64]| -> Vec<f64> {
            let n = signal.len();
            let blocks = n.min(most);
            let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
            (0..blocks).map(|i| mean(&signal[i * n / blocks..(i + 1) * n / blocks])).collect()
        };
        if displacement_m.len() != force_n.len() {
            return Self::new(displacement_m.to_vec(), force_n.to_vec(), None);
        }
        Self::new(thin(displacement_m), thin(force_n), None)
    }

    /// The same loop with an error of the force in addition to its noise, independent from point to
    /// point, as a fraction of the force's amplitude: what the law or the rig leaves unexplained.
    #[must_use]
    pub fn with_force_error(mut self, fraction: f64) -> Self {
        self.noise.force_n = self.noise.force_n.hypot(fraction * self.force_amplitude_n());
        self
    }

    /// The average of several cycles of the same number of points (displacement in m, force in N),
    /// with the noise of the average from the scatter of the cycles. What changes slowly from cycle
    /// to cycle is removed before: each cycle's mean.
    ///
    /// # Errors
    /// Fewer than four cycles, cycles of different length, or as [`Self::new`].
    pub fn from_cycles(cycles: &[(Vec<f64>, Vec<f64>)]) -> Result<Self, FrictionError> {
        let points = cycles.first().map_or(0, |(x, _)| x.len());
        let same = cycles.iter().all(|(x, f)| x.len() == points && f.len() == points);
        if cycles.len() < FEWEST_CYCLES || !same || points == 0 {
            return Err(FrictionError::Cycles { cycles: cycles.len(), least: FEWEST_CYCLES });
        }
        let (motion, force): (Vec<&[f64]>, Vec<&[f64]>) =
            cycles.iter().map(|(x, f)| (x.as_slice(), f.as_slice())).unzip();
        let (displacement_m, motion_rest) = average(&motion, points);
        let (force_n, force_rest) = average(&force, points);
        // the scatter about the average has lost one of the cycles
        let freedom = (cycles.len() - 1) as f64 * points as f64;
        let product = |rest: &[Vec<f64>], lag: usize| -> f64 {
            let of = |r: &Vec<f64>| (0..points).map(|i| r[i] * r[(i + lag) % points]).sum::<f64>();
            rest.iter().map(of).sum::<f64>() / freedom
        };
        let std = |rest: &[Vec<f64>]| (product(rest, 0) / cycles.len() as f64).sqrt();
        let whole = product(&force_rest, 0);
        let correlation = if whole > 0.0 { product(&force_rest, 1) / whole } else { 0.0 };
        let noise = LoopNoise {
            displacement_m: std(&motion_rest),
            force_n: std(&force_rest),
            force_correlation: correlation.clamp(-0.99, 0.99),
        };
        Self::new(displacement_m, force_n, Some(noise))
    }

    /// Displacement of its points, m.
    pub fn displacement_m(&self) -> &[f64] {
        &self.displacement_m
    }

    /// Force of its points, N.
    pub fn force_n(&self) -> &[f64] {
        &self.force_n
    }

    /// Displacement of its significant harmonics, m.
    pub fn smooth_displacement_m(&self) -> &[f64] {
        &self.smooth_m
    }

    /// Noise of its points.
    pub fn noise(&self) -> LoopNoise {
        self.noise
    }

    /// Relative variance of the stated noise's variance: 0 if it was stated.
    pub(super) fn noise_variance_doubt(&self) -> f64 {
        // found with normal noise of 64 to 1024 points
        if self.noise_is_estimated { 16.0 / self.force_n.len() as f64 } else { 0.0 }
    }

    /// The highest significant harmonic of the displacement.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Half the swing of the displacement, m.
    pub fn amplitude_m(&self) -> f64 {
        0.5 * swing(&self.smooth_m)
    }

    /// Half the swing of the force, N.
    pub fn force_amplitude_n(&self) -> f64 {
        0.5 * swing(&self.force_n)
    }

    /// The smallest and the largest displacement, m.
    pub(super) fn ends_m(&self) -> (f64, f64) {
        ends(&self.smooth_m)
    }

    /// The area of the loop, J.
    pub fn energy_j(&self) -> f64 {
        area(&self.smooth_m, &self.force_n)
    }

    /// Standard deviation of the area, J.
    pub fn energy_std_j(&self) -> f64 {
        let squares = |signal: &[f64]| -> f64 {
            let n = signal.len();
            (0..n).map(|i| (0.5 * (signal[(i + 1) % n] - signal[(i + n - 1) % n])).powi(2)).sum()
        };
        let LoopNoise { displacement_m, force_n, force_correlation } = self.noise;
        // slow signals gather correlated noise: their sums have the noise's spectrum at zero
        let longer = (1.0 + force_correlation) / (1.0 - force_correlation);
        (squares(&self.smooth_m) * force_n.powi(2) * longer + squares(&self.force_n) * displacement_m.powi(2))
            .sqrt()
    }

    /// Columns cos, sin of each significant harmonic: points × 2 harmonics.
    pub(super) fn basis(&self) -> &DMatrix<f64> {
        &self.basis
    }

    /// Standard deviation of each harmonic's cosine and sine, m.
    pub(super) fn harmonic_std_m(&self) -> f64 {
        self.noise.displacement_m * (2.0 / self.displacement_m.len() as f64).sqrt()
    }

    /// The whitened form of residuals (N) of its points: independent, of unit variance.
    pub(super) fn whitened(&self, residual_n: &[f64]) -> Vec<f64> {
        let LoopNoise { force_n, force_correlation: c, .. } = self.noise;
        let scale = 1.0 / (force_n * (1.0 - c * c).sqrt());
        let n = residual_n.len();
        (0..n).map(|i| scale * (residual_n[i] - c * residual_n[(i + n - 1) % n])).collect()
    }
}

/// The area that a closed path of points encloses, ∮ F dx, J.
pub fn area(displacement_m: &[f64], force_n: &[f64]) -> f64 {
    let n = displacement_m.len().min(force_n.len());
    (0..n)
        .map(|i| {
            let next = (i + 1) % n;
            0.5 * (force_n[i] + force_n[next]) * (displacement_m[next] - displacement_m[i])
        })
        .sum()
}

/// The mean of several cycles, and their deviations from it, each less its own mean.
fn average(cycles: &[&[f64]], points: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    let level = |signal: &[f64]| signal.iter().sum::<f64>() / points as f64;
    let mean: Vec<f64> =
        (0..points).map(|i| cycles.iter().map(|cycle| cycle[i]).sum::<f64>() / cycles.len() as f64).collect();
    let all = level(&mean);
    let rest = cycles
        .iter()
        .map(|cycle| {
            let own = level(cycle);
            cycle.iter().zip(&mean).map(|(v, m)| (v - own) - (m - all)).collect()
        })
        .collect();
    (mean, rest)
}

fn dot<'a>(a: impl Iterator<Item = &'a f64>, b: impl Iterator<Item = &'a f64>) -> f64 {
    a.zip(b).map(|(a, b)| a * b).sum()
}

fn basis(points: usize, harmonics: usize) -> DMatrix<f64> {
    DMatrix::from_fn(points, 2 * harmonics, |i, column| {
        let turn = TAU * ((column / 2 + 1) * i % points) as f64 / points as f64;
        if column % 2 == 0 { turn.cos() } else { turn.sin() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;
    use rand_distr::{Distribution as _, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus as Rng;

    fn wave(n: usize, scale: f64, phase: f64) -> Vec<f64> {
        (0..n).map(|i| scale * (TAU * i as f64 / n as f64 + phase).sin()).collect()
    }

    fn noisy(rng: &mut Rng, signal: &[f64], std: f64) -> Vec<f64> {
        signal
            .iter()
            .map(|v| {
                v + std * <StandardNormal as rand_distr::Distribution<f64>>::sample(&StandardNormal, rng)
            })
            .collect()
    }

    #[test]
    fn an_ellipse_has_its_area_and_the_stated_scatter() {
        let (x, f) = (wave(256, 2e-6, 0.0), wave(256, 30.0, 0.3));
        let exact = std::f64::consts::PI * 2e-6 * 30.0 * 0.3f64.sin();
        let mut rng = Rng::seed_from_u64(5);
        let noise = LoopNoise { displacement_m: 2e-8, force_n: 0.5, force_correlation: 0.0 };
        let energies: Vec<f64> = (0..400)
            .map(|_| {
                let (x, f) = (noisy(&mut rng, &x, 2e-8), noisy(&mut rng, &f, 0.5));
                MeasuredLoop::new(x, f, Some(noise)).expect("a loop").energy_j()
            })
            .collect();
        let mean = energies.iter().sum::<f64>() / 400.0;
        let std = (energies.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        let stated = MeasuredLoop::new(x, f, Some(noise)).expect("a loop").energy_std_j();
        // the standard deviation of 400 values is known to 4 %
        assert!((std / stated - 1.0).abs() < 0.12, "{std} {stated}");
        assert!((mean - exact).abs() < 4.0 * stated / 20.0 + 1e-3 * exact, "{mean} {exact}");
    }

    #[test]
    fn noise_is_read_off_differences_and_off_cycles() {
        let mut rng = Rng::seed_from_u64(7);
        let (x, f) = (wave(256, 2e-6, 0.0), wave(256, 30.0, 0.3));
        let one =
            MeasuredLoop::new(noisy(&mut rng, &x, 2e-8), noisy(&mut rng, &f, 0.5), None).expect("a loop");
        assert!((one.noise().force_n / 0.5 - 1.0).abs() < 0.3, "{:?}", one.noise());
        assert!((one.noise().displacement_m / 2e-8 - 1.0).abs() < 0.3, "{:?}", one.noise());
        assert_eq!(one.harmonics(), 1);
        let cycles: Vec<_> = (0..25)
            .map(|_| {
                let mut last = 0.0;
                let force = f
                    .iter()
                    .map(|v| {
                        let fresh: f64 = StandardNormal.sample(&mut rng);
                        last = 0.6 * last + 0.8 * fresh;
                        v + 0.5 * last
                    })
                    .collect();
                (noisy(&mut rng, &x, 2e-8), force)
            })
            .collect();
        let many = MeasuredLoop::from_cycles(&cycles).expect("cycles");
        let LoopNoise { displacement_m, force_n, force_correlation } = many.noise();
        assert!((displacement_m / 4e-9 - 1.0).abs() < 0.05, "{displacement_m}");
        assert!((force_n / 0.1 - 1.0).abs() < 0.05, "{force_n}");
        assert!((force_correlation - 0.6).abs() < 0.03, "{force_correlation}");
    }

    #[test]
    fn what_is_no_loop_is_refused_with_its_reason() {
        let (x, f) = (wave(64, 1.0, 0.0), wave(64, 1.0, 0.2));
        let reason = |x: Vec<f64>, f: Vec<f64>| MeasuredLoop::new(x, f, None).err();
        assert!(matches!(reason(x.clone(), f[..60].to_vec()), Some(FrictionError::Lengths { .. })));
        assert!(matches!(reason(x[..8].to_vec(), f[..8].to_vec()), Some(FrictionError::Lengths { .. })));
        assert_eq!(reason(vec![1.0; 64], f.clone()), Some(FrictionError::NoMotion));
        let mut broken = f.clone();
        broken[17] = f64::NAN;
        assert_eq!(reason(x.clone(), broken), Some(FrictionError::NotFinite { point: 17 }));
        let noise = LoopNoise { displacement_m: -1.0, force_n: 1.0, force_correlation: 0.0 };
        assert!(matches!(
            MeasuredLoop::new(x.clone(), f.clone(), Some(noise)),
            Err(FrictionError::Noise { .. })
        ));
        let cycles = vec![(x, f); 3];
        assert_eq!(MeasuredLoop::from_cycles(&cycles), Err(FrictionError::Cycles { cycles: 3, least: 4 }));
    }
}

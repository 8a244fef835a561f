//! First and third harmonic of a cycle's signals.

use super::sums::dot;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Amplitudes of one signal over one cycle: at the fundamental, and at its third harmonic.
pub(super) type Pair = [Complex<f64>; 2];

/// First and third harmonic of one cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Harmonics {
    /// Of Δx, m.
    pub displacement: Pair,
    /// Of T, N.
    pub force: Pair,
}

/// Cosine and negative sine of the first and third harmonic, sampled at the points of a cycle.
pub(super) struct Wheels([[Vec<f64>; 2]; 2]);

impl Wheels {
    /// For cycles of `points` points.
    pub fn new(points: usize) -> Self {
        let turn = |times: usize, part: fn(f64) -> f64| -> Vec<f64> {
            // the remainder keeps the angle small, so the third harmonic is as accurate as the
            // first
            let angle = |i: usize| TAU * (times * i % points) as f64 / points as f64;
            (0..points).map(|i| 2.0 / points as f64 * part(angle(i))).collect()
        };
        Self([1, 3].map(|times| [turn(times, f64::cos), turn(times, |angle| -angle.sin())]))
    }

    /// Amplitudes of one signal.
    pub fn harmonics(&self, x: &[f64]) -> Pair {
        self.0.each_ref().map(|[cosine, sine]| Complex::new(dot(cosine, x), dot(sine, x)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_of_a_sum_of_waves_come_back() {
        for points in [16, 205, 512] {
            let at = |i: usize| TAU * i as f64 / points as f64;
            let wave = |i: usize| 0.4 + 3.0 * (at(i) + 0.3).cos() + 0.5 * (3.0 * at(i) - 1.0).cos();
            let x: Vec<f64> = (0..points).map(wave).collect();
            let [first, third] = Wheels::new(points).harmonics(&x);
            // rounding only
            assert!((first - Complex::from_polar(3.0, 0.3)).norm() < 1e-12, "{first}");
            assert!((third - Complex::from_polar(0.5, -1.0)).norm() < 1e-12, "{third}");
        }
    }
}

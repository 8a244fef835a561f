//! What comes out of an average: FRFs with coherence and variance, and what can be made of them.

use super::records::MotionQuantity;
use crate::substructuring::frf::{FrfMatrix, Quantity};
use nalgebra::DMatrix;
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// FRFs of one impact position, averaged over its good hits. Per-line vectors are indexed \[line\]; per-output ones \[line\]\[output\].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AveragedFrf {
    /// Frequency of each line, Hz.
    pub frequency_hz: Vec<f64>,
    /// Damping of the exponential window, 1/s: the FRFs are on s = σ + iω.
    pub sigma_per_s: f64,
    /// Hits averaged.
    pub hits: usize,
    /// Mean auto-spectrum of the force, N² s².
    pub s_ff: Vec<f64>,
    /// H1 = S_xf / S_ff, response per newton.
    pub h1: Vec<Vec<Complex<f64>>>,
    /// H2 = S_xx / S_fx: biased by noise in the response, not in the force.
    pub h2: Vec<Vec<Complex<f64>>>,
    /// Hv: between H1 and H2, for noise in both; by default the geometric mean of their sizes.
    pub hv: Vec<Vec<Complex<f64>>>,
    /// γ² = |S_xf|² / (S_ff S_xx); NaN with a single hit, where it is 1 whatever the noise.
    pub coherence: Vec<Vec<f64>>,
    /// Variance of the real part of H1, and of its imaginary part: |H1|²(1 − γ²)/(2 n γ²). The complex variance E|δH|² is
    /// twice that. NaN with a single hit.
    pub variance: Vec<Vec<f64>>,
    /// The same variance by leaving out each hit in turn, where it was asked for.
    pub jackknife: Option<Vec<Vec<f64>>>,
}

/// |H|²(1 − γ²)/(2 n γ²): variance of the real, and of the imaginary part of H1 (Bendat and Piersol). Infinite at γ² = 0.
pub fn variance_of_part(h1: Complex<f64>, coherence: f64, hits: usize) -> f64 {
    if coherence == 0.0 {
        return f64::INFINITY;
    }
    h1.norm_sqr() * (1.0 - coherence).max(0.0) / (2.0 * hits as f64 * coherence)
}

impl AveragedFrf {
    /// Only the lines with `low_hz` ≤ f ≤ `high_hz`.
    #[must_use]
    pub fn band(&self, low_hz: f64, high_hz: f64) -> AveragedFrf {
        let from = self.frequency_hz.partition_point(|f| *f < low_hz);
        let to = self.frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        AveragedFrf {
            frequency_hz: self.frequency_hz[from..to].to_vec(),
            sigma_per_s: self.sigma_per_s,
            hits: self.hits,
            s_ff: self.s_ff[from..to].to_vec(),
            h1: self.h1[from..to].to_vec(),
            h2: self.h2[from..to].to_vec(),
            hv: self.hv[from..to].to_vec(),
            coherence: self.coherence[from..to].to_vec(),
            variance: self.variance[from..to].to_vec(),
            jackknife: self.jackknife.as_ref().map(|v| v[from..to].to_vec()),
        }
    }

    /// The same FRFs as another quantity: multiplied by s once or twice for each time derivative, or divided. The variances follow.
    /// A line at s = 0 has no lower derivative: it is left out where one is asked for.
    #[must_use]
    pub fn converted(&self, from: MotionQuantity, to: MotionQuantity) -> AveragedFrf {
        let order = to.frf().order_of_s() - from.frf().order_of_s();
        let mut out = self.clone();
        if order < 0 && self.sigma_per_s == 0.0 {
            out = out.band(f64::MIN_POSITIVE, f64::INFINITY);
        }
        for l in 0..out.frequency_hz.len() {
            let factor = Complex::new(out.sigma_per_s, TAU * out.frequency_hz[l]).powi(order);
            for h in [&mut out.h1[l], &mut out.h2[l], &mut out.hv[l]].into_iter().flatten() {
                *h *= factor;
            }
            let jackknife = out.jackknife.as_mut().map(|v| &mut v[l]);
            for variance in out.variance[l].iter_mut().chain(jackknife.into_iter().flatten()) {
                *variance *= factor.norm_sqr();
            }
        }
        out
    }

    /// H1 as an FRF matrix with one input.
    pub fn to_matrix(&self, quantity: Quantity, outputs: Vec<String>, input: String) -> FrfMatrix {
        let lines = self.h1.iter().map(|row| DMatrix::from_column_slice(row.len(), 1, row)).collect();
        FrfMatrix {
            frequency_hz: self.frequency_hz.clone(),
            sigma_per_s: self.sigma_per_s,
            quantity,
            outputs,
            inputs: vec![input],
            lines,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_line_at_zero_and_one_above(sigma_per_s: f64) -> AveragedFrf {
        let h = vec![vec![Complex::new(1.0, 2.0)]; 2];
        AveragedFrf {
            frequency_hz: vec![0.0, 10.0],
            sigma_per_s,
            hits: 3,
            s_ff: vec![1.0; 2],
            h1: h.clone(),
            h2: h.clone(),
            hv: h,
            coherence: vec![vec![0.9]; 2],
            variance: vec![vec![0.5]; 2],
            jackknife: Some(vec![vec![0.5]; 2]),
        }
    }

    #[test]
    fn derivatives_multiply_by_s_and_variances_by_its_square() {
        use MotionQuantity::{Acceleration, Displacement, Velocity};
        let y = one_line_at_zero_and_one_above(2.3);
        let a = y.converted(Velocity, Acceleration);
        let s = Complex::new(2.3, TAU * 10.0);
        assert!((a.hv[1][0] - s * y.hv[1][0]).norm() < 1e-12);
        assert!((a.variance[1][0] - 0.5 * s.norm_sqr()).abs() < 1e-9);
        let back = a.converted(Acceleration, Displacement).converted(Displacement, Velocity);
        assert!((back.h1[0][0] - y.h1[0][0]).norm() < 1e-12 && back.frequency_hz == y.frequency_hz);
        // without an exponential window 0 Hz has no receptance
        assert_eq!(
            one_line_at_zero_and_one_above(0.0).converted(Velocity, Displacement).frequency_hz,
            [10.0]
        );
        assert_eq!(
            one_line_at_zero_and_one_above(0.0).converted(Velocity, Acceleration).h1[0][0].norm(),
            0.0
        );
    }
}

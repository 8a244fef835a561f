//! What is read off one closed loop of T over Δx. Each quantity has its own name, because at 200 Hz beside a hidden resonance the
//! peak secant says 213 N/µm where the least-squares slope says 90.

use super::cycles::Cycle;
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// A quantity over the cycles of a record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OverCycles {
    /// Mean over the cycles.
    pub mean: f64,
    /// Population standard deviation over the cycles.
    pub std: f64,
    /// Number of cycles.
    pub cycles: usize,
}

impl OverCycles {
    /// Statistics of per-cycle values; none of none.
    pub fn of(values: &[f64]) -> Option<OverCycles> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        Some(OverCycles { mean, std, cycles: values.len() })
    }
}

/// Least-squares slope of `y` on `x` with a free intercept; NaN when x does not vary.
pub fn slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        xy += (x - mx) * (y - my);
        xx += (x - mx).powi(2);
    }
    xy / xx
}

/// k_eq: least-squares slope of T on Δx over the whole loop, N/m (|Z| cos φ for an ellipse).
pub fn equivalent_stiffness(cycle: &Cycle) -> f64 {
    slope(&cycle.displacement_m, &cycle.force_n)
}

/// Area of the closed loop, ∮ T dΔx, J. May come out slightly negative for a stuck contact: that is noise, not an error. The area of
/// an ellipse beside a hidden resonance is no friction energy.
pub fn energy(cycle: &Cycle) -> f64 {
    let n = cycle.force_n.len();
    (0..n)
        .map(|i| {
            let next = (i + 1) % n;
            0.5 * (cycle.force_n[i] + cycle.force_n[next])
                * (cycle.displacement_m[next] - cycle.displacement_m[i])
        })
        .sum()
}

/// Peak secant: the force's swing over the displacement's, N/m.
pub fn secant_stiffness(cycle: &Cycle) -> f64 {
    swing(&cycle.force_n) / swing(&cycle.displacement_m)
}

/// Ratio of the fundamentals T₁/Δx₁, N/m: its angle is the phase by which Δx lags T, its real part is k_eq for a sinusoidal Δx.
pub fn fundamental_stiffness(cycle: &Cycle) -> Complex<f64> {
    fundamental(&cycle.force_n) / fundamental(&cycle.displacement_m)
}

/// Largest minus smallest value.
pub(super) fn swing(x: &[f64]) -> f64 {
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low
}

fn fundamental(x: &[f64]) -> Complex<f64> {
    let n = x.len() as f64;
    x.iter().enumerate().map(|(i, v)| v * Complex::from_polar(2.0 / n, -TAU * i as f64 / n)).sum()
}

//! A steady record as complex amplitudes, stretch by stretch.

use super::HysteresisError;
use super::record::{HysteresisRecord, RelativeMotion};
use nalgebra::{Matrix3, Vector3};
use num_complex::Complex;
use std::f64::consts::TAU;

/// Fewest cycles of a stretch: over these a mean, a cosine and a sine are told apart.
const FEWEST_CYCLES: f64 = 4.0;

/// T (N) and the displacements of A and B (m) at the excitation's frequency over at most `count` stretches of whole cycles, one after the
/// other. Their scatter holds the noise and whatever drifts.
///
/// # Errors
/// The signals do not fit together, or there is no excitation frequency or whole cycle.
pub fn stretches(record: &HysteresisRecord, count: usize) -> Result<Vec<[Complex<f64>; 3]>, HysteresisError> {
    record.check()?;
    let frequency_hz = record.excitation_hz.ok_or(HysteresisError::Excitation(0.0))?;
    let period = record.fs_hz / frequency_hz;
    let samples = record.force_n.len();
    let cycles = (samples as f64 / period).floor();
    let count = count.min((cycles / FEWEST_CYCLES).floor() as usize);
    if count == 0 {
        return Err(HysteresisError::NoCycle { frequency_hz, samples, points: period as usize });
    }
    let long = (cycles / count as f64).floor() * period;
    let omega = TAU * frequency_hz;
    let (a, b, order) = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => (a_m_per_s, b_m_per_s, 1),
        RelativeMotion::Displacement { a_m, b_m } => (a_m, b_m, 0),
    };
    let integrated = Complex::new(0.0, omega).powi(order);
    let of = |n: usize| {
        let (from, to) = ((n as f64 * long).round() as usize, ((n + 1) as f64 * long).round() as usize);
        let tone = |x: &[f64]| amplitude(&x[from..to.min(samples)], from, omega / record.fs_hz);
        Some([tone(&record.force_n)?, tone(a)? / integrated, tone(b)? / integrated])
    };
    let found: Option<Vec<_>> = (0..count).map(of).collect();
    found.ok_or(HysteresisError::NoCycle { frequency_hz, samples, points: period as usize })
}

/// Complex amplitude of x = Re(X e^(iφn)) + mean by least squares, with n counted from `first`: exact where a period is no whole number of
/// samples.
fn amplitude(x: &[f64], first: usize, turn: f64) -> Option<Complex<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (i, value) in x.iter().enumerate() {
        let (sin, cos) = (turn * (first + i) as f64).sin_cos();
        let row = Vector3::new(cos, -sin, 1.0);
        normal += row * row.transpose();
        right += row * *value;
    }
    let found = normal.cholesky()?.solve(&right);
    Some(Complex::new(found[0], found[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_are_those_put_in_whatever_the_period() {
        let (fs_hz, f) = (51_200.0, 311.3);
        let wave = |amplitude: f64, phase: f64, mean: f64| -> Vec<f64> {
            let t = |i: i32| TAU * f * f64::from(i) / fs_hz + phase;
            (0..30_000).map(|i| mean + amplitude * t(i).cos()).collect()
        };
        let record = HysteresisRecord {
            fs_hz,
            motion: RelativeMotion::Velocity {
                a_m_per_s: wave(3e-4, 0.4, 1e-3),
                b_m_per_s: wave(1e-4, -0.2, 0.0),
            },
            force_n: wave(25.0, 0.9, 7.0),
            excitation_hz: Some(f),
            normal_load_n: None,
        };
        let found = stretches(&record, 8).expect("182 cycles");
        assert_eq!(found.len(), 8);
        let i_omega = Complex::new(0.0, TAU * f);
        let expected = [
            Complex::from_polar(25.0, 0.9),
            Complex::from_polar(3e-4, 0.4) / i_omega,
            Complex::from_polar(1e-4, -0.2) / i_omega,
        ];
        for one in &found {
            for (got, expected) in one.iter().zip(&expected) {
                assert!((got - expected).norm() < 1e-9 * expected.norm(), "{got} for {expected}");
            }
        }
        let short = HysteresisRecord { force_n: vec![1.0; 100], ..record };
        assert!(stretches(&short, 8).is_err());
    }
}

//! A steady record as complex amplitudes, one per stretch.

use super::HysteresisError;
use super::record::{HysteresisRecord, RelativeMotion};
use nalgebra::{Matrix3, Vector3};
use num_complex::Complex;
use std::f64::consts::TAU;

/// Fewest cycles of a stretch: enough to separate a mean, a cosine and a sine.
const FEWEST_CYCLES: f64 = 4.0;

/// Complex amplitudes of one steady level, or of a stretch of it, with a common phase reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tones {
    /// Circular frequency, rad/s.
    pub omega_rad_s: f64,
    /// x_A, m.
    pub a_m: Complex<f64>,
    /// x_B, m.
    pub b_m: Complex<f64>,
    /// T, N.
    pub force_n: Complex<f64>,
}

impl Tones {
    /// Of a steady record of known excitation frequency, over its whole cycles.
    ///
    /// # Errors
    /// The signals do not match, or there is no excitation frequency or whole cycle.
    pub fn of(record: &HysteresisRecord) -> Result<Self, HysteresisError> {
        // returns exactly one stretch, or an error
        of_stretches(record, |_| 1).map(|one| one[0])
    }

    /// Of at most `count` successive stretches of whole cycles. Their scatter includes the noise
    /// and any drift.
    ///
    /// # Errors
    /// As [`Tones::of`]; fewer than four cycles.
    pub fn stretches(record: &HysteresisRecord, count: usize) -> Result<Vec<Self>, HysteresisError> {
        of_stretches(record, |cycles| count.min((cycles / FEWEST_CYCLES).floor() as usize))
    }

    /// Δx, m.
    pub fn relative_m(&self) -> Complex<f64> {
        self.a_m - self.b_m
    }
}

/// Amplitudes of the number of stretches that `count` returns for a record's whole cycles.
fn of_stretches(
    record: &HysteresisRecord,
    count: impl Fn(f64) -> usize,
) -> Result<Vec<Tones>, HysteresisError> {
    record.check()?;
    let frequency_hz = record.excitation_hz.ok_or(HysteresisError::Excitation(0.0))?;
    let period = record.fs_hz / frequency_hz;
    let samples = record.force_n.len();
    let none = || HysteresisError::NoCycle { frequency_hz, samples, points: period as usize };
    let cycles = (samples as f64 / period).floor();
    let count = count(cycles);
    if count == 0 || cycles < 1.0 {
        return Err(none());
    }
    let long = (cycles / count as f64).floor() * period;
    let omega_rad_s = TAU * frequency_hz;
    let (a, b, order) = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => (a_m_per_s, b_m_per_s, 1),
        RelativeMotion::Displacement { a_m, b_m } => (a_m, b_m, 0),
    };
    let integrated = Complex::new(0.0, omega_rad_s).powi(order);
    let of = |n: usize| {
        let (from, to) = ((n as f64 * long).round() as usize, ((n + 1) as f64 * long).round() as usize);
        let tone = |x: &[f64]| amplitude(&x[from..to.min(samples)], from, omega_rad_s / record.fs_hz);
        let (force_n, a_m, b_m) = (tone(&record.force_n)?, tone(a)? / integrated, tone(b)? / integrated);
        Some(Tones { omega_rad_s, a_m, b_m, force_n })
    };
    (0..count).map(of).collect::<Option<_>>().ok_or_else(none)
}

/// Complex amplitude of x = Re(X e^(iφn)) + mean by least squares, with n counted from `first`:
/// exact even if a period is not a whole number of samples.
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
        let found = Tones::stretches(&record, 8).expect("182 cycles");
        assert_eq!(found.len(), 8);
        let i_omega = Complex::new(0.0, TAU * f);
        let expected = [
            Complex::from_polar(25.0, 0.9),
            Complex::from_polar(3e-4, 0.4) / i_omega,
            Complex::from_polar(1e-4, -0.2) / i_omega,
        ];
        for one in found.iter().chain([&Tones::of(&record).expect("182 cycles")]) {
            for (got, expected) in [one.force_n, one.a_m, one.b_m].iter().zip(&expected) {
                assert!((got - expected).norm() < 1e-9 * expected.norm(), "{got} for {expected}");
            }
        }
        let short = HysteresisRecord { force_n: vec![1.0; 100], ..record };
        assert!(Tones::stretches(&short, 8).is_err() && Tones::of(&short).is_err());
    }
}

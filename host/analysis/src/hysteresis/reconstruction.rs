//! Fits a decay with a few decaying sinusoids, to check whether two modes alone explain a
//! specimen's motion.

use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Decay rates tried for each mode, 1/s: 0.4 % to 8 % of damping at 200 Hz.
const DECAYS_PER_S: [f64; 7] = [5.0, 10.0, 18.0, 30.0, 45.0, 65.0, 100.0];

/// A sum of decaying sinusoids fitted to a signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Decaying {
    /// Frequency (Hz), decay rate (1/s) and initial amplitude (the signal's unit) of each.
    pub modes: Vec<[f64; 3]>,
    /// The sum, sample by sample.
    pub signal: Vec<f64>,
    /// The straight line added to it: the residue of integrating a velocity.
    pub trend: Vec<f64>,
    /// Fraction of the signal's variance about that line that the sum explains.
    pub explained: f64,
}

/// The best sum of one sinusoid for each frequency (one or two) and a straight line, over the decay
/// rates tried; `None` for a signal that does not move or has fewer samples than unknowns.
pub fn decaying(signal: &[f64], fs_hz: f64, frequencies_hz: &[f64]) -> Option<Decaying> {
    let rates: Vec<Vec<f64>> = match frequencies_hz.len() {
        1 => DECAYS_PER_S.iter().map(|d| vec![*d]).collect(),
        2 => DECAYS_PER_S.iter().flat_map(|d| DECAYS_PER_S.iter().map(|e| vec![*d, *e])).collect(),
        _ => return None,
    };
    let fits = rates.iter().filter_map(|rates| fitted(signal, fs_hz, frequencies_hz, rates));
    fits.max_by(|a, b| a.explained.total_cmp(&b.explained))
}

fn fitted(signal: &[f64], fs_hz: f64, frequencies_hz: &[f64], rates: &[f64]) -> Option<Decaying> {
    let unknowns = 2 * rates.len() + 2;
    if signal.len() < 2 * unknowns {
        return None;
    }
    let basis = DMatrix::from_fn(signal.len(), unknowns, |i, column| {
        let t = i as f64 / fs_hz;
        let Some((frequency, rate)) = frequencies_hz.get(column / 2).zip(rates.get(column / 2)) else {
            // scaled by the signal's length, so that the columns are of similar size
            return if column % 2 == 0 { 1.0 } else { i as f64 / signal.len() as f64 };
        };
        let angle = TAU * frequency * t;
        (-rate * t).exp() * if column % 2 == 0 { angle.cos() } else { angle.sin() }
    });
    let wanted = DVector::from_column_slice(signal);
    let coefficients = (basis.transpose() * &basis).cholesky()?.solve(&(basis.transpose() * &wanted));
    let line = |i: usize| {
        basis[(i, unknowns - 2)] * coefficients[unknowns - 2]
            + basis[(i, unknowns - 1)] * coefficients[unknowns - 1]
    };
    let trend: Vec<f64> = (0..signal.len()).map(line).collect();
    let sum: Vec<f64> = (&basis * &coefficients).iter().zip(&trend).map(|(all, line)| all - line).collect();
    let variance: f64 = signal.iter().zip(&trend).map(|(v, line)| (v - line).powi(2)).sum();
    let left: f64 = signal.iter().zip(&trend).zip(&sum).map(|((v, line), s)| (v - line - s).powi(2)).sum();
    (variance > 0.0).then(|| Decaying {
        modes: frequencies_hz
            .iter()
            .zip(rates)
            .enumerate()
            .map(|(m, (f, d))| [*f, *d, coefficients[2 * m].hypot(coefficients[2 * m + 1])])
            .collect(),
        signal: sum,
        trend,
        explained: 1.0 - left / variance,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_modes_close_together_are_told_apart_within_a_tenth_of_a_second() {
        let fs = 5_120.0;
        let signal: Vec<f64> = (0..512)
            .map(|i| {
                let t = f64::from(i) / fs;
                let mode = |f: f64, d: f64, a: f64, p: f64| a * (-d * t).exp() * (TAU * f * t + p).cos();
                mode(192.0, 45.0, 3e-8, 1.0) + mode(208.0, 10.0, 1e-7, 0.2) + 5e-9 - 1e-6 * t
            })
            .collect();
        let both = decaying(&signal, fs, &[192.0, 208.0]).expect("a fit");
        assert!(both.explained > 0.999_999, "{both:?}");
        assert!((both.modes[0][2] / 3e-8 - 1.0).abs() < 1e-6 && (both.modes[1][2] / 1e-7 - 1.0).abs() < 1e-6);
        assert!((both.trend[511] - (5e-9 - 1e-6 * 511.0 / fs)).abs() < 1e-12);
        let one = decaying(&signal, fs, &[208.0]).expect("a fit");
        assert!(one.explained < 0.99, "{}", one.explained);
        assert_eq!(decaying(&[0.0; 100], fs, &[208.0]), None);
        assert_eq!(decaying(&signal[..7], fs, &[208.0]), None);
    }
}

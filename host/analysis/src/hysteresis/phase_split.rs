//! Identifies which specimen has a hidden resonance: the phase of each specimen relative to its own
//! arm, from the same impact (the paper's Fig. 8). To check whether two modes alone explain a
//! specimen's motion, its decay is fitted with a few decaying sinusoids.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use std::f64::consts::TAU;

/// The split is searched within this distance of the resonance, Hz: the phase changes fastest near
/// the peak of Δx/T.
const NEAR_HZ: f64 = 8.0;
/// Lines within ± this distance are averaged, Hz.
const AVERAGE_HZ: f64 = 0.75;
/// A smaller phase difference is noise, degrees.
const CLEAR_DEG: f64 = 5.0;

/// An FRF on evenly spaced lines.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Magnitude, \[line\], in one unit for all curves that are compared.
    pub magnitude: &'a [f64],
    /// Phase, degrees, \[line\].
    pub phase_deg: &'a [f64],
}

/// One of the two specimens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Specimen {
    /// On the moving arm.
    A,
    /// On the static arm.
    B,
}

/// Phase differences at one frequency, degrees, −180…180.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseSplit {
    /// The frequency, Hz.
    pub frequency_hz: f64,
    /// Specimen A relative to specimen B.
    pub specimens: f64,
    /// Specimen A relative to arm A.
    pub a: f64,
    /// Specimen B relative to arm B.
    pub b: f64,
    /// Arm A relative to arm B.
    pub arms: f64,
}

impl PhaseSplit {
    /// At the frequency near `resonance_hz` where x_A and x_B are furthest out of phase; `None` if
    /// the curves have no line there.
    pub fn near(
        [x_a, x_b]: [Curve<'_>; 2],
        [arm_a, arm_b]: [Curve<'_>; 2],
        resonance_hz: f64,
    ) -> Option<Self> {
        let lines = (0..x_a.phase_deg.len()).map(|l| x_a.frequency_hz(l));
        lines
            .filter(|f| (f - resonance_hz).abs() <= NEAR_HZ)
            .filter_map(|f| {
                Some(Self {
                    frequency_hz: f,
                    specimens: x_a.turned(&x_b, f)?,
                    a: x_a.turned(&arm_a, f)?,
                    b: x_b.turned(&arm_b, f)?,
                    arms: arm_a.turned(&arm_b, f)?,
                })
            })
            .max_by(|x, y| x.specimens.abs().total_cmp(&y.specimens.abs()))
    }

    /// The specimen that moves in its clamp, if its phase relative to its own arm clearly exceeds
    /// that of the other.
    pub fn moves(&self) -> Option<Specimen> {
        let (a, b) = (self.a.abs(), self.b.abs());
        if a > CLEAR_DEG && a > 2.0 * b {
            Some(Specimen::A)
        } else if b > CLEAR_DEG && b > 2.0 * a {
            Some(Specimen::B)
        } else {
            None
        }
    }
}

impl Curve<'_> {
    fn frequency_hz(&self, line: usize) -> f64 {
        self.first_hz + self.step_hz * line as f64
    }

    /// Sum of the lines around a frequency; `None` outside the lines.
    fn around(&self, frequency_hz: f64) -> Option<Complex<f64>> {
        let lines =
            (0..self.phase_deg.len()).filter(|&l| (self.frequency_hz(l) - frequency_hz).abs() <= AVERAGE_HZ);
        let sum: Complex<f64> =
            lines.map(|l| Complex::from_polar(self.magnitude[l], self.phase_deg[l].to_radians())).sum();
        (sum.norm() > 0.0).then_some(sum)
    }

    /// Phase relative to another curve around a frequency, degrees; `None` outside their lines.
    fn turned(&self, against: &Curve<'_>, frequency_hz: f64) -> Option<f64> {
        let phase = (self.around(frequency_hz)? * against.around(frequency_hz)?.conj()).arg().to_degrees();
        phase.is_finite().then_some(phase)
    }
}

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

    /// All curves move alike except the curve `own`, which has an additional mode at 192 Hz.
    fn curves(own: usize) -> [(Vec<f64>, Vec<f64>); 4] {
        [0, 1, 2, 3].map(|curve| {
            (0..400)
                .map(|l| {
                    let f = 100.0 + 0.5 * f64::from(l);
                    let alike = Complex::from_polar(1e-8, -0.01 * f);
                    let ratio = Complex::new(1.0 - (f / 192.0).powi(2), 0.02 * f / 192.0);
                    let y = if curve == own { alike * (1.0 + 0.02 * ratio.inv()) } else { alike };
                    (y.norm(), y.arg().to_degrees())
                })
                .unzip()
        })
    }

    #[test]
    fn the_specimen_that_leaves_its_arm_is_named() {
        for (own, name) in [(0, Specimen::A), (1, Specimen::B)] {
            let all = curves(own);
            let [x_a, x_b, arm_a, arm_b] = all.each_ref().map(|(magnitude, phase_deg)| Curve {
                first_hz: 100.0,
                step_hz: 0.5,
                magnitude,
                phase_deg,
            });
            let split = PhaseSplit::near([x_a, x_b], [arm_a, arm_b], 192.0).expect("lines there");
            assert_eq!(split.moves(), Some(name), "{split:?}");
            // the mode adds ±45° where it is half as large as at its peak: ratio 1 against 1
            assert!(split.specimens.abs() > 25.0, "{split:?}");
            assert!(split.arms.abs() < 1e-9, "{split:?}");
            assert_eq!(PhaseSplit::near([x_a, x_b], [arm_a, arm_b], 900.0), None);
        }
    }
}

#[cfg(test)]
mod reconstruction_tests {
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

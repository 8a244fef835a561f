//! The static arm B between contact and load cells: from the cells' sum to the force at the
//! contact, and how the arm's properties are identified.
//!
//! The force of the contact on B is balanced by the load cells, by anything parallel to them (a
//! lower push rod), and by B's inertia:
//!
//! F = (1 + ρ) T + m ẍ_B
//!
//! with T the cells' sum, ρ the stiffness parallel to the cells over theirs, and m B's *effective*
//! mass at the contact (see `Correction`). This is not the arm's mass: the arm also rotates about
//! its supports, so that only part of it moves with the contact. On a rig of 1.56 kg over 150 N/µm,
//! T reads 2.4 % too high at 250 Hz and 14 % at 500 Hz.
//!
//! There are two methods to find m and ρ. **Hits on B alone**: the force at the contact is that of
//! the hammer, transformed to the virtual point; both m and ρ come from one least-squares fit over
//! frequency. **Stuck loops at several frequencies**, from a steady record as complex amplitudes,
//! one per stretch: T/Δx = k/(1 + ρ) − m/(1 + ρ) · ẍ_B/Δx must give the same k at all of them; ρ
//! cannot be separated from k this way and must be known. A contact with a hidden resonance has no
//! common k, which shows in the fit's residual.

use super::HysteresisError;
use super::record::{HysteresisRecord, RelativeMotion, within};
use nalgebra::{Matrix3, Vector3};
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;
use std::ops::Range;

/// A fit with a larger relative rms residual of the force is rejected.
pub const WORST_RESIDUAL: f64 = 0.03;

/// The frequencies of the levels must have at least this ratio, highest over lowest.
const SPREAD: f64 = 1.5;

/// Source of the correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CorrectionSource {
    /// Stated by the user or the plan.
    Given,
    /// Fitted to hits on B alone.
    Hits,
    /// Fitted to stuck loops at several frequencies.
    Levels,
}

/// An identified correction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Identified {
    /// m and ρ.
    #[serde(flatten)]
    pub correction: Correction,
    /// Source of the values.
    pub basis: CorrectionSource,
    /// Relative rms residual of the force after the fit; 0 if the values were given.
    pub residual: f64,
}

/// From lines of (T/F, ẍ_B/F) with F known at the contact; `parallel_path` is fitted if it is not
/// given. `None` without lines, or if the fit leaves too large a residual or gives no positive
/// mass.
pub fn from_known_force(
    lines: &[(Complex<f64>, Complex<f64>)],
    parallel_path: Option<f64>,
) -> Option<Identified> {
    let n = lines.len() as f64;
    let real: Vec<(f64, f64)> = lines.iter().map(|(t, a)| (t.re, a.re)).collect();
    let (factor, mass) = match parallel_path {
        Some(path) => {
            let factor = 1.0 + path;
            let (ay, aa) =
                real.iter().fold((0.0, 0.0), |(ay, aa), (t, a)| (ay + a * (1.0 - factor * t), aa + a * a));
            (factor, ay / aa)
        }
        None => least_squares(real.iter().map(|(t, a)| ([*t, *a], 1.0)))?,
    };
    let squares: f64 = real.iter().map(|(t, a)| (factor * t + mass * a - 1.0).powi(2)).sum();
    accepted(factor - 1.0, mass, (squares / n).sqrt(), CorrectionSource::Hits)
}

/// From stuck levels; `None` with too few frequencies, or if no common stiffness explains them.
pub fn from_levels(levels: &[Tones], parallel_path: f64) -> Option<Identified> {
    let (low, high) =
        levels.iter().fold((f64::INFINITY, 0.0f64), |(l, h), t| (l.min(t.omega_rad_s), h.max(t.omega_rad_s)));
    let mut distinct: Vec<f64> = levels.iter().map(|t| t.omega_rad_s).collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-3);
    if distinct.len() < 3 || high < SPREAD * low {
        return None;
    }
    let points: Vec<(f64, f64)> = levels
        .iter()
        .map(|t| {
            let inertia = t.omega_rad_s.powi(2) * t.b_m / t.relative_m();
            (inertia.re, (t.force_n / t.relative_m()).re)
        })
        .collect();
    let (stiffness, slope) = least_squares(points.iter().map(|(x, y)| ([1.0, *x], *y)))?;
    let squares: f64 = points.iter().map(|(x, y)| (stiffness + slope * x - y).powi(2)).sum();
    let residual = (squares / points.len() as f64).sqrt() / stiffness.abs();
    accepted(parallel_path, slope * (1.0 + parallel_path), residual, CorrectionSource::Levels)
}

fn accepted(
    parallel_path: f64,
    effective_mass_kg: f64,
    residual: f64,
    basis: CorrectionSource,
) -> Option<Identified> {
    (effective_mass_kg > 0.0 && residual < WORST_RESIDUAL && parallel_path > -0.1).then_some(Identified {
        correction: Correction { effective_mass_kg, parallel_path },
        basis,
        residual,
    })
}

/// p, q of p x₀ + q x₁ = y; `None` if the two are linearly dependent.
fn least_squares(rows: impl Iterator<Item = ([f64; 2], f64)>) -> Option<(f64, f64)> {
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ([a, b], y) in rows {
        aa += a * a;
        ab += a * b;
        bb += b * b;
        ay += a * y;
        by += b * y;
    }
    let determinant = aa * bb - ab * ab;
    (determinant > 1e-12 * aa * bb)
        .then(|| ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant))
}

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

/// The parameters that correct the raw force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correction {
    /// m, kg.
    pub effective_mass_kg: f64,
    /// ρ, dimensionless.
    pub parallel_path: f64,
}

impl Correction {
    /// The same record with the force at the contact instead of the load cells' sum.
    #[must_use]
    pub fn applied(&self, record: &HysteresisRecord) -> HysteresisRecord {
        let mut force_n = Vec::with_capacity(record.force_n.len());
        self.force(record, 0..record.force_n.len().cast_signed(), &mut force_n);
        HysteresisRecord { force_n, ..record.clone() }
    }

    /// Writes the force at the contact over a range of samples to `to`; beyond the ends of the
    /// record its end values are repeated.
    pub(super) fn force(&self, record: &HysteresisRecord, range: Range<isize>, to: &mut Vec<f64>) {
        let (t, fs_hz) = (&record.force_n, record.fs_hz);
        let corrected = |t: &f64, acceleration: f64| {
            (1.0 + self.parallel_path) * t + self.effective_mass_kg * acceleration
        };
        within(range, t.len(), to, |inside, to| match &record.motion {
            RelativeMotion::Velocity { b_m_per_s: v, .. } => {
                let inner = inside.start.max(1)..inside.end.min(v.len() - 1);
                let ends = |i: usize| corrected(&t[i], rate(v, i, fs_hz));
                to.extend((inside.start..inner.start).map(ends));
                let around = v[inner.start - 1..].iter().zip(&v[inner.start + 1..]);
                to.extend(
                    t[inner.clone()]
                        .iter()
                        .zip(around)
                        .map(|(t, (before, after))| corrected(t, (after - before) * (0.5 * fs_hz))),
                );
                to.extend((inner.end..inside.end).map(ends));
            }
            RelativeMotion::Displacement { b_m: x, .. } => to.extend(inside.map(|i| {
                let (from, until) = around(i, x.len());
                let [before, after] = [from, until].map(|i| rate(x, i, fs_hz));
                corrected(&t[i], (after - before) * fs_hz / (until - from) as f64)
            })),
        });
    }
}

/// The neighbours of sample `i` of `len` (two or more); at an end, the sample itself replaces the
/// missing one.
fn around(i: usize, len: usize) -> (usize, usize) {
    (i.saturating_sub(1), (i + 1).min(len - 1))
}

/// Rate of change of `x` per second at one sample: the central difference, one-sided at the ends.
pub(super) fn rate(x: &[f64], i: usize, fs_hz: f64) -> f64 {
    let (from, to) = around(i, x.len());
    (x[to] - x[from]) * fs_hz / (to - from) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const MASS: f64 = 1.56;
    const CELLS: f64 = 150e6;
    const PATH: f64 = 0.0133;

    fn level(frequency_hz: f64, contact: f64) -> Tones {
        let w = TAU * frequency_hz;
        let stiffness = CELLS * (1.0 + PATH) - MASS * w * w;
        let b = 20.0 / stiffness;
        Tones {
            omega_rad_s: w,
            a_m: Complex::from_polar(b + 20.0 / contact, 0.3),
            b_m: Complex::from_polar(b, 0.3),
            force_n: Complex::from_polar(CELLS * b, 0.3),
        }
    }

    #[test]
    fn a_known_force_gives_mass_and_path() {
        let lines: Vec<_> = (100..600)
            .step_by(5)
            .map(|f| {
                let one = level(f64::from(f), 180e6);
                let w2 = one.omega_rad_s.powi(2);
                let turned = Complex::from_polar(20.0, 0.3);
                (one.force_n / turned, -w2 * one.b_m / turned)
            })
            .collect();
        let found = from_known_force(&lines, None).expect("a fit");
        assert!((found.correction.effective_mass_kg - MASS).abs() < 1e-6, "{found:?}");
        assert!((found.correction.parallel_path - PATH).abs() < 1e-9 && found.residual < 1e-9);
        let given = from_known_force(&lines, Some(PATH)).expect("a fit");
        assert!((given.correction.effective_mass_kg - MASS).abs() < 1e-6, "{given:?}");
        // a force other than the contact's
        let wrong: Vec<_> = lines.iter().map(|(t, a)| (t * 1.2, a * -0.4)).collect();
        assert_eq!(from_known_force(&wrong, Some(PATH)), None);
        assert_eq!(from_known_force(&[], None), None);
    }

    #[test]
    fn stuck_levels_give_the_mass_and_a_hidden_resonance_none() {
        let stuck: Vec<Tones> = [100.0, 200.0, 300.0, 500.0].map(|f| level(f, 180e6)).to_vec();
        let found = from_levels(&stuck, PATH).expect("a fit");
        assert!((found.correction.effective_mass_kg / MASS - 1.0).abs() < 1e-6, "{found:?}");
        let hidden =
            [(100.0, 140e6), (250.0, 190e6), (300.0, 173e6), (500.0, 165e6)].map(|(f, k)| level(f, k));
        assert_eq!(from_levels(&hidden, PATH), None);
        assert_eq!(from_levels(&stuck[..2], PATH), None);
        assert_eq!(from_levels(&[stuck[0], stuck[0], stuck[0]], PATH), None);
    }
}

#[cfg(test)]
mod tones_tests {
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

#[cfg(test)]
mod correction_tests {
    use super::*;
    use std::f64::consts::TAU;

    /// An arm of mass m on load cells of stiffness k and a rod of ρ k: the corrected force equals
    /// that of the contact at every frequency.
    #[test]
    fn the_contacts_force_comes_back() {
        let (mass, k, path, contact) = (1.56, 150e6, 0.0133, 180e6);
        for frequency_hz in [100.0, 250.0, 500.0] {
            let w = TAU * frequency_hz;
            let stiffness = k * (1.0 + path) - mass * w * w;
            let n = (20.0 * 51_200.0 / frequency_hz) as usize;
            let wave = |amplitude: f64| -> Vec<f64> {
                (0..n).map(|i| amplitude * (w * i as f64 / 51_200.0).cos()).collect()
            };
            // 20 N at the contact
            let (x_b, x_a) = (20.0 / stiffness, 20.0 / stiffness + 20.0 / contact);
            let record = HysteresisRecord {
                fs_hz: 51_200.0,
                motion: RelativeMotion::Displacement { a_m: wave(x_a), b_m: wave(x_b) },
                force_n: wave(k * x_b),
                excitation_hz: Some(frequency_hz),
                normal_load_n: None,
            };
            let correction = Correction { effective_mass_kg: mass, parallel_path: path };
            let k_t = |record: &HysteresisRecord| {
                super::super::analyse(record).expect("a loop").k_t_n_per_m.expect("stuck").mean
            };
            let (raw, corrected) = (k_t(&record), k_t(&correction.applied(&record)));
            assert!((corrected / contact - 1.0).abs() < 1e-3, "{frequency_hz}: {corrected}");
            // the error without the correction
            assert!((raw / contact - k / stiffness).abs() < 1e-3, "{frequency_hz}: {raw}");
        }
    }
}

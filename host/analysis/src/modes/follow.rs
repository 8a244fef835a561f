//! One mode in a few lines of one column, such as those of a single hit: whether its frequency is
//! the same from hit to hit.
//!
//! The values of each output are R (1 − e^((λ − s)T))/(s − λ), the transform of a free vibration
//! that is cut off after the time T, with the pole λ common to all; the same of neighbouring modes
//! at fixed poles; and a straight line over s. All residues are free, so that errors of aim
//! and direction, which change residues, do not change the frequency. Each output is weighted by
//! what the fit leaves of it.

use crate::C;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Steps of the iteration, at most.
const STEPS: usize = 30;

/// The iteration has converged if the pole moves by less than this part of itself.
const CONVERGED: f64 = 1e-10;

/// The frequency of one mode in the values of one hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// The pole, 1/s.
    pub pole_per_s: C,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation, Hz, from what the fit leaves of the values. It assumes noise that is
    /// independent from line to line.
    pub frequency_std_hz: f64,
    /// What the fit leaves of the values over the mode's own part of them, both as root of the sum
    /// of squares, in the output with the least of it: noise, or another mode that is not among
    /// the neighbours and then changes the frequency.
    pub left: f64,
}

/// The mode near `start` (1/s) in the `outputs`, each with one value per line `s` of a record that
/// ends `length_s` after the hit (infinite for one that ends at rest); `neighbours` are the poles
/// of other modes in or near these lines. `None` if the lines do not determine it.
pub fn follow(s: &[C], outputs: &[Vec<C>], length_s: f64, start: C, neighbours: &[C]) -> Option<Followed> {
    let unknowns = 3 + neighbours.len();
    // twice as many lines as unknowns, so that what is left of them is an estimate of the noise
    if s.len() < 2 * unknowns || outputs.is_empty() {
        return None;
    }
    let freedom = (s.len() - unknowns) as f64;
    let middle = s[s.len() / 2];
    let scale = (s[s.len() - 1] - s[0]).norm();
    // what is left of the vibration at the end of the record, at the line s
    let left_at_end = |pole: C, s: C| {
        if length_s.is_finite() { ((pole - s) * length_s).exp() } else { C::from(0.0) }
    };
    let peak = |pole: C, s: C| (1.0 - left_at_end(pole, s)) / (s - pole);
    let mut pole = start;
    for _ in 0..STEPS {
        let basis = DMatrix::from_fn(s.len(), unknowns, |l, k| match k {
            0 => scale * peak(pole, s[l]),
            1 => C::from(1.0),
            2 => (s[l] - middle) / scale,
            _ => scale * peak(neighbours[k - 3], s[l]),
        });
        let orthogonal = basis.qr();
        let (q, r) = (orthogonal.q(), orthogonal.r());
        let rest = |v: &DVector<C>| v - &q * q.ad_mul(v);
        let (mut product, mut square, mut least) = (C::from(0.0), 0.0, f64::INFINITY);
        for values in outputs {
            let values = DVector::from_column_slice(values);
            let left = rest(&values);
            let residue = r.solve_upper_triangular(&q.ad_mul(&values))?[0] * scale;
            let slope = s.iter().map(|s| {
                residue * (peak(pole, *s) - length_s_times(left_at_end(pole, *s), length_s)) / (s - pole)
            });
            let slope = rest(&DVector::from_iterator(values.len(), slope));
            let own = s.iter().map(|s| (residue * peak(pole, *s)).norm_sqr()).sum::<f64>();
            least = f64::min(least, (left.norm_squared() / own).sqrt());
            // variance of the real part
            let variance = left.norm_squared() / (2.0 * freedom);
            // exact values are limited by rounding
            let variance = variance.max(1e-30 * values.norm_squared());
            if variance > 0.0 {
                product += slope.dotc(&left) / variance;
                square += slope.norm_squared() / variance;
            }
        }
        let step = product / square;
        if !step.is_finite() {
            return None;
        }
        pole += step;
        // the pole has left the lines: they do not determine it
        if (pole.im - middle.im).abs() > scale {
            return None;
        }
        if step.norm() < CONVERGED * pole.norm() || (step.norm_sqr() * square) < 1e-6 {
            return Some(Followed {
                pole_per_s: pole,
                frequency_hz: pole.norm() / TAU,
                frequency_std_hz: square.sqrt().recip() / TAU,
                left: least,
            });
        }
    }
    None
}

/// Zero at the end of a record without end, where the vibration is zero.
fn length_s_times(left: C, length_s: f64) -> C {
    if left == C::from(0.0) { left } else { left * length_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const LENGTH_S: f64 = 0.3;

    /// Lines of 3 Hz with a window of 8 1/s, two outputs, a mode at `frequency_hz` beside one at
    /// 220 Hz.
    fn hit(frequency_hz: f64, noise: f64, seed: u64) -> (Vec<C>, Vec<Vec<C>>, C, C) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let pole = |f: f64| TAU * f * C::new(-0.01, 0.99995);
        let (own, other) = (pole(frequency_hz), pole(220.0));
        let cut = |s: C, pole: C| (1.0 - ((pole - s) * LENGTH_S).exp()) / (s - pole);
        let s: Vec<C> = (50..84).map(|l| C::new(8.0, TAU * 3.0 * f64::from(l))).collect();
        let outputs = [C::new(1.0, 0.1), C::new(-0.4, 0.3)].map(|residue| {
            let value = |s: &C| {
                residue * cut(*s, own) + 0.5 * cut(*s, other) + s * 1e-6 + noise * C::new(normal(), normal())
            };
            s.iter().map(value).collect()
        });
        (s, outputs.to_vec(), pole(190.5), other)
    }

    #[test]
    fn a_frequency_is_found_with_its_standard_deviation() {
        let (s, outputs, start, other) = hit(191.0, 0.0, 0);
        let found = follow(&s, &outputs, LENGTH_S, start, &[other]).expect("a mode");
        assert!((found.frequency_hz - 191.0).abs() < 1e-6, "{found:?}");
        let mut squares = 0.0;
        for seed in 0..400 {
            let (s, outputs, start, other) = hit(191.0, 1e-3, seed);
            let found = follow(&s, &outputs, LENGTH_S, start, &[other]).expect("a mode");
            squares += ((found.frequency_hz - 191.0) / found.frequency_std_hz).powi(2);
        }
        let rms = f64::sqrt(squares / 400.0);
        assert!((0.9..1.15).contains(&rms), "{rms}");
    }

    #[test]
    fn noise_alone_and_too_few_lines_give_nothing_certain() {
        let (s, outputs, start, other) = hit(191.0, 0.0, 0);
        assert_eq!(follow(&s[..7], &[outputs[0][..7].to_vec()], LENGTH_S, start, &[other]), None);
        let (s, outputs, start, other) = hit(191.0, 10.0, 3);
        let found = follow(&s, &outputs, LENGTH_S, start, &[other]);
        assert!(found.is_none_or(|found| found.frequency_std_hz > 0.5), "{found:?}");
    }
}

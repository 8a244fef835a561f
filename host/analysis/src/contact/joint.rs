//! One k_T from the hits and the shaker's levels together.
//!
//! A level's compliance also depends on the hits: on the force's form, the spots, gains and the
//! rotation of the bodies. The readings are therefore not independent, and are averaged with their
//! full covariance (generalised least squares). What they share is known: each is a sum over the
//! parameters of the hits' fit plus an independent part. No weight is negative: for readings with
//! nearly the same errors, negative weights would trust the covariance more than it deserves.

use super::driven::REACH_HZ;
use super::levels::LevelStiffness;
use super::levels::{Reading, unit};
use super::outcome::{Interval, Variances, stiffness_of};
use super::parameters::{COMPLIANCE, Cause};
use super::{Known, Stiffness};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// k_T of hits and levels together.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// k_T, N/m.
    pub k_t_n_per_m: Interval,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<Cause, f64>,
    /// Number of levels with a positive weight.
    pub levels: usize,
}

/// Averages hits and levels; none if no level narrows the interval of the hits.
pub fn joint(hits: &Stiffness, known: &Known, levels: &[&LevelStiffness]) -> Option<Joint> {
    let readings: Vec<&Reading> = levels.iter().map(|level| &level.reading).collect();
    let values: Vec<f64> =
        std::iter::once(known.p[COMPLIANCE]).chain(readings.iter().map(|r| r.compliance)).collect();
    let rows: Vec<DVector<f64>> =
        std::iter::once(unit(known)).chain(readings.iter().map(|r| r.row.clone())).collect();
    let covariance = &known.certainty.covariance * known.misfit;
    let answered: Vec<DVector<f64>> = rows.iter().map(|row| &covariance * row).collect();
    let whole = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        let own = if i == 0 || j == 0 { 0.0 } else { shared(readings[i - 1], readings[j - 1], i == j) };
        rows[i].dot(&answered[j]) + own
    });
    let weights = weights(&whole)?;
    let compliance: f64 = values.iter().zip(&weights).map(|(value, weight)| value * weight).sum();
    let mut row = DVector::zeros(known.p.len());
    for (of, weight) in rows.iter().zip(&weights) {
        row += of * *weight;
    }
    let mut variances: Variances = known.of_sum(&row);
    let counted: Vec<(&Reading, f64)> = readings.iter().copied().zip(weights[1..].iter().copied()).collect();
    let products = |of: fn(&Reading, &Reading) -> f64| -> f64 {
        counted.iter().flat_map(|(a, v)| counted.iter().map(move |(b, w)| v * w * of(a, b))).sum()
    };
    let scatter: f64 = counted.iter().map(|(reading, weight)| weight * weight * reading.level).sum();
    *variances.entry(Cause::Noise).or_default() += products(turning) + scatter;
    *variances.entry(Cause::Aim).or_default() += products(place);
    let (k_t_n_per_m, budget) = stiffness_of(compliance, variances, known.hammer_gain).ok()?;
    let width = |k: &Interval| k.ci95[0].recip() - k.ci95[1].recip();
    let levels = weights[1..].iter().filter(|weight| **weight > 0.0).count();
    (levels > 0 && width(&k_t_n_per_m) < width(&hits.k_t_n_per_m)).then_some(Joint {
        k_t_n_per_m,
        budget,
        levels,
    })
}

/// Covariance of two levels in addition to that from the parameters.
fn shared(a: &Reading, b: &Reading, same: bool) -> f64 {
    turning(a, b) + place(a, b) + if same { a.level } else { 0.0 }
}

/// The motions per newton are read from lines within a reach of each frequency, so nearby levels
/// share some of these lines.
fn turning(a: &Reading, b: &Reading) -> f64 {
    let overlap = (1.0 - (a.frequency_hz - b.frequency_hz).abs() / (2.0 * REACH_HZ)).max(0.0);
    overlap * (a.turning * b.turning).sqrt()
}

/// The shaker pushes at one place at all frequencies. The sign of the effect is not kept, so full
/// correlation is assumed as the worst case.
fn place(a: &Reading, b: &Reading) -> f64 {
    (a.place * b.place).sqrt()
}

/// Weights of the smallest variance among those that are non-negative and add up to one.
fn weights(covariance: &DMatrix<f64>) -> Option<Vec<f64>> {
    let scale = covariance[(0, 0)];
    let mut kept: Vec<usize> = (0..covariance.nrows()).collect();
    loop {
        let own = DMatrix::from_fn(kept.len(), kept.len(), |i, j| covariance[(kept[i], kept[j])] / scale);
        let solved = own.cholesky()?.solve(&DVector::from_element(kept.len(), 1.0));
        let (least, value) =
            solved.iter().enumerate().map(|(i, v)| (i, *v)).min_by(|a, b| a.1.total_cmp(&b.1))?;
        if value >= 0.0 {
            let mut all = vec![0.0; covariance.nrows()];
            for (place, weight) in kept.iter().zip(solved.iter()) {
                all[*place] = weight / solved.sum();
            }
            return Some(all);
        }
        kept.remove(least);
    }
}

#[cfg(test)]
mod tests {
    use super::weights;
    use nalgebra::DMatrix;

    #[test]
    fn readings_of_shared_errors_count_by_what_is_their_own() {
        // independent: weights proportional to 1/variance
        let independent = weights(&DMatrix::from_diagonal_element(2, 2, 1.0)).expect("positive");
        assert_eq!(independent, [0.5, 0.5]);
        let unequal = weights(&DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 4.0])).expect("positive");
        assert!((unequal[0] - 0.8).abs() < 1e-12);
        // the second has all of the first's error and some more: it adds no information, and must
        // not get a negative weight
        let contained = weights(&DMatrix::from_row_slice(2, 2, &[1.0, 1.2, 1.2, 2.0])).expect("positive");
        assert_eq!(contained, [1.0, 0.0]);
    }
}

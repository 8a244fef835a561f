//! How well virtual points and internals represent the measurement.
//!
//! How rigid the interface is: the part of the measured motion and force that a virtual point
//! retains.
//!
//! u = Y 1 (the responses of a group to the sum of its impacts) is filtered through the virtual
//! point, u_f = R_u T_u u; impacts likewise with y = 1ᵀ Y, y_f = y T_f R_fᵀ. Overall consistency is
//! |u_f| / |u| of a line, specific consistency of a channel the mean over lines of coh(u_f, u).
//! This is pyFBS's definition.
//!
//! Properties of every passive linear structure: driving points absorb energy, and cause and effect
//! can be exchanged.
//!
//! The part of the measurement that a virtual point's modes retain, over a band.

use super::idm::Dof;
use super::method::Method;
use super::product::product;
use super::vpt::Transformation;
use crate::band::Band;
use crate::parallel;
use crate::structure::Structure;
use nalgebra::{Complex, DMatrix, DVector};
use serde::Serialize;

/// Internals used by a form of Eq. (3): n_i and n_c, and whether P and Q cover every interface
/// motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Internals {
    /// The form of Eq. (3).
    pub method: Method,
    /// n_c, number of interface deformation modes.
    pub idms: usize,
    /// n_i, number of internal impacts.
    pub impacts: usize,
    /// n_i, number of internal responses.
    pub responses: usize,
    /// The line at which ranks and condition numbers are computed, Hz.
    pub frequency_hz: f64,
    /// Rank of P to rounding.
    pub rank_p: usize,
    /// Rank of Q to rounding.
    pub rank_q: usize,
    /// Condition number of P, rotations scaled by 40 mm: upper bound of the noise amplification.
    pub condition_p: f64,
    /// Condition number of Q.
    pub condition_q: f64,
}

/// Quality of the virtual points of A alone and B alone for one IDM set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPointQuality {
    /// A or B.
    pub substructure: Structure,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The modes.
    pub modes: Vec<Dof>,
    /// Condition number of R_u, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of R_f, rotations scaled by 40 mm.
    pub condition_impacts: f64,
    /// Names of the channels, in the order of `consistency.specific_sensor`.
    pub channels: Vec<String>,
    /// Names of the impacts, in the order of `consistency.specific_impact`.
    pub impacts: Vec<String>,
    /// Frequency of each line of `consistency.overall_*`, Hz.
    pub frequency_hz: Vec<f64>,
    /// The part of motion and force that the virtual point retains.
    pub consistency: Consistency,
    /// Fraction of lines with a passive driving point, by degree of freedom in the set's order.
    pub passivity: Vec<f64>,
    /// Agreement of Y_ij and Y_ji at the virtual point, 0…1; rotations in metres over 40 mm.
    pub reciprocity: f64,
}

/// Consistency of one group of channels and impacts. All values lie between 0 and 1 (to rounding,
/// unweighted).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Consistency {
    /// |u_f| / |u| per line.
    pub overall_sensor: Vec<f64>,
    /// |y_f| / |y| per line.
    pub overall_impact: Vec<f64>,
    /// Per channel, mean over lines.
    pub specific_sensor: Vec<f64>,
    /// Per impact, mean over lines.
    pub specific_impact: Vec<f64>,
}

/// Consistency of FRFs `lines` (channel × impact each, any of the three quantities) with the
/// transformations of the same channels and impacts.
pub fn consistency(
    lines: &[DMatrix<Complex<f64>>],
    responses: &Transformation,
    impacts: &Transformation,
) -> Consistency {
    let filter_u = &responses.r * &responses.t;
    let filter_f = &impacts.r * impacts.t.transpose();
    let ((overall_sensor, specific_sensor), (overall_impact, specific_impact)) = parallel::join(
        || side(&filter_u, lines.iter().map(DMatrix::column_sum)),
        || side(&filter_f, lines.iter().map(|y| y.row_sum().transpose())),
    );
    Consistency { overall_sensor, overall_impact, specific_sensor, specific_impact }
}

/// coh(x, y) = (x+y)(x+y)* / (2 (xx* + yy*)): 1 when equal, 0 when opposite, ½ when one of them is
/// zero.
pub fn coherence_of(x: Complex<f64>, y: Complex<f64>) -> f64 {
    let power = 2.0 * (x.norm_sqr() + y.norm_sqr());
    if power == 0.0 { 1.0 } else { (x + y).norm_sqr() / power }
}

/// Overall consistency per line, and specific consistency per point, of the motions or forces
/// `measured`.
fn side(
    filter: &DMatrix<f64>,
    measured: impl Iterator<Item = DVector<Complex<f64>>>,
) -> (Vec<f64>, Vec<f64>) {
    let mut overall = Vec::new();
    let mut specific = vec![0.0; filter.nrows()];
    for measured in measured {
        let measured = DMatrix::from_column_slice(measured.len(), 1, measured.as_slice());
        let filtered = product(filter, &measured);
        let size = measured.norm();
        overall.push(if size == 0.0 { 1.0 } else { filtered.norm() / size });
        for (sum, (f, m)) in specific.iter_mut().zip(filtered.iter().zip(measured.iter())) {
            *sum += coherence_of(*f, *m);
        }
    }
    let lines = overall.len() as f64;
    (overall, specific.into_iter().map(|sum| sum / lines).collect())
}

/// Fraction of lines, 0…1, at which the real part of the driving-point mobility s Y_dd is not
/// negative, by degree of freedom.
///
/// On s = σ + iω with σ ≥ 0 this holds at every line of a passive structure; lines at which it
/// fails have a wrong phase, sign or position. `lines` are receptances with the same rows and
/// columns; the result is empty without lines.
pub fn passivity(lines: &[DMatrix<Complex<f64>>], s: &[Complex<f64>]) -> Vec<f64> {
    let n = lines.first().map_or(0, DMatrix::nrows);
    (0..n)
        .map(|d| {
            let passive = lines.iter().zip(s).filter(|(y, s)| (y[(d, d)] * **s).re >= 0.0).count();
            passive as f64 / lines.len() as f64
        })
        .collect()
}

/// Mean over lines of Σ |Y_ij + Y_ji|² / Σ 2(|Y_ij|² + |Y_ji|²) over all pairs i < j, 0…1: 1 for a
/// reciprocal structure.
///
/// The pairs of a line are summed first, so that couplings that are zero by symmetry except for
/// rounding have no weight. Rows and columns should have one unit. NaN without pairs or lines.
pub fn reciprocity(lines: &[DMatrix<Complex<f64>>]) -> f64 {
    let mut values = Vec::new();
    for y in lines {
        let (mut common, mut whole) = (0.0, 0.0);
        for i in 0..y.nrows() {
            for j in i + 1..y.nrows() {
                common += (y[(i, j)] + y[(j, i)]).norm_sqr();
                whole += 2.0 * (y[(i, j)].norm_sqr() + y[(j, i)].norm_sqr());
            }
        }
        if whole > 0.0 {
            values.push(common / whole);
        }
    }
    values.iter().sum::<f64>() / values.len() as f64
}

impl VirtualPointQuality {
    /// Parts of the measured motion and of the measured force that the modes retain, 0…1: means
    /// over the lines of the band, or over all lines if it contains none.
    pub fn held_over(&self, band: Band) -> [f64; 2] {
        let mean = |values: &[f64]| {
            let lines = self.frequency_hz.iter().zip(values);
            let inside: Vec<f64> = lines.filter(|(f, _)| band.contains(**f)).map(|(_, v)| *v).collect();
            let used = if inside.is_empty() { values } else { &inside };
            used.iter().sum::<f64>() / used.len() as f64
        };
        [mean(&self.consistency.overall_sensor), mean(&self.consistency.overall_impact)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(4), ..ProptestConfig::default() })]

        #[test]
        fn coherence_is_symmetric_and_bounded(v in prop::array::uniform4(-1.0..1.0f64)) {
            let (x, y) = (Complex::new(v[0], v[1]), Complex::new(v[2], v[3]));
            let coh = coherence_of(x, y);
            // rounding only
            prop_assert!((-1e-15..=1.0 + 1e-15).contains(&coh));
            prop_assert!((coh - coherence_of(y, x)).abs() < 1e-15);
            prop_assert!((coherence_of(x, x) - 1.0).abs() < 1e-15);
            prop_assert!(coherence_of(x, -x).abs() < 1e-15);
        }
    }
}

#[cfg(test)]
mod plausibility_tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Two masses on damped springs: (s²M + sC + K)⁻¹.
    fn structure() -> (Vec<DMatrix<Complex<f64>>>, Vec<Complex<f64>>) {
        let s: Vec<Complex<f64>> = (1..60).map(|l| Complex::new(2.3, TAU * 5.0 * f64::from(l))).collect();
        let lines = s
            .iter()
            .map(|s| {
                let spring = (s * 1e-4 + 1.0) * 1e6;
                let z = DMatrix::from_row_slice(
                    2,
                    2,
                    &[spring * 2.0 + s * s, -spring, -spring, spring + s * s * 2.0],
                );
                z.try_inverse().expect("damped")
            })
            .collect();
        (lines, s)
    }

    #[test]
    fn a_structure_is_passive_and_reciprocal() {
        let (lines, s) = structure();
        assert_eq!(passivity(&lines, &s), [1.0, 1.0]);
        // rounding of a 2 × 2 inverse
        assert!((reciprocity(&lines) - 1.0).abs() < 1e-12);
        assert!(reciprocity(&[]).is_nan() && passivity(&[], &[]).is_empty());
    }

    #[test]
    fn a_sensor_turned_round_is_neither() {
        let (mut lines, s) = structure();
        for y in &mut lines {
            y.row_mut(1).neg_mut();
        }
        assert_eq!(passivity(&lines, &s), [1.0, 0.0]);
        assert!(reciprocity(&lines) < 1e-12);
    }
}

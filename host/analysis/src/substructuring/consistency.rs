//! How rigid the interface is: the part of the measured motion and force that a virtual point
//! retains.
//!
//! u = Y 1 (the responses of a group to the sum of its impacts) is filtered through the virtual
//! point, u_f = R_u T_u u; impacts likewise with y = 1ᵀ Y, y_f = y T_f R_fᵀ. Overall consistency is
//! |u_f| / |u| of a line, specific consistency of a channel the mean over lines of coh(u_f, u).
//! This is pyFBS's definition.

use super::product::product;
use super::vpt::Transformation;
use crate::parallel;
use nalgebra::{Complex, DMatrix, DVector};
use serde::Serialize;

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

//! The virtual point transformation: measured responses and impacts onto the interface's
//! deformation modes.
//!
//! Each response is a row of R_u, eᵀ \[I, −skew(r)\] for rigid modes (channel × degree of freedom),
//! each impact one of R_f. With weights W: T_u = (R_uᵀ W R_u)⁻¹ R_uᵀ W and T_f = W⁻¹ R_f (R_fᵀ W⁻¹
//! R_f)⁻¹, and Y_vp = T_u Y T_f (the paper's Sec. 2.4; van der Seijs et al.).

use super::geometry::Point;
use super::idm::IdmSet;
use super::product::product;
use nalgebra::{Complex, DMatrix, Vector3};

/// Length by which rotations are compared with translations, m: about the distance of the rig's
/// sensors from the contact. Without a length a condition number mixes metres with radians and
/// means nothing. The length affects only that number and the rounding, not the result.
pub const ROTATION_LENGTH_M: f64 = 0.040;

/// Scaled singular values below this fraction of the largest carry no information: at 40 mm this is
/// a displacement of 40 nm over the sensor's distance, far below any position's accuracy.
const RANK_FLOOR: f64 = 1e-6;

/// The reason why a set of channels or impacts cannot form a virtual point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VptError {
    /// Too few points, or points that cannot distinguish two motions.
    #[error(
        "the {kind} ({names}) determine only {rank} of {needed} motions of the virtual point (scaled singular values {singular_values:.6?}): \
         add points off the line of the others, or use fewer IDMs"
    )]
    RankDeficient {
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Names of the points.
        names: String,
        /// Number of motions determined.
        rank: usize,
        /// Number of motions required.
        needed: usize,
        /// Singular values of R with rotations scaled by [`ROTATION_LENGTH_M`].
        singular_values: Vec<f64>,
    },
    /// Weights must be positive, one per point.
    #[error("{kind}: {given} weights for {points} points, and each must be a positive number")]
    Weights {
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Weights given.
        given: usize,
        /// Points given.
        points: usize,
    },
}

/// One side (responses or impacts) of a virtual point.
#[derive(Debug, Clone, PartialEq)]
pub struct Transformation {
    /// The modes.
    pub idms: IdmSet,
    /// R (point × degree of freedom): m per m, m per rad.
    pub r: DMatrix<f64>,
    /// For responses T_u (degree of freedom × point); for impacts T_f (point × degree of freedom).
    pub t: DMatrix<f64>,
    /// Condition number of R with rotations scaled by [`ROTATION_LENGTH_M`].
    pub condition: f64,
}

/// T_u of these channels about `virtual_point_m`; `weights` are the diagonal of W.
///
/// # Errors
/// [`VptError`] if the channels cannot distinguish the motions.
pub fn responses(
    channels: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    weights: Option<&[f64]>,
) -> Result<Transformation, VptError> {
    let root = root_weights("responses", channels.len(), weights)?;
    let (r, plus, condition) = weighted_inverse("responses", channels, virtual_point_m, idms, &root)?;
    // T_u = (W½ R)⁺ W½
    let t = DMatrix::from_fn(plus.nrows(), plus.ncols(), |d, i| plus[(d, i)] * root[i]);
    Ok(Transformation { idms, r, t, condition })
}

/// T_f of these impacts about `virtual_point_m`; `weights` are the diagonal of W (a large weight
/// means little trust).
///
/// # Errors
/// [`VptError`] if the impacts cannot excite the motions independently.
pub fn impacts(
    points: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    weights: Option<&[f64]>,
) -> Result<Transformation, VptError> {
    let root: Vec<f64> =
        root_weights("impacts", points.len(), weights)?.into_iter().map(|w| 1.0 / w).collect();
    let (r, plus, condition) = weighted_inverse("impacts", points, virtual_point_m, idms, &root)?;
    // T_f = W^-½ ((W^-½ R)⁺)ᵀ
    let t = DMatrix::from_fn(plus.ncols(), plus.nrows(), |i, d| plus[(d, i)] * root[i]);
    Ok(Transformation { idms, r, t, condition })
}

/// T_u Y: outputs reduced to the virtual point.
pub fn reduce_outputs(t_u: &DMatrix<f64>, y: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    product(t_u, y)
}

/// Y T_f: inputs reduced to the virtual point.
pub fn reduce_inputs(y: &DMatrix<Complex<f64>>, t_f: &DMatrix<f64>) -> DMatrix<Complex<f64>> {
    product(y, t_f)
}

fn root_weights(kind: &'static str, points: usize, weights: Option<&[f64]>) -> Result<Vec<f64>, VptError> {
    let Some(weights) = weights else { return Ok(vec![1.0; points]) };
    if weights.len() != points || weights.iter().any(|w| !w.is_finite() || *w <= 0.0) {
        return Err(VptError::Weights { kind, given: weights.len(), points });
    }
    Ok(weights.iter().map(|w| w.sqrt()).collect())
}

/// R, (diag(row_scale) R)⁺ and the scaled condition number.
fn weighted_inverse(
    kind: &'static str,
    points: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    row_scale: &[f64],
) -> Result<(DMatrix<f64>, DMatrix<f64>, f64), VptError> {
    let dofs = idms.dofs();
    let r = DMatrix::from_fn(points.len(), dofs.len(), |i, d| {
        dofs[d].displacement(points[i].position() - virtual_point_m).dot(&points[i].direction())
    });
    let per_length: Vec<f64> = dofs.iter().map(|d| ROTATION_LENGTH_M.powi(-d.power_of_length())).collect();
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, d| row_scale[i] * r[(i, d)] * per_length[d]);
    let needed = dofs.len();
    let svd = scaled.clone().svd(true, true);
    let mut singular_values: Vec<f64> = svd.singular_values.iter().copied().collect();
    singular_values.sort_by(|a, b| b.total_cmp(a));
    let largest = singular_values.first().copied().unwrap_or(0.0);
    let rank = singular_values.iter().filter(|&&v| v > largest * RANK_FLOOR && v > 0.0).count();
    let deficient = |singular_values: Vec<f64>| VptError::RankDeficient {
        kind,
        names: points.iter().map(|p| p.description.as_str()).collect::<Vec<_>>().join(", "),
        rank,
        needed,
        singular_values,
    };
    if rank < needed {
        return Err(deficient(singular_values));
    }
    let condition = largest / singular_values[needed - 1];
    let Ok(mut plus) = svd.pseudo_inverse(0.0) else { return Err(deficient(singular_values)) };
    for (d, scale) in per_length.iter().enumerate() {
        plus.row_mut(d).scale_mut(*scale);
    }
    Ok((r, plus, condition))
}

#[cfg(test)]
mod tests {
    use super::super::geometry::Grouping;
    use super::*;
    use proptest::prelude::*;

    fn point(position_m: [f64; 3], direction: [f64; 3]) -> Point {
        Point {
            name: "p".into(),
            description: "p".into(),
            grouping: Grouping::InterfaceA,
            position_m,
            direction,
        }
    }

    fn triaxial(positions: &[[f64; 3]]) -> Vec<Point> {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        positions.iter().flat_map(|&p| axes.map(|e| point(p, e))).collect()
    }

    #[test]
    fn two_triaxial_points_cannot_give_six_motions() {
        let two = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03]]);
        let error =
            responses(&two, Vector3::zeros(), IdmSet::Six, None).expect_err("rotation about the line");
        assert!(matches!(error, VptError::RankDeficient { rank: 5, needed: 6, .. }), "{error}");
        let three = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, 0.03]]);
        let t = responses(&three, Vector3::zeros(), IdmSet::Six, None).expect("three points do");
        assert!(t.condition > 1.0 && t.condition < 50.0, "condition {}", t.condition);
    }

    #[test]
    fn weights_must_fit() {
        let three = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, 0.03]]);
        assert!(responses(&three, Vector3::zeros(), IdmSet::Two, Some(&[1.0])).is_err());
        assert!(impacts(&three, Vector3::zeros(), IdmSet::Two, Some(&[0.0; 9])).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        /// T_u R_u = I and R_fᵀ T_f = I for any weights: a rigid motion is reproduced.
        #[test]
        fn transformations_are_left_inverses(
            v in prop::collection::vec(-0.05..0.05f64, 12),
            w in prop::collection::vec(0.1..10.0f64, 12),
        ) {
            let positions: Vec<[f64; 3]> = v.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
            let points = triaxial(&positions);
            let identity = DMatrix::<f64>::identity(6, 6);
            if let Ok(u) = responses(&points, Vector3::zeros(), IdmSet::Six, Some(&w)) {
                // rounding grows with the condition number
                prop_assert!((&u.t * &u.r - &identity).norm() < 1e-11 * u.condition);
            }
            if let Ok(f) = impacts(&points, Vector3::zeros(), IdmSet::Six, Some(&w)) {
                prop_assert!((f.r.transpose() * &f.t - &identity).norm() < 1e-11 * f.condition);
            }
        }
    }
}

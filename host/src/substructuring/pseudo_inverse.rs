//! Inverses and full-rank pseudo-inverses that never truncate.
//!
//! A pseudo-inverse with a tolerance silently drops the small singular values, and in decoupling those are
//! the joint: 1e-6 of the largest, where a truncated inverse turned 180 N/µm into 106 ± 221. So here a matrix
//! either has full rank to rounding, and is inverted whole, or it is refused.

use nalgebra::{ColPivQR, Complex, DMatrix, Dyn};

/// A pivot below this fraction of the largest is rounding: a dozen operations on doubles leave some 1e-15,
/// while the weakest true direction seen in exact data is about 1e-8.
const ROUNDING: f64 = 1e-13;

/// A matrix that ought to have full rank has not.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} ({rows} × {columns}) has rank {rank}, {needed} is needed: {advice}")]
pub struct RankLost {
    /// Which matrix.
    pub name: &'static str,
    /// Its rows.
    pub rows: usize,
    /// Its columns.
    pub columns: usize,
    /// The rank found.
    pub rank: usize,
    /// The rank that the method needs.
    pub needed: usize,
    /// What to do.
    pub advice: &'static str,
}

/// Rank to rounding, from the pivots of a column-pivoted QR decomposition.
pub fn rank(a: &DMatrix<Complex<f64>>) -> usize {
    pivots_above_rounding(&a.clone().col_piv_qr())
}

/// Largest over smallest singular value; infinite for a singular matrix.
pub fn condition(a: &DMatrix<Complex<f64>>) -> f64 {
    let values = a.clone().svd(false, false).singular_values;
    values.max() / values.min()
}

/// The (pseudo-)inverse of a matrix of full rank: A⁻¹, (AᴴA)⁻¹Aᴴ when tall, Aᴴ(AAᴴ)⁻¹ when wide.
///
/// # Errors
/// [`RankLost`] naming the matrix.
pub fn full_rank_inverse(
    a: &DMatrix<Complex<f64>>,
    name: &'static str,
) -> Result<DMatrix<Complex<f64>>, RankLost> {
    if a.nrows() < a.ncols() {
        let inverse = tall_inverse(&a.adjoint(), name).map_err(|lost| RankLost {
            rows: lost.columns,
            columns: lost.rows,
            ..lost
        })?;
        return Ok(inverse.adjoint());
    }
    tall_inverse(a, name)
}

fn tall_inverse(a: &DMatrix<Complex<f64>>, name: &'static str) -> Result<DMatrix<Complex<f64>>, RankLost> {
    let needed = a.ncols();
    let lost = |rank| RankLost {
        name,
        rows: a.nrows(),
        columns: a.ncols(),
        rank,
        needed,
        advice: "measure more points, in more directions, or use fewer IDMs",
    };
    let qr = a.clone().col_piv_qr();
    let rank = pivots_above_rounding(&qr);
    if rank < needed {
        return Err(lost(rank));
    }
    // A Π = Q R, so A⁺ = Π R⁻¹ Qᴴ.
    let mut inverse = qr.r().solve_upper_triangular(&qr.q().adjoint()).ok_or_else(|| lost(rank))?;
    qr.p().inv_permute_rows(&mut inverse);
    Ok(inverse)
}

fn pivots_above_rounding(qr: &ColPivQR<Complex<f64>, Dyn, Dyn>) -> usize {
    let r = qr.r();
    let pivots: Vec<f64> = (0..r.nrows().min(r.ncols())).map(|i| r[(i, i)].norm()).collect();
    let largest = pivots.iter().copied().fold(0.0, f64::max);
    // NaN compares false, so a matrix with a NaN has no rank and is refused.
    pivots.iter().filter(|&&p| p > largest * ROUNDING && p > 0.0).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix(rows: usize, columns: usize, v: &[f64]) -> DMatrix<Complex<f64>> {
        DMatrix::from_fn(rows, columns, |r, c| {
            let i = (r * columns + c) * 2;
            Complex::new(v[i], v[i + 1])
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default() })]

        /// The two Penrose identities that do not follow from the construction: A⁺A = I (tall), AA⁺A = A.
        #[test]
        fn inverse_of_a_tall_or_wide_matrix(v in prop::collection::vec(-1.0..1.0f64, 2 * 7 * 4)) {
            let a = matrix(7, 4, &v);
            let plus = full_rank_inverse(&a, "A").expect("random matrices have full rank");
            // condition numbers of such matrices stay below 1e3
            prop_assert!((&plus * &a - DMatrix::identity(4, 4)).norm() < 1e-11);
            let wide = a.adjoint();
            let plus = full_rank_inverse(&wide, "A").expect("random matrices have full rank");
            prop_assert!((&wide * &plus - DMatrix::identity(4, 4)).norm() < 1e-11);
        }
    }

    #[test]
    fn small_directions_are_kept_and_lost_ones_refused() {
        let mut a = DMatrix::<Complex<f64>>::identity(3, 3);
        a[(2, 2)] = Complex::new(1e-9, 0.0);
        let inverse = full_rank_inverse(&a, "A").expect("rank three");
        assert!((inverse[(2, 2)].re * 1e-9 - 1.0).abs() < 1e-12);
        a[(2, 2)] = Complex::new(0.0, 0.0);
        let lost = full_rank_inverse(&a, "A").expect_err("rank two");
        assert_eq!((lost.rank, lost.needed), (2, 3));
        a[(0, 0)] = Complex::new(f64::NAN, 0.0);
        assert!(full_rank_inverse(&a, "A").is_err());
    }
}

//! Inverses and full-rank pseudo-inverses that never truncate.
//!
//! A pseudo-inverse with a tolerance silently drops the small singular values, and in decoupling
//! those are the joint: 1e-6 of the largest, where a truncated inverse turned 180 N/µm into 106
//! ± 221. Therefore a matrix either has full rank to rounding and is inverted completely, or it is
//! refused.
//!
//! Thousands of lines are inverted several times each. If the pivots leave no doubt about the rank,
//! elimination and Gram–Schmidt take a third of the time; otherwise QR with column pivoting is
//! used, whose pivots determine the rank.

use crate::Line;
use crate::vectors::wide;
use nalgebra::{ColPivQR, Complex, Dyn};
use pulp::NullaryFnOnce;
use std::cmp::Ordering;

/// A pivot below this fraction of the largest is rounding: a dozen operations on doubles leave
/// about 1e-15, while the weakest true direction in exact data is about 1e-8.
const ROUNDING: f64 = 1e-13;
/// With all pivots above this fraction of the largest the rank is beyond doubt, and the fast
/// methods are accurate enough.
pub(super) const CLEAR: f64 = 1e-8;

/// A matrix that should have full rank does not.
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
pub fn rank(a: &Line) -> usize {
    pivots_above_rounding(&a.clone().col_piv_qr())
}

/// Largest over smallest singular value; infinite for a singular matrix.
pub fn condition(a: &Line) -> f64 {
    let values = a.clone().svd(false, false).singular_values;
    values.max() / values.min()
}

/// The (pseudo-)inverse of a matrix of full rank: A⁻¹, (AᴴA)⁻¹Aᴴ if tall, Aᴴ(AAᴴ)⁻¹ if wide.
///
/// # Errors
/// [`RankLost`] naming the matrix.
pub fn full_rank_inverse(a: &Line, name: &'static str) -> Result<Line, RankLost> {
    match a.nrows().cmp(&a.ncols()) {
        Ordering::Equal => elimination(a).map_or_else(|| careful_inverse(a, name), Ok),
        Ordering::Greater => orthogonalisation(a).map_or_else(|| careful_inverse(a, name), Ok),
        Ordering::Less => {
            let inverse = full_rank_inverse(&a.adjoint(), name).map_err(|lost| RankLost {
                rows: lost.columns,
                columns: lost.rows,
                ..lost
            })?;
            Ok(inverse.adjoint())
        }
    }
}

/// A⁻¹ by Gauss–Jordan elimination with row pivoting; none if a pivot is not clearly above
/// rounding.
fn elimination(a: &Line) -> Option<Line> {
    // sizes known at compile time let the loops be unrolled: one virtual point's motions, and both
    // of an assembly
    match a.nrows() {
        6 => wide(Elimination::<6> { a, scratch: &mut [Complex::default(); 12] }),
        12 => wide(Elimination::<12> { a, scratch: &mut [Complex::default(); 24] }),
        n => wide(Elimination::<ANY> { a, scratch: &mut vec![Complex::default(); 2 * n] }),
    }
}

/// Elimination of a matrix with N rows, or with any number of rows for [`ANY`].
struct Elimination<'a, const N: usize> {
    a: &'a Line,
    /// Two columns.
    scratch: &'a mut [Complex<f64>],
}

const ANY: usize = 0;

impl<const N: usize> NullaryFnOnce for Elimination<'_, N> {
    type Output = Option<Line>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) -> Option<Line> {
        let n = if N == ANY { self.a.nrows() } else { N };
        let mut inverse = self.a.clone();
        let mut swaps = Vec::with_capacity(n);
        let (x, turned) = self.scratch.split_at_mut(n);
        let mut largest = 0.0f64;
        for k in 0..n {
            let column = &mut inverse.as_mut_slice()[k * n..(k + 1) * n];
            let (mut row, mut pivot) = (k, 0.0);
            for (r, v) in column.iter().enumerate().skip(k) {
                if v.norm_sqr() > pivot {
                    (row, pivot) = (r, v.norm_sqr());
                }
            }
            largest = largest.max(pivot);
            if !clear(pivot, largest) {
                return None;
            }
            swaps.push(row);
            // column k is overwritten by that of the inverse, which starts as the unit vector; −1
            // lets the update below scale row k too
            x.copy_from_slice(column);
            x.swap(k, row);
            let minus_inverse = -x[k].inv();
            x[k] = Complex::from(-1.0);
            column.fill(Complex::default());
            column[row] = Complex::from(1.0);
            // f x = x Re f + ix Im f: real factors only
            for (turned, x) in turned.iter_mut().zip(x.iter()) {
                *turned = Complex::new(-x.im, x.re);
            }
            for column in inverse.as_mut_slice().chunks_exact_mut(n) {
                column.swap(k, row);
                let f = std::mem::take(&mut column[k]) * minus_inverse;
                for ((v, x), turned) in column.iter_mut().zip(x.iter()).zip(turned.iter()) {
                    *v += x * f.re + turned * f.im;
                }
            }
        }
        for (k, row) in swaps.into_iter().enumerate().rev() {
            inverse.swap_columns(k, row);
        }
        Some(inverse)
    }
}

/// A⁺ = R⁻¹Qᴴ of a tall matrix by Gram–Schmidt, repeated if much cancels, so that Q is orthogonal
/// to rounding; none if a diagonal entry of R is not clearly above rounding.
fn orthogonalisation(a: &Line) -> Option<Line> {
    wide(Orthogonalisation { a })
}

struct Orthogonalisation<'a> {
    a: &'a Line,
}

impl NullaryFnOnce for Orthogonalisation<'_> {
    type Output = Option<Line>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) -> Option<Line> {
        let a = self.a;
        let (m, n) = a.shape();
        let mut q = a.clone();
        let mut r = Line::zeros(n, n);
        let mut largest = 0.0f64;
        for k in 0..n {
            let (done, rest) = q.as_mut_slice().split_at_mut(k * m);
            let (v, r) = (&mut rest[..m], &mut r.as_mut_slice()[k * n..=k * n + k]);
            let mut square = square_of(v);
            for _ in 0..2 {
                for (q, r) in done.chunks_exact(m).zip(r.iter_mut()) {
                    let along =
                        q.iter().zip(v.iter()).fold(Complex::default(), |sum, (q, v)| sum + q.conj() * v);
                    *r += along;
                    for (v, q) in v.iter_mut().zip(q) {
                        *v -= q * along;
                    }
                }
                let before = std::mem::replace(&mut square, square_of(v));
                // if little was subtracted, the component along the other columns that rounding
                // leaves is small
                if square > 0.1 * before {
                    break;
                }
            }
            largest = largest.max(square);
            if !clear(square, largest) {
                return None;
            }
            // the diagonal holds 1/Rₖₖ: multiplications instead of divisions
            let inverse = 1.0 / square.sqrt();
            r[k] = Complex::from(inverse);
            for v in v {
                *v *= inverse;
            }
        }
        let mut inverse = q.adjoint();
        for x in inverse.as_mut_slice().chunks_exact_mut(n.max(1)) {
            for (k, r) in r.as_slice().chunks_exact(n).enumerate().rev() {
                let solved = x[k] * r[k].re;
                x[k] = solved;
                for (x, r) in x[..k].iter_mut().zip(r) {
                    *x -= r * solved;
                }
            }
        }
        Some(inverse)
    }
}

fn square_of(v: &[Complex<f64>]) -> f64 {
    v.iter().map(Complex::norm_sqr).sum()
}

/// Whether a pivot leaves no doubt about the rank; both are squared. NaN compares false.
fn clear(pivot: f64, largest: f64) -> bool {
    pivot > largest * (CLEAR * CLEAR) && largest < f64::INFINITY
}

/// The inverse of a square or tall matrix by a QR decomposition with column pivoting, which
/// determines the rank.
fn careful_inverse(a: &Line, name: &'static str) -> Result<Line, RankLost> {
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

    fn matrix(rows: usize, columns: usize, v: &[f64]) -> Line {
        Line::from_fn(rows, columns, |r, c| {
            let i = (r * columns + c) * 2;
            Complex::new(v[i], v[i + 1])
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default() })]

        /// The two Penrose identities that do not follow from the construction: A⁺A = I (tall),
        /// AA⁺A = A.
        #[test]
        fn inverse_of_a_tall_or_wide_matrix(v in prop::collection::vec(-1.0..1.0f64, 2 * 7 * 4)) {
            let a = matrix(7, 4, &v);
            let plus = full_rank_inverse(&a, "A").expect("random matrices have full rank");
            // condition numbers of such matrices stay below 1e3
            prop_assert!((&plus * &a - Line::identity(4, 4)).norm() < 1e-11);
            let wide = a.adjoint();
            let plus = full_rank_inverse(&wide, "A").expect("random matrices have full rank");
            prop_assert!((&wide * &plus - Line::identity(4, 4)).norm() < 1e-11);
        }
    }

    /// Both sides of the limit between the fast methods and pivoted QR.
    #[test]
    fn weak_directions_are_inverted_whole_however_weak() {
        let v: Vec<f64> = (0..72).map(|i| (1.0 + 0.7 * f64::from(i * i)).sin()).collect();
        let turn = |m: Line| m.qr().q();
        let (left, right) = (turn(matrix(6, 4, &v)), turn(matrix(4, 4, &v)));
        for weak in [1e-2, 1e-6, 1e-7, 1e-8, 1e-9, 1e-11] {
            let sizes = nalgebra::DVector::from_vec([1.0, 0.3, 2.0, weak].map(Complex::from).to_vec());
            for tall in [&left * Line::from_diagonal(&sizes), &right * Line::from_diagonal(&sizes)] {
                let a = tall * right.adjoint();
                let left_over = full_rank_inverse(&a, "A").expect("full rank") * &a - Line::identity(4, 4);
                // rounding times the condition number
                assert!(left_over.norm() < 1e-14 / weak, "{weak}: {}", left_over.norm());
            }
        }
    }

    #[test]
    fn a_value_that_is_no_number_is_refused_wherever_it_stands() {
        for (rows, columns) in [(3, 3), (5, 3), (3, 5), (1, 1)] {
            for at in 0..rows * columns {
                for bad in [f64::NAN, f64::INFINITY] {
                    let mut a = Line::from_fn(rows, columns, |r, c| {
                        Complex::new(if r == c { 2.0 } else { 0.0 }, 0.1 * (r + 2 * c) as f64)
                    });
                    a[at].im = bad;
                    assert!(full_rank_inverse(&a, "A").is_err(), "{bad} at {at} of {rows} × {columns}");
                }
            }
        }
    }

    #[test]
    fn small_directions_are_kept_and_lost_ones_refused() {
        let mut a = Line::identity(3, 3);
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

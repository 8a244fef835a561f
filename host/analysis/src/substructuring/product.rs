//! Products of the small complex matrices of one line, about twice as fast as the general ones,
//! which are optimised for large matrices and scale every term once more.

use crate::vectors::wide;
use nalgebra::{Complex, DMatrix, Scalar};
use pulp::NullaryFnOnce;
use std::ops::Mul;

/// A B, where either may be real.
pub(crate) fn product<A, B>(a: &DMatrix<A>, b: &DMatrix<B>) -> DMatrix<Complex<f64>>
where
    A: Scalar + Copy + Mul<B, Output = Complex<f64>>,
    B: Scalar + Copy,
{
    assert_eq!(a.ncols(), b.nrows(), "A has as many columns as B has rows");
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    let (columns, factors) = (a.as_slice(), b.as_slice());
    wide(ProductSums { out: out.as_mut_slice(), rows: a.nrows(), columns, factors, inner: b.nrows() });
    out
}

/// T times the given rows and columns of Y.
pub(crate) fn product_of_block(
    t: &DMatrix<f64>,
    y: &DMatrix<Complex<f64>>,
    rows: &[usize],
    columns: &[usize],
) -> DMatrix<Complex<f64>> {
    assert_eq!(t.ncols(), rows.len(), "T has a column for each row named");
    let mut out = DMatrix::zeros(t.nrows(), columns.len());
    let mut factors = Vec::with_capacity(rows.len() * columns.len());
    for column in columns.iter().map(|&c| &y.as_slice()[c * y.nrows()..][..y.nrows()]) {
        factors.extend(rows.iter().map(|&r| column[r]));
    }
    wide(ProductSums {
        out: out.as_mut_slice(),
        rows: t.nrows(),
        columns: t.as_slice(),
        factors: &factors,
        inner: rows.len(),
    });
    out
}

/// out + A B, all column-major.
struct ProductSums<'a, A, B> {
    out: &'a mut [Complex<f64>],
    rows: usize,
    columns: &'a [A],
    factors: &'a [B],
    inner: usize,
}

impl<A, B> NullaryFnOnce for ProductSums<'_, A, B>
where
    A: Copy + Mul<B, Output = Complex<f64>>,
    B: Copy,
{
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        match self.rows {
            6 => self.of(6),
            n => self.of(n.max(1)),
        }
    }
}

impl<A, B> ProductSums<'_, A, B>
where
    A: Copy + Mul<B, Output = Complex<f64>>,
    B: Copy,
{
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn of(self, rows: usize) {
        let factors = self.factors.chunks_exact(self.inner.max(1));
        for (sum, factors) in self.out.chunks_exact_mut(rows).zip(factors) {
            add_columns_of(rows, sum, self.columns, factors);
        }
    }
}

/// Adds three columns at a time, which saves two of three loads and stores of the sum.
#[expect(clippy::inline_always, reason = "must be inlined for the size to be a constant")]
#[inline(always)]
fn add_columns_of<A, B>(rows: usize, sum: &mut [Complex<f64>], columns: &[A], factors: &[B])
where
    A: Copy + Mul<B, Output = Complex<f64>>,
    B: Copy,
{
    let (mut columns, mut factors) = (columns.chunks_exact(3 * rows), factors.chunks_exact(3));
    for (columns, f) in columns.by_ref().zip(factors.by_ref()) {
        let (x, rest) = columns.split_at(rows);
        let (y, z) = rest.split_at(rows);
        for (((sum, x), y), z) in sum.iter_mut().zip(x).zip(y).zip(z) {
            *sum += *x * f[0] + *y * f[1] + *z * f[2];
        }
    }
    for (column, f) in columns.remainder().chunks_exact(rows).zip(factors.remainder()) {
        for (sum, x) in sum.iter_mut().zip(column) {
            *sum += *x * *f;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_and_complex_factors_give_the_matrix_product() {
        // every remainder of three, and empty matrices
        for (rows, inner, columns) in [(1, 1, 1), (2, 3, 4), (5, 4, 2), (3, 5, 6), (2, 0, 3), (0, 2, 2)] {
            let y = DMatrix::from_fn(rows, inner, |r, c| Complex::new(r as f64 - 1.0, c as f64 + 0.5));
            let x = DMatrix::from_fn(inner, columns, |r, c| Complex::new(c as f64 - 0.3, r as f64 - 2.0));
            let (t, u) = (y.map(|y| y.im), x.map(|x| x.re));
            // rounding only
            assert!((product(&y, &x) - &y * &x).norm() < 1e-13);
            assert!((product(&t, &x) - t.map(Complex::from) * &x).norm() < 1e-13);
            assert!((product(&y, &u) - &y * u.map(Complex::from)).norm() < 1e-13);
        }
    }
}

//! Large symmetric matrices with a few columns: the Cholesky factor, and the products that every
//! step of the search needs.
//!
//! The factor is computed block by block, so that nearly all of the work is matrix products: column
//! by column, as for small matrices, a thousand columns take most of a second; in blocks, a small
//! part of it.
//!
//! Products optimised for large matrices first copy both into a suitable order. With a dozen
//! columns the copy of the large matrix takes as long as the product; here it is read once in its
//! own order. Sums run in vectors of the processor's width, so the results differ from scalar sums
//! by rounding.

use crate::vectors::wide;
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

/// Columns of a block: few enough for the processor's cache, enough that a matrix product is worth
/// its overhead.
const BLOCK: usize = 64;

/// Copies these rows to a separate matrix, column by column: copying a view proceeds value by
/// value.
pub(super) fn rows(x: &DMatrix<f64>, first: usize, count: usize) -> DMatrix<f64> {
    let mut values = Vec::with_capacity(count * x.ncols());
    for column in x.as_slice().chunks_exact(x.nrows().max(1)) {
        values.extend_from_slice(&column[first..first + count]);
    }
    DMatrix::from_vec(count, x.ncols(), values)
}

/// L of A = L Lᵀ.
pub(super) struct Factor {
    /// L, in blocks of columns.
    blocks: Vec<ColumnBlock>,
}

/// Some columns of L. Stored as separate matrices: views of few rows are slow to multiply, and
/// their products read past their end.
struct ColumnBlock {
    /// Inverse of the diagonal block, and its transpose.
    inverse: DMatrix<f64>,
    inverse_turned: DMatrix<f64>,
    /// The part below it, and its transpose.
    below: DMatrix<f64>,
    below_turned: DMatrix<f64>,
}

impl Factor {
    /// Factorises a symmetric matrix, of which only the lower triangle is read; none if it is not
    /// positive definite.
    pub(super) fn of(mut a: DMatrix<f64>) -> Option<Factor> {
        let n = a.nrows();
        let mut blocks = Vec::with_capacity(n.div_ceil(BLOCK));
        for first in (0..n).step_by(BLOCK) {
            let size = BLOCK.min(n - first);
            let below = first + size;
            let l = a.view((first, first), (size, size)).clone_owned().cholesky()?.l();
            let inverse = l.solve_lower_triangular(&DMatrix::identity(size, size))?;
            let inverse_turned = inverse.transpose();
            let panel = a.view((below, first), (n - below, size)).clone_owned() * &inverse_turned;
            let turned = panel.transpose();
            for column in (below..n).step_by(BLOCK) {
                let width = BLOCK.min(n - column);
                let own = rows(&panel, column - below, n - column);
                let other = turned.columns(column - below, width);
                let taken = own * other;
                let mut rest = a.view_mut((column, column), (n - column, width));
                rest -= taken;
            }
            blocks.push(ColumnBlock { inverse, inverse_turned, below: panel, below_turned: turned });
        }
        Some(Factor { blocks })
    }

    /// Replaces X by L⁻¹X.
    pub(super) fn forward(&self, x: &mut DMatrix<f64>) {
        let mut first = 0;
        for block in &self.blocks {
            let size = block.inverse.nrows();
            let own = rows(x, first, size);
            if x.ncols() <= NARROW {
                x.rows_mut(first, size).fill(0.0);
                add_product(x, first, 1.0, &block.inverse, &own);
                let solved = rows(x, first, size);
                first += size;
                add_product(x, first, -1.0, &block.below, &solved);
            } else {
                let solved = &block.inverse * own;
                x.rows_mut(first, size).copy_from(&solved);
                first += size;
                let mut rest = x.rows_mut(first, block.below.nrows());
                rest -= &block.below * solved;
            }
        }
    }

    /// Replaces X by L⁻ᵀX.
    pub(super) fn backward(&self, x: &mut DMatrix<f64>) {
        let mut below = x.nrows();
        for block in self.blocks.iter().rev() {
            let size = block.inverse.nrows();
            let first = below - size;
            let (own, solved_before) = (rows(x, first, size), rows(x, below, block.below.nrows()));
            let solved = if x.ncols() <= NARROW {
                crossed(&block.inverse, &(own - crossed(&block.below, &solved_before)))
            } else {
                &block.inverse_turned * (own - &block.below_turned * solved_before)
            };
            x.rows_mut(first, size).copy_from(&solved);
            below = first;
        }
    }
}

/// Number of columns up to which these products are faster.
pub(super) const NARROW: usize = 48;

/// AᵀB.
pub(super) fn crossed(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    assert_eq!(a.nrows(), b.nrows(), "A and B are of one height");
    let mut out = DMatrix::zeros(a.ncols(), b.ncols());
    if a.nrows() > 0 && !out.is_empty() {
        let height = a.nrows();
        let (a, b) = (a.as_slice(), b.as_slice());
        wide(Crossed { a, b, height, out: out.as_mut_slice() });
    }
    out
}

/// Adds `factor` A X to the rows of `to` from `first` on.
pub(super) fn add_product(
    to: &mut DMatrix<f64>,
    first: usize,
    factor: f64,
    a: &DMatrix<f64>,
    x: &DMatrix<f64>,
) {
    assert_eq!((a.ncols(), to.ncols()), (x.nrows(), x.ncols()), "A, X and what they are added to fit");
    assert!(first + a.nrows() <= to.nrows(), "there are rows for all of A's");
    if a.is_empty() || x.is_empty() {
        return;
    }
    let (rows, inner, stride) = (a.nrows(), a.ncols(), to.nrows());
    let (a, x) = (a.as_slice(), x.as_slice());
    wide(Added { to: to.as_mut_slice(), stride, first, factor, a, rows, x, inner });
}

/// Columns of `a` and `b` of the same height, and AᵀB column-major.
struct Crossed<'a> {
    a: &'a [f64],
    b: &'a [f64],
    height: usize,
    out: &'a mut [f64],
}

impl WithSimd for Crossed<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // as many sums as the registers hold together with their operands
        if S::REGISTER_COUNT >= 32 { self.by::<S, 6, 4>(simd) } else { self.by::<S, 4, 2>(simd) }
    }
}

impl Crossed<'_> {
    /// I columns of A with J of B at a time.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn by<S: Simd, const I: usize, const J: usize>(self, simd: S) {
        let Crossed { a, b, height, out } = self;
        let count = a.len() / height;
        let mut put = |i: usize, j: usize, sum: f64| out[j * count + i] = sum;
        let several = a.chunks_exact(I * height);
        let single = several.remainder().chunks_exact(height);
        let first_single = count - single.len();
        for (at, a) in several.enumerate() {
            crossed_with::<S, I, J>(simd, I * at, a, b, height, &mut put);
        }
        for (i, a) in single.enumerate() {
            crossed_with::<S, 1, J>(simd, first_single + i, a, b, height, &mut put);
        }
    }
}

/// I columns with all of `b`.
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn crossed_with<S: Simd, const I: usize, const J: usize>(
    simd: S,
    first: usize,
    a: &[f64],
    b: &[f64],
    height: usize,
    put: &mut impl FnMut(usize, usize, f64),
) {
    let several = b.chunks_exact(J * height);
    let single = several.remainder().chunks_exact(height);
    let first_single = b.len() / height - single.len();
    for (at, b) in several.enumerate() {
        for (i, sums) in dots::<S, I, J>(simd, a, b, height).into_iter().enumerate() {
            for (j, sum) in sums.into_iter().enumerate() {
                put(first + i, J * at + j, sum);
            }
        }
    }
    for (j, b) in single.enumerate() {
        for (i, [sum]) in dots::<S, I, 1>(simd, a, b, height).into_iter().enumerate() {
            put(first + i, first_single + j, sum);
        }
    }
}

/// The products of I columns with J others.
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn dots<'a, S: Simd, const I: usize, const J: usize>(
    simd: S,
    a: &'a [f64],
    b: &'a [f64],
    height: usize,
) -> [[f64; J]; I] {
    let count = height / S::F64_LANES;
    let whole = count * S::F64_LANES;
    let vectors = |of: &'a [f64], column: usize| -> &'a [S::f64s] {
        &S::as_simd_f64s(&of[column * height..][..whole]).0[..count]
    };
    let a_vectors: [&[S::f64s]; I] = std::array::from_fn(|i| vectors(a, i));
    let b_vectors: [&[S::f64s]; J] = std::array::from_fn(|j| vectors(b, j));
    let mut sums = [[simd.splat_f64s(0.0); J]; I];
    for l in 0..count {
        let own: [S::f64s; I] = std::array::from_fn(|i| a_vectors[i][l]);
        for j in 0..J {
            let other = b_vectors[j][l];
            for i in 0..I {
                sums[i][j] = simd.mul_add_e_f64s(own[i], other, sums[i][j]);
            }
        }
    }
    let mut dots = [[0.0; J]; I];
    for i in 0..I {
        for j in 0..J {
            let rest = a[i * height + whole..(i + 1) * height].iter().zip(&b[j * height + whole..]);
            dots[i][j] = rest.fold(sum_of_lanes::<S>(sums[i][j]), |sum, (a, b)| sum + a * b);
        }
    }
    dots
}

/// Upper bound of the lanes of a processor's vectors.
pub(super) const MOST_LANES: usize = 8;

/// The sum of a vector's lanes. It goes through memory: the intrinsic is not inlined for vectors of
/// eight, and takes longer than the products.
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn sum_of_lanes<S: Simd>(vector: S::f64s) -> f64 {
    let mut lanes = [0.0; MOST_LANES];
    if let [all, ..] = S::as_mut_simd_f64s(&mut lanes).0 {
        *all = vector;
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// A with `rows` × `inner`, X with `inner` rows, and the destination of `factor` times their
/// product, all column-major.
struct Added<'a> {
    to: &'a mut [f64],
    stride: usize,
    first: usize,
    factor: f64,
    a: &'a [f64],
    rows: usize,
    x: &'a [f64],
    inner: usize,
}

/// Vectors of a column that are summed simultaneously.
const HIGH: usize = 4;

impl WithSimd for Added<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let count = self.x.len() / self.inner;
        let mut row = 0;
        while self.rows - row >= HIGH * S::F64_LANES {
            self.strip::<S, HIGH>(simd, row, count);
            row += HIGH * S::F64_LANES;
        }
        while self.rows - row >= S::F64_LANES {
            self.strip::<S, 1>(simd, row, count);
            row += S::F64_LANES;
        }
        for row in row..self.rows {
            for j in 0..count {
                let x = &self.x[j * self.inner..(j + 1) * self.inner];
                let a = self.a[row..].iter().step_by(self.rows);
                let sum: f64 = a.zip(x).map(|(a, x)| a * x).sum();
                self.to[j * self.stride + self.first + row] += self.factor * sum;
            }
        }
    }
}

impl Added<'_> {
    /// R vectors of rows from `row` on, with all columns of X.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn strip<S: Simd, const R: usize>(&mut self, simd: S, row: usize, count: usize) {
        let mut j = 0;
        while j + 4 <= count {
            self.tile::<S, R, 4>(simd, row, j);
            j += 4;
        }
        while j < count {
            self.tile::<S, R, 1>(simd, row, j);
            j += 1;
        }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn tile<S: Simd, const R: usize, const J: usize>(&mut self, simd: S, row: usize, first_j: usize) {
        let mut sums = [[simd.splat_f64s(0.0); R]; J];
        let x: [&[f64]; J] = std::array::from_fn(|j| &self.x[(first_j + j) * self.inner..][..self.inner]);
        for (i, own) in self.a.chunks_exact(self.rows).enumerate() {
            let own = &own[row..][..R * S::F64_LANES];
            let own: [S::f64s; R] = std::array::from_fn(|r| S::as_simd_f64s(own).0[r]);
            for j in 0..J {
                let factor = simd.splat_f64s(x[j][i]);
                for r in 0..R {
                    sums[j][r] = simd.mul_add_e_f64s(own[r], factor, sums[j][r]);
                }
            }
        }
        let factor = simd.splat_f64s(self.factor);
        for (j, sums) in sums.into_iter().enumerate() {
            let at = (first_j + j) * self.stride + self.first + row;
            let to = S::as_mut_simd_f64s(&mut self.to[at..][..R * S::F64_LANES]).0;
            for (to, sum) in to.iter_mut().zip(sums) {
                *to = simd.mul_add_e_f64s(sum, factor, *to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes around the block size, compared with the factor that nalgebra computes column by
    /// column.
    #[test]
    fn in_blocks_it_is_the_factor_of_single_columns() {
        for n in [1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7] {
            let root = DMatrix::from_fn(n, n, |r, c| ((r * 37 + c * 101) % 97) as f64 / 97.0 - 0.5);
            let a = &root * root.transpose() + DMatrix::identity(n, n);
            let plain = a.clone().cholesky().expect("positive");
            let factor = Factor::of(a).expect("positive");
            for count in [13, NARROW + 1] {
                let x = DMatrix::from_fn(n, count, |r, c| ((r * 11 + c * 5) % 31) as f64 - 15.0);
                let mut solved = x.clone();
                factor.forward(&mut solved);
                let half = plain.l().solve_lower_triangular(&x).expect("regular");
                // rounding: the condition number is below 1e4
                assert!((&solved - &half).norm() < 1e-10 * half.norm(), "{n}");
                factor.backward(&mut solved);
                let whole = plain.solve(&x);
                assert!((&solved - &whole).norm() < 1e-10 * whole.norm(), "{n}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_has_no_factor() {
        let mut a = DMatrix::<f64>::identity(BLOCK + 2, BLOCK + 2);
        a[(BLOCK + 1, BLOCK + 1)] = -1.0;
        assert!(Factor::of(a).is_none());
    }
}

#[cfg(test)]
mod narrow_tests {
    use super::*;

    fn matrix(rows: usize, columns: usize, seed: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |r, c| ((r * 37 + c * 101 + seed) % 97) as f64 / 97.0 - 0.5)
    }

    #[test]
    fn products_of_every_shape_are_those_of_whole_matrices() {
        for (rows, inner, count) in
            [(1, 1, 1), (3, 7, 2), (8, 8, 4), (41, 5, 13), (288, 9, 13), (130, 66, 43), (0, 3, 2), (3, 0, 2)]
        {
            let (a, b) = (matrix(rows, inner, 1), matrix(rows, count, 2));
            // rounding of sums of numbers below one
            assert!((crossed(&a, &b) - a.transpose() * &b).amax() < 1e-12);
            let x = matrix(inner, count, 3);
            let before = matrix(rows + 5, count, 4);
            let mut to = before.clone();
            add_product(&mut to, 2, -1.5, &a, &x);
            let mut whole = before;
            let mut part = whole.rows_mut(2, rows);
            part -= (&a * &x) * 1.5;
            assert!((to - whole).amax() < 1e-12, "{rows} × {inner}, {count}");
        }
    }
}

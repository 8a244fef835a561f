//! Cholesky factor of a large symmetric matrix, computed block by block, so that nearly all of the
//! work is matrix products.
//!
//! Column by column, as for small matrices, a thousand columns take most of a second; in blocks, a
//! small part of it.

use super::narrow::{NARROW, add_product, crossed};
use nalgebra::DMatrix;

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

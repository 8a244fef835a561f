//! Cholesky's factor of a large symmetric matrix, block by block, so that nearly all of the work is products of matrices.
//!
//! Column by column, as small matrices are factorised, a thousand columns take most of a second; in blocks, a small part of it.

use nalgebra::DMatrix;

/// Columns of a block: few enough for the processor's cache, enough for a product to be worth its start.
const BLOCK: usize = 64;

/// AᵀB by the product that is fast for wide A.
pub(super) fn crossed(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    (b.transpose() * a).transpose()
}

/// L of A = L Lᵀ.
pub(super) struct Factor {
    /// L in the lower triangle; what is above it means nothing.
    lower: DMatrix<f64>,
    /// Inverses of L's blocks on the diagonal.
    inverses: Vec<DMatrix<f64>>,
}

impl Factor {
    /// Of a symmetric matrix, of which only the lower triangle is read; none where it is not positive.
    pub(super) fn of(mut a: DMatrix<f64>) -> Option<Factor> {
        let n = a.nrows();
        let mut inverses = Vec::with_capacity(n.div_ceil(BLOCK));
        for first in (0..n).step_by(BLOCK) {
            let size = BLOCK.min(n - first);
            let below = first + size;
            let l = a.view((first, first), (size, size)).clone_owned().cholesky()?.l();
            let inverse = l.solve_lower_triangular(&DMatrix::identity(size, size))?;
            a.view_mut((first, first), (size, size)).copy_from(&l);
            let panel = a.view((below, first), (n - below, size)) * inverse.transpose();
            a.view_mut((below, first), (n - below, size)).copy_from(&panel);
            for column in (below..n).step_by(BLOCK) {
                let width = BLOCK.min(n - column);
                let own = panel.rows(column - below, n - column);
                let other = panel.rows(column - below, width).transpose();
                a.view_mut((column, column), (n - column, width)).gemm(-1.0, &own, &other, 1.0);
            }
            inverses.push(inverse);
        }
        Some(Factor { lower: a, inverses })
    }

    /// L⁻¹X, in the place of X.
    pub(super) fn forward(&self, x: &mut DMatrix<f64>) {
        let n = self.lower.nrows();
        for (block, inverse) in self.inverses.iter().enumerate() {
            let (first, size) = (block * BLOCK, inverse.nrows());
            let below = first + size;
            let solved = inverse * x.rows(first, size);
            x.rows_mut(first, size).copy_from(&solved);
            let l = self.lower.view((below, first), (n - below, size));
            x.rows_mut(below, n - below).gemm(-1.0, &l, &solved, 1.0);
        }
    }

    /// L⁻ᵀX, in the place of X.
    pub(super) fn backward(&self, x: &mut DMatrix<f64>) {
        let n = self.lower.nrows();
        for (block, inverse) in self.inverses.iter().enumerate().rev() {
            let (first, size) = (block * BLOCK, inverse.nrows());
            let below = first + size;
            let l = self.lower.view((below, first), (n - below, size)).transpose();
            let solved = inverse.transpose() * (x.rows(first, size) - l * x.rows(below, n - below));
            x.rows_mut(first, size).copy_from(&solved);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes about the blocks' edges, against the factor that nalgebra makes column by column.
    #[test]
    fn in_blocks_it_is_the_factor_of_single_columns() {
        for n in [1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7] {
            let root = DMatrix::from_fn(n, n, |r, c| ((r * 37 + c * 101) % 97) as f64 / 97.0 - 0.5);
            let a = &root * root.transpose() + DMatrix::identity(n, n);
            let x = DMatrix::from_fn(n, 13, |r, c| ((r * 11 + c * 5) % 31) as f64 - 15.0);
            let plain = a.clone().cholesky().expect("positive");
            let factor = Factor::of(a).expect("positive");
            let mut solved = x.clone();
            factor.forward(&mut solved);
            let half = plain.l().solve_lower_triangular(&x).expect("regular");
            // rounding: the condition number is below 1e4
            assert!((&solved - &half).norm() < 1e-10 * half.norm(), "{n}");
            factor.backward(&mut solved);
            let whole = plain.solve(&x);
            assert!((&solved - &whole).norm() < 1e-10 * whole.norm(), "{n}");
            assert!((crossed(&x, &half) - x.transpose() * &half).norm() < 1e-12 * x.norm() * half.norm());
        }
    }

    #[test]
    fn what_is_not_positive_has_no_factor() {
        let mut a = DMatrix::<f64>::identity(BLOCK + 2, BLOCK + 2);
        a[(BLOCK + 1, BLOCK + 1)] = -1.0;
        assert!(Factor::of(a).is_none());
    }
}

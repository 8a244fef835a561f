//! The covariance of one band's residual. Noise of a line is circular, so it is one Hermitian
//! matrix N.

use super::large_matrix::{Factor, rows};
use crate::Line;
use crate::substructuring::product::product;
use nalgebra::DMatrix;

/// N, computed with real matrix products, which are the fast ones.
#[derive(Clone)]
pub(super) struct Noise {
    /// Rows and columns of the residual; its entries are column-major.
    shape: (usize, usize),
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

/// A part Σᵢ Uᵢ ⊗ (ρᵢ ρᵢᴴ) of N: the effect of one impact's cells on the rows times that of the
/// impact on the columns.
///
/// Written out, each cell is a column as long as the residual; in this form all cells of an impact
/// are one small matrix.
pub(super) struct ByImpact {
    /// Uᵢ column-major, one column for each impact: rows² × impacts.
    pub(super) by_rows: Line,
    /// ρᵢ: impacts × columns.
    pub(super) by_columns: Line,
}

impl ByImpact {
    /// scale · Σ v_oi x xᴴ, x = (column o of left) ⊗ (row i of right).
    pub(super) fn of_cells(left: &Line, right: Line, variance: &DMatrix<f64>, scale: f64) -> ByImpact {
        let rows = left.nrows();
        let mut squares = Line::zeros(rows * rows, left.ncols());
        for (mut square, column) in squares.column_iter_mut().zip(left.column_iter()) {
            let pairs =
                column.iter().flat_map(|other| column.iter().map(move |own| own * other.conj() * scale));
            square.iter_mut().zip(pairs).for_each(|(to, v)| *to = v);
        }
        ByImpact { by_rows: product(&squares, variance), by_columns: right }
    }
}

impl Noise {
    pub(super) fn none(rows: usize, columns: usize) -> Noise {
        let none = || DMatrix::zeros(rows * columns, rows * columns);
        Noise { shape: (rows, columns), re: none(), im: none() }
    }

    /// Adds these parts: one matrix product, whose entries are then added at their positions.
    pub(super) fn add_by_impact(&mut self, parts: &[ByImpact]) {
        let (rows, columns) = self.shape;
        let (height, width) = (rows * rows, columns * columns);
        let count: usize = parts.iter().map(|part| part.by_columns.nrows()).sum();
        let (mut left, mut right) = (DMatrix::zeros(2 * height, 2 * count), DMatrix::zeros(2 * count, width));
        let impacts = parts.iter().flat_map(|p| (0..p.by_columns.nrows()).map(move |i| (p, i)));
        for (j, (part, i)) in impacts.enumerate() {
            for (at, u) in part.by_rows.column(i).iter().enumerate() {
                left[(at, j)] = u.re;
                left[(height + at, j)] = u.im;
                left[(at, count + j)] = -u.im;
                left[(height + at, count + j)] = u.re;
            }
            let row = part.by_columns.row(i);
            for (at, v) in
                row.iter().flat_map(|other| row.iter().map(move |own| own * other.conj())).enumerate()
            {
                right[(j, at)] = v.re;
                right[(count + j, at)] = v.im;
            }
        }
        let both: DMatrix<f64> = left * right;
        for (pair, both) in both.as_slice().chunks_exact((2 * height).max(1)).enumerate() {
            let (c, other) = (pair % columns, pair / columns);
            let (re, im) = both.split_at(height);
            for (part, own) in [(&mut self.re, re), (&mut self.im, im)] {
                for (r, own) in own.chunks_exact(rows).enumerate() {
                    let first = (other * rows + r) * rows * columns + c * rows;
                    let to = &mut part.as_mut_slice()[first..first + rows];
                    to.iter_mut().zip(own).for_each(|(to, v)| *to += v);
                }
            }
        }
    }

    /// Adds X Xᴴ for X with its real parts on top of its imaginary parts.
    pub(super) fn add(&mut self, x: &DMatrix<f64>) {
        let m = self.re.nrows();
        // copied to separate matrices: products of views with few rows read past their end
        let (re, im) = (rows(x, 0, m), rows(x, m, m));
        let re_t = re.transpose();
        let crossed: DMatrix<f64> = &im * &re_t;
        self.im += &crossed - crossed.transpose();
        self.re.gemm(1.0, &re, &re_t, 1.0);
        self.re.gemm(1.0, &im, &im.transpose(), 1.0);
    }

    pub(super) fn whitening(&self) -> Option<Whitening> {
        let m = self.re.nrows();
        let scale: Vec<f64> = (0..m).map(|r| (0.5 * self.re[(r, r)]).sqrt().recip()).collect();
        if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
            return None;
        }
        // real and imaginary part have half the variance each
        let part = |of: &DMatrix<f64>| DMatrix::from_fn(m, m, |r, c| 0.5 * of[(r, c)] * scale[r] * scale[c]);
        let (re, im) = (part(&self.re), part(&self.im));
        // the lower triangle is sufficient
        let mut both = DMatrix::zeros(2 * m, 2 * m);
        both.view_mut((0, 0), (m, m)).copy_from(&re);
        both.view_mut((m, m), (m, m)).copy_from(&re);
        both.view_mut((m, 0), (m, m)).copy_from(&im);
        Some(Whitening { factor: Factor::of(both)?, scale })
    }
}

/// Converts residuals and derivatives to unit variance.
pub(super) struct Whitening {
    /// Scales entries to a similar magnitude; without it rounding makes the factorisation fail.
    scale: Vec<f64>,
    /// Factor of the covariance of (real parts, imaginary parts) in these units.
    factor: Factor,
}

impl Whitening {
    /// Whitens columns of real parts on top of imaginary parts.
    pub(super) fn of(&self, mut x: DMatrix<f64>) -> DMatrix<f64> {
        self.scaled(&mut x);
        self.factor.forward(&mut x);
        x
    }

    /// Applies the transposed whitening to whitened columns: the result can be multiplied by the
    /// transpose of unwhitened columns.
    pub(super) fn back(&self, mut x: DMatrix<f64>) -> DMatrix<f64> {
        self.factor.backward(&mut x);
        self.scaled(&mut x);
        x
    }

    /// The left half of N's inverse acting on (real parts, imaginary parts): the upper and the
    /// lower block. The right half consists of the same two: the negated lower one on top, the
    /// upper one below.
    pub(super) fn inverse(&self) -> [DMatrix<f64>; 2] {
        let m = self.scale.len();
        let left = self.back(self.of(DMatrix::identity(2 * m, m)));
        [rows(&left, 0, m), rows(&left, m, m)]
    }

    fn scaled(&self, x: &mut DMatrix<f64>) {
        for mut column in x.column_iter_mut() {
            for (v, scale) in column.iter_mut().zip(self.scale.iter().cycle()) {
                *v *= scale;
            }
        }
    }
}

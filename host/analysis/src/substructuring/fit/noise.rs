//! The covariance of one band's residual. Noise of a line is circular, so it is one Hermitian matrix N.

use super::block::Line;
use super::factor::Factor;
use nalgebra::DMatrix;

/// N, gathered from real products, which are the fast ones.
#[derive(Clone)]
pub(super) struct Noise {
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

impl Noise {
    pub(super) fn none(entries: usize) -> Noise {
        Noise { re: DMatrix::zeros(entries, entries), im: DMatrix::zeros(entries, entries) }
    }

    /// Adds scale · Σ v_oi x xᴴ, x = (column o of left) ⊗ (row i of right) by columns.
    pub(super) fn spread(&mut self, left: &Line, right: &Line, variance: &DMatrix<f64>, scale: f64) {
        let (rows, columns) = (left.nrows(), right.ncols());
        let (outputs, inputs) = variance.shape();
        let mut x = DMatrix::zeros(2 * rows * columns, outputs * inputs);
        for i in 0..inputs {
            for o in 0..outputs {
                let std = variance[(o, i)].sqrt();
                let mut both = x.column_mut(i * outputs + o);
                let (re, im) = both.as_mut_slice().split_at_mut(rows * columns);
                let parts = re.chunks_exact_mut(rows).zip(im.chunks_exact_mut(rows));
                for (c, (re, im)) in parts.enumerate() {
                    let factor = right[(i, c)] * std;
                    for ((re, im), l) in re.iter_mut().zip(im).zip(left.column(o).iter()) {
                        let v = l * factor;
                        (*re, *im) = (v.re, v.im);
                    }
                }
            }
        }
        self.add(&x, scale);
    }

    /// Adds scale · X Xᴴ of an X whose real parts stand above its imaginary ones.
    pub(super) fn add(&mut self, x: &DMatrix<f64>, scale: f64) {
        let m = self.re.nrows();
        let (re, im) = (x.rows(0, m), x.rows(m, m));
        let turned = x.transpose();
        let (re_t, im_t) = (turned.columns(0, m), turned.columns(m, m));
        self.re.gemm(scale, &re, &re_t, 1.0);
        self.re.gemm(scale, &im, &im_t, 1.0);
        let mut crossed = DMatrix::zeros(m, m);
        crossed.gemm(scale, &im, &re_t, 0.0);
        self.im += &crossed - crossed.transpose();
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
        // the lower triangle is enough
        let mut both = DMatrix::zeros(2 * m, 2 * m);
        both.view_mut((0, 0), (m, m)).copy_from(&re);
        both.view_mut((m, m), (m, m)).copy_from(&re);
        both.view_mut((m, 0), (m, m)).copy_from(&im);
        Some(Whitening { factor: Factor::of(both)?, scale })
    }
}

/// What makes residuals and derivatives ones of unit variance.
pub(super) struct Whitening {
    /// Units of one size, or rounding fails the factorisation.
    scale: Vec<f64>,
    /// Of the covariance of (real parts, imaginary parts) in these units.
    factor: Factor,
}

impl Whitening {
    /// Columns of real parts above imaginary ones in units of their noise.
    pub(super) fn of(&self, mut x: DMatrix<f64>) -> DMatrix<f64> {
        for mut column in x.column_iter_mut() {
            for (v, scale) in column.iter_mut().zip(self.scale.iter().cycle()) {
                *v *= scale;
            }
        }
        self.factor.forward(&mut x);
        x
    }
}

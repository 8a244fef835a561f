//! The covariance of one band's residual, and the effect of aims at the assembly's cells on that
//! residual, in factored form.
//!
//! Noise of a line is circular, so the covariance is one Hermitian matrix N. A cell of impact i
//! reaches the residual through its row tᵢ of T_f, which is real and the same at every line. The
//! effect of an aim is therefore v ⊗ tᵢ, where v has one entry per measured row only, and the
//! products with N⁻¹ that the fit needs are computed from these short columns. Two thirds of all
//! nuisance parameters are such aims.

use super::large_matrix::{Factor, MOST_LANES, add_product, rows};
use crate::Line;
use crate::substructuring::product::product;
use nalgebra::{Complex, DMatrix, DMatrixView};

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

/// The aims of all cells of the assembly, impact by impact.
pub(super) struct AssemblyAims {
    /// v of every aim at an impact's cells, sensor by sensor, in standard deviations of the aim:
    /// real parts of the measured rows on top of imaginary parts.
    pub(super) by_impact: Vec<DMatrix<f64>>,
    /// Their transposes, padded with rows of zeros to whole vectors.
    turned: Vec<DMatrix<f64>>,
}

/// tᵢ of all impacts: impacts × measured columns, and its transpose.
pub(super) struct Pushes {
    t: DMatrix<f64>,
    turned: DMatrix<f64>,
}

impl Pushes {
    pub(super) fn of(t_f: &DMatrix<f64>) -> Pushes {
        Pushes { t: t_f.clone(), turned: t_f.transpose() }
    }

    /// Σ_c tᵢ\[c\] · (column c of blocks of `inner` values): inner × impacts.
    fn contracted(&self, values: &[f64], inner: usize) -> DMatrix<f64> {
        DMatrixView::from_slice(values, inner, self.t.ncols()) * &self.turned
    }

    /// Contracts columns (real parts on top of imaginary parts) with tᵢ of each impact: per impact
    /// (2 · rows) × columns.
    fn met(&self, columns: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
        let (height, count) = columns.shape();
        let met = height / self.t.ncols();
        let rows = met / 2;
        // all values of one measured column are moved to one column
        let mut values = DMatrix::zeros(met * count, self.t.ncols());
        for (part, own) in columns.as_slice().chunks_exact((height / 2).max(1)).enumerate() {
            for (own, to) in own.chunks_exact(rows).zip(values.as_mut_slice().chunks_exact_mut(met * count)) {
                to[part * rows..][..rows].copy_from_slice(own);
            }
        }
        let mut sums = DMatrix::zeros(met * count, self.t.nrows());
        add_product(&mut sums, 0, 1.0, &values, &self.turned);
        sums.column_iter().map(|sum| DMatrix::from_column_slice(met, count, sum.as_slice())).collect()
    }
}

impl AssemblyAims {
    pub(super) fn of(by_impact: Vec<DMatrix<f64>>) -> AssemblyAims {
        let turned =
            |v: &DMatrix<f64>| v.transpose().resize_vertically(v.ncols().next_multiple_of(MOST_LANES), 0.0);
        AssemblyAims { turned: by_impact.iter().map(turned).collect(), by_impact }
    }

    /// The difference between these and others, times `scale`.
    pub(super) fn apart(&self, other: &AssemblyAims, scale: f64) -> AssemblyAims {
        let pairs = self.by_impact.iter().zip(&other.by_impact);
        AssemblyAims::of(pairs.map(|(one, other)| (one - other) * scale).collect())
    }

    /// The covariance of the residual if every aim has unit variance.
    pub(super) fn covariance(&self, pushes: &Pushes) -> ByImpact {
        let rows = self.by_impact.first().map_or(0, |v| v.nrows() / 2);
        let mut by_rows = DMatrix::zeros(rows * rows, self.by_impact.len());
        for (v, mut u) in self.by_impact.iter().zip(by_rows.column_iter_mut()) {
            let square = v * v.transpose();
            for (at, u) in u.iter_mut().enumerate() {
                let (r, other) = (at % rows, at / rows);
                *u = Complex::new(
                    square[(r, other)] + square[(rows + r, rows + other)],
                    square[(rows + r, other)] - square[(r, rows + other)],
                );
            }
        }
        ByImpact { by_rows, by_columns: pushes.t.map(Complex::from) }
    }

    /// G η of these aims, unwhitened; η impact by impact.
    pub(super) fn times(&self, pushes: &Pushes, eta: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
        let (impacts, columns) = pushes.t.shape();
        let height = self.by_impact.first().map_or(0, DMatrix::nrows);
        let rows = height / 2;
        let mut sum = DMatrix::zeros(height * columns, 1);
        let (re, im) = sum.as_mut_slice().split_at_mut(rows * columns);
        for i in 0..impacts {
            let v = &self.by_impact[i];
            let own = v * DMatrix::from_fn(v.ncols(), 1, |k, _| eta(i, k));
            for c in 0..columns {
                let t = pushes.t[(i, c)];
                for r in 0..rows {
                    re[c * rows + r] += own[r] * t;
                    im[c * rows + r] += own[rows + r] * t;
                }
            }
        }
        sum
    }

    /// Gᵀ x of these aims per impact (aims × columns, then rows of zeros); x = N⁻¹ times some
    /// columns, unwhitened.
    pub(super) fn pulled(&self, pushes: &Pushes, x: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
        let pulled = |(turned, x): (&DMatrix<f64>, DMatrix<f64>)| {
            let mut pulled = DMatrix::zeros(turned.nrows(), x.ncols());
            add_product(&mut pulled, 0, 1.0, turned, &x);
            pulled
        };
        self.turned.iter().zip(pushes.met(x)).map(pulled).collect()
    }
}

/// The factors of one band's information matrix.
pub(super) struct Met {
    /// N⁻¹ times the explicitly stored columns, contracted with each impact's tᵢ: columns × (2 ·
    /// rows).
    written: Vec<DMatrix<f64>>,
    /// N⁻¹ contracted with the tᵢ of two impacts; per impact (rows · impacts) × (2 · rows), upper
    /// block next to the lower.
    inverse: Vec<DMatrix<f64>>,
    /// Transposes of the aims' columns.
    turned: Vec<DMatrix<f64>>,
}

/// Information of one impact's aims, summed over bands.
pub(super) struct OfImpact {
    /// With the explicitly stored columns: columns × aims.
    pub(super) written: DMatrix<f64>,
    /// With the aims of this impact and of each later one: later aims × aims.
    pub(super) later: Vec<DMatrix<f64>>,
}

impl Met {
    /// From the explicitly stored, whitened columns.
    pub(super) fn of(
        whitening: &Whitening,
        pushes: &Pushes,
        written: &DMatrix<f64>,
        aims: &AssemblyAims,
    ) -> Met {
        let written = pushes.met(&whitening.back(written.clone())).iter().map(DMatrix::transpose).collect();
        let (impacts, columns) = pushes.t.shape();
        let between = |part: &DMatrix<f64>| -> DMatrix<f64> {
            let m = part.nrows();
            let rows = m / columns.max(1);
            let right = pushes.contracted(part.as_slice(), m * rows);
            let right = DMatrixView::from_slice(right.as_slice(), m, rows * impacts).transpose();
            pushes.contracted(right.as_slice(), rows * impacts * rows)
        };
        let [upper, lower] = whitening.inverse().map(|part| between(&part));
        let rows = aims.by_impact.first().map_or(0, |v| v.nrows() / 2);
        let inverse = upper.column_iter().zip(lower.column_iter()).map(|(upper, lower)| {
            DMatrix::from_iterator(rows * impacts, 2 * rows, upper.iter().chain(&lower).copied())
        });
        let inverse = inverse.collect();
        Met { written, inverse, turned: aims.by_impact.iter().map(DMatrix::transpose).collect() }
    }
}

impl OfImpact {
    /// The information of impact `i`, summed over bands.
    pub(super) fn sum<'a>(
        i: usize,
        bands: impl Iterator<Item = (&'a AssemblyAims, &'a Met)>,
    ) -> Option<OfImpact> {
        let mut sum: Option<OfImpact> = None;
        for (aims, met) in bands {
            let v = &aims.by_impact[i];
            let (rows, count) = (v.nrows() / 2, v.ncols());
            // upper · v and lower · v, arranged for the products with the real and imaginary parts
            // of a later impact's aims
            let mut both = DMatrix::zeros(2 * rows, 2 * count);
            both.view_mut((0, 0), (2 * rows, count)).copy_from(v);
            both.view_mut((0, count), (rows, count)).copy_from(&v.rows(rows, rows));
            both.view_mut((rows, count), (rows, count)).copy_from(&-v.rows(0, rows));
            let seen = &met.inverse[i] * both;
            let sum = sum.get_or_insert_with(|| OfImpact {
                written: DMatrix::zeros(met.written[i].nrows(), count),
                later: met.turned[i..].iter().map(|t| DMatrix::zeros(t.nrows(), count)).collect(),
            });
            sum.written.gemm(1.0, &met.written[i], v, 1.0);
            let mut stacked = DMatrix::zeros(2 * rows, count);
            for (later, (turned, to)) in met.turned[i..].iter().zip(&mut sum.later).enumerate() {
                let first = (i + later) * rows;
                stacked.rows_mut(0, rows).copy_from(&seen.view((first, 0), (rows, count)));
                stacked.rows_mut(rows, rows).copy_from(&seen.view((first, count), (rows, count)));
                to.gemm(1.0, turned, &stacked, 1.0);
            }
        }
        sum
    }
}

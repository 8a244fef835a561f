//! Effect of aims at the assembly's cells on a band's residual, in factored form.
//!
//! A cell of impact i reaches the residual through its row tᵢ of T_f, which is real and the same at
//! every line. The effect of an aim is therefore v ⊗ tᵢ, where v has one entry per measured row
//! only, and the products with N⁻¹ that the fit needs are computed from these short columns. Two
//! thirds of all nuisance parameters are such aims.

use super::large_matrix::{MOST_LANES, add_product};
use super::noise::{ByImpact, Whitening};
use nalgebra::{Complex, DMatrix, DMatrixView};

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

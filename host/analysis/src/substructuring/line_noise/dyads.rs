//! The derivatives of Z_dd, as sums of dyads over the cells of measured blocks.

use crate::substructuring::interface_data::{Balanced, Side};
use crate::substructuring::product::product;
use crate::vectors::wide;
use crate::{C, Line};
use nalgebra::DMatrix;
use pulp::NullaryFnOnce;

/// Index of AJB's file; A and B are 0 and 1.
pub(super) const ASSEMBLED: usize = 2;

/// A measured block with the transformations to a reduced one: T_l Y\[rows, columns\] T_r.
pub(super) struct MeasuredBlock<'a> {
    pub(super) file: usize,
    pub(super) rows: &'a [usize],
    pub(super) t_l: Option<&'a DMatrix<f64>>,
    pub(super) columns: &'a [usize],
    pub(super) t_r: Option<&'a DMatrix<f64>>,
}

/// Derivative of Z_dd by a cell: row d of `left` at the cell's row times row d of `right` at its
/// column.
struct Dyad<'a> {
    source: &'a MeasuredBlock<'a>,
    /// Whether it contributes to h* instead of g.
    conjugate: bool,
    /// Degree of freedom × row.
    left: Line,
    /// Degree of freedom × column.
    right: Line,
}

/// All dyads of one line.
#[derive(Default)]
pub(super) struct Dyads<'a>(Vec<Dyad<'a>>);

impl<'a> Dyads<'a> {
    /// Adds L δA R.
    pub(super) fn linear(&mut self, source: &'a MeasuredBlock<'a>, l: &Line, r: &Line) {
        let left = source.t_l.map_or_else(|| l.clone(), |t| product(l, t));
        let right = source.t_r.map_or_else(|| r.clone(), |t| product(t, r));
        self.0.push(Dyad { source, conjugate: false, left, right: right.transpose() });
    }

    /// Adds X δAᴴ W.
    fn adjoint(&mut self, source: &'a MeasuredBlock<'a>, x: &Line, w: &Line) {
        let rows = source.t_l.map_or_else(|| w.clone(), |t| product(&t.transpose(), w));
        let columns = source.t_r.map_or_else(|| x.clone(), |t| product(x, &t.transpose()));
        self.0.push(Dyad { source, conjugate: true, left: rows.adjoint(), right: columns.conjugate() });
    }

    /// Adds L δ(A⁺) R.
    pub(super) fn inverse(
        &mut self,
        source: &'a MeasuredBlock<'a>,
        l: &Line,
        [a, plus]: [&Line; 2],
        r: &Line,
    ) {
        let (rows, columns) = a.shape();
        self.linear(source, &(-product(l, plus)), &product(plus, r));
        let adjoint = plus.adjoint();
        if rows > columns {
            let beside = r - product(a, &product(plus, r));
            self.adjoint(source, &product(&product(l, plus), &adjoint), &beside);
        } else if columns > rows {
            let beside = l - product(&product(l, plus), a);
            self.adjoint(source, &beside, &product(&adjoint, &product(plus, r)));
        }
    }

    /// Variances of K and of ωC of every degree of freedom, where Z is its factor times the sum of
    /// the dyads, from the variances of the files' cells at this line.
    pub(super) fn variances(&self, factors: &[C], variance: [&DMatrix<f64>; 3], tau: f64) -> Vec<[f64; 2]> {
        let dofs = factors.len();
        // factors of K, and of ωC
        let factors: Vec<[C; 2]> =
            factors.iter().map(|factor| [factor * C::new(1.0, tau), *factor]).collect();
        let mut sums = vec![[0.0; 2]; dofs];
        for (file, variance) in variance.into_iter().enumerate() {
            // column by column, so that only one column is held at a time; within a column the
            // order of the dyads is kept
            let mut places: Vec<(usize, &Dyad<'_>, usize)> = Vec::new();
            for dyad in self.0.iter().filter(|dyad| dyad.source.file == file) {
                places.extend(dyad.source.columns.iter().enumerate().map(|(j, column)| (*column, dyad, j)));
            }
            places.sort_by_key(|(column, ..)| *column);
            let mut by_dof = vec![0.0; dofs];
            // g and h* of every row, with all degrees of freedom contiguous
            let mut moved = [false, true].map(|_| vec![C::default(); dofs * variance.nrows()]);
            for column in places.chunk_by(|a, b| a.0 == b.0) {
                // most dyads do not contribute to h*
                let mixed = column.iter().any(|(_, dyad, _)| dyad.conjugate);
                for to in &mut moved[..=usize::from(mixed)] {
                    to.fill(C::default());
                }
                for (_, dyad, j) in column {
                    let rows = (dyad.source.rows, dyad.left.as_slice());
                    let right = &dyad.right.as_slice()[j * dofs..][..dofs];
                    wide(Add { to: &mut moved[usize::from(dyad.conjugate)], rows, right });
                }
                let variance = variance.column(column[0].0);
                let [g, h] = &moved;
                let variance = variance.as_slice();
                if mixed {
                    wide(Mixed { g, h, variance, factors: &factors, sums: &mut sums });
                } else {
                    by_dof.fill(0.0);
                    wide(Squares { g, variance, sums: &mut by_dof });
                    for ((sums, sum), [of_k, of_c]) in sums.iter_mut().zip(&by_dof).zip(&factors) {
                        sums[0] += of_k.norm_sqr() * sum;
                        sums[1] += of_c.norm_sqr() * sum;
                    }
                }
            }
        }
        sums
    }
}

/// Adds left times right for every row and degree of freedom.
struct Add<'a> {
    /// Sums of all rows, with the degrees of freedom of each contiguous.
    to: &'a mut [C],
    /// Indices of the rows, and their left factors.
    rows: (&'a [usize], &'a [C]),
    right: &'a [C],
}

impl NullaryFnOnce for Add<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let dofs = self.right.len();
        let (rows, left) = self.rows;
        for (row, left) in rows.iter().zip(left.chunks_exact(dofs)) {
            let to = &mut self.to[row * dofs..][..dofs];
            for ((to, left), right) in to.iter_mut().zip(left).zip(self.right) {
                *to += left * right;
            }
        }
    }
}

/// Adds the variance from a column of cells by g alone to the sums of the degrees of freedom, which
/// are contiguous.
struct Squares<'a> {
    g: &'a [C],
    variance: &'a [f64],
    sums: &'a mut [f64],
}

impl NullaryFnOnce for Squares<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for (g, v) in self.g.chunks_exact(self.sums.len()).zip(self.variance) {
            for (sum, g) in self.sums.iter_mut().zip(g) {
                // the variance of a cell without influence may be unknown
                *sum += if *g == C::default() { 0.0 } else { g.norm_sqr() * v };
            }
        }
    }
}

/// The same for K and for ωC, from g and h* together.
struct Mixed<'a> {
    g: &'a [C],
    h: &'a [C],
    variance: &'a [f64],
    /// Factors of K and of ωC.
    factors: &'a [[C; 2]],
    sums: &'a mut [[f64; 2]],
}

impl NullaryFnOnce for Mixed<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let dofs = self.factors.len();
        let rows = self.g.chunks_exact(dofs).zip(self.h.chunks_exact(dofs)).zip(self.variance);
        for ((g, h), v) in rows {
            for (((g, h), [of_k, of_c]), sums) in g.iter().zip(h).zip(self.factors).zip(&mut *self.sums) {
                let counts = *g != C::default() || *h != C::default();
                let k = (of_k * g + of_k.conj() * h).norm_sqr() * v;
                let c = (of_c * g - of_c.conj() * h).norm_sqr() * v;
                sums[0] += if counts { k } else { 0.0 };
                sums[1] += if counts { c } else { 0.0 };
            }
        }
    }
}

/// Both virtual points of the assembly combined.
pub(super) struct Both {
    rows: Vec<usize>,
    columns: Vec<usize>,
    t_u: DMatrix<f64>,
    t_f: DMatrix<f64>,
}

impl Both {
    pub(super) fn of([a, b]: &[Balanced; 2]) -> Both {
        let stacked = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            let (rows, columns) = a.shape();
            let mut all = DMatrix::zeros(rows + b.nrows(), columns + b.ncols());
            all.view_mut((0, 0), a.shape()).copy_from(a);
            all.view_mut((rows, columns), b.shape()).copy_from(b);
            all
        };
        Both {
            rows: [&a.vp.rows.at[..], &b.vp.rows.at].concat(),
            columns: [&a.vp.columns.at[..], &b.vp.columns.at].concat(),
            t_u: stacked(&a.t_u, &b.t_u),
            t_f: stacked(&a.t_f, &b.t_f),
        }
    }

    pub(super) fn source(&self) -> MeasuredBlock<'_> {
        MeasuredBlock {
            file: ASSEMBLED,
            rows: &self.rows,
            t_l: Some(&self.t_u),
            columns: &self.columns,
            t_r: Some(&self.t_f),
        }
    }
}

pub(super) fn own(side: Side, at: &Balanced) -> MeasuredBlock<'_> {
    MeasuredBlock {
        file: side as usize,
        rows: &at.vp.rows.at,
        t_l: Some(&at.t_u),
        columns: &at.vp.columns.at,
        t_r: Some(&at.t_f),
    }
}

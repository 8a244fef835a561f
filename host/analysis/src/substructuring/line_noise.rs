//! Effect of the FRFs' noise on every line of a method, and the noise of a band's lines: linear
//! propagation through virtual points and method.
//!
//! Each method consists of sums, products and inverses of the measured blocks, so a small δY
//! changes Z_dd by Σ g δY + Σ h δY* over the cells. Both g and h are sums of dyads (`Dyads`):
//! δ(A⁻¹) = −A⁻¹ δA A⁻¹ takes a row and a column of A⁻¹, which T_u and T_f transform to the cells.
//! h is not zero if P or Q is inverted by least squares and the data do not fit (Golub and
//! Pereyra's derivative of A⁺). Noise is independent between cells, and real and imaginary part
//! have the variance v each: then var K = Σ |(1 + iτ) g + (1 − iτ) h*|² v with τ = σ/ω, and
//! ω² var C = Σ |g − h*|² v.

use super::coupling::boolean_difference;
use super::decoupling::{
    DecouplingError, Factors, InverseBlock, PrimalBlock, SUBSTRUCTURE, factors, stiffnesses, with_m_inverse,
};
use super::idm::Dof;
use super::interface_data::{Balanced, MeasuredSet, Side, balance};
use super::joint_over_bands::median;
use super::method::Method;
use super::product::product;
use super::pseudo_inverse::full_rank_inverse;
use super::reduced::{MethodKind, Rearrangement, Reduced, RefusedReason, every_line};
use crate::band::Band;
use crate::vectors::wide;
use crate::{C, Line};
use nalgebra::{Complex, DMatrix};
use pulp::NullaryFnOnce;
use std::collections::BTreeMap;

/// Standard deviations of one line's stiffness and damping due to the FRFs' noise alone, \[line\];
/// NaN if the variance of a cell with influence is not known.
#[derive(Debug, Clone, PartialEq)]
pub struct LineNoise {
    /// Standard deviation of K, N/m (N m/rad for rotations).
    pub stiffness_n_per_m: BTreeMap<Dof, Vec<f64>>,
    /// Standard deviation of C, N s/m (N m s/rad for rotations).
    pub damping_n_s_per_m: BTreeMap<Dof, Vec<f64>>,
}

impl Reduced {
    /// The noise of every line by `method`; `noises` are the variances of A, B and AJB at the
    /// files' lines.
    pub(super) fn line_noise(
        &self,
        measured_set: &MeasuredSet<'_>,
        noises: [&[DMatrix<f64>]; 3],
        method: Method,
    ) -> Result<LineNoise, RefusedReason> {
        let own = [own(Side::A, &self.a), own(Side::B, &self.b)];
        let [y_a, y_b] = self.alone(measured_set)?;
        let lines = y_a.len();
        let by_line: Result<Vec<Vec<[f64; 2]>>, RefusedReason> = match MethodKind::from(method) {
            MethodKind::Internal(seen, hit, which) => {
                let internals = Rearrangement::of(seen, hit, which, measured_set, [&self.a, &self.b]);
                let sources = Sources::of(&internals);
                every_line(lines, |l| {
                    let dyads =
                        Self::by_internals(measured_set, l, [&y_a[l], &y_b[l]], &internals, &sources, &own)?;
                    Ok(self.deviations(measured_set, noises, l, &dyads))
                })
            }
            MethodKind::Interface => {
                let both = Both::of(self.assembled()?);
                let (both, y) = (both.source(), self.assembly(measured_set)?);
                every_line(lines, |l| {
                    let dyads = self.by_interface(measured_set, l, [&y_a[l], &y_b[l], &y[l]], &both, &own)?;
                    Ok(self.deviations(measured_set, noises, l, &dyads))
                })
            }
            MethodKind::Primal(block) => {
                let both = Both::of(self.assembled()?);
                let (both, z) = (both.source(), self.impedance(measured_set)?);
                let (at, y, own) = match block {
                    PrimalBlock::A => (0, y_a, &own[0]),
                    PrimalBlock::B => (self.idms.count(), y_b, &own[1]),
                };
                every_line(lines, |l| {
                    let alone = full_rank_inverse(&y[l], SUBSTRUCTURE)
                        .map_err(|lost| Reduced::refused(measured_set, l, lost.into()))?;
                    let mut dyads = Dyads::default();
                    let (row, column) = self.cross(&z[l], at, at);
                    dyads.linear(&both, &-row, &column);
                    dyads.linear(own, &alone, &alone);
                    Ok(self.deviations(measured_set, noises, l, &dyads))
                })
            }
            MethodKind::Inverse(block) => {
                let both = Both::of(self.assembled()?);
                let (both, z) = (both.source(), self.impedance(measured_set)?);
                let n = self.idms.count();
                let (at, other) = match block {
                    InverseBlock::Ab => (0, n),
                    InverseBlock::Ba => (n, 0),
                };
                every_line(lines, |l| {
                    let mut dyads = Dyads::default();
                    let (row, column) = self.cross(&z[l], at, other);
                    dyads.linear(&both, &row, &column);
                    Ok(self.deviations(measured_set, noises, l, &dyads))
                })
            }
        };
        let by_line = by_line?;
        let column = |which: usize| {
            (self.idms.dofs().into_iter().enumerate())
                .map(|(d, dof)| (dof, by_line.iter().map(|line| line[d][which]).collect()))
                .collect()
        };
        Ok(LineNoise { stiffness_n_per_m: column(0), damping_n_s_per_m: column(1) })
    }

    /// The rows of one virtual point and the columns of another in the impedance of both points.
    fn cross(&self, z: &Line, row: usize, column: usize) -> (Line, Line) {
        let n = self.idms.count();
        (z.rows(row, n).clone_owned(), z.columns(column, n).clone_owned())
    }

    /// Z = D⁻¹ − W⁻¹, where D = B Y^AJB Bᵀ.
    fn by_interface<'a>(
        &self,
        measured_set: &MeasuredSet<'_>,
        l: usize,
        [y_a, y_b, y]: [&Line; 3],
        both: &'a MeasuredBlock<'a>,
        own: &'a [MeasuredBlock<'a>; 2],
    ) -> Result<Dyads<'a>, RefusedReason> {
        let [d, w] = stiffnesses(y_a, y_b, y).map_err(refused(measured_set, l))?;
        let relative = boolean_difference(self.idms.count());
        let mut dyads = Dyads::default();
        dyads.linear(both, &-product(&d, &relative), &product(&relative.transpose(), &d));
        for own in own {
            dyads.linear(own, &w, &w);
        }
        Ok(dyads)
    }

    /// Z = (G − Y^A − Y^B)⁻¹ with G⁻¹ = P⁺ M Q⁺, or G = Q M⁻¹ P as printed.
    fn by_internals<'a>(
        measured_set: &MeasuredSet<'_>,
        l: usize,
        [y_a, y_b]: [&Line; 2],
        internals: &Rearrangement<'_>,
        sources: &'a Sources<'a>,
        own: &'a [MeasuredBlock<'a>; 2],
    ) -> Result<Dyads<'a>, RefusedReason> {
        let (p, q, m) = (internals.p(l)?, internals.q(l)?, internals.m(l)?);
        let mut dyads = Dyads::default();
        let z = if internals.printed {
            let [z, m_plus] = with_m_inverse(y_a, y_b, &p, &m, &q).map_err(refused(measured_set, l))?;
            dyads.linear(&sources.q, &-&z, &product(&m_plus, &product(&p, &z)));
            for source in &sources.m {
                dyads.inverse(source, &-product(&z, &q), [&m, &m_plus], &product(&p, &z));
            }
            dyads.linear(&sources.p, &-product(&product(&z, &q), &m_plus), &z);
            z
        } else {
            let Factors { p_plus, q_plus, g, z } =
                factors(y_a, y_b, &p, &m, &q).map_err(refused(measured_set, l))?;
            let (left, right) = (product(&z, &g), product(&g, &z));
            let (to_m, from_m) = (product(&left, &p_plus), product(&q_plus, &right));
            dyads.inverse(&sources.p, &left, [&p, &p_plus], &product(&m, &from_m));
            dyads.inverse(&sources.q, &product(&to_m, &m), [&q, &q_plus], &right);
            for (source, sign) in sources.m.iter().zip(sources.signs) {
                dyads.linear(source, &(&to_m * Complex::from(sign)), &from_m);
            }
            z
        };
        for own in own {
            dyads.linear(own, &z, &z);
        }
        Ok(dyads)
    }

    /// Standard deviations of K and C by degree of freedom, in the original units of rotations and
    /// after removing the files' quantity.
    fn deviations(
        &self,
        measured_set: &MeasuredSet<'_>,
        noises: [&[DMatrix<f64>]; 3],
        l: usize,
        dyads: &Dyads<'_>,
    ) -> Vec<[f64; 2]> {
        let frf = measured_set.a.frf;
        let s = frf.s(l);
        let quantity = s.powi(frf.quantity().order_of_s());
        let variance = noises.map(|n| &n[l]);
        let factors: Vec<_> = balance(self.idms).iter().map(|length| quantity * length * length).collect();
        let variances = dyads.variances(&factors, variance, s.re / s.im).into_iter();
        variances.map(|[k, omega_c]| [k.sqrt(), omega_c.sqrt() / s.im]).collect()
    }
}

fn refused<'a>(
    measured_set: &'a MeasuredSet<'_>,
    l: usize,
) -> impl Fn(DecouplingError) -> RefusedReason + 'a {
    move |source| Reduced::refused(measured_set, l, source)
}

/// The blocks that P, Q and M consist of.
struct Sources<'a> {
    p: MeasuredBlock<'a>,
    q: MeasuredBlock<'a>,
    m: Vec<MeasuredBlock<'a>>,
    /// Signs of M's blocks.
    signs: [f64; 2],
}

impl<'a> Sources<'a> {
    fn of(internals: &'a Rearrangement<'a>) -> Sources<'a> {
        let (seen, hit) = (internals.seen_at, internals.hit_at);
        let block = |file: usize, rows: &'a [usize], columns: &'a [usize]| MeasuredBlock {
            file,
            rows,
            t_l: None,
            columns,
            t_r: None,
        };
        let assembled = block(ASSEMBLED, &internals.rows_ajb.at, &internals.columns_ajb.at);
        let (m, signs) = if internals.seen == internals.hit {
            let alone = block(internals.seen as usize, &internals.rows.at, &internals.columns.at);
            (vec![alone, assembled], [1.0, -1.0])
        } else {
            (vec![assembled], [1.0, 1.0])
        };
        Sources {
            p: MeasuredBlock {
                t_r: Some(&seen.t_f),
                ..block(internals.seen as usize, &internals.rows.at, &seen.vp.columns.at)
            },
            q: MeasuredBlock {
                t_l: Some(&hit.t_u),
                ..block(internals.hit as usize, &hit.vp.rows.at, &internals.columns.at)
            },
            m,
            signs,
        }
    }
}

impl LineNoise {
    /// Median of the translations' stiffness noise over the lines of a band, N/m; `frequency_hz`
    /// are the lines, Hz. Directions without a known value are left out.
    pub fn stiffness_over(&self, frequency_hz: &[f64], band: Band) -> BTreeMap<Dof, f64> {
        let translations = self.stiffness_n_per_m.iter().filter(|(dof, _)| dof.is_translation());
        translations
            .filter_map(|(dof, of_k)| {
                let inside: Vec<f64> = (frequency_hz.iter().zip(of_k))
                    .filter(|(f, v)| band.contains(**f) && v.is_finite())
                    .map(|(_, v)| *v)
                    .collect();
                (!inside.is_empty()).then(|| (*dof, median(&inside)))
            })
            .collect()
    }
}

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

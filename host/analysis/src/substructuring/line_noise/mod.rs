//! Effect of the FRFs' noise on every line of a method: linear propagation through virtual points
//! and method.
//!
//! Each method consists of sums, products and inverses of the measured blocks, so a small δY
//! changes Z_dd by Σ g δY + Σ h δY* over the cells. Both g and h are sums of dyads: δ(A⁻¹) = −A⁻¹
//! δA A⁻¹ takes a row and a column of A⁻¹, which T_u and T_f transform to the cells. h is not zero
//! if P or Q is inverted by least squares and the data do not fit (Golub and Pereyra's derivative
//! of A⁺). Noise is independent between cells, and real and imaginary part have the variance v
//! each: then var K = Σ |(1 + iτ) g + (1 − iτ) h*|² v with τ = σ/ω, and ω² var C = Σ |g − h*|² v.
//!
//! The noise of a method's lines over a band.

use super::coupling::boolean_difference;
use super::decoupling::{
    DecouplingError, Factors, InverseBlock, PrimalBlock, SUBSTRUCTURE, factors, stiffnesses, with_m_inverse,
};
use super::idm::Dof;
use super::interface_data::balance;
use super::interface_data::{MeasuredSet, Side};
use super::internal_dofs::Rearrangement;
use super::joint_over_bands::median;
use super::method::Method;
use super::product::product;
use super::pseudo_inverse::full_rank_inverse;
use super::reduced::{MethodKind, Reduced, RefusedReason, every_line};
use crate::Line;
use crate::band::Band;
use dyads::{ASSEMBLED, Both, Dyads, MeasuredBlock, own};
use nalgebra::{Complex, DMatrix};
use std::collections::BTreeMap;

mod dyads;

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

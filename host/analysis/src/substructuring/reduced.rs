//! One IDM set's virtual points with their admittances, line by line; P, Q and M of Eq. (3) with
//! the related rearrangements (the internal points used, and their matrices); and Z^J of every line
//! by every requested method.

use super::coupling::BackCoupling;
use super::decoupling::{
    ASSEMBLY, DecouplingError, InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse_of,
    observed_rank, primal_of,
};
use super::geometry::Grouping;
use super::idm::IdmSet;
use super::interface_data::{Balanced, Found, InterfaceError, MeasuredSet, Side, balance, scaled};
use super::method::Method;
use super::pseudo_inverse::{condition, full_rank_inverse, rank};
use super::quality::{Internals, VirtualPointQuality, consistency, passivity, reciprocity};
use super::vpt::reduce_inputs;
use crate::Line;
use crate::band::Band;
use crate::parallel::prelude::*;
use crate::structure::Structure;
use nalgebra::Complex;
use std::sync::OnceLock;

/// The reason why one method with one IDM set gave no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RefusedReason {
    /// The virtual points or internals cannot be formed.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// The method refuses the data at a line.
    #[error("at {frequency_hz} Hz: {source}")]
    Decoupling {
        /// The line, Hz.
        frequency_hz: f64,
        /// Why.
        source: DecouplingError,
    },
}

/// The kind of computation behind a method.
pub(super) enum MethodKind {
    /// Responses on the first side, hits on the second.
    Internal(Side, Side, Which),
    Interface,
    Primal(PrimalBlock),
    Inverse(InverseBlock),
}

impl From<Method> for MethodKind {
    fn from(method: Method) -> MethodKind {
        match method {
            Method::Internal => MethodKind::Internal(Side::B, Side::A, Which::All),
            Method::InternalPrinted => MethodKind::Internal(Side::B, Side::A, Which::Printed),
            Method::InternalAa => MethodKind::Internal(Side::A, Side::A, Which::All),
            Method::InternalAb => MethodKind::Internal(Side::A, Side::B, Which::All),
            Method::InternalBb => MethodKind::Internal(Side::B, Side::B, Which::All),
            Method::Interface => MethodKind::Interface,
            Method::PrimalA => MethodKind::Primal(PrimalBlock::A),
            Method::PrimalB => MethodKind::Primal(PrimalBlock::B),
            Method::Inverse => MethodKind::Inverse(InverseBlock::Ab),
            Method::InverseBa => MethodKind::Inverse(InverseBlock::Ba),
        }
    }
}

/// Virtual points of A and B for one IDM set, alone and in the assembly (rotations scaled to
/// metres).
///
/// Admittances stay in the files' quantity, receptance times sᵏ: every method then gives Z^J
/// divided by sᵏ, and one factor at the end corrects this.
pub(super) struct Reduced {
    pub(super) idms: IdmSet,
    pub(super) a: Balanced,
    pub(super) b: Balanced,
    assembled: Result<[Balanced; 2], InterfaceError>,
    /// For all lines, kept for repeated use: Y^A and Y^B, Y^AJB_cc, and its inverse.
    alone: OnceLock<Result<[Vec<Line>; 2], RefusedReason>>,
    assembly: OnceLock<Result<Vec<Line>, RefusedReason>>,
    impedance: OnceLock<Result<Vec<Line>, RefusedReason>>,
}

impl Reduced {
    pub(super) fn of(measured_set: &MeasuredSet<'_>, idms: IdmSet) -> Result<Reduced, InterfaceError> {
        let of = |file, grouping| Balanced::of(file, grouping, measured_set.geometry, idms);
        let (a, b) = (of(measured_set.a, Grouping::InterfaceA)?, of(measured_set.b, Grouping::InterfaceB)?);
        let in_ajb = |grouping| of(measured_set.ajb, grouping);
        let assembled = in_ajb(Grouping::InterfaceA).and_then(|a| Ok([a, in_ajb(Grouping::InterfaceB)?]));
        let (alone, assembly, impedance) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Ok(Reduced { idms, a, b, assembled, alone, assembly, impedance })
    }

    pub(super) fn quality(
        &self,
        measured_set: &MeasuredSet<'_>,
        [y_a, y_b]: [&[Line]; 2],
    ) -> Vec<VirtualPointQuality> {
        [(Structure::A, measured_set.a, &self.a.vp, y_a), (Structure::B, measured_set.b, &self.b.vp, y_b)]
            .into_par_iter()
            .filter_map(|(substructure, file, vp, y)| {
                // factor from driving-point admittance to mobility
                let order = file.frf.quantity().order_of_s();
                let s: Vec<Complex<f64>> = (0..y.len()).map(|l| file.frf.s(l).powi(1 - order)).collect();
                let lines = every_line(y.len(), |l| file.cells(l, &vp.rows, &vp.columns)).ok()?;
                Some(VirtualPointQuality {
                    substructure,
                    idms: self.idms.count(),
                    modes: self.idms.dofs(),
                    condition_responses: vp.responses.condition,
                    condition_impacts: vp.impacts.condition,
                    channels: vp.rows.names.clone(),
                    impacts: vp.columns.names.clone(),
                    frequency_hz: file.frf.frequency_hz().to_vec(),
                    consistency: consistency(&lines, &vp.responses, &vp.impacts),
                    passivity: passivity(y, &s),
                    reciprocity: reciprocity(y),
                })
            })
            .collect()
    }

    /// How well A and B, coupled by this joint (mean over `band`), reproduce the measured assembly;
    /// none if it cannot be computed.
    pub(super) fn back_coupling(
        &self,
        measured_set: &MeasuredSet<'_>,
        z: &[Line],
        band: Band,
    ) -> Option<BackCoupling> {
        let d: Vec<f64> = balance(self.idms).iter().map(|d| 1.0 / d).collect();
        let z: Vec<Line> = z.par_iter().map(|z| scaled(z.clone(), &d, Complex::from(1.0))).collect();
        let [y_a, y_b] = self.alone(measured_set).ok()?;
        let y = self.assembly(measured_set).ok()?;
        BackCoupling::of(measured_set.a.frf, y_a, y_b, y, &z, band)
    }

    /// The virtual point of one substructure alone.
    pub(super) fn own(&self, side: Side) -> &Balanced {
        match side {
            Side::A => &self.a,
            Side::B => &self.b,
        }
    }

    /// Y^A or Y^B at one line.
    pub(super) fn alone_at(
        &self,
        measured_set: &MeasuredSet<'_>,
        side: Side,
        l: usize,
    ) -> Result<Line, InterfaceError> {
        let own = self.own(side);
        own.admittance(measured_set.alone(side), l, own)
    }

    /// Y^A and Y^B.
    pub(super) fn alone(&self, measured_set: &MeasuredSet<'_>) -> Result<&[Vec<Line>; 2], RefusedReason> {
        let of = |side| {
            every_line(measured_set.alone(side).frf.lines().len(), |l| self.alone_at(measured_set, side, l))
        };
        let found = self.alone.get_or_init(|| Ok([of(Side::A)?, of(Side::B)?]));
        found.as_ref().map_err(Clone::clone)
    }

    /// Both virtual points of the assembly, A's first.
    pub(super) fn assembled(&self) -> Result<&[Balanced; 2], InterfaceError> {
        self.assembled.as_ref().map_err(Clone::clone)
    }

    /// Y^AJB_cc at one line: both virtual points of the assembly, A's first.
    pub(super) fn assembly_at(
        &self,
        measured_set: &MeasuredSet<'_>,
        l: usize,
    ) -> Result<Line, InterfaceError> {
        let (n, vp) = (self.idms.count(), self.assembled()?);
        let mut line = Line::zeros(2 * n, 2 * n);
        for (r, out) in vp.iter().enumerate() {
            for (c, input) in vp.iter().enumerate() {
                let y = out.admittance(measured_set.ajb, l, input)?;
                line.view_mut((r * n, c * n), (n, n)).copy_from(&y);
            }
        }
        Ok(line)
    }

    /// Y^AJB_cc.
    pub(super) fn assembly(&self, measured_set: &MeasuredSet<'_>) -> Result<&[Line], RefusedReason> {
        let found = self.assembly.get_or_init(|| {
            self.assembled()?;
            every_line(measured_set.ajb.frf.lines().len(), |l| Ok(self.assembly_at(measured_set, l)?))
        });
        found.as_deref().map_err(Clone::clone)
    }

    /// (Y^AJB_cc)⁻¹ at one line, with `y` = Y^AJB_cc.
    pub(super) fn impedance_of(
        measured_set: &MeasuredSet<'_>,
        l: usize,
        y: &Line,
    ) -> Result<Line, RefusedReason> {
        full_rank_inverse(y, ASSEMBLY).map_err(|lost| Self::refused(measured_set, l, lost.into()))
    }

    /// (Y^AJB_cc)⁻¹.
    pub(super) fn impedance(&self, measured_set: &MeasuredSet<'_>) -> Result<&[Line], RefusedReason> {
        let y = self.assembly(measured_set)?;
        let found = self
            .impedance
            .get_or_init(|| every_line(y.len(), |l| Self::impedance_of(measured_set, l, &y[l])));
        found.as_deref().map_err(Clone::clone)
    }

    pub(super) fn refused(
        measured_set: &MeasuredSet<'_>,
        line: usize,
        source: DecouplingError,
    ) -> RefusedReason {
        RefusedReason::Decoupling { frequency_hz: measured_set.a.frf.frequency_hz()[line], source }
    }
}

/// The result of `of` for each line, in parallel; if some refuse, the refusal of the first of them.
pub(super) fn every_line<T: Send, E>(
    lines: usize,
    of: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let found: Vec<Option<T>> = (0..lines).into_par_iter().with_min_len(16).map(|l| of(l).ok()).collect();
    match found.into_iter().collect() {
        Some(all) => Ok(all),
        // run in order to find the first refusal
        None => (0..lines).map(of).collect(),
    }
}

/// The points that count as internal.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Which {
    /// All points measured on the substructure, including its interface points; A's internal
    /// responses are spares and are left out.
    All,
    /// Grouping 3 and 4 only, as in the paper.
    Printed,
}

impl Side {
    fn impacts(self, which: Which) -> &'static [Grouping] {
        match (self, which) {
            (Side::A, Which::All) => &[Grouping::InterfaceA, Grouping::InternalA],
            (Side::A, Which::Printed) => &[Grouping::InternalA],
            (Side::B, Which::All) => &[Grouping::InterfaceB, Grouping::InternalB],
            (Side::B, Which::Printed) => &[Grouping::InternalB],
        }
    }

    fn responses(self, which: Which) -> &'static [Grouping] {
        match (self, which) {
            (Side::A, Which::All) => &[Grouping::InterfaceA],
            _ => self.impacts(which),
        }
    }
}

/// One rearrangement of Eq. (1): responses on `seen`, hits on `hit`, at the points that the
/// assembly's file has too.
pub(super) struct Rearrangement<'a> {
    pub(super) seen: Side,
    pub(super) hit: Side,
    /// Whether M is inverted (Eq. 3 as printed) instead of P and Q.
    pub(super) printed: bool,
    /// Rows in the file of `seen`, and the same in the assembly's file.
    pub(super) rows: Found,
    pub(super) rows_ajb: Found,
    /// Columns in the file of `hit`, and the same in the assembly's file.
    pub(super) columns: Found,
    pub(super) columns_ajb: Found,
    measured_set: &'a MeasuredSet<'a>,
    pub(super) seen_at: &'a Balanced,
    pub(super) hit_at: &'a Balanced,
}

impl<'a> Rearrangement<'a> {
    /// Responses on `seen` and hits on `hit`; `at` are the virtual points of A and B alone.
    pub(super) fn of(
        seen: Side,
        hit: Side,
        which: Which,
        measured_set: &'a MeasuredSet<'a>,
        at: [&'a Balanced; 2],
    ) -> Self {
        let (seen_on, hit_on) = (seen.responses(which), hit.impacts(which));
        let (columns, columns_ajb) =
            shared(&measured_set.alone(hit).inputs(hit_on), &measured_set.ajb.inputs(hit_on));
        let (rows, rows_ajb) =
            shared(&measured_set.alone(seen).outputs(seen_on), &measured_set.ajb.outputs(seen_on));
        let printed = which == Which::Printed;
        let [seen_at, hit_at] = [seen, hit].map(|side| at[side as usize]);
        Rearrangement {
            seen,
            hit,
            printed,
            rows,
            rows_ajb,
            columns,
            columns_ajb,
            measured_set,
            seen_at,
            hit_at,
        }
    }

    /// P: from the virtual point to the internal responses (n_i × n_c).
    pub(super) fn p(&self, l: usize) -> Result<Line, InterfaceError> {
        let cells = self.measured_set.alone(self.seen).cells(l, &self.rows, &self.seen_at.vp.columns)?;
        Ok(reduce_inputs(&cells, &self.seen_at.t_f))
    }

    /// Q: from the internal impacts to the virtual point (n_c × n_i).
    pub(super) fn q(&self, l: usize) -> Result<Line, InterfaceError> {
        let file = self.measured_set.alone(self.hit);
        file.reduced_outputs(l, &self.hit_at.t_u, &self.hit_at.vp.rows, &self.columns)
    }

    /// M: from the internal impacts to the internal responses in the assembly; if both are on one
    /// substructure, its value alone minus that in the assembly.
    pub(super) fn m(&self, l: usize) -> Result<Line, InterfaceError> {
        let assembled = self.measured_set.ajb.cells(l, &self.rows_ajb, &self.columns_ajb)?;
        if self.seen == self.hit {
            Ok(self.measured_set.alone(self.seen).cells(l, &self.rows, &self.columns)? - assembled)
        } else {
            Ok(assembled)
        }
    }
}

/// The rows (or columns) that both files have, in the order of the first.
fn shared(first: &Found, second: &Found) -> (Found, Found) {
    let mut one = Found { names: vec![], points: vec![], at: vec![] };
    let mut two = Found { names: vec![], points: vec![], at: vec![] };
    for (i, name) in first.names.iter().enumerate() {
        if let Some(j) = second.names.iter().position(|n| n == name) {
            one.names.push(name.clone());
            one.points.push(first.points[i].clone());
            one.at.push(first.at[i]);
            two.names.push(name.clone());
            two.points.push(second.points[j].clone());
            two.at.push(second.at[j]);
        }
    }
    (one, two)
}

/// Z^J per line, with notes for the user.
pub(super) struct Solution {
    pub(super) z: Vec<Line>,
    pub(super) notes: Vec<String>,
    pub(super) internals: Option<Internals>,
}

/// Results of all methods.
pub(super) struct Solutions {
    /// Y^A and Y^B, rotations in metres; empty if not requested.
    pub(super) alone: Vec<Vec<Line>>,
    /// In the order of the methods.
    pub(super) by_method: Vec<Result<Solution, RefusedReason>>,
}

/// The operation that a method applies to a line.
enum Work<'a> {
    Internals(Box<Rearrangement<'a>>),
    Interface,
    Primal(PrimalBlock),
    Inverse(InverseBlock),
}

/// A method with notes for the user.
struct MethodPlan<'a> {
    work: Work<'a>,
    notes: Vec<String>,
    internals: Option<Internals>,
}

impl Reduced {
    /// The result or refusal of every method, and Y^A and Y^B if requested.
    ///
    /// # Errors
    /// Y^A or Y^B contains a value that is not finite: then no method works.
    pub(super) fn solve(
        &self,
        measured_set: &MeasuredSet<'_>,
        methods: &[Method],
        alone: bool,
    ) -> Result<Solutions, RefusedReason> {
        let [y_a, y_b] = self.alone(measured_set)?;
        let alone = if alone { vec![y_a.clone(), y_b.clone()] } else { Vec::new() };
        let by_method = methods
            .iter()
            .map(|&method| {
                let MethodPlan { work, notes, internals } = self.plan(measured_set, method)?;
                Ok(Solution { z: self.z(measured_set, &work)?, notes, internals })
            })
            .collect();
        Ok(Solutions { alone, by_method })
    }

    /// Z^J of every line. The admittances of the virtual points are computed once for all methods;
    /// the first line without a result is the refusal.
    fn z(&self, measured_set: &MeasuredSet<'_>, work: &Work<'_>) -> Result<Vec<Line>, RefusedReason> {
        let [y_a, y_b] = self.alone(measured_set)?;
        let d = balance(self.idms);
        let frf = measured_set.a.frf;
        let order = frf.quantity().order_of_s();
        let in_si = |l: usize, z: Result<Line, DecouplingError>| {
            z.map(|z| scaled(z, &d, frf.s(l).powi(order)))
                .map_err(|source| Self::refused(measured_set, l, source))
        };
        let lines = frf.lines().len();
        match work {
            Work::Internals(internals) => {
                let method = if internals.printed { internal_printed } else { internal };
                every_line(lines, |l| {
                    let (p, m, q) = (internals.p(l)?, internals.m(l)?, internals.q(l)?);
                    in_si(l, method(&y_a[l], &y_b[l], &p, &m, &q))
                })
            }
            Work::Interface => {
                let y = self.assembly(measured_set)?;
                every_line(lines, |l| in_si(l, interface(&y_a[l], &y_b[l], &y[l])))
            }
            Work::Primal(block) => {
                let z = self.impedance(measured_set)?;
                let alone = match block {
                    PrimalBlock::A => y_a,
                    PrimalBlock::B => y_b,
                };
                every_line(lines, |l| in_si(l, primal_of(*block, &alone[l], &z[l])))
            }
            Work::Inverse(block) => {
                let z = self.impedance(measured_set)?;
                every_line(lines, |l| in_si(l, Ok(inverse_of(*block, &z[l]))))
            }
        }
    }

    fn plan<'a>(
        &'a self,
        measured_set: &'a MeasuredSet<'a>,
        method: Method,
    ) -> Result<MethodPlan<'a>, RefusedReason> {
        let work = match MethodKind::from(method) {
            MethodKind::Internal(seen, hit, which) => {
                let internals = Rearrangement::of(seen, hit, which, measured_set, [&self.a, &self.b]);
                return self.with_internals(measured_set, method, internals);
            }
            MethodKind::Interface => Work::Interface,
            MethodKind::Primal(block) => Work::Primal(block),
            MethodKind::Inverse(block) => Work::Inverse(block),
        };
        self.assembled()?;
        Ok(MethodPlan { work, notes: Vec::new(), internals: None })
    }

    /// Both forms of Eq. (3) and the related rearrangements: P, Q from the substructures, M from
    /// the assembly, at the internals that both have.
    fn with_internals<'a>(
        &self,
        measured_set: &MeasuredSet<'_>,
        name: Method,
        internals: Rearrangement<'a>,
    ) -> Result<MethodPlan<'a>, RefusedReason> {
        let mut notes = Vec::new();
        let (n_b, n_a) = (internals.rows.at.len(), internals.columns.at.len());
        let n_c = self.idms.count();
        let lines = measured_set.a.frf.lines().len();
        if n_a.min(n_b) == 0 && lines > 0 {
            let source = DecouplingError::TooFewInternals { impacts: n_a, responses: n_b, needed: n_c };
            return Err(Self::refused(measured_set, 0, source));
        }
        let found = if lines == 0 {
            None
        } else {
            let middle = lines / 2;
            let (p, q) = (internals.p(middle)?, internals.q(middle)?);
            Some(Internals {
                method: name,
                idms: n_c,
                impacts: n_a,
                responses: n_b,
                frequency_hz: measured_set.ajb.frf.frequency_hz()[middle],
                rank_p: rank(&p),
                rank_q: rank(&q),
                condition_p: condition(&p),
                condition_q: condition(&q),
            })
        };
        if internals.printed && lines > 0 && (n_a != n_c || n_b != n_c) {
            let rank = observed_rank(&internals.p(0)?, &internals.q(0)?);
            notes.push(format!(
                "Eq. 3 as printed with {n_a} internal impacts and {n_b} internal responses for {n_c} interface DoFs: Π has rank {rank} of {n_c}, \
                 so the result is right only for the interface forces that these internals generate, and biased otherwise; `internal` is the exact form"
            ));
        }
        Ok(MethodPlan { work: Work::Internals(Box::new(internals)), notes, internals: found })
    }
}

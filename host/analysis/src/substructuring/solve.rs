//! Z^J of every line by every requested method.

use super::decoupling::{DecouplingError, InverseBlock, PrimalBlock, inverse_of, observed_rank, primal_of};
use super::decoupling::{interface, internal, internal_printed};
use super::interface_data::{MeasuredSet, balance, scaled};
use super::method::Method;
use super::pseudo_inverse::{condition, rank};
use super::quality::Internals;
use super::reduced::Rearrangement;
use super::reduced::{MethodKind, Reduced, RefusedReason, every_line};
use crate::Line;

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

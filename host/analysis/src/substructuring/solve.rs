//! Z^J of every line by every requested method.

use super::batched::{Job, LineResults};
use super::decoupling::{DecouplingError, PrimalBlock, inverse_of, observed_rank, primal_of};
use super::decoupling::{interface, internal, internal_printed};
use super::interface_data::{MeasuredSet, Side};
use super::internal_dofs::Rearrangement;
use super::method::Method;
use super::pseudo_inverse::{condition, rank};
use super::quality::Internals;
use super::reduced::{LineRefusal, Stage, Work};
use super::reduced::{MethodKind, Reduced, RefusedReason};
use nalgebra::{Complex, DMatrix};

type Line = DMatrix<Complex<f64>>;

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
        let plans: Vec<Result<MethodPlan<'_>, RefusedReason>> =
            methods.iter().map(|&method| self.plan(measured_set, method)).collect();
        let works = plans.iter().flatten().map(|plan| &plan.work).collect();
        let LineResults { alone, z } = Job { reduced: self, measured_set, works, alone }.found()?;
        let mut z = z.into_iter();
        let by_method = plans
            .into_iter()
            .map(|plan| {
                let MethodPlan { notes, internals, .. } = plan?;
                let z = z.next().unwrap_or_else(|| Ok(Vec::new()))?;
                Ok(Solution { z, notes, internals })
            })
            .collect();
        Ok(Solutions { alone, by_method })
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

impl Reduced {
    /// Z^J of one separate line, for lines near rank loss or with a refusal. Rotations in metres.
    pub(super) fn per_line(
        &self,
        measured_set: &MeasuredSet<'_>,
        work: &Work<'_>,
        l: usize,
    ) -> Result<Line, LineRefusal> {
        let alone = |side| self.alone_at(measured_set, side, l).map_err(Stage::Method.refuses());
        let assembly = || self.assembly_at(measured_set, l).map_err(Stage::Assembly.refuses());
        let impedance =
            || Self::impedance_of(measured_set, l, &assembly()?).map_err(Stage::Impedance.refuses());
        let found = match work {
            Work::Internals(internals) => {
                let method = if internals.printed { internal_printed } else { internal };
                let (p, m, q) = (internals.p(l), internals.m(l), internals.q(l));
                let [p, m, q] = [p, m, q].map(|block| block.map_err(Stage::Method.refuses()));
                method(&alone(Side::A)?, &alone(Side::B)?, &p?, &m?, &q?)
            }
            Work::Interface => {
                let y = assembly()?;
                interface(&alone(Side::A)?, &alone(Side::B)?, &y)
            }
            Work::Primal(block) => {
                let z = impedance()?;
                let side = match block {
                    PrimalBlock::A => Side::A,
                    PrimalBlock::B => Side::B,
                };
                primal_of(*block, &alone(side)?, &z)
            }
            Work::Inverse(block) => Ok(inverse_of(*block, &impedance()?)),
        };
        found.map_err(|source| Stage::Method.refuses()(Self::refused(measured_set, l, source)))
    }
}

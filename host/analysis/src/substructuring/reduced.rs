//! One IDM set's virtual points with their admittances, and every method solved on them line by line.

use super::back_coupling::BackCoupling;
use super::consistency::consistency;
use super::decoupling::{
    ASSEMBLY, DecouplingError, InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse_of,
    observed_rank, primal_of,
};
use super::geometry::Grouping;
use super::idm::IdmSet;
use super::interface_data::{InterfaceError, balance, scaled};
use super::internal_dofs::{Rearrangement, Which};
use super::method::Method;
use super::plausibility::{passivity, reciprocity};
use super::pseudo_inverse::{condition, full_rank_inverse, rank};
use super::quality::{Internals, VirtualPointQuality};
use super::rooms::{Balanced, Rooms, Side};
use crate::band::Band;
use crate::parallel::prelude::*;
use crate::structure::Structure;
use nalgebra::{Complex, DMatrix};
use std::sync::OnceLock;

type Line = DMatrix<Complex<f64>>;

/// Why one method with one IDM set gave no result.
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

/// What a method is made of.
pub(super) enum Kind {
    /// Responses on the first, hits on the second.
    Internal(Side, Side, Which),
    Interface,
    Primal(PrimalBlock),
    Inverse(InverseBlock),
}

impl From<Method> for Kind {
    fn from(method: Method) -> Kind {
        match method {
            Method::Internal => Kind::Internal(Side::B, Side::A, Which::All),
            Method::InternalPrinted => Kind::Internal(Side::B, Side::A, Which::Printed),
            Method::InternalAa => Kind::Internal(Side::A, Side::A, Which::All),
            Method::InternalAb => Kind::Internal(Side::A, Side::B, Which::All),
            Method::InternalBb => Kind::Internal(Side::B, Side::B, Which::All),
            Method::Interface => Kind::Interface,
            Method::PrimalA => Kind::Primal(PrimalBlock::A),
            Method::PrimalB => Kind::Primal(PrimalBlock::B),
            Method::Inverse => Kind::Inverse(InverseBlock::Ab),
            Method::InverseBa => Kind::Inverse(InverseBlock::Ba),
        }
    }
}

/// Virtual points of A and B alone for one IDM set, with their admittances (rotations scaled to metres).
///
/// Admittances stay in the files' quantity, receptance times sᵏ: every method turns it into Z^J over sᵏ, and one factor at the
/// end makes up for it.
pub(super) struct Reduced {
    pub(super) idms: IdmSet,
    pub(super) a: Balanced,
    pub(super) b: Balanced,
    pub(super) y_a: Vec<Line>,
    pub(super) y_b: Vec<Line>,
    /// Y^AJB_cc and its inverse: five methods share them.
    assembly: OnceLock<Result<Vec<Line>, RefusedReason>>,
    impedance: OnceLock<Result<Vec<Line>, RefusedReason>>,
}

/// Z^J per line, and what is to be said about it.
pub(super) struct Solution {
    pub(super) z: Vec<Line>,
    pub(super) notes: Vec<String>,
    pub(super) internals: Option<Internals>,
}

type Solved = Result<Solution, RefusedReason>;

impl Reduced {
    pub(super) fn of(rooms: &Rooms<'_>, idms: IdmSet) -> Result<Reduced, InterfaceError> {
        let a = Balanced::of(rooms.a, Grouping::InterfaceA, rooms.geometry, idms)?;
        let b = Balanced::of(rooms.b, Grouping::InterfaceB, rooms.geometry, idms)?;
        let y_a = every_line(rooms.a.frf.lines().len(), |l| a.admittance(rooms.a, l, &a))?;
        let y_b = every_line(rooms.b.frf.lines().len(), |l| b.admittance(rooms.b, l, &b))?;
        let (assembly, impedance) = (OnceLock::new(), OnceLock::new());
        Ok(Reduced { idms, a, b, y_a, y_b, assembly, impedance })
    }

    pub(super) fn quality(&self, rooms: &Rooms<'_>) -> Vec<VirtualPointQuality> {
        [(Structure::A, rooms.a, &self.a.vp, &self.y_a), (Structure::B, rooms.b, &self.b.vp, &self.y_b)]
            .into_par_iter()
            .filter_map(|(substructure, file, vp, y)| {
                // what times a driving-point admittance is a mobility
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

    pub(super) fn solve(&self, rooms: &Rooms<'_>, method: Method) -> Solved {
        match Kind::from(method) {
            Kind::Internal(seen, hit, which) => {
                let internals = Rearrangement::of(seen, hit, which, rooms, [&self.a, &self.b]);
                self.with_internals(rooms, method, &internals)
            }
            Kind::Interface => {
                let y = self.assembly(rooms)?;
                self.plain(rooms, |l| interface(&self.y_a[l], &self.y_b[l], &y[l]))
            }
            Kind::Primal(block) => {
                let z = self.impedance(rooms)?;
                let y = match block {
                    PrimalBlock::A => &self.y_a,
                    PrimalBlock::B => &self.y_b,
                };
                self.plain(rooms, |l| primal_of(block, &y[l], &z[l]))
            }
            Kind::Inverse(block) => {
                let z = self.impedance(rooms)?;
                self.plain(rooms, |l| Ok(inverse_of(block, &z[l])))
            }
        }
    }

    /// How well A and B, coupled by this joint (mean over `band`), give the measured assembly; none where that cannot be said.
    pub(super) fn back_coupling(&self, rooms: &Rooms<'_>, z: &[Line], band: Band) -> Option<BackCoupling> {
        let d: Vec<f64> = balance(self.idms).iter().map(|d| 1.0 / d).collect();
        let z: Vec<Line> = z.par_iter().map(|z| scaled(z.clone(), &d, Complex::from(1.0))).collect();
        let y = self.assembly(rooms).ok()?;
        BackCoupling::of(rooms.a.frf, &self.y_a, &self.y_b, y, &z, band)
    }

    /// Both virtual points of the assembly, A's first.
    pub(super) fn assembled(&self, rooms: &Rooms<'_>) -> Result<[Balanced; 2], InterfaceError> {
        let of = |grouping| Balanced::of(rooms.ajb, grouping, rooms.geometry, self.idms);
        Ok([of(Grouping::InterfaceA)?, of(Grouping::InterfaceB)?])
    }

    /// Y^AJB_cc: both virtual points of the assembly, A's first.
    pub(super) fn assembly(&self, rooms: &Rooms<'_>) -> Result<&[Line], RefusedReason> {
        let found = self.assembly.get_or_init(|| {
            let n = self.idms.count();
            let vp = self.assembled(rooms)?;
            every_line(rooms.ajb.frf.lines().len(), |l| {
                let mut line = Line::zeros(2 * n, 2 * n);
                for (r, out) in vp.iter().enumerate() {
                    for (c, input) in vp.iter().enumerate() {
                        let y = out.admittance(rooms.ajb, l, input)?;
                        line.view_mut((r * n, c * n), (n, n)).copy_from(&y);
                    }
                }
                Ok(line)
            })
        });
        found.as_deref().map_err(Clone::clone)
    }

    /// (Y^AJB_cc)⁻¹.
    pub(super) fn impedance(&self, rooms: &Rooms<'_>) -> Result<&[Line], RefusedReason> {
        let y = self.assembly(rooms)?;
        let found = self.impedance.get_or_init(|| {
            every_line(y.len(), |l| {
                full_rank_inverse(&y[l], ASSEMBLY).map_err(|lost| RefusedReason::Decoupling {
                    frequency_hz: rooms.ajb.frf.frequency_hz()[l],
                    source: lost.into(),
                })
            })
        });
        found.as_deref().map_err(Clone::clone)
    }

    /// A method without anything to add.
    fn plain(
        &self,
        rooms: &Rooms<'_>,
        solve: impl Fn(usize) -> Result<Line, DecouplingError> + Sync,
    ) -> Solved {
        let z = self.per_line(rooms, |l| solve(l).map_err(|source| Self::refused(rooms, l, source)))?;
        Ok(Solution { z, notes: Vec::new(), internals: None })
    }

    /// Both forms of Eq. (3) and its sisters: P, Q from the substructures, M from the assembly, at the internals that both have.
    fn with_internals(&self, rooms: &Rooms<'_>, name: Method, internals: &Rearrangement<'_>) -> Solved {
        let printed = internals.printed;
        let mut notes = Vec::new();
        let (n_b, n_a) = (internals.rows.at.len(), internals.columns.at.len());
        let n_c = self.idms.count();
        let lines = self.y_a.len();
        if n_a.min(n_b) == 0 && lines > 0 {
            let source = DecouplingError::TooFewInternals { impacts: n_a, responses: n_b, needed: n_c };
            return Err(Self::refused(rooms, 0, source));
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
                frequency_hz: rooms.ajb.frf.frequency_hz()[middle],
                rank_p: rank(&p),
                rank_q: rank(&q),
                condition_p: condition(&p),
                condition_q: condition(&q),
            })
        };
        if printed && lines > 0 && (n_a != n_c || n_b != n_c) {
            let rank = observed_rank(&internals.p(0)?, &internals.q(0)?);
            notes.push(format!(
                "Eq. 3 as printed with {n_a} internal impacts and {n_b} internal responses for {n_c} interface DoFs: Π has rank {rank} of {n_c}, \
                 so the result is right only for the interface forces that these internals generate, and biased otherwise; `internal` is the exact form"
            ));
        }
        let method = if printed { internal_printed } else { internal };
        let z = self.per_line(rooms, |l| {
            method(&self.y_a[l], &self.y_b[l], &internals.p(l)?, &internals.m(l)?, &internals.q(l)?)
                .map_err(|source| Self::refused(rooms, l, source))
        })?;
        Ok(Solution { z, notes, internals: found })
    }

    pub(super) fn refused(rooms: &Rooms<'_>, line: usize, source: DecouplingError) -> RefusedReason {
        RefusedReason::Decoupling { frequency_hz: rooms.a.frf.frequency_hz()[line], source }
    }

    /// Solves every line and takes the rotations' scale and the files' quantity out again: Z = D Z' D sᵏ.
    fn per_line(
        &self,
        rooms: &Rooms<'_>,
        solve: impl Fn(usize) -> Result<Line, RefusedReason> + Sync,
    ) -> Result<Vec<Line>, RefusedReason> {
        let d = balance(self.idms);
        let order = rooms.a.frf.quantity().order_of_s();
        every_line(self.y_a.len(), |l| Ok(scaled(solve(l)?, &d, rooms.a.frf.s(l).powi(order))))
    }
}

/// What `of` gives for each line, in parallel; the first line's refusal if there are some.
pub(super) fn every_line<T: Send, E>(
    lines: usize,
    of: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let found: Vec<Option<T>> = (0..lines).into_par_iter().with_min_len(16).map(|l| of(l).ok()).collect();
    match found.into_iter().collect() {
        Some(all) => Ok(all),
        // which refusal is the first shows when they are asked in order
        None => (0..lines).map(of).collect(),
    }
}

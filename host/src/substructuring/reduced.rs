//! One IDM set's virtual points with their admittances, and every method solved on them line by line.

use super::back_coupling::BackCoupling;
use super::consistency::consistency;
use super::decoupling::{
    ASSEMBLY, DecouplingError, InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse_of,
    observed_rank, primal_of,
};
use super::geometry::{Geometry, Grouping};
use super::identify::{Internals as InternalsFound, VirtualPointQuality};
use super::idm::IdmSet;
use super::interface_data::{Found, InterfaceError, Measured, VirtualPoint, balance, scaled};
use super::joint::Band;
use super::method::Method;
use super::plausibility::{passivity, reciprocity};
use super::pseudo_inverse::{condition, full_rank_inverse, rank};
use super::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;
use std::sync::OnceLock;

type Line = DMatrix<Complex<f64>>;

/// Why one method with one IDM set gave no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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

/// The three measurements and the geometry.
pub(super) struct Rooms<'a> {
    pub(super) a: Measured<'a>,
    pub(super) b: Measured<'a>,
    pub(super) ajb: Measured<'a>,
    pub(super) geometry: &'a Geometry,
}

/// Virtual points of A and B alone for one IDM set, with their admittances (rotations scaled to metres).
pub(super) struct Reduced {
    idms: IdmSet,
    vp_a: VirtualPoint,
    vp_b: VirtualPoint,
    y_a: Vec<Line>,
    y_b: Vec<Line>,
    /// Y^AJB_cc and its inverse: five methods share them.
    assembly: OnceLock<Result<Vec<Line>, RefusedReason>>,
    impedance: OnceLock<Result<Vec<Line>, RefusedReason>>,
}

/// Z^J per line, and what is to be said about it.
pub(super) struct Solution {
    pub(super) z: Vec<Line>,
    pub(super) notes: Vec<String>,
    pub(super) internals: Option<InternalsFound>,
}

type Solved = Result<Solution, RefusedReason>;

impl Reduced {
    pub(super) fn of(rooms: &Rooms<'_>, idms: IdmSet) -> Result<Reduced, InterfaceError> {
        let vp_a = rooms.a.virtual_point(Grouping::InterfaceA, rooms.geometry, idms)?;
        let vp_b = rooms.b.virtual_point(Grouping::InterfaceB, rooms.geometry, idms)?;
        let y_a = Self::admittance(rooms.a, &vp_a, &vp_a, idms)?;
        let y_b = Self::admittance(rooms.b, &vp_b, &vp_b, idms)?;
        let (assembly, impedance) = (OnceLock::new(), OnceLock::new());
        Ok(Reduced { idms, vp_a, vp_b, y_a, y_b, assembly, impedance })
    }

    /// T_u Y T_f between two virtual points of one file.
    fn admittance(
        file: Measured<'_>,
        out: &VirtualPoint,
        input: &VirtualPoint,
        idms: IdmSet,
    ) -> Result<Vec<Line>, InterfaceError> {
        let d = balance(idms);
        let lines = file.block(&out.rows, &input.columns)?;
        Ok(lines
            .par_iter()
            .map(|y| {
                let reduced = reduce_inputs(&reduce_outputs(&out.responses.t, y), &input.impacts.t);
                scaled(&reduced, Some(&d), Some(&d))
            })
            .collect())
    }

    pub(super) fn quality(&self, rooms: &Rooms<'_>) -> Vec<VirtualPointQuality> {
        [("A", rooms.a, &self.vp_a, &self.y_a), ("B", rooms.b, &self.vp_b, &self.y_b)]
            .into_iter()
            .filter_map(|(substructure, file, vp, y)| {
                let s: Vec<Complex<f64>> = (0..y.len()).map(|l| file.frf.s(l)).collect();
                let lines = file.block(&vp.rows, &vp.columns).ok()?;
                Some(VirtualPointQuality {
                    substructure,
                    idms: self.idms.count(),
                    modes: self.idms.dofs(),
                    condition_responses: vp.responses.condition,
                    condition_impacts: vp.impacts.condition,
                    channels: vp.rows.names.clone(),
                    impacts: vp.columns.names.clone(),
                    frequency_hz: file.frf.frequency_hz.clone(),
                    consistency: consistency(&lines, &vp.responses, &vp.impacts),
                    passivity: passivity(y, &s),
                    reciprocity: reciprocity(y),
                })
            })
            .collect()
    }

    pub(super) fn solve(&self, rooms: &Rooms<'_>, method: Method) -> Solved {
        match method {
            Method::Internal => self.internals(rooms, method, Side::B, Side::A, Internals::All),
            Method::InternalPrinted => self.internals(rooms, method, Side::B, Side::A, Internals::Printed),
            Method::InternalAa => self.internals(rooms, method, Side::A, Side::A, Internals::All),
            Method::InternalAb => self.internals(rooms, method, Side::A, Side::B, Internals::All),
            Method::InternalBb => self.internals(rooms, method, Side::B, Side::B, Internals::All),
            Method::Interface => {
                let y = self.assembly(rooms)?;
                self.plain(rooms, |l| interface(&self.y_a[l], &self.y_b[l], &y[l]))
            }
            Method::PrimalA => {
                let z = self.impedance(rooms)?;
                self.plain(rooms, |l| primal_of(PrimalBlock::A, &self.y_a[l], &z[l]))
            }
            Method::PrimalB => {
                let z = self.impedance(rooms)?;
                self.plain(rooms, |l| primal_of(PrimalBlock::B, &self.y_b[l], &z[l]))
            }
            Method::Inverse => {
                let z = self.impedance(rooms)?;
                self.plain(rooms, |l| Ok(inverse_of(InverseBlock::Ab, &z[l])))
            }
            Method::InverseBa => {
                let z = self.impedance(rooms)?;
                self.plain(rooms, |l| Ok(inverse_of(InverseBlock::Ba, &z[l])))
            }
        }
    }

    /// How well A and B, coupled by this joint (mean over `band`), give the measured assembly; none where that cannot be said.
    pub(super) fn back_coupling(&self, rooms: &Rooms<'_>, z: &[Line], band: Band) -> Option<BackCoupling> {
        let d: Vec<f64> = balance(self.idms).iter().map(|d| 1.0 / d).collect();
        let z: Vec<Line> = z.iter().map(|z| scaled(z, Some(&d), Some(&d))).collect();
        let y = self.assembly(rooms).ok()?;
        BackCoupling::of(rooms.a.frf, &self.y_a, &self.y_b, y, &z, band)
    }

    /// Y^AJB_cc: both virtual points of the assembly, A's first.
    fn assembly(&self, rooms: &Rooms<'_>) -> Result<&[Line], RefusedReason> {
        let found = self.assembly.get_or_init(|| {
            let n = self.idms.count();
            let vp = [
                rooms.ajb.virtual_point(Grouping::InterfaceA, rooms.geometry, self.idms)?,
                rooms.ajb.virtual_point(Grouping::InterfaceB, rooms.geometry, self.idms)?,
            ];
            let mut lines = vec![Line::zeros(2 * n, 2 * n); rooms.ajb.frf.lines.len()];
            for (r, out) in vp.iter().enumerate() {
                for (c, input) in vp.iter().enumerate() {
                    for (line, y) in lines.iter_mut().zip(Self::admittance(rooms.ajb, out, input, self.idms)?)
                    {
                        line.view_mut((r * n, c * n), (n, n)).copy_from(&y);
                    }
                }
            }
            Ok(lines)
        });
        found.as_deref().map_err(Clone::clone)
    }

    /// (Y^AJB_cc)⁻¹.
    fn impedance(&self, rooms: &Rooms<'_>) -> Result<&[Line], RefusedReason> {
        let y = self.assembly(rooms)?;
        let found = self.impedance.get_or_init(|| {
            y.par_iter()
                .zip(&rooms.ajb.frf.frequency_hz)
                .map(|(y, &frequency_hz)| {
                    full_rank_inverse(y, ASSEMBLY)
                        .map_err(|lost| RefusedReason::Decoupling { frequency_hz, source: lost.into() })
                })
                .collect()
        });
        found.as_deref().map_err(Clone::clone)
    }

    /// A method without anything to add.
    fn plain(
        &self,
        rooms: &Rooms<'_>,
        solve: impl Fn(usize) -> Result<Line, DecouplingError> + Sync,
    ) -> Solved {
        Ok(Solution { z: self.per_line(rooms, solve)?, notes: Vec::new(), internals: None })
    }

    /// Both forms of Eq. (3) and its sisters: P, Q from the substructures, M from the assembly, at the internals that both have.
    fn internals(&self, rooms: &Rooms<'_>, name: Method, seen: Side, hit: Side, which: Internals) -> Solved {
        let printed = which == Internals::Printed;
        let d = balance(self.idms);
        let alone = |side| match side {
            Side::A => (rooms.a, &self.vp_a),
            Side::B => (rooms.b, &self.vp_b),
        };
        let ((seen_file, seen_vp), (hit_file, hit_vp)) = (alone(seen), alone(hit));
        let (seen_on, hit_on) = (seen.responses(which), hit.impacts(which));
        let (columns, columns_ajb) = shared(&hit_file.inputs(hit_on), &rooms.ajb.inputs(hit_on));
        let (rows, rows_ajb) = shared(&seen_file.outputs(seen_on), &rooms.ajb.outputs(seen_on));
        let q_raw = hit_file.block(&hit_vp.rows, &columns)?;
        let p_raw = seen_file.block(&rows, &seen_vp.columns)?;
        let mut m = rooms.ajb.block(&rows_ajb, &columns_ajb)?;
        if seen == hit {
            // the substructure alone minus the assembly
            for (m, own) in m.iter_mut().zip(seen_file.block(&rows, &columns)?) {
                *m = own - &*m;
            }
        }
        let q = |l: usize| scaled(&reduce_outputs(&hit_vp.responses.t, &q_raw[l]), Some(&d), None);
        let p = |l: usize| scaled(&reduce_inputs(&p_raw[l], &seen_vp.impacts.t), None, Some(&d));
        let mut notes = Vec::new();
        let (n_b, n_a) = m.first().map_or((0, 0), DMatrix::shape);
        let n_c = self.idms.count();
        if n_a.min(n_b) == 0 && !m.is_empty() {
            let source = DecouplingError::TooFewInternals { impacts: n_a, responses: n_b, needed: n_c };
            return Err(RefusedReason::Decoupling { frequency_hz: rooms.ajb.frf.frequency_hz[0], source });
        }
        let middle = m.len() / 2;
        let internals = (!m.is_empty()).then(|| {
            let (p, q) = (p(middle), q(middle));
            InternalsFound {
                method: name,
                idms: n_c,
                impacts: n_a,
                responses: n_b,
                frequency_hz: rooms.ajb.frf.frequency_hz[middle],
                rank_p: rank(&p),
                rank_q: rank(&q),
                condition_p: condition(&p),
                condition_q: condition(&q),
            }
        });
        if printed && !m.is_empty() && (n_a != n_c || n_b != n_c) {
            let rank = observed_rank(&p(0), &q(0));
            notes.push(format!(
                "Eq. 3 as printed with {n_a} internal impacts and {n_b} internal responses for {n_c} interface DoFs: Π has rank {rank} of {n_c}, \
                 so the result is right only for the interface forces that these internals generate, and biased otherwise; `internal` is the exact form"
            ));
        }
        let method = if printed { internal_printed } else { internal };
        let z = self.per_line(rooms, |l| method(&self.y_a[l], &self.y_b[l], &p(l), &m[l], &q(l)))?;
        Ok(Solution { z, notes, internals })
    }

    /// Solves every line and takes the rotations' scale out again: Z = D Z' D.
    fn per_line(
        &self,
        rooms: &Rooms<'_>,
        solve: impl Fn(usize) -> Result<Line, DecouplingError> + Sync,
    ) -> Result<Vec<Line>, RefusedReason> {
        let d = balance(self.idms);
        (0..self.y_a.len())
            .into_par_iter()
            .map(|l| {
                solve(l).map(|z| scaled(&z, Some(&d), Some(&d))).map_err(|source| RefusedReason::Decoupling {
                    frequency_hz: rooms.a.frf.frequency_hz[l],
                    source,
                })
            })
            .collect()
    }
}

/// A substructure.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    A,
    B,
}

/// Which points count as internal.
#[derive(Clone, Copy, PartialEq)]
enum Internals {
    /// All that was measured on the substructure, its interface points too; A's internal responses are spares and stay out.
    All,
    /// Grouping 3 and 4 only, as the paper has them.
    Printed,
}

impl Side {
    fn impacts(self, which: Internals) -> &'static [Grouping] {
        match (self, which) {
            (Side::A, Internals::All) => &[Grouping::InterfaceA, Grouping::InternalA],
            (Side::A, Internals::Printed) => &[Grouping::InternalA],
            (Side::B, Internals::All) => &[Grouping::InterfaceB, Grouping::InternalB],
            (Side::B, Internals::Printed) => &[Grouping::InternalB],
        }
    }

    fn responses(self, which: Internals) -> &'static [Grouping] {
        match (self, which) {
            (Side::A, Internals::All) => &[Grouping::InterfaceA],
            _ => self.impacts(which),
        }
    }
}

/// Those rows (or columns) that both files have, in the order of the first.
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

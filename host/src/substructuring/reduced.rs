//! One IDM set's virtual points with their admittances, and every method solved on them line by line.

use super::consistency::consistency;
use super::decoupling::{
    DecouplingError, InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse,
    observed_rank, primal,
};
use super::geometry::{Geometry, Grouping};
use super::identify::VirtualPointQuality;
use super::idm::IdmSet;
use super::interface_data::{Found, InterfaceError, Measured, VirtualPoint, balance, scaled};
use super::method::Method;
use super::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

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
}

type Solved = Result<(Vec<Line>, Vec<String>), RefusedReason>;

impl Reduced {
    pub(super) fn of(rooms: &Rooms<'_>, idms: IdmSet) -> Result<Reduced, InterfaceError> {
        let vp_a = rooms.a.virtual_point(Grouping::InterfaceA, rooms.geometry, idms)?;
        let vp_b = rooms.b.virtual_point(Grouping::InterfaceB, rooms.geometry, idms)?;
        let y_a = Self::admittance(rooms.a, &vp_a, &vp_a, idms)?;
        let y_b = Self::admittance(rooms.b, &vp_b, &vp_b, idms)?;
        Ok(Reduced { idms, vp_a, vp_b, y_a, y_b })
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
        [("A", rooms.a, &self.vp_a), ("B", rooms.b, &self.vp_b)]
            .into_iter()
            .filter_map(|(substructure, file, vp)| {
                let lines = file.block(&vp.rows, &vp.columns).ok()?;
                Some(VirtualPointQuality {
                    substructure,
                    idms: self.idms.count(),
                    condition_responses: vp.responses.condition,
                    condition_impacts: vp.impacts.condition,
                    channels: vp.rows.names.clone(),
                    impacts: vp.columns.names.clone(),
                    frequency_hz: file.frf.frequency_hz.clone(),
                    consistency: consistency(&lines, &vp.responses, &vp.impacts),
                })
            })
            .collect()
    }

    pub(super) fn solve(&self, rooms: &Rooms<'_>, method: Method) -> Solved {
        match method {
            Method::Internal => self.internals(
                rooms,
                &[Grouping::InterfaceA, Grouping::InternalA],
                &[Grouping::InterfaceB, Grouping::InternalB],
                false,
            ),
            Method::InternalPrinted => {
                self.internals(rooms, &[Grouping::InternalA], &[Grouping::InternalB], true)
            }
            Method::Interface => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| interface(&self.y_a[l], &self.y_b[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::PrimalA => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| primal(PrimalBlock::A, &self.y_a[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::PrimalB => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| primal(PrimalBlock::B, &self.y_b[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::Inverse => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| inverse(InverseBlock::Ab, &y[l])).map(|z| (z, vec![]))
            }
            Method::InverseBa => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| inverse(InverseBlock::Ba, &y[l])).map(|z| (z, vec![]))
            }
        }
    }

    /// Y^AJB_cc: both virtual points of the assembly, A's first.
    fn assembly(&self, rooms: &Rooms<'_>) -> Result<Vec<Line>, InterfaceError> {
        let n = self.idms.count();
        let vp = [
            rooms.ajb.virtual_point(Grouping::InterfaceA, rooms.geometry, self.idms)?,
            rooms.ajb.virtual_point(Grouping::InterfaceB, rooms.geometry, self.idms)?,
        ];
        let mut lines = vec![Line::zeros(2 * n, 2 * n); rooms.ajb.frf.lines.len()];
        for (r, out) in vp.iter().enumerate() {
            for (c, input) in vp.iter().enumerate() {
                for (line, y) in lines.iter_mut().zip(Self::admittance(rooms.ajb, out, input, self.idms)?) {
                    line.view_mut((r * n, c * n), (n, n)).copy_from(&y);
                }
            }
        }
        Ok(lines)
    }

    /// Both forms of Eq. (3): P, Q from the substructures, M from the assembly, at the internals that both have.
    fn internals(
        &self,
        rooms: &Rooms<'_>,
        impacts_on_a: &[Grouping],
        responses_on_b: &[Grouping],
        printed: bool,
    ) -> Solved {
        let d = balance(self.idms);
        let (columns_a, columns_ajb) = shared(&rooms.a.inputs(impacts_on_a), &rooms.ajb.inputs(impacts_on_a));
        let (rows_b, rows_ajb) = shared(&rooms.b.outputs(responses_on_b), &rooms.ajb.outputs(responses_on_b));
        let q_raw = rooms.a.block(&self.vp_a.rows, &columns_a)?;
        let p_raw = rooms.b.block(&rows_b, &self.vp_b.columns)?;
        let m = rooms.ajb.block(&rows_ajb, &columns_ajb)?;
        let q = |l: usize| scaled(&reduce_outputs(&self.vp_a.responses.t, &q_raw[l]), Some(&d), None);
        let p = |l: usize| scaled(&reduce_inputs(&p_raw[l], &self.vp_b.impacts.t), None, Some(&d));
        let mut notes = Vec::new();
        if printed && !m.is_empty() {
            let (n_b, n_a) = m[0].shape();
            let n_c = self.idms.count();
            if n_a.min(n_b) == 0 {
                let source = DecouplingError::TooFewInternals { impacts: n_a, responses: n_b, needed: n_c };
                let frequency_hz = rooms.ajb.frf.frequency_hz[0];
                return Err(RefusedReason::Decoupling { frequency_hz, source });
            }
            if n_a != n_c || n_b != n_c {
                let rank = observed_rank(&p(0), &q(0));
                notes.push(format!(
                    "Eq. 3 as printed with {n_a} internal impacts and {n_b} internal responses for {n_c} interface DoFs: Π has rank {rank} of {n_c}, \
                     so the result is right only for the interface forces that these internals generate, and biased otherwise; `internal` is the exact form"
                ));
            }
        }
        let method = if printed { internal_printed } else { internal };
        let z = self.per_line(rooms, |l| method(&self.y_a[l], &self.y_b[l], &p(l), &m[l], &q(l)))?;
        Ok((z, notes))
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

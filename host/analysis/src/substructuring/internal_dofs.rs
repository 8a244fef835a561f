//! P, Q and M of Eq. (3) and the related rearrangements: the internal points used, and the matrices
//! line by line.

use super::geometry::Grouping;
use super::interface_data::{Balanced, Found, InterfaceError, MeasuredSet, Side};
use super::vpt::reduce_inputs;
use crate::Line;

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

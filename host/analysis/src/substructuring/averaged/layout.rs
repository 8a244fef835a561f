//! Positions of the cells of the assembly's interface, and their reduction to its two virtual
//! points.

use super::Line;
use crate::substructuring::geometry::{Geometry, Point};
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::interface_data::{Found, LocatedVirtualPoint, balance};
use crate::substructuring::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{DMatrix, Vector3};

/// A channel or impact with the data that the propagation needs.
pub(super) struct PlacedPoint {
    pub(super) direction: Vector3<f64>,
    pub(super) offset: Vector3<f64>,
    /// 0 for A's virtual point, 1 for B's.
    pub(super) side: usize,
    /// Index of the sensor: its axes share one error of position.
    pub(super) point: usize,
}

/// The transformations of both virtual points combined, and the places of channels and impacts.
pub(super) struct Layout {
    /// 2n_c × channels and impacts × 2n_c, rotations scaled.
    pub(super) t_u: DMatrix<f64>,
    pub(super) t_f: DMatrix<f64>,
    pub(super) channels: Vec<PlacedPoint>,
    pub(super) impacts: Vec<PlacedPoint>,
    pub(super) points: usize,
    pub(super) translations: Axes,
    pub(super) rotations: Axes,
}

/// Index of the degree of freedom along each axis in the IDM set, and its scale; none if the set
/// does not contain it.
pub(super) type Axes = [Option<(usize, f64)>; 3];

impl Layout {
    pub(super) fn new(
        a: &LocatedVirtualPoint,
        b: &LocatedVirtualPoint,
        rows: &Found,
        columns: &Found,
        geometry: &Geometry,
        idms: IdmSet,
    ) -> Layout {
        let n = idms.count();
        let d = balance(idms);
        let (rows_a, columns_a) = (a.rows.at.len(), a.columns.at.len());
        let t_u = DMatrix::from_fn(2 * n, rows.at.len(), |r, c| match (r < n, c < rows_a) {
            (true, true) => a.responses.t[(r, c)] * d[r],
            (false, false) => b.responses.t[(r - n, c - rows_a)] * d[r - n],
            _ => 0.0,
        });
        let t_f = DMatrix::from_fn(columns.at.len(), 2 * n, |r, c| match (r < columns_a, c < n) {
            (true, true) => a.impacts.t[(r, c)] * d[c],
            (false, false) => b.impacts.t[(r - columns_a, c - n)] * d[c - n],
            _ => 0.0,
        });
        let origins = [geometry.virtual_point_a_m, geometry.virtual_point_b_m].map(Vector3::from);
        let place = |p: &Point, side: usize, point: usize| PlacedPoint {
            direction: p.direction(),
            offset: p.position() - origins[side],
            side,
            point,
        };
        let mut names: Vec<&str> = Vec::new();
        let mut channels = Vec::new();
        for (i, channel) in rows.points.iter().enumerate() {
            let at = names.iter().position(|name| *name == channel.name).unwrap_or(names.len());
            if at == names.len() {
                names.push(&channel.name);
            }
            channels.push(place(channel, usize::from(i >= rows_a), at));
        }
        let impacts = columns
            .points
            .iter()
            .enumerate()
            .map(|(i, impact)| place(impact, usize::from(i >= columns_a), i))
            .collect();
        let axes = |dofs: [Dof; 3]| dofs.map(|dof| idms.position(dof).map(|at| (at, d[at])));
        let translations = axes([Dof::X, Dof::Y, Dof::Z]);
        let rotations = axes([Dof::Rx, Dof::Ry, Dof::Rz]);
        Layout { t_u, t_f, channels, impacts, points: names.len(), translations, rotations }
    }

    /// T_u Y T_f: reduces cells to both virtual points, rotations scaled.
    pub(super) fn reduce(&self, cells: &Line) -> Line {
        reduce_inputs(&reduce_outputs(&self.t_u, cells), &self.t_f)
    }
}

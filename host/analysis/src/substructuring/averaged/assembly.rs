//! The assembly's interface cells: their positions, their receptances and noise over a band, and
//! their reduction to two virtual points.

use super::{AveragedError, Line};
use crate::band::Band;
use crate::frf::Frf;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping, Point};
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::interface_data::{Found, LocatedVirtualPoint, Measured, balance};
use crate::substructuring::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{Complex, DMatrix, Vector3};

/// The assembly's FRFs reduced to its two virtual points, with the data needed to relate an error
/// to its cell.
pub(super) struct Assembly {
    pub(super) frequency_hz: Vec<f64>,
    pub(super) s: Vec<Complex<f64>>,
    /// Interface cells (channels of A then B × impacts on A then B), receptance, m/N.
    pub(super) cells: Vec<Line>,
    /// Variance of the cells' real parts; none where it is not known.
    pub(super) variance: Option<Vec<DMatrix<f64>>>,
    pub(super) layout: Layout,
    /// Names of the cells' rows and columns.
    pub(super) outputs: Vec<String>,
    pub(super) inputs: Vec<String>,
}

impl Assembly {
    pub(super) fn of(
        ajb: &Frf,
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
    ) -> Result<Assembly, AveragedError> {
        let in_band: Vec<usize> = (0..ajb.frequency_hz().len())
            .filter(|&l| ajb.frequency_hz()[l] > 0.0 && band.contains(ajb.frequency_hz()[l]))
            .collect();
        if in_band.is_empty() {
            return Err(AveragedError::EmptyBand { low_hz: band.low_hz, high_hz: band.high_hz });
        }
        let file = Measured { file: Structure::Ajb, frf: ajb, points: &geometry.ajb };
        let a = file.virtual_point(Grouping::InterfaceA, geometry, idms)?;
        let b = file.virtual_point(Grouping::InterfaceB, geometry, idms)?;
        let (rows, columns) = (joined(&a.rows, &b.rows), joined(&a.columns, &b.columns));
        let cut = ajb.band(band.low_hz.max(f64::MIN_POSITIVE), band.high_hz);
        let cells = Measured { frf: &cut, ..file }.block(&rows, &columns)?;
        let order = ajb.quantity().order_of_s();
        let s: Vec<Complex<f64>> = in_band.iter().map(|&l| ajb.s(l)).collect();
        let cells = cells.iter().zip(&s).map(|(y, s)| y * s.powi(-order)).collect();
        let variance = ajb
            .receptance_variance(&in_band, &rows.at, &columns.at)
            // if the variance of one cell is unknown, the whole is unknown: an interval of part of
            // the errors would be useless
            .filter(|v| v.iter().all(|line| line.iter().all(|v| v.is_finite())));
        let frequency_hz = in_band.iter().map(|&l| ajb.frequency_hz()[l]).collect();
        let layout = Layout::new(&a, &b, &rows, &columns, geometry, idms);
        Ok(Assembly { frequency_hz, s, cells, variance, layout, outputs: rows.names, inputs: columns.names })
    }

    /// Mean spacing of the lines, Hz.
    pub(super) fn step_hz(&self) -> f64 {
        let n = self.frequency_hz.len();
        if n < 2 { f64::INFINITY } else { (self.frequency_hz[n - 1] - self.frequency_hz[0]) / (n - 1) as f64 }
    }
}

fn joined(first: &Found, second: &Found) -> Found {
    let both = |a: &[String], b: &[String]| a.iter().chain(b).cloned().collect();
    Found {
        names: both(&first.names, &second.names),
        points: first.points.iter().chain(&second.points).cloned().collect(),
        at: first.at.iter().chain(&second.at).copied().collect(),
    }
}

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

//! The geometry of one cell, nominal or with errors: the response of its sensor to the ports'
//! motions, and the port forces of its hit; and its errors as nuisance parameters.
//!
//! A sensor misplaced by δ measures e·(θ × δ) more, where θ is the rotation of its virtual point; a
//! hit misplaced by δ adds the moment δ × e; a tilted one pushes along another e.

use super::block::{Impact, Ports, ReceptanceBlock, Sensor};
use crate::substructuring::averaged::Priors;
use crate::substructuring::vpt::ROTATION_LENGTH_M;
use nalgebra::{DMatrix, Unit, UnitQuaternion, Vector3};

/// Errors of one cell's geometry: m, m, rad.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellError {
    pub(super) sensor: Vector3<f64>,
    pub(super) impact: [f64; 2],
    pub(super) tilt: [f64; 2],
}

/// One cell with some geometry, as a map from motions and forces of the ports.
pub(super) struct CellGeometry {
    /// Response of the sensor's axes to the output ports: axes × ports.
    pub(super) seen: DMatrix<f64>,
    /// Its derivatives by a shift along x, y and z.
    pub(super) turned: [DMatrix<f64>; 3],
    /// Input ports × 1: the port forces of a unit hit.
    pub(super) pushed: DMatrix<f64>,
    /// Its derivatives by two shifts and two tilts: input ports × 4.
    pub(super) slopes: DMatrix<f64>,
}

impl ReceptanceBlock {
    /// The cell of this sensor and impact with an error of its geometry.
    pub(super) fn cell(&self, sensor: &Sensor, impact: &Impact, error: &CellError) -> CellGeometry {
        let (pushed, slopes) = self.pushed(impact, error);
        CellGeometry {
            seen: self.seen(sensor, error.sensor),
            turned: [0, 1, 2].map(|axis| self.turned(sensor, Vector3::ith(axis, 1.0))),
            pushed,
            slopes,
        }
    }

    /// Response of the sensor's axes to a unit of each output port if it is `shift` away from its
    /// nominal position: axes × ports.
    fn seen(&self, sensor: &Sensor, shift: Vector3<f64>) -> DMatrix<f64> {
        let rows = &self.rows;
        let mut seen = self.turned(sensor, shift);
        for (axis, direction) in sensor.directions.iter().enumerate() {
            match sensor.port {
                Some(port) => seen[(axis, port + axis)] += 1.0,
                None => {
                    self.wrench(*direction, sensor.offset.cross(direction), sensor.side, rows, |at, v| {
                        seen[(axis, at)] += v;
                    });
                }
            }
        }
        seen
    }

    /// The part of it due to a shift: an internal sensor is assumed to be on its side's interface
    /// body.
    fn turned(&self, sensor: &Sensor, shift: Vector3<f64>) -> DMatrix<f64> {
        let rows = &self.rows;
        let mut turned = DMatrix::zeros(sensor.directions.len(), rows.count);
        for (axis, direction) in sensor.directions.iter().enumerate() {
            self.wrench(Vector3::zeros(), shift.cross(direction), sensor.side, rows, |at, v| {
                turned[(axis, at)] += v;
            });
        }
        turned
    }

    /// The port forces of a unit hit with this error of geometry, and their derivatives by two
    /// shifts and two tilts.
    fn pushed(&self, impact: &Impact, error: &CellError) -> (DMatrix<f64>, DMatrix<f64>) {
        let columns = &self.columns;
        let turn: Vector3<f64> = impact.across[0] * error.tilt[0] + impact.across[1] * error.tilt[1];
        let direction = match Unit::try_new(turn, 0.0) {
            Some(axis) => UnitQuaternion::from_axis_angle(&axis, turn.norm()) * impact.direction,
            None => impact.direction,
        };
        let shift: Vector3<f64> = impact.across[0] * error.impact[0] + impact.across[1] * error.impact[1];
        let mut force = DMatrix::zeros(columns.count, 1);
        let put = |to: &mut DMatrix<f64>, column: usize, f: Vector3<f64>, m: Vector3<f64>| {
            self.wrench(f, m, impact.side, columns, |at, v| to[(at, column)] += v);
        };
        match impact.port {
            Some(port) => {
                force[(port, 0)] = 1.0;
                put(&mut force, 0, Vector3::zeros(), shift.cross(&direction));
            }
            None => put(&mut force, 0, direction, (impact.offset + shift).cross(&direction)),
        }
        let mut slopes = DMatrix::zeros(columns.count, 4);
        for (k, across) in impact.across.iter().enumerate() {
            put(&mut slopes, k, Vector3::zeros(), across.cross(&direction));
            let swung = across.cross(&direction);
            put(&mut slopes, 2 + k, swung, (impact.offset + shift).cross(&swung));
        }
        (force, slopes)
    }

    /// Writes a force and a moment (or an axis and its lever arm) to the degrees of freedom of the
    /// IDM set.
    fn wrench(
        &self,
        force: Vector3<f64>,
        moment: Vector3<f64>,
        side: usize,
        ports: &Ports,
        mut put: impl FnMut(usize, f64),
    ) {
        for (at, dof) in self.idms.dofs().iter().enumerate() {
            let axis = *dof as usize % 3;
            let value = if dof.is_rotation() { moment[axis] / ROTATION_LENGTH_M } else { force[axis] };
            put(ports.first[side] + at, value);
        }
    }
}

/// The matrix from the ports' admittance y (column-major) to the derivatives of all cells' values,
/// cell by cell: by three shifts of the sensor, two of the impact, and two tilts. It is real, and
/// the same at every line.
pub(super) fn factors(cells: &[CellGeometry]) -> DMatrix<f64> {
    let (rows, columns) = cells.first().map_or((0, 0), |cell| (cell.seen.ncols(), cell.pushed.nrows()));
    let count: usize =
        cells.iter().map(|cell| cell.seen.nrows() * (cell.turned.len() + cell.slopes.ncols())).sum();
    // transposed, so that the factors of one value are contiguous
    let mut factors = DMatrix::<f64>::zeros(rows * columns, count);
    let mut values = factors.column_iter_mut();
    for cell in cells {
        let by_shift = cell.turned.iter().map(|turned| (turned, cell.pushed.column(0)));
        let by_impact = cell.slopes.column_iter().map(|slope| (&cell.seen, slope));
        for (seen, pushed) in by_shift.chain(by_impact) {
            for (axis, mut own) in (0..seen.nrows()).zip(values.by_ref()) {
                for (own, push) in own.as_mut_slice().chunks_exact_mut(rows.max(1)).zip(pushed.iter()) {
                    own.iter_mut().zip(seen.row(axis).iter()).for_each(|(to, seen)| *to = seen * push);
                }
            }
        }
    }
    factors.transpose()
}

/// Nuisance parameters for the aim of a cell: three of the sensor, two of the impact.
pub(super) const AIMS: usize = 5;

/// All unknown errors of geometry with their priors: the nuisance parameters.
///
/// A sensor's position (three) and an impact's position and tilt (two each) are common to all
/// configurations; each cell has five more for its aim. An internal point's own error cancels
/// between the substructure and the assembly.
pub(super) struct Nuisances {
    /// Standard deviations, m or rad.
    pub(super) std: Vec<f64>,
    sensors: Vec<(String, usize)>,
    impacts: Vec<(String, usize)>,
    /// Index of the first aim error of each block.
    aims: Vec<usize>,
}

/// Indices of one cell's nuisance parameters: sensor's position (3), impact's position and tilt
/// (4), aim (5).
pub(super) struct CellNuisances {
    pub(super) sensor: Option<usize>,
    pub(super) impact: Option<usize>,
    pub(super) aim: usize,
}

impl Nuisances {
    pub(super) fn of(blocks: &[&ReceptanceBlock], priors: &Priors) -> Nuisances {
        let mut n = Nuisances { std: vec![], sensors: vec![], impacts: vec![], aims: vec![] };
        for block in blocks {
            for sensor in block.sensors.iter().filter(|s| !s.internal()) {
                if !n.sensors.iter().any(|(name, _)| *name == sensor.name) {
                    n.sensors.push((sensor.name.clone(), n.std.len()));
                    n.std.extend([priors.position_m; 3]);
                }
            }
            for impact in block.impacts.iter().filter(|i| !i.internal()) {
                if !n.impacts.iter().any(|(name, _)| *name == impact.name) {
                    n.impacts.push((impact.name.clone(), n.std.len()));
                    n.std.extend([priors.position_m; 2]);
                    n.std.extend([priors.hammer_angle_rad; 2]);
                }
            }
        }
        for block in blocks {
            n.aims.push(n.std.len());
            let cells = block.sensors.len() * block.impacts.len();
            n.std.extend(std::iter::repeat_n(priors.aim_m, AIMS * cells));
        }
        n
    }

    /// Index of the first aim error of the assembly, the last block; all later ones are aims at its
    /// cells.
    pub(super) fn of_assembly(&self) -> usize {
        self.aims.last().copied().unwrap_or_default()
    }

    pub(super) fn of_cell(
        &self,
        block: usize,
        of: &ReceptanceBlock,
        sensor: usize,
        impact: usize,
    ) -> CellNuisances {
        let find =
            |all: &[(String, usize)], name: &str| all.iter().find(|(n, _)| n == name).map(|(_, at)| *at);
        CellNuisances {
            sensor: find(&self.sensors, &of.sensors[sensor].name).filter(|_| !of.sensors[sensor].internal()),
            impact: find(&self.impacts, &of.impacts[impact].name).filter(|_| !of.impacts[impact].internal()),
            aim: self.aims[block] + AIMS * (sensor * of.impacts.len() + impact),
        }
    }

    /// The cell's error for nuisance parameters `eta` in standard deviations.
    pub(super) fn error(&self, at: &CellNuisances, eta: &[f64]) -> CellError {
        let value = |i: usize| eta[i] * self.std[i];
        let mut error = CellError {
            sensor: Vector3::from_fn(|k, _| value(at.aim + k)),
            impact: [value(at.aim + 3), value(at.aim + 4)],
            tilt: [0.0; 2],
        };
        if let Some(sensor) = at.sensor {
            error.sensor += Vector3::from_fn(|k, _| value(sensor + k));
        }
        if let Some(impact) = at.impact {
            for k in 0..2 {
                error.impact[k] += value(impact + k);
                error.tilt[k] = value(impact + 2 + k);
            }
        }
        error
    }
}

//! One configuration as input of the fit: cells, their noise, and the geometry of every sensor and
//! impact.
//!
//! Ports are what cells are reduced to: the n_c degrees of freedom of a virtual point (rotations
//! scaled), followed by the internal channels or impacts without change. The assembly's ports are
//! A's and then B's.
//!
//! The geometry of a cell is nominal or has errors: the response of its sensor to the ports'
//! motions, and the port forces of its hit. The errors are nuisance parameters. A sensor misplaced
//! by δ measures e·(θ × δ) more, where θ is the rotation of its virtual point; a hit misplaced by δ
//! adds the moment δ × e; a tilted one pushes along another e.

use super::{FitError, Internals};
use crate::Line;
use crate::band::Band;
use crate::structure::Structure;
use crate::substructuring::averaged::Priors;
use crate::substructuring::geometry::{Geometry, Grouping};
use crate::substructuring::idm::IdmSet;
use crate::substructuring::interface_data::{Found, InterfaceError, Measured, balance};
use crate::substructuring::product::product;
use crate::substructuring::vpt;
use crate::substructuring::vpt::ROTATION_LENGTH_M;
use nalgebra::{DMatrix, Unit, UnitQuaternion, Vector3};

/// The axes of one sensor.
pub(super) struct Sensor {
    pub(super) name: String,
    /// Its channels among the block's rows.
    pub(super) rows: Vec<usize>,
    pub(super) directions: Vec<Vector3<f64>>,
    pub(super) offset: Vector3<f64>,
    pub(super) side: usize,
    /// First port of its channels if it is internal.
    pub(super) port: Option<usize>,
}

/// One impact.
pub(super) struct Impact {
    pub(super) name: String,
    pub(super) direction: Vector3<f64>,
    /// Two directions across it: a shift along the hit, or a rotation about it, has no effect.
    pub(super) across: [Vector3<f64>; 2],
    pub(super) offset: Vector3<f64>,
    pub(super) side: usize,
    pub(super) port: Option<usize>,
}

impl Sensor {
    pub(super) fn internal(&self) -> bool {
        self.port.is_some()
    }
}

impl Impact {
    pub(super) fn internal(&self) -> bool {
        self.port.is_some()
    }
}

/// Positions of virtual points and internals among the ports of a block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ports {
    /// First port of each side's virtual point; a substructure alone has one side.
    pub(super) first: Vec<usize>,
    pub(super) count: usize,
}

/// A configuration's cells over the band as receptances.
pub(super) struct ReceptanceBlock {
    /// Ports × channels, impacts × ports.
    pub(super) t_u: DMatrix<f64>,
    pub(super) t_f: DMatrix<f64>,
    pub(super) cells: Vec<Line>,
    pub(super) variance: Vec<DMatrix<f64>>,
    pub(super) sensors: Vec<Sensor>,
    pub(super) impacts: Vec<Impact>,
    pub(super) rows: Ports,
    pub(super) columns: Ports,
    pub(super) idms: IdmSet,
}

impl ReceptanceBlock {
    /// The lines of the file in `band` with a frequency above 0.
    pub(super) fn lines(file: &Measured<'_>, band: Band) -> Vec<usize> {
        (0..file.frf.frequency_hz().len())
            .filter(|&l| file.frf.frequency_hz()[l] > 0.0 && band.contains(file.frf.frequency_hz()[l]))
            .collect()
    }

    /// The block of `file` with these sides' virtual points and the given internals.
    pub(super) fn of(
        file: &Measured<'_>,
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
        sides: &[Side],
        internals: &Internals,
    ) -> Result<ReceptanceBlock, FitError> {
        let lines = ReceptanceBlock::lines(file, band);
        let mut rows = CollectedAxis::default();
        let mut columns = CollectedAxis::default();
        for side in sides {
            let origin = Vector3::from(match side {
                Side::A => geometry.virtual_point_a_m,
                Side::B => geometry.virtual_point_b_m,
            });
            let (interface, internal) = side.groupings();
            // in the order of `names`, which is the same in every block
            let only = |found: Found, names: &[String]| {
                let kept: Vec<usize> =
                    names.iter().filter_map(|name| found.names.iter().position(|n| n == name)).collect();
                Found {
                    names: kept.iter().map(|&i| found.names[i].clone()).collect(),
                    points: kept.iter().map(|&i| found.points[i].clone()).collect(),
                    at: kept.iter().map(|&i| found.at[i]).collect(),
                }
            };
            let fail = |source| InterfaceError::VirtualPoint {
                substructure: side.structure(),
                file: file.file,
                source,
            };
            let at = file.outputs(&[interface]);
            let t = if at.at.is_empty() {
                None
            } else {
                Some(vpt::responses(&at.points, origin, idms, None).map_err(fail)?.t)
            };
            rows.add(at, t, only(file.outputs(&[internal]), &internals.outputs), origin, idms.count());
            let at = file.inputs(&[interface]);
            let t = if at.at.is_empty() {
                None
            } else {
                Some(vpt::impacts(&at.points, origin, idms, None).map_err(fail)?.t.transpose())
            };
            columns.add(at, t, only(file.inputs(&[internal]), &internals.inputs), origin, idms.count());
        }
        let cells = file.block(&rows.found, &columns.found)?;
        let order = file.frf.quantity().order_of_s();
        let cells = lines.iter().map(|&l| &cells[l] * file.frf.s(l).powi(-order)).collect();
        let (at, to) = (&rows.found.at, &columns.found.at);
        let variance = (file.frf.receptance_variance(&lines, at, to))
            .unwrap_or_else(|| vec![DMatrix::from_element(at.len(), to.len(), f64::NAN); lines.len()]);
        for line in &variance {
            // a cell without noise would get an infinite weight
            if let Some(bad) = line.iter().position(|v| !(v.is_finite() && *v > 0.0)) {
                let (row, column) = (bad % line.nrows(), bad / line.nrows());
                return Err(FitError::NoiseUnknown {
                    file: file.file,
                    output: rows.found.names[row].clone(),
                    input: columns.found.names[column].clone(),
                });
            }
        }
        let d = balance(idms);
        Ok(ReceptanceBlock {
            t_u: rows.transformation(&d),
            t_f: columns.transformation(&d).transpose(),
            cells,
            variance,
            sensors: rows.sensors(),
            impacts: columns.impacts(),
            rows: rows.ports(),
            columns: columns.ports(),
            idms,
        })
    }

    /// T_u Y T_f of a line.
    pub(super) fn reduce(&self, cells: &Line) -> Line {
        product(&product(&self.t_u, cells), &self.t_f)
    }
}

/// A or B.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    A,
    B,
}

impl Side {
    fn structure(self) -> Structure {
        match self {
            Side::A => Structure::A,
            Side::B => Structure::B,
        }
    }

    pub(super) fn groupings(self) -> (Grouping, Grouping) {
        match self {
            Side::A => (Grouping::InterfaceA, Grouping::InternalA),
            Side::B => (Grouping::InterfaceB, Grouping::InternalB),
        }
    }
}

/// Rows or columns while they are collected.
#[derive(Default)]
struct CollectedAxis {
    found: Found,
    /// Per point: its side and, for an internal one, its port.
    places: Vec<(usize, Option<usize>)>,
    origins: Vec<Vector3<f64>>,
    /// Per side: its first port, its first point, and T of its virtual point.
    sides: Vec<(usize, usize, Option<DMatrix<f64>>)>,
    ports: usize,
}

impl CollectedAxis {
    fn add(
        &mut self,
        interface: Found,
        t: Option<DMatrix<f64>>,
        internal: Found,
        origin: Vector3<f64>,
        modes: usize,
    ) {
        let side = self.sides.len();
        self.sides.push((self.ports, self.found.at.len(), t));
        self.origins.push(origin);
        self.places.extend(interface.at.iter().map(|_| (side, None)));
        let first = self.ports + modes;
        self.places.extend((0..internal.at.len()).map(|i| (side, Some(first + i))));
        self.ports = first + internal.at.len();
        for found in [interface, internal] {
            self.found.names.extend(found.names);
            self.found.points.extend(found.points);
            self.found.at.extend(found.at);
        }
    }

    fn ports(&self) -> Ports {
        Ports { first: self.sides.iter().map(|s| s.0).collect(), count: self.ports }
    }

    /// Ports × points; a row of zeros where a virtual point was not measured.
    fn transformation(&self, balance: &[f64]) -> DMatrix<f64> {
        let mut t = DMatrix::zeros(self.ports, self.found.at.len());
        for (port, point, virtual_point) in &self.sides {
            if let Some(v) = virtual_point {
                for (r, scale) in balance.iter().enumerate() {
                    for c in 0..v.ncols() {
                        t[(port + r, point + c)] = scale * v[(r, c)];
                    }
                }
            }
        }
        for (point, (_, port)) in self.places.iter().enumerate() {
            if let Some(port) = port {
                t[(*port, point)] = 1.0;
            }
        }
        t
    }

    fn sensors(&self) -> Vec<Sensor> {
        let mut sensors: Vec<Sensor> = Vec::new();
        for (row, (point, (side, port))) in self.found.points.iter().zip(&self.places).enumerate() {
            match sensors.last_mut().filter(|s| s.name == point.name) {
                Some(sensor) => {
                    sensor.rows.push(row);
                    sensor.directions.push(point.direction());
                }
                None => sensors.push(Sensor {
                    name: point.name.clone(),
                    rows: vec![row],
                    directions: vec![point.direction()],
                    offset: point.position() - self.origins[*side],
                    side: *side,
                    port: *port,
                }),
            }
        }
        sensors
    }

    fn impacts(&self) -> Vec<Impact> {
        (self.found.points.iter().zip(&self.places))
            .map(|(point, (side, port))| {
                let direction = point.direction();
                let least = direction.iamin();
                let first = direction.cross(&Vector3::ith(least, 1.0)).normalize();
                Impact {
                    name: point.name.clone(),
                    direction,
                    across: [first, direction.cross(&first)],
                    offset: point.position() - self.origins[*side],
                    side: *side,
                    port: *port,
                }
            })
            .collect()
    }
}

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

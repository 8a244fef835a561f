//! One configuration as input of the fit: cells, their noise, and the geometry of every sensor and
//! impact.
//!
//! Ports are what cells are reduced to: the n_c degrees of freedom of a virtual point (rotations
//! scaled), followed by the internal channels or impacts without change. The assembly's ports are
//! A's and then B's.

use super::{FitError, Internals};
use crate::Line;
use crate::band::Band;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping};
use crate::substructuring::idm::IdmSet;
use crate::substructuring::interface_data::{Found, InterfaceError, Measured, balance};
use crate::substructuring::product::product;
use crate::substructuring::vpt;
use nalgebra::{DMatrix, Vector3};

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

//! The data at the interface: the rows and columns of the three FRF files that virtual points and
//! internals use, the three measurements with their geometry, and a virtual point in one of them.

use super::geometry::{Configuration, Geometry, Grouping, Point};
use super::idm::IdmSet;
use super::product::product_of_block;
use super::vpt;
use super::vpt::{ROTATION_LENGTH_M, Transformation, VptError, reduce_inputs};
use crate::Line;
use crate::frf::{Frf, FrfError, block};
use crate::structure::Structure;
use nalgebra::{Complex, DMatrix, DVector, Vector3};

/// The reason why the data of an interface cannot be formed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InterfaceError {
    /// The virtual point cannot be formed.
    #[error("virtual point of {substructure} in {file}: {source}")]
    VirtualPoint {
        /// `A` or `B`.
        substructure: Structure,
        /// Which FRF file.
        file: Structure,
        /// Why.
        source: VptError,
    },
    /// None of the geometry's points for it are in the file.
    #[error(
        "virtual point of {substructure}: {file} has none of its {kind} ({wanted}); the file has: {available}. Names must agree between geometry and file"
    )]
    NoPoints {
        /// `A` or `B`.
        substructure: Structure,
        /// Which FRF file.
        file: Structure,
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Their names in the geometry.
        wanted: String,
        /// Names in the file.
        available: String,
    },
    /// The selected cells contain a NaN.
    #[error("{file}: {source}")]
    Frf {
        /// Which FRF file.
        file: Structure,
        /// Why.
        source: FrfError,
    },
}

/// Points of the geometry that an FRF file contains, with their indices in it.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) names: Vec<String>,
    pub(crate) points: Vec<Point>,
    pub(crate) at: Vec<usize>,
}

/// The rows (or columns) of `available` whose row in the geometry has one of these groupings, in
/// the geometry's order.
pub(crate) fn found(
    points: &[Point],
    names: &[String],
    groupings: &[Grouping],
    available: &[String],
) -> Found {
    let mut found = Found { names: Vec::new(), points: Vec::new(), at: Vec::new() };
    for (point, name) in points.iter().zip(names) {
        if !groupings.contains(&point.grouping) {
            continue;
        }
        if let Some(at) = available.iter().position(|a| a == name) {
            found.names.push(name.clone());
            found.points.push(point.clone());
            found.at.push(at);
        }
    }
    found
}

/// A virtual point in one file: its rows and columns, and both transformations.
pub(crate) struct LocatedVirtualPoint {
    pub(crate) rows: Found,
    pub(crate) columns: Found,
    pub(crate) responses: Transformation,
    pub(crate) impacts: Transformation,
}

/// One of the three files, with its FRFs and points.
#[derive(Clone, Copy)]
pub(crate) struct Measured<'a> {
    pub(crate) file: Structure,
    pub(crate) frf: &'a Frf,
    pub(crate) points: &'a Configuration,
}

impl Measured<'_> {
    pub(crate) fn outputs(&self, groupings: &[Grouping]) -> Found {
        found(&self.points.channels, &self.points.output_names(), groupings, self.frf.outputs())
    }

    pub(crate) fn inputs(&self, groupings: &[Grouping]) -> Found {
        found(&self.points.impacts, &self.points.input_names(), groupings, self.frf.inputs())
    }

    pub(crate) fn virtual_point(
        &self,
        grouping: Grouping,
        geometry: &Geometry,
        idms: IdmSet,
    ) -> Result<LocatedVirtualPoint, InterfaceError> {
        let (substructure, origin) = match grouping {
            Grouping::InterfaceA | Grouping::InternalA | Grouping::SpecimenA => {
                (Structure::A, geometry.virtual_point_a_m)
            }
            Grouping::InterfaceB | Grouping::InternalB | Grouping::SpecimenB => {
                (Structure::B, geometry.virtual_point_b_m)
            }
        };
        let origin = Vector3::from(origin);
        let fail = |source| InterfaceError::VirtualPoint { substructure, file: self.file, source };
        let rows = self.outputs(&[grouping]);
        let columns = self.inputs(&[grouping]);
        let lost = |kind, points: &[Point], names: Vec<String>, available: &[String]| {
            let wanted: Vec<String> =
                points.iter().zip(names).filter(|(p, _)| p.grouping == grouping).map(|(_, n)| n).collect();
            let (wanted, available) = (wanted.join(", "), available.join(", "));
            InterfaceError::NoPoints { substructure, file: self.file, kind, wanted, available }
        };
        if rows.at.is_empty() {
            return Err(lost(
                "responses",
                &self.points.channels,
                self.points.output_names(),
                self.frf.outputs(),
            ));
        }
        if columns.at.is_empty() {
            return Err(lost("impacts", &self.points.impacts, self.points.input_names(), self.frf.inputs()));
        }
        let responses = vpt::responses(&rows.points, origin, idms, None).map_err(fail)?;
        let impacts = vpt::impacts(&columns.points, origin, idms, None).map_err(fail)?;
        Ok(LocatedVirtualPoint { rows, columns, responses, impacts })
    }

    /// The given block of every line; refuses values that are not finite.
    pub(crate) fn block(&self, rows: &Found, columns: &Found) -> Result<Vec<Line>, InterfaceError> {
        (0..self.frf.lines().len()).map(|l| self.cells(l, rows, columns)).collect()
    }

    /// The given block of one line; refuses values that are not finite.
    pub(crate) fn cells(&self, line: usize, rows: &Found, columns: &Found) -> Result<Line, InterfaceError> {
        let y = block(&self.frf.lines()[line], &rows.at, &columns.at);
        if finite(&y) { Ok(y) } else { Err(self.not_finite(line, rows, columns)) }
    }

    /// T times the given block of one line; refuses values that are not finite.
    pub(crate) fn reduced_outputs(
        &self,
        line: usize,
        t: &DMatrix<f64>,
        rows: &Found,
        columns: &Found,
    ) -> Result<Line, InterfaceError> {
        let reduced = product_of_block(t, &self.frf.lines()[line], &rows.at, &columns.at);
        // every value enters some sum, and NaN or infinity times 0 is NaN
        if finite(&reduced) { Ok(reduced) } else { Err(self.not_finite(line, rows, columns)) }
    }

    /// The refusal, naming the first cell of the block that is not finite.
    fn not_finite(&self, line: usize, rows: &Found, columns: &Found) -> InterfaceError {
        let y = block(&self.frf.lines()[line], &rows.at, &columns.at);
        // storage is column-major
        let bad = y.iter().position(|v| !v.is_finite()).unwrap_or_default();
        let source = FrfError::NotFinite {
            output: rows.names[bad % y.nrows()].clone(),
            input: columns.names[bad / y.nrows()].clone(),
            frequency_hz: self.frf.frequency_hz()[line],
        };
        InterfaceError::Frf { file: self.file, source }
    }
}

/// Whether all values are finite; checking all of them is faster than an early exit.
fn finite(y: &Line) -> bool {
    y.as_slice().iter().fold(true, |all, v| all & v.is_finite())
}

/// 1 for translations, the scaling length for rotations (its square for modes that grow with the
/// square): all entries of D Y D are in m/N.
pub(crate) fn balance(idms: IdmSet) -> Vec<f64> {
    idms.dofs().iter().map(|d| ROTATION_LENGTH_M.powi(d.power_of_length())).collect()
}

/// factor diag(d) Z diag(d).
pub(crate) fn scaled(mut z: Line, d: &[f64], factor: Complex<f64>) -> Line {
    for (column, right) in z.as_mut_slice().chunks_exact_mut(d.len().max(1)).zip(d) {
        let factor = factor * right;
        column.iter_mut().zip(d).for_each(|(z, left)| *z = *z * factor * left);
    }
    z
}

/// A substructure.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Side {
    A,
    B,
}

/// The three measurements and the geometry.
pub(super) struct MeasuredSet<'a> {
    pub(super) a: Measured<'a>,
    pub(super) b: Measured<'a>,
    pub(super) ajb: Measured<'a>,
    pub(super) geometry: &'a Geometry,
}

impl<'a> MeasuredSet<'a> {
    /// The file of one substructure alone.
    pub(super) fn alone(&self, side: Side) -> Measured<'a> {
        match side {
            Side::A => self.a,
            Side::B => self.b,
        }
    }
}

/// A virtual point in one file with its rotations in metres: T_u and T_f between measured points
/// and D u, D⁻¹ f.
pub(super) struct Balanced {
    pub(super) vp: LocatedVirtualPoint,
    pub(super) t_u: DMatrix<f64>,
    pub(super) t_f: DMatrix<f64>,
}

impl Balanced {
    pub(super) fn of(
        file: Measured<'_>,
        grouping: Grouping,
        geometry: &Geometry,
        idms: IdmSet,
    ) -> Result<Balanced, InterfaceError> {
        let vp = file.virtual_point(grouping, geometry, idms)?;
        let d = DMatrix::from_diagonal(&DVector::from_vec(balance(idms)));
        let (t_u, t_f) = (&d * &vp.responses.t, &vp.impacts.t * &d);
        Ok(Balanced { vp, t_u, t_f })
    }

    /// T_u Y T_f of one line, with responses at this virtual point and forces at the other.
    pub(super) fn admittance(
        &self,
        file: Measured<'_>,
        line: usize,
        input: &Balanced,
    ) -> Result<Line, InterfaceError> {
        let motions = file.reduced_outputs(line, &self.t_u, &self.vp.rows, &input.vp.columns)?;
        Ok(reduce_inputs(&motions, &input.t_f))
    }
}

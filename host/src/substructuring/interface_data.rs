//! Which rows and columns of the three FRF files a virtual point and the internals take, and the reduced blocks.

use super::frf::{FrfError, FrfMatrix, block};
use super::geometry::{Configuration, Geometry, Grouping, Point};
use super::idm::IdmSet;
use super::vpt::{self, ROTATION_LENGTH_M, Transformation, VptError};
use nalgebra::{Complex, DMatrix, Vector3};

type Lines = Vec<DMatrix<Complex<f64>>>;

/// Why the data of an interface cannot be formed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InterfaceError {
    /// The virtual point cannot be formed.
    #[error("virtual point of {substructure} in {file}: {source}")]
    VirtualPoint {
        /// `A` or `B`.
        substructure: &'static str,
        /// Which FRF file.
        file: &'static str,
        /// Why.
        source: VptError,
    },
    /// The geometry's points for it are not in the file at all.
    #[error(
        "virtual point of {substructure}: {file} has none of its {kind} ({wanted}); the file has: {available}. Names must agree between geometry and file"
    )]
    NoPoints {
        /// `A` or `B`.
        substructure: &'static str,
        /// Which FRF file.
        file: &'static str,
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Names the geometry gives them.
        wanted: String,
        /// Names in the file.
        available: String,
    },
    /// The chosen cells hold a NaN.
    #[error("{file}: {source}")]
    Frf {
        /// Which FRF file.
        file: &'static str,
        /// Why.
        source: FrfError,
    },
}

/// Points of the geometry that an FRF file really has, with their places in it.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) names: Vec<String>,
    pub(crate) points: Vec<Point>,
    pub(crate) at: Vec<usize>,
}

/// The rows (or columns) of `available` whose geometry line has one of these groupings, in the geometry's order.
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

/// A virtual point in one file: the rows and columns it is made of, and both transformations.
pub(crate) struct VirtualPoint {
    pub(crate) rows: Found,
    pub(crate) columns: Found,
    pub(crate) responses: Transformation,
    pub(crate) impacts: Transformation,
}

/// Which file of the three, with what it holds.
#[derive(Clone, Copy)]
pub(crate) struct Measured<'a> {
    pub(crate) file: &'static str,
    pub(crate) frf: &'a FrfMatrix,
    pub(crate) points: &'a Configuration,
}

impl Measured<'_> {
    pub(crate) fn outputs(&self, groupings: &[Grouping]) -> Found {
        found(&self.points.channels, &self.points.output_names(), groupings, &self.frf.outputs)
    }

    pub(crate) fn inputs(&self, groupings: &[Grouping]) -> Found {
        found(&self.points.impacts, &self.points.input_names(), groupings, &self.frf.inputs)
    }

    pub(crate) fn virtual_point(
        &self,
        grouping: Grouping,
        geometry: &Geometry,
        idms: IdmSet,
    ) -> Result<VirtualPoint, InterfaceError> {
        let (substructure, origin) = match grouping {
            Grouping::InterfaceA | Grouping::InternalA => ("A", geometry.virtual_point_a_m),
            Grouping::InterfaceB | Grouping::InternalB => ("B", geometry.virtual_point_b_m),
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
                &self.frf.outputs,
            ));
        }
        if columns.at.is_empty() {
            return Err(lost("impacts", &self.points.impacts, self.points.input_names(), &self.frf.inputs));
        }
        let responses = vpt::responses(&rows.points, origin, idms, None).map_err(fail)?;
        let impacts = vpt::impacts(&columns.points, origin, idms, None).map_err(fail)?;
        Ok(VirtualPoint { rows, columns, responses, impacts })
    }

    /// The named block of every line, refusing values that are not numbers.
    pub(crate) fn block(&self, rows: &Found, columns: &Found) -> Result<Lines, InterfaceError> {
        let lines: Lines = self.frf.lines.iter().map(|y| block(y, &rows.at, &columns.at)).collect();
        for (y, &frequency_hz) in lines.iter().zip(&self.frf.frequency_hz) {
            if let Some(bad) = y.iter().position(|v| !(v.re.is_finite() && v.im.is_finite())) {
                // storage is by columns
                let (row, column) = (bad % y.nrows(), bad / y.nrows());
                let source = FrfError::NotFinite {
                    output: rows.names[row].clone(),
                    input: columns.names[column].clone(),
                    frequency_hz,
                };
                return Err(InterfaceError::Frf { file: self.file, source });
            }
        }
        Ok(lines)
    }
}

/// 1 for translations, the scaling length for rotations (its square for modes that grow so): after D Y D all entries are m/N.
pub(crate) fn balance(idms: IdmSet) -> Vec<f64> {
    idms.dofs().iter().map(|d| ROTATION_LENGTH_M.powi(d.power_of_length())).collect()
}

/// diag(left) Y diag(right), with 1 where a side is not given.
pub(crate) fn scaled(
    y: &DMatrix<Complex<f64>>,
    left: Option<&[f64]>,
    right: Option<&[f64]>,
) -> DMatrix<Complex<f64>> {
    DMatrix::from_fn(y.nrows(), y.ncols(), |r, c| {
        y[(r, c)] * left.map_or(1.0, |l| l[r]) * right.map_or(1.0, |s| s[c])
    })
}

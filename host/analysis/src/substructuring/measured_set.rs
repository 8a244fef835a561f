//! The three measurements with their geometry, and a virtual point in one of them.

use super::geometry::{Geometry, Grouping};
use super::idm::IdmSet;
use super::interface_data::{InterfaceError, LocatedVirtualPoint, Measured, balance};
use super::vpt::reduce_inputs;
use nalgebra::{Complex, DMatrix, DVector};

type Line = DMatrix<Complex<f64>>;

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

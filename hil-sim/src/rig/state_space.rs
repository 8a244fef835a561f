//! The structure as x' = A x + b f, in coordinates in which all numbers have similar magnitude.
//!
//! Rotations in rad and translations in m make matrices whose entries span ten decades. Here η are
//! the undamped modes' coordinates (M-orthonormal), and x = (d η, η') with d the undamped
//! frequencies, so that A is skew-symmetric except for the damping and |x|²/2 is the mechanical
//! energy in joules. Both steppers work on it.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::RigError;
use super::structure::Structure;

/// Undamped frequencies below this fraction of the highest are replaced by it for scaling (a free
/// body has 0 rad/s).
const SOFTEST: f64 = 1e-6;

/// x' = A x + b f with 2n states.
#[derive(Debug, Clone)]
pub struct StateSpace {
    /// A (1/s), 2n × 2n.
    pub a: DMatrix<f64>,
    shapes: DMatrix<f64>,
    scale: DVector<f64>,
    frequencies: DVector<f64>,
}

impl StateSpace {
    /// From M, C and K.
    ///
    /// # Errors
    /// [`RigError::Structure`] if M is not positive definite or the undamped modes do not converge.
    pub fn new(structure: &Structure) -> Result<Self, RigError> {
        let fail = |what| RigError::Structure { configuration: structure.configuration(), what };
        let n = structure.order();
        let factor =
            structure.mass.clone().cholesky().ok_or(fail("the mass matrix is not positive definite"))?;
        let inverse = factor
            .l()
            .solve_lower_triangular(&DMatrix::identity(n, n))
            .ok_or(fail("the mass matrix has no inverse"))?;
        let symmetric = |matrix: &DMatrix<f64>| {
            let reduced = &inverse * matrix * inverse.transpose();
            (&reduced + reduced.transpose()) * 0.5
        };
        let eigen = SymmetricEigen::try_new(symmetric(&structure.stiffness), f64::EPSILON, 10_000)
            .ok_or(fail("the undamped modes do not converge"))?;
        let shapes = inverse.transpose() * &eigen.eigenvectors;
        let damping = shapes.transpose() * &structure.damping * &shapes;
        let frequencies = eigen.eigenvalues.map(|square| square.max(0.0).sqrt());
        let softest = SOFTEST * frequencies.max();
        // A completely free structure has only zero frequencies; then any positive scale works.
        let scale = frequencies.map(|omega| if softest > 0.0 { omega.max(softest) } else { 1.0 });
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        for i in 0..n {
            a[(i, n + i)] = scale[i];
            a[(n + i, i)] = -frequencies[i] * frequencies[i] / scale[i];
        }
        let symmetric_damping = (&damping + damping.transpose()) * 0.5;
        a.view_mut((n, n), (n, n)).copy_from(&-symmetric_damping);
        Ok(Self { a, shapes, scale, frequencies })
    }

    /// Number of states, 2n.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// Undamped circular frequencies (rad/s), from K and M alone, in the order of the states.
    pub fn undamped_rad_s(&self) -> &DVector<f64> {
        &self.frequencies
    }

    /// Row (2n) for the displacement along the row `seen` (n) of the structure.
    pub fn displacement(&self, seen: &DVector<f64>) -> DVector<f64> {
        let n = self.scale.len();
        let modal = self.shapes.tr_mul(seen);
        DVector::from_fn(2 * n, |i, _| if i < n { modal[i] / self.scale[i] } else { 0.0 })
    }

    /// Row (2n) for the velocity along the row `seen` (n) of the structure.
    pub fn velocity(&self, seen: &DVector<f64>) -> DVector<f64> {
        let n = self.scale.len();
        let modal = self.shapes.tr_mul(seen);
        DVector::from_fn(2 * n, |i, _| if i < n { 0.0 } else { modal[i - n] })
    }

    /// Column b (2n) of a force along the row `pushed` (n) of the structure.
    pub fn input(&self, pushed: &DVector<f64>) -> DVector<f64> {
        self.velocity(pushed)
    }

    /// Mechanical energy (J) of the state `x` (2n).
    pub fn energy_j(&self, x: &DVector<f64>) -> f64 {
        let n = self.scale.len();
        let potential: f64 = (0..n).map(|i| x[i] * self.frequencies[i] / self.scale[i]).map(|e| e * e).sum();
        let kinetic: f64 = (n..2 * n).map(|i| x[i] * x[i]).sum();
        0.5 * (potential + kinetic)
    }
}

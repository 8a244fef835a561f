//! Regressions with noisy regressors: which part of an information matrix is only due to noise.
//!
//! With J the information formed from noisy regressors and N the mean contribution of their noise
//! to it, the curvature is J − N and the slope at the true value scatters by J: the estimate's
//! covariance is (J − N)⁻¹ J (J − N)⁻¹. In units in which J is the identity, the eigenvalues of N
//! are from 0 to about 1: the fraction of the information along each axis that is due to noise.
//! Sums of finitely many lines scatter, so J − N itself need not be positive.

use nalgebra::{DMatrix, DVector};

/// Entries below the square of the rounding error are set to zero.
const NOTHING: f64 = f64::EPSILON * f64::EPSILON;

/// The axes of the information matrix and the fraction of information along each that is due to
/// noise.
#[derive(Debug, Clone)]
pub struct NoiseInflation {
    /// Columns x with xᵀ J x = 1.
    axes: DMatrix<f64>,
    /// xᵀ N x for each column.
    fraction: DVector<f64>,
}

impl NoiseInflation {
    /// From J and N, both n × n and symmetric; `None` if J is not positive, or if either contains
    /// values that are not finite.
    pub fn of(information: DMatrix<f64>, noise: &DMatrix<f64>) -> Option<Self> {
        let root = information.cholesky()?.l();
        let half = root.solve_lower_triangular(noise)?;
        let mut fractions = root.solve_lower_triangular(&half.transpose())?;
        // entries below any rounding error; their squares underflow, and with them the lengths that
        // the eigensolver divides by
        fractions.apply(|entry| {
            if entry.abs() < NOTHING {
                *entry = 0.0;
            }
        });
        let found = fractions.symmetric_eigen();
        let axes = root.transpose().solve_upper_triangular(&found.eigenvectors)?;
        let numbers = axes.iter().chain(found.eigenvalues.iter()).all(|v| v.is_finite());
        numbers.then_some(NoiseInflation { axes, fraction: found.eigenvalues })
    }

    /// Σ weight(fraction) x xᵀ over the axes: with 1/(1 − f) the inverse of J − N, with 1/(1 − f)²
    /// the estimate's covariance.
    pub fn weighed(&self, weight: impl Fn(f64) -> f64) -> DMatrix<f64> {
        &self.axes * DMatrix::from_diagonal(&self.fraction.map(weight)) * self.axes.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_exactly_does_not_break_the_rest() {
        // the last parameter is known so precisely that, in its own units, the square of any noise
        // contribution underflows
        let mut noise = DMatrix::from_diagonal_element(3, 3, 0.25);
        noise.row_mut(2).fill(1e-170);
        noise.column_mut(2).fill(1e-170);
        noise[(2, 0)] = 1e-200;
        noise[(0, 2)] = 1e-200;
        let noise_inflation = NoiseInflation::of(DMatrix::identity(3, 3), &noise).expect("positive");
        let inverse = noise_inflation.weighed(|f| 1.0 / (1.0 - f));
        let expected = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0 / 3.0, 4.0 / 3.0, 1.0]));
        assert!((inverse - expected).norm() < 1e-12);
        assert!(
            NoiseInflation::of(DMatrix::identity(2, 2), &DMatrix::from_element(2, 2, f64::NAN)).is_none()
        );
    }

    #[test]
    fn the_weights_give_the_matrices_they_are_said_to() {
        let root =
            DMatrix::from_fn(7, 7, |r, c| ((r * 5 + c * 3) % 11) as f64 / 11.0 + f64::from(u8::from(r == c)));
        let information = &root * root.transpose();
        let part = root.columns(0, 3);
        let noise = part * part.transpose() * 0.4;
        let noise_inflation = NoiseInflation::of(information.clone(), &noise).expect("positive");
        let inverse = (&information - &noise).try_inverse().expect("regular");
        let covariance = &inverse * &information * &inverse;
        // rounding: the condition number is below 1e4
        let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).norm() < 1e-10 * b.norm();
        assert!(near(&noise_inflation.weighed(|f| 1.0 / (1.0 - f)), &inverse));
        assert!(near(&noise_inflation.weighed(|f| (1.0 - f).powi(-2)), &covariance));
    }
}

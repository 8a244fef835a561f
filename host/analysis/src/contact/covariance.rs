//! Uncertainty of the parameters when the motion itself is known from noisy signals only.

use super::ContactError;
use super::bins::{Bin, summed};
use super::block::Block;
use super::line::Normal;
use crate::errors_in_variables::Feigned;
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector};

/// Relative regularisation, which keeps a parameter without any information finite.
pub const REGULAR: f64 = 1e-13;
/// Upper limit of the fraction of information that is attributed to noise. The sums over so few
/// lines scatter themselves, so that a larger fraction is not significant.
const MOSTLY_NOISE: f64 = 0.8;

/// Response of the parameters to data and priors, and their covariance.
#[derive(Debug, Clone)]
pub struct Certainty {
    /// Response to measured data and priors: half the inverse of the posterior's curvature.
    pub answer: DMatrix<f64>,
    /// Covariance of the parameters, without any factor for misfit.
    pub covariance: DMatrix<f64>,
}

/// Scale of each parameter. Metres and kilograms occur together: only the scaled matrix can be
/// factorised.
pub fn units(information: &DMatrix<f64>) -> DVector<f64> {
    information.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 })
}

/// `matrix` in these scales.
pub fn scaled(matrix: &DMatrix<f64>, unit: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(unit.len(), unit.len(), |i, j| matrix[(i, j)] * unit[i] * unit[j])
}

/// Certainty of the most likely parameters `p`, whose `information` includes the contribution of
/// noise.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the information matrix is not positive definite.
pub fn certainty(
    blocks: &[Block],
    bins: &[Bin],
    p: &[f64],
    information: &DMatrix<f64>,
    shared: f64,
) -> Result<Certainty, ContactError> {
    let of_noise: Vec<(usize, Normal)> =
        bins.par_iter().map(|bin| (bin.block, of_noise(blocks, bin, p))).collect();
    let (noise, _) = summed(blocks, of_noise.iter().map(|(block, normal)| (*block, normal)), p.len(), shared);
    let unit = units(information);
    let regular = scaled(information, &unit) + DMatrix::identity(unit.len(), unit.len()) * REGULAR;
    let feigned = Feigned::of(regular, &scaled(&noise, &unit)).ok_or_else(ContactError::no_force)?;
    let inverse = |power: i32| {
        let weight = |of_noise: f64| (1.0 - of_noise.clamp(0.0, MOSTLY_NOISE)).powi(-power);
        // the information is half of the curvature
        scaled(&(0.5 * feigned.weighed(weight)), &unit)
    };
    Ok(Certainty { answer: inverse(1), covariance: inverse(2) })
}

fn of_noise(blocks: &[Block], bin: &Bin, p: &[f64]) -> Normal {
    let block = &blocks[bin.block];
    let mut normal = Normal::none(block.parameters.len());
    for residual in &bin.residuals {
        normal.add_of_noise(block, residual.line, p);
    }
    normal
}

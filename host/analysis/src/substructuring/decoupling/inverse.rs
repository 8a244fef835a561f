//! Eq. (A.1): inverse substructuring.

use super::super::pseudo_inverse::full_rank_inverse;
use super::{ASSEMBLY, DecouplingError};
use nalgebra::{Complex, DMatrix};

/// The off-diagonal block of Eq. (A.1) that is used. For exact data of a reciprocal structure they
/// are equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InverseBlock {
    /// c(A), c(B).
    Ab,
    /// c(B), c(A).
    Ba,
}

/// Z^J = minus an off-diagonal block of (Y^AJB_cc)⁻¹. Needs neither Y^A nor Y^B, so it does not
/// depend on changes of A between configurations. `y_ajb` is 2n_c × 2n_c, A's virtual point first.
///
/// Implements Eq. (A.1).
///
/// # Errors
/// Y^AJB_cc is singular.
pub fn inverse(
    block: InverseBlock,
    y_ajb: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    Ok(inverse_of(block, &full_rank_inverse(y_ajb, ASSEMBLY)?))
}

/// The same from a given (Y^AJB_cc)⁻¹.
pub fn inverse_of(block: InverseBlock, z_ajb: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    let n = z_ajb.nrows() / 2;
    let at = match block {
        InverseBlock::Ab => (0, n),
        InverseBlock::Ba => (n, 0),
    };
    z_ajb.view(at, (n, n)).map(|z| -z)
}

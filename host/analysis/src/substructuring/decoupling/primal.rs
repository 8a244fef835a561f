//! Eq. (A.2): primal decoupling.

use super::super::pseudo_inverse::full_rank_inverse;
use super::{ASSEMBLY, DecouplingError, SUBSTRUCTURE};
use nalgebra::{Complex, DMatrix};

/// The diagonal block of Eq. (A.2) that is used. (The off-diagonal ones are Eq. (A.1) again.)
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PrimalBlock {
    /// c(A), c(A): needs Y^A only.
    A,
    /// c(B), c(B): needs Y^B only, so a clamp that changes A between configurations does not affect
    /// it.
    B,
}

/// Z^J = Z^AJB_SS − Z^S.
///
/// Implements Eq. (A.2), one diagonal block; the printed lower-right subscript is a misprint.
///
/// `y_s` is the admittance of the substructure of that block (n_c × n_c), `y_ajb` 2n_c × 2n_c, A's
/// virtual point first.
///
/// # Errors
/// Y^AJB or Y^S is singular.
pub fn primal(
    block: PrimalBlock,
    y_s: &DMatrix<Complex<f64>>,
    y_ajb: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    primal_of(block, y_s, &full_rank_inverse(y_ajb, ASSEMBLY)?)
}

/// The same from a given (Y^AJB_cc)⁻¹.
///
/// # Errors
/// Y^S is singular.
pub fn primal_of(
    block: PrimalBlock,
    y_s: &DMatrix<Complex<f64>>,
    z_ajb: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    let n = y_s.nrows();
    let at = match block {
        PrimalBlock::A => 0,
        PrimalBlock::B => n,
    };
    Ok(z_ajb.view((at, at), (n, n)) - full_rank_inverse(y_s, SUBSTRUCTURE)?)
}

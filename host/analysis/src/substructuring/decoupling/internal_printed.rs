//! Eq. (3) as printed in the paper.

use super::super::product::product;
use super::super::pseudo_inverse::{full_rank_inverse, rank};
use super::DecouplingError;
use nalgebra::{Complex, DMatrix};

/// Z^J from Y^J = Q M⁻¹ P − Y^A_cc − Y^B_cc.
///
/// Implements Eq. (3), as printed.
///
/// `p` = Y^B_{i,c}, `q` = Y^A_{c,i}, `m` = Y^AJB_{i(B),i(A)}. Exact only for n_i = n_c. With n_i <
/// n_c the result is Y^J − G (I − Π) with Π of rank n_i ([`observed_rank`]): correct for the forces
/// that the internals generate, −(Y^A + Y^B) elsewhere.
///
/// # Errors
/// M, or the resulting admittance, is singular.
pub fn internal_printed(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    p: &DMatrix<Complex<f64>>,
    m: &DMatrix<Complex<f64>>,
    q: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    let [z, _] = with_m_inverse(y_a, y_b, p, m, q)?;
    Ok(z)
}

/// Z^J as [`internal_printed`] gives it, and M⁻¹.
pub(crate) fn with_m_inverse(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    p: &DMatrix<Complex<f64>>,
    m: &DMatrix<Complex<f64>>,
    q: &DMatrix<Complex<f64>>,
) -> Result<[DMatrix<Complex<f64>>; 2], DecouplingError> {
    let m_inverse = full_rank_inverse(m, "M = Y^AJB between B's and A's internals")?;
    let admittance = product(&product(q, &m_inverse), p) - y_a - y_b;
    Ok([full_rank_inverse(&admittance, "the joint's admittance")?, m_inverse])
}

/// Rank of Π: the number of directions of interface force, of n_c, that these internals observe. It
/// cannot exceed the rank of P or Q, whatever the joint is.
pub fn observed_rank(p: &DMatrix<Complex<f64>>, q: &DMatrix<Complex<f64>>) -> usize {
    rank(p).min(rank(q))
}

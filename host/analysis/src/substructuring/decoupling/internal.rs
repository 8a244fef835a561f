//! Eq. (3) in its exact least-squares form, for any number of internal degrees of freedom ≥ n_c.

use super::super::product::product;
use super::super::pseudo_inverse::full_rank_inverse;
use super::DecouplingError;
use nalgebra::{Complex, DMatrix};

/// Z^J from G = (P⁺ M Q⁺)⁻¹, Y^J = G − Y^A_cc − Y^B_cc.
///
/// Implements Eq. (3), solved for G by least squares.
///
/// `p` = Y^B_{i,c} (responses on B × n_c), `q` = Y^A_{c,i} (n_c × impacts on A), `m` =
/// Y^AJB_{i(B),i(A)}. Because M = P G⁻¹ Q exactly, P and Q are inverted without truncation, and M,
/// which is singular for n_i > n_c, is never inverted.
///
/// Tol and Özgüven's other three rearrangements of Eq. (1) have the same form with other factors,
/// and are evaluated here too: hits and responses on A with M = Y^A_ii − Y^AJB_ii, P = Y^A_ic, Q =
/// Y^A_ci; hits on B and responses on A with M = Y^AJB_{i(A),i(B)}, P = Y^A_ic, Q = Y^B_ci; both on
/// B with M = Y^B_ii − Y^AJB_ii, P = Y^B_ic, Q = Y^B_ci. If M is a difference of two measurements
/// it is small compared with both, and therefore sensitive to noise.
///
/// # Errors
/// Too few internals, or P or Q without full rank.
pub fn internal(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    p: &DMatrix<Complex<f64>>,
    m: &DMatrix<Complex<f64>>,
    q: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    Ok(factors(y_a, y_b, p, m, q)?.z)
}

/// Z^J and the matrices that it is computed from.
pub(crate) struct Factors {
    pub(crate) p_plus: DMatrix<Complex<f64>>,
    pub(crate) q_plus: DMatrix<Complex<f64>>,
    pub(crate) g: DMatrix<Complex<f64>>,
    pub(crate) z: DMatrix<Complex<f64>>,
}

/// As [`internal`], with the factors.
pub(crate) fn factors(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    p: &DMatrix<Complex<f64>>,
    m: &DMatrix<Complex<f64>>,
    q: &DMatrix<Complex<f64>>,
) -> Result<Factors, DecouplingError> {
    let needed = y_a.nrows();
    let (responses, impacts) = m.shape();
    if responses.min(impacts) < needed {
        return Err(DecouplingError::TooFewInternals { impacts, responses, needed });
    }
    let p_plus =
        full_rank_inverse(p, "P, the admittance between the virtual point and the internal responses,")?;
    let q_plus =
        full_rank_inverse(q, "Q, the admittance between the internal impacts and the virtual point,")?;
    let g = full_rank_inverse(&product(&product(&p_plus, m), &q_plus), "P⁺ M Q⁺")?;
    let z = full_rank_inverse(&(&g - y_a - y_b), "the joint's admittance")?;
    Ok(Factors { p_plus, q_plus, g, z })
}

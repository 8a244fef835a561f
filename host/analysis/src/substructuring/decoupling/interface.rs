//! Eq. (A.3): decoupling with interface degrees of freedom only.

use super::super::pseudo_inverse::full_rank_inverse;
use super::DecouplingError;
use nalgebra::{Complex, DMatrix};

/// Z^J with W = Y^A + Y^B and D = Y^AJB_AA − Y^AJB_AB − Y^AJB_BA + Y^AJB_BB: Y^J = −W + W (W − D)⁻¹
/// W.
///
/// Implements Eqs. (A.3) and (A.4), sign corrected.
///
/// It is evaluated in Z, where the same identity is Z^J = D⁻¹ − W⁻¹: the relative motion in the
/// assembly is resisted by the joint and the two substructures in parallel. `y_ajb` is 2n_c × 2n_c,
/// A's virtual point first.
///
/// # Errors
/// D or W is singular.
pub fn interface(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    y_ajb: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<Complex<f64>>, DecouplingError> {
    let [d_inverse, w_inverse] = stiffnesses(y_a, y_b, y_ajb)?;
    Ok(d_inverse - w_inverse)
}

/// D⁻¹ and W⁻¹.
pub(crate) fn stiffnesses(
    y_a: &DMatrix<Complex<f64>>,
    y_b: &DMatrix<Complex<f64>>,
    y_ajb: &DMatrix<Complex<f64>>,
) -> Result<[DMatrix<Complex<f64>>; 2], DecouplingError> {
    let n = y_a.nrows();
    let block = |r: usize, c: usize| y_ajb.view((r * n, c * n), (n, n));
    let d = block(0, 0) - block(0, 1) - block(1, 0) + block(1, 1);
    let d_inverse = full_rank_inverse(&d, "the assembly's relative admittance")?;
    Ok([d_inverse, full_rank_inverse(&(y_a + y_b), "Y^A + Y^B")?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, rng_seed: proptest::test_runner::RngSeed::Fixed(5), ..ProptestConfig::default() })]

        /// The form used equals the inverse of the paper's (sign corrected) admittance form.
        #[test]
        fn equals_the_admittance_form(v in prop::collection::vec(-1.0..1.0f64, 2 * (9 + 9 + 36))) {
            let take = |from: usize, n: usize, shift: f64| DMatrix::from_fn(n, n, |r, c| {
                let i = from + 2 * (r * n + c);
                Complex::new(v[i] + if r == c { shift } else { 0.0 }, v[i + 1])
            });
            let (y_a, y_b, y_ajb) = (take(0, 3, 4.0), take(18, 3, 4.0), take(36, 6, 3.0));
            let w = &y_a + &y_b;
            let b = |r: usize, c: usize| y_ajb.view((r * 3, c * 3), (3, 3)).clone_owned();
            let x = &w - (b(0, 0) - b(0, 1) - b(1, 0) + b(1, 1));
            let x_inverse = x.try_inverse();
            prop_assume!(x_inverse.is_some());
            let y_j = &w * x_inverse.expect("assumed") * &w - &w;
            let z = interface(&y_a, &y_b, &y_ajb).expect("diagonally dominant");
            let product = &z * &y_j;
            // conditioning of random 3 × 3 matrices
            prop_assert!((product - DMatrix::identity(3, 3)).norm() < 1e-8 * (1.0 + z.norm() * y_j.norm()));
        }
    }
}

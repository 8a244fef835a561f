//! Decoupling: the joint's dynamic stiffness Z^J from FRFs of A, B and the assembly AJB, by each
//! method, and a fixture's removal from a measured substructure.
//!
//! Every function takes receptances of one line and returns Z^J (n_c × n_c, N/m in consistent
//! units). They work in Z, not in Y, because a massless joint has no finite admittance on degrees
//! of freedom that it does not couple. c denotes the interface (virtual point) degrees of freedom,
//! i the internal ones. Rows and columns of rotations may be scaled by a length beforehand: the
//! methods are equivariant, and it reduces rounding.
//!
//! The methods are Eq. (A.1), inverse substructuring; Eq. (A.2), primal decoupling; Eq. (A.3), with
//! interface degrees of freedom only; Eq. (3) in its exact least-squares form, for any number of
//! internal degrees of freedom ≥ n_c; and Eq. (3) as printed in the paper.
//!
//! The transmission simulator: a fixture replaces the partner while A is measured, and is removed
//! numerically. A alone has a free, unloaded interface. Measured with a fixture clamped to it as
//! the partner will be, A deforms and is loaded as in the assembly; the fixture's own FRFs,
//! measured alone, are then decoupled (Mayes and Arviso 2010; with a virtual point Pasma et al.
//! 2018, the paper's Refs. 45 and 46). For this rig it gives a substructure A with the same
//! clamping as in the assembly.

use super::product::product;
use super::pseudo_inverse::{RankLost, full_rank_inverse, rank};
use crate::Line;
use nalgebra::{Complex, DMatrix};

/// Name of Y^AJB_cc in errors.
pub(super) const ASSEMBLY: &str = "the assembly's interface admittance";

/// Name of Y^A_cc or Y^B_cc in errors.
pub(super) const SUBSTRUCTURE: &str = "the substructure's interface admittance";

/// The reason why a method cannot be applied to this data.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DecouplingError {
    /// The least-squares form needs at least n_c internal degrees of freedom on both sides.
    #[error(
        "{impacts} internal impacts and {responses} internal responses, but {needed} interface DoFs: with fewer internals than \
         interface DoFs the joint is seen only through the forces they generate (biased); measure more points, or use fewer IDMs"
    )]
    TooFewInternals {
        /// Internal impacts (on A for Eq. 3).
        impacts: usize,
        /// Internal responses (on B for Eq. 3).
        responses: usize,
        /// n_c.
        needed: usize,
    },
    /// A matrix that must be inverted is singular.
    #[error(transparent)]
    RankLost(#[from] RankLost),
}

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

/// The motions of the fixture for which compatibility and equilibrium are required.
#[derive(Debug, Clone, Copy)]
pub struct Weakening<'a> {
    /// T_u (motion × output on the fixture), for instance from
    /// [`super::vpt::responses`].
    pub outputs: &'a DMatrix<f64>,
    /// T_f (input on the fixture × force).
    pub inputs: &'a DMatrix<f64>,
}

/// The admittance of A at all its measured points, from A with the fixture and the fixture alone.
///
/// `with_fixture` is outputs × inputs; its rows `outputs` and columns `inputs` are on the fixture,
/// in the order of `fixture`. Dual disassembly: Y − Y_f (Y_ff − Y^F)⁻¹ Y_f, the coupling of the
/// negative fixture. Points on the fixture beyond its interface (the extended interface) are
/// redundant; then Y_ff − Y^F is singular, and the conditions are required for the fixture's own
/// motions only, through `weakening`.
///
/// # Errors
/// [`DecouplingError::RankLost`]: the fixture has more points than motions and no weakening was
/// given, or fewer.
pub fn remove_fixture(
    with_fixture: &Line,
    fixture: &Line,
    outputs: &[usize],
    inputs: &[usize],
    weakening: Option<Weakening<'_>>,
) -> Result<Line, DecouplingError> {
    let all_rows: Vec<usize> = (0..with_fixture.nrows()).collect();
    let all_columns: Vec<usize> = (0..with_fixture.ncols()).collect();
    let part = |rows: &[usize], columns: &[usize]| crate::frf::block(with_fixture, rows, columns);
    let mut flexibility = part(outputs, inputs) - fixture;
    let mut gap = part(outputs, &all_columns);
    let mut push = part(&all_rows, inputs);
    if let Some(weakening) = weakening {
        let (t_u, t_f) = (weakening.outputs.map(Complex::from), weakening.inputs.map(Complex::from));
        flexibility = &t_u * flexibility * &t_f;
        gap = t_u * gap;
        push *= t_f;
    }
    Ok(with_fixture
        - push * full_rank_inverse(&flexibility, "Y with the fixture minus the fixture's own")? * gap)
}

#[cfg(test)]
mod exactness_tests;

#[cfg(test)]
mod interface_tests {
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

#[cfg(test)]
mod fixture_tests {
    use super::*;
    use crate::substructuring::geometry::{Grouping, Point};
    use crate::substructuring::idm::IdmSet;
    use crate::substructuring::vpt;
    use nalgebra::Vector3;
    use std::f64::consts::TAU;

    /// Nine channels on a rigid body, as R (9 × 6).
    fn points() -> Vec<Point> {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        [[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, -0.03]]
            .into_iter()
            .flat_map(|position_m| {
                axes.map(|direction| Point {
                    name: "p".into(),
                    description: "p".into(),
                    grouping: Grouping::InterfaceA,
                    position_m,
                    direction,
                })
            })
            .collect()
    }

    /// Impedance of a rigid body (mass, inertias) on springs of all six motions.
    fn body(mass: f64, inertia: f64, spring: f64, f: f64) -> Line {
        let w = TAU * f;
        Line::from_fn(6, 6, |r, c| {
            let (m, k) = if r < 3 { (mass, spring) } else { (inertia, spring * 1e-3) };
            let coupling = if r == c { 1.0 } else { 0.02 };
            Complex::new(k * coupling - if r == c { w * w * m } else { 0.0 }, 0.01 * k * coupling)
        })
    }

    #[test]
    fn what_was_clamped_on_comes_off_again() {
        let points = points();
        let u = vpt::responses(&points, Vector3::zeros(), IdmSet::Six, None).expect("three points");
        let e = vpt::impacts(&points, Vector3::zeros(), IdmSet::Six, None).expect("three points");
        let r = u.r.map(Complex::from);
        for f in [80.0, 150.0, 420.0] {
            // A: two bodies, an inner one (unknown) and the interface; the fixture is rigidly
            // joined to the latter
            let (inner, outer, fixture) =
                (body(2.0, 3e-3, 4e6, f), body(1.1, 2e-3, 1e5, f), body(0.7, 8e-4, 1e2, f));
            let link = body(0.0, 0.0, 3e6, f);
            let a = |outer: &Line| {
                let mut z = Line::zeros(12, 12);
                z.view_mut((0, 0), (6, 6)).copy_from(&(&inner + &link));
                z.view_mut((6, 6), (6, 6)).copy_from(&(outer + &link));
                z.view_mut((0, 6), (6, 6)).copy_from(&-&link);
                z.view_mut((6, 0), (6, 6)).copy_from(&-&link);
                z.try_inverse().expect("damped")
            };
            let seen = |y: &Line| {
                // six inner DoFs unchanged, the interface through nine channels and nine hits
                let mut rows = Line::zeros(15, 12);
                rows.view_mut((0, 0), (6, 6)).fill_with_identity();
                rows.view_mut((6, 6), (9, 6)).copy_from(&r);
                &rows * y * rows.transpose()
            };
            let (alone, with) = (seen(&a(&outer)), seen(&a(&(&outer + &fixture))));
            let own = &r * fixture.try_inverse().expect("damped") * r.transpose();
            let on_fixture: Vec<usize> = (6..15).collect();
            let weakening = Weakening { outputs: &u.t, inputs: &e.t };
            let found =
                remove_fixture(&with, &own, &on_fixture, &on_fixture, Some(weakening)).expect("six motions");
            // condition numbers of these matrices stay below 1e5
            assert!((&found - &alone).norm() < 1e-9 * alone.norm(), "{f} Hz");
            let refused =
                remove_fixture(&with, &own, &on_fixture, &on_fixture, None).expect_err("nine for six");
            assert!(refused.to_string().contains("has rank 6, 9 is needed"), "{refused}");
        }
    }
}

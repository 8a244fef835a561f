//! A known joint is put in and must be returned: every method on a random pair of substructures
//! coupled by Eq. (1).

use super::*;
use nalgebra::{Complex, DMatrix};
use proptest::prelude::*;

type M = DMatrix<Complex<f64>>;

const C: usize = 3;
const EXTRA: usize = 2;

/// A random symmetric admittance (reciprocal structure) of n DoFs, diagonally dominant so that it
/// is regular.
fn admittance(n: usize, v: &[f64]) -> M {
    M::from_fn(n, n, |r, c| {
        let (lo, hi) = (r.min(c), r.max(c));
        let i = 2 * (lo * n + hi);
        Complex::new(v[i] + if r == c { 3.0 } else { 0.0 }, v[i + 1])
    })
}

/// The assembly by Eq. (1): Ỹ = Y − Y Bᵀ (B Y Bᵀ + Y^J)⁻¹ B Y, with A's and B's first C DoFs as the
/// interface.
fn couple(y_a: &M, y_b: &M, y_j: &M) -> M {
    let (n, m) = (y_a.nrows(), y_b.nrows());
    let mut y = M::zeros(n + m, n + m);
    y.view_mut((0, 0), (n, n)).copy_from(y_a);
    y.view_mut((n, n), (m, m)).copy_from(y_b);
    let b = M::from_fn(C, n + m, |r, c| {
        Complex::from(if c == r {
            1.0
        } else if c == n + r {
            -1.0
        } else {
            0.0
        })
    });
    let middle = (&b * &y * b.transpose() + y_j).lu().solve(&(&b * &y)).expect("dominant diagonal");
    &y - &y * b.transpose() * middle
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(6), ..ProptestConfig::default() })]

    #[test]
    fn every_method_returns_the_joint(v in prop::collection::vec(-1.0..1.0f64, 3 * 2 * 25)) {
        let n = C + EXTRA;
        let (y_a, y_b) = (admittance(n, &v[..50]), admittance(n, &v[50..100]));
        let z_j = admittance(C, &v[100..]);
        let y_j = z_j.clone().lu().solve(&M::identity(C, C)).expect("dominant diagonal");
        let y = couple(&y_a, &y_b, &y_j);
        let cc = |y: &M| y.view((0, 0), (C, C)).clone_owned();
        let (a, b) = (cc(&y_a), cc(&y_b));
        let at: Vec<usize> = (0..C).chain(n..n + C).collect();
        let ajb = M::from_fn(2 * C, 2 * C, |r, c| y[(at[r], at[c])]);
        // all of A's and B's DoFs as internals, then as many internals as interface DoFs
        let (p, q) = (y_b.columns(0, C).clone_owned(), y_a.rows(0, C).clone_owned());
        let m = y.view((n, 0), (n, n)).clone_owned();
        let (p3, q3, m3) = (p.rows(1, C).clone_owned(), q.columns(1, C).clone_owned(), m.view((1, 1), (C, C)).clone_owned());
        let results = [
            interface(&a, &b, &ajb),
            primal(PrimalBlock::A, &a, &ajb),
            primal(PrimalBlock::B, &b, &ajb),
            inverse(InverseBlock::Ab, &ajb),
            inverse(InverseBlock::Ba, &ajb),
            internal(&a, &b, &p, &m, &q),
        ];
        for (which, result) in results.into_iter().enumerate() {
            let z = result.expect("regular");
            // exact algebra; condition numbers of these matrices stay below 1e3
            prop_assert!((&z - &z_j).norm() < 1e-9 * z_j.norm(), "method {which}");
        }
        // square internals may be ill conditioned by chance: compare only where they are not
        if let Ok(z) = internal_printed(&a, &b, &p3, &m3, &q3) {
            let worst = m3.clone().svd(false, false).singular_values;
            prop_assume!(worst.min() > 1e-3 * worst.max());
            prop_assert!((&z - &z_j).norm() < 1e-6 * z_j.norm());
        }
        prop_assert!(observed_rank(&p.rows(0, 2).clone_owned(), &q) <= 2);
    }
}

#[test]
fn too_few_internals_are_refused_with_the_count() {
    let one = M::identity(3, 3);
    let error =
        internal(&one, &one, &M::identity(2, 3), &M::identity(2, 5), &M::identity(3, 5)).expect_err("2 < 3");
    assert_eq!(error, DecouplingError::TooFewInternals { impacts: 5, responses: 2, needed: 3 });
    // rank matters, not only the number: two of the four responses on B are copies
    let p = M::from_fn(4, 3, |r, c| Complex::from(if r % 2 == c { 1.0 } else { 0.0 }));
    let error = internal(&one, &one, &p, &M::identity(4, 4), &M::identity(3, 4)).expect_err("rank 2");
    assert!(matches!(error, DecouplingError::RankLost(_)), "{error}");
}

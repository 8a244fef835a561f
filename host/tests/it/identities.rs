//! The algebra of the methods on random well-posed structures: masses, dampers and springs on
//! s = σ + iω, assembled directly.

use jointrig::substructuring::coupling::couple;
use jointrig::substructuring::decoupling::{InverseBlock, PrimalBlock, interface, internal, inverse, primal};
use jointrig::substructuring::geometry::{Grouping, Point};
use jointrig::substructuring::idm::{IdmSet, rigid_row};
use jointrig::substructuring::joint_over_bands::stiffness_and_damping;
use jointrig::substructuring::vpt;
use nalgebra::{Complex, DMatrix, DVector, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::TAU;

type M = DMatrix<Complex<f64>>;

/// Degrees of freedom of each structure; its first `C` are the interface.
const N: usize = 5;
const C: usize = 3;

/// A random symmetric positive definite matrix of size about `scale`.
fn definite(n: usize, v: &[f64], scale: f64) -> DMatrix<f64> {
    let root = DMatrix::from_fn(n, n, |r, c| v[r * n + c]);
    (&root * root.transpose() + DMatrix::identity(n, n)) * scale
}

/// Masses of kilograms, springs of N/µm, structural damping in s; the joint is stiffer than its
/// neighbours.
#[derive(Debug)]
struct System {
    s: Complex<f64>,
    z_a: M,
    z_b: M,
    stiffness: DMatrix<f64>,
    damping: DMatrix<f64>,
}

impl System {
    fn new(v: &[f64], frequency_hz: f64, sigma: f64) -> System {
        let s = Complex::new(sigma, TAU * frequency_hz);
        let body = |v: &[f64]| {
            let (m, k) = (definite(N, &v[..25], 1.0), definite(N, &v[25..50], 2e6));
            DMatrix::from_fn(N, N, |r, c| s * s * m[(r, c)] + (s * 4e-5 + 1.0) * k[(r, c)])
        };
        let (stiffness, damping) = (definite(C, &v[100..109], 2e7), definite(C, &v[109..118], 300.0));
        System { s, z_a: body(&v[..50]), z_b: body(&v[50..100]), stiffness, damping }
    }

    fn joint(&self) -> M {
        DMatrix::from_fn(C, C, |r, c| self.s * self.damping[(r, c)] + self.stiffness[(r, c)])
    }

    /// The assembly's impedance: both structures, and the joint between their interfaces.
    fn assembled(&self) -> M {
        let mut z = self.uncoupled();
        let joint = self.joint();
        for (r, c, sign) in [(0, 0, 1.0), (N, N, 1.0), (0, N, -1.0), (N, 0, -1.0)] {
            let sum = z.view((r, c), (C, C)) + &joint * Complex::from(sign);
            z.view_mut((r, c), (C, C)).copy_from(&sum);
        }
        z
    }

    fn uncoupled(&self) -> M {
        let mut z = M::zeros(2 * N, 2 * N);
        z.view_mut((0, 0), (N, N)).copy_from(&self.z_a);
        z.view_mut((N, N), (N, N)).copy_from(&self.z_b);
        z
    }
}

fn inverted(z: &M) -> M {
    z.clone().try_inverse().expect("damped structures are regular")
}

fn system() -> impl Strategy<Value = System> {
    (prop::collection::vec(-1.0..1.0f64, 118), 60.0..900.0f64, 0.0..8.0f64)
        .prop_map(|(v, f, sigma)| System::new(&v, f, sigma))
}

fn cases(seed: u64) -> ProptestConfig {
    ProptestConfig { cases: 64, rng_seed: RngSeed::Fixed(seed), ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(11))]

    /// Eq. (1) with a compliant joint equals the direct assembly of the matrices.
    #[test]
    fn coupling_is_direct_assembly(system in system()) {
        let y = inverted(&system.uncoupled());
        let b = DMatrix::from_fn(C, 2 * N, |r, c| f64::from(i8::from(c == r)) - f64::from(i8::from(c == N + r)));
        let coupled = couple(&y, &b, &b, Some(&inverted(&system.joint()))).expect("regular");
        let direct = inverted(&system.assembled());
        // condition numbers of such systems stay below 1e4
        prop_assert!((&coupled - &direct).norm() < 1e-10 * direct.norm());
        // rigid: no gap is left
        let rigid = couple(&y, &b, &b, None).expect("regular");
        prop_assert!((b.map(Complex::from) * &rigid).norm() < 1e-10 * rigid.norm());
    }

    /// M = P G⁻¹ Q, all methods return K + sC, and with it K and C on any s.
    #[test]
    fn every_method_returns_the_joint_on_s(system in system()) {
        let (y_a, y_b, y) = (inverted(&system.z_a), inverted(&system.z_b), inverted(&system.assembled()));
        let cc = |y: &M| y.view((0, 0), (C, C)).clone_owned();
        let (p, q) = (y_b.columns(0, C).clone_owned(), y_a.rows(0, C).clone_owned());
        let m = y.view((N, 0), (N, N)).clone_owned();
        let g = cc(&y_a) + cc(&y_b) + inverted(&system.joint());
        let product = &p * inverted(&g) * &q;
        prop_assert!((&product - &m).norm() < 1e-10 * m.norm());
        let at: Vec<usize> = (0..C).chain(N..N + C).collect();
        let ajb = M::from_fn(2 * C, 2 * C, |r, c| y[(at[r], at[c])]);
        let methods = [
            internal(&cc(&y_a), &cc(&y_b), &p, &m, &q),
            interface(&cc(&y_a), &cc(&y_b), &ajb),
            primal(PrimalBlock::A, &cc(&y_a), &ajb),
            primal(PrimalBlock::B, &cc(&y_b), &ajb),
            inverse(InverseBlock::Ab, &ajb),
            inverse(InverseBlock::Ba, &ajb),
        ];
        for (which, z) in methods.into_iter().enumerate() {
            let z = z.expect("regular");
            for d in 0..C {
                let (k, c) = stiffness_and_damping(z[(d, d)], system.s);
                let size = system.joint().norm();
                // amplification |Y^A + Y^B| / |Y^J| of these systems stays below 1e5
                prop_assert!((k - system.stiffness[(d, d)]).abs() < 1e-8 * size, "method {which}");
                prop_assert!((c - system.damping[(d, d)]).abs() < 1e-8 * size / system.s.norm(), "method {which}");
            }
        }
    }

    /// The off-diagonal block of Eq. (A.2) equals Eq. (A.1): their agreement proves nothing about
    /// the data.
    #[test]
    fn inverse_is_the_off_diagonal_of_primal(v in prop::collection::vec(-1.0..1.0f64, 2 * 36 + 2 * 18)) {
        // arbitrary matrices, not of a physical system
        let take = |from: usize, n: usize| M::from_fn(n, n, |r, c| {
            let i = from + 2 * (r * n + c);
            Complex::new(v[i] + if r == c { 3.0 } else { 0.0 }, v[i + 1])
        });
        let (ajb, a, b) = (take(0, 6), take(72, 3), take(90, 3));
        let mut both = M::zeros(6, 6);
        both.view_mut((0, 0), (3, 3)).copy_from(&inverted(&a));
        both.view_mut((3, 3), (3, 3)).copy_from(&inverted(&b));
        let z = inverted(&ajb) - both;
        let ab = inverse(InverseBlock::Ab, &ajb).expect("dominant diagonal");
        prop_assert!((&ab + z.view((0, 3), (3, 3))).norm() < 1e-10 * ab.norm());
        let ba = inverse(InverseBlock::Ba, &ajb).expect("dominant diagonal");
        prop_assert!((&ba + z.view((3, 0), (3, 3))).norm() < 1e-10 * ba.norm());
    }

    /// T_u of any valid set of sensors returns a rigid motion exactly; T_f returns the forces.
    #[test]
    fn the_virtual_point_of_a_rigid_motion_is_that_motion(
        positions in prop::collection::vec(prop::array::uniform3(-0.05..0.05f64), 4),
        motion in prop::array::uniform6(-1.0..1.0f64),
    ) {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let points: Vec<Point> = positions
            .iter()
            .flat_map(|&position_m| axes.map(|direction| Point {
                name: "p".into(), description: "p".into(), grouping: Grouping::InterfaceA, position_m, direction,
            }))
            .collect();
        let t = vpt::responses(&points, Vector3::zeros(), IdmSet::Six, None);
        prop_assume!(t.is_ok());
        let t = t.expect("assumed");
        prop_assume!(t.condition < 1e3);
        let q = DVector::from_column_slice(&motion);
        let seen = DVector::from_iterator(points.len(), points.iter().map(|p| {
            rigid_row(p.direction(), p.position()).iter().zip(&motion).map(|(r, q)| r * q).sum::<f64>()
        }));
        // rounding times the condition number, in metres per radian over a few centimetres
        prop_assert!((&t.t * seen - &q).norm() < 1e-10 * t.condition);
        prop_assert!((&t.t * &t.r - DMatrix::<f64>::identity(6, 6)).norm() < 1e-10 * t.condition);
        let f = vpt::impacts(&points, Vector3::zeros(), IdmSet::Six, None).expect("the same R");
        prop_assert!((f.r.transpose() * &f.t - DMatrix::<f64>::identity(6, 6)).norm() < 1e-10 * t.condition);
    }
}

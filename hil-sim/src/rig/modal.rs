//! The structure as x' = A x + b f, and the stuck motion's complex modes.
//!
//! The state is in coordinates in which all numbers have similar magnitude. Rotations in rad and
//! translations in m make matrices whose entries span ten decades. Here η are the undamped modes'
//! coordinates (M-orthonormal), and x = (d η, η') with d the undamped frequencies, so that A is
//! skew-symmetric except for the damping and |x|²/2 is the mechanical energy in joules. Both
//! steppers work on it.
//!
//! The modes are eigenvectors of A, verified before use. Eigenvalues come from the real Schur form,
//! vectors from inverse iteration. Left vectors are rows of the inverse of the basis, so that a bad
//! basis can be detected: its condition number and a comparison of its FRFs with a direct solve
//! decide whether it is used. Overdamped modes are real and count once; the others come in
//! conjugate pairs of which one is kept.

use super::RigError;
use super::structure::Structure;
use nalgebra::{DMatrix, DVector, Schur, SymmetricEigen};
use num_complex::Complex;

/// With a larger condition number the result would have fewer than the eight digits required.
const WORST_CONDITION: f64 = 1e7;
/// Largest deviation of the basis' transfer functions from a direct solve, relative to the largest
/// entry.
const WORST_DEVIATION: f64 = 1e-8;
/// Schur sweeps and inverse iterations that suffice for any usable basis.
const SWEEPS: usize = 10_000;
const ITERATIONS: usize = 3;

/// Why a structure is stepped by its matrix exponential instead.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ModalError {
    /// The Schur form did not converge.
    #[error("the eigenvalues do not converge")]
    NoEigenvalues,
    /// Two modes are (nearly) the same: critical damping.
    #[error("the modes are nearly dependent (condition number {condition:.1e})")]
    Dependent {
        /// Condition number of the basis of unit vectors.
        condition: f64,
    },
    /// The basis does not reproduce the transfer functions.
    #[error("the modes miss the exact transfer functions by {deviation:.1e}")]
    Inexact {
        /// Largest deviation over the largest entry.
        deviation: f64,
    },
}

/// One complex mode: z' = λ z + (left · b) f, and x gains weight · Re(right z).
#[derive(Debug, Clone)]
pub struct Mode {
    /// Eigenvalue (1/s), imaginary part not negative.
    pub lambda: Complex<f64>,
    /// 2 for one of a conjugate pair, 1 for an overdamped mode.
    pub weight: f64,
    /// Right vector (2n).
    pub right: DVector<Complex<f64>>,
    /// Left vector (2n), without conjugation.
    pub left: DVector<Complex<f64>>,
}

/// All modes, slowest decay first.
pub fn modes(space: &StateSpace) -> Result<Vec<Mode>, ModalError> {
    let order = space.order();
    let schur = Schur::try_new(space.a.clone(), f64::EPSILON, SWEEPS).ok_or(ModalError::NoEigenvalues)?;
    let mut lambdas: Vec<Complex<f64>> =
        schur.complex_eigenvalues().iter().copied().filter(|lambda| lambda.im >= 0.0).collect();
    lambdas.sort_by(|a, b| b.re.total_cmp(&a.re).then(a.im.total_cmp(&b.im)));
    let states: usize = lambdas.iter().map(|lambda| if lambda.im > 0.0 { 2 } else { 1 }).sum();
    if states != order || lambdas.iter().any(|lambda| !lambda.is_finite()) {
        return Err(ModalError::NoEigenvalues);
    }
    let mut found = Vec::with_capacity(lambdas.len());
    for guess in lambdas {
        let (lambda, right) = vector(space, guess).ok_or(ModalError::NoEigenvalues)?;
        let weight = if guess.im > 0.0 { 2.0 } else { 1.0 };
        found.push(Mode { lambda, weight, right, left: DVector::zeros(order) });
    }
    invert(&mut found, order)?;
    verify(space, &found)?;
    Ok(found)
}

/// Inverse iteration from `guess`: eigenvalue and unit vector. A real guess stays real.
///
/// With x = (u, v), the first half of (A − σ) x = b says v = (b₁ + σ u)/d; inserted into the second
/// half, it leaves n equations for u, to be factored at an eighth of the cost of all 2n.
fn vector(space: &StateSpace, guess: Complex<f64>) -> Option<(Complex<f64>, DVector<Complex<f64>>)> {
    let (order, n) = (space.order(), space.scale.len());
    // Exactly at the eigenvalue the factorisation may have a zero pivot; with a relative offset of
    // 1e-12 it converges as fast.
    let shift = guess * (1.0 + 1e-12) + f64::MIN_POSITIVE;
    let lower = |columns: usize| space.a.view((n, columns), (n, n)).map(Complex::from);
    let (stiffness, mut damped) = (lower(0), lower(n));
    (0..n).for_each(|i| damped[(i, i)] -= shift);
    let inverse = space.scale.map(|d| Complex::from(d.recip()));
    let mut reduced = damped.clone();
    for (mut column, d) in reduced.column_iter_mut().zip(&inverse) {
        column *= shift * d;
    }
    let factors = (stiffness + reduced).lu();
    // Any start with a component in every mode works; it is fixed so that the result is
    // deterministic.
    let mut x = DVector::from_fn(order, |i, _| {
        let angle = if guess.im > 0.0 { 1.3 * i as f64 } else { 0.0 };
        Complex::from_polar(1.0 + 0.37 * (0.9 * i as f64).sin(), angle)
    });
    for _ in 0..ITERATIONS {
        let first = inverse.component_mul(&x.rows(0, n));
        let u = factors.solve(&(x.rows(n, n) - &damped * &first))?;
        let v = first + u.component_mul(&inverse) * shift;
        x.rows_mut(0, n).copy_from(&u);
        x.rows_mut(n, n).copy_from(&v);
        let norm = x.norm();
        if !(norm.is_finite() && norm > 0.0) {
            return None;
        }
        x.unscale_mut(norm);
    }
    let moved = DVector::from_fn(order, |i, _| {
        space.a.row(i).iter().zip(x.iter()).map(|(a, x)| x * *a).sum::<Complex<f64>>()
    });
    let mut lambda = x.dotc(&moved);
    if guess.im <= 0.0 {
        lambda.im = 0.0;
    }
    Some((lambda, x))
}

/// Left vectors from the inverse of the real basis [w Re v, −w Im v | v].
fn invert(modes: &mut [Mode], order: usize) -> Result<(), ModalError> {
    let mut basis = DMatrix::zeros(order, order);
    let mut column = 0;
    for mode in modes.iter() {
        basis.set_column(column, &mode.right.map(|v| mode.weight * v.re));
        column += 1;
        if mode.lambda.im > 0.0 {
            basis.set_column(column, &mode.right.map(|v| -mode.weight * v.im));
            column += 1;
        }
    }
    let singular = basis.clone().singular_values();
    let condition = singular.max() / singular.min();
    let dependent = ModalError::Dependent { condition };
    if condition.is_nan() || condition > WORST_CONDITION {
        return Err(dependent);
    }
    let inverse = basis.try_inverse().ok_or(dependent)?;
    let mut row = 0;
    for mode in modes {
        if mode.lambda.im > 0.0 {
            let (re, im) = (inverse.row(row), inverse.row(row + 1));
            mode.left = DVector::from_fn(order, |i, _| Complex::new(re[i], im[i]));
            row += 2;
        } else {
            mode.left = DVector::from_fn(order, |i, _| Complex::from(inverse[(row, i)]));
            row += 1;
        }
    }
    Ok(())
}

/// Compares (s − A)⁻¹ b from the modes with a direct solve, for two fixed b that excite every
/// state, at, near and far from the resonances.
fn verify(space: &StateSpace, modes: &[Mode]) -> Result<(), ModalError> {
    let order = space.order();
    let fastest = modes.iter().map(|mode| mode.lambda.norm()).fold(0.0, f64::max);
    // every third mode; fewer of the many of bodies that bend, because each costs a solve
    let apart = (modes.len() / 8).max(3);
    let beside = modes.iter().step_by(apart).map(|mode| Complex::new(2.3, mode.lambda.im));
    let decades = (1..=6).map(|k| Complex::new(0.0, fastest * 10_f64.powi(-k)));
    let inputs = DMatrix::from_fn(order, 2, |i, j| Complex::from((1.3 * (i + 1) as f64 + j as f64).sin()));
    let excited: Vec<_> =
        modes.iter().map(|mode| (mode.left.tr_mul(&inputs), mode.left.conjugate().tr_mul(&inputs))).collect();
    let mut worst = 0.0_f64;
    for s in beside.chain(decades) {
        let shifted = DMatrix::from_fn(order, order, |i, j| {
            Complex::from(-space.a[(i, j)]) + if i == j { s } else { Complex::ZERO }
        });
        let Some(direct) = shifted.lu().solve(&inputs) else { continue };
        let mut sum = DMatrix::zeros(order, 2);
        for (mode, (excited, of_conjugate)) in modes.iter().zip(&excited) {
            let half = Complex::from(0.5 * mode.weight);
            sum.gemm(half / (s - mode.lambda), &mode.right, excited, Complex::ONE);
            sum.gemm(half / (s - mode.lambda.conj()), &mode.right.conjugate(), of_conjugate, Complex::ONE);
        }
        let largest = direct.iter().map(|v| v.norm()).fold(0.0, f64::max);
        let deviation = (&sum - &direct).iter().map(|v| v.norm()).fold(0.0, f64::max) / largest;
        worst = if deviation.is_nan() { f64::INFINITY } else { worst.max(deviation) };
    }
    if worst > WORST_DEVIATION { Err(ModalError::Inexact { deviation: worst }) } else { Ok(()) }
}

/// Undamped frequencies below this fraction of the highest are replaced by it for scaling (a free
/// body has 0 rad/s).
const SOFTEST: f64 = 1e-6;

/// x' = A x + b f with 2n states.
#[derive(Debug, Clone)]
pub struct StateSpace {
    /// A (1/s), 2n × 2n.
    pub a: DMatrix<f64>,
    shapes: DMatrix<f64>,
    scale: DVector<f64>,
    frequencies: DVector<f64>,
}

impl StateSpace {
    /// From M, C and K.
    ///
    /// # Errors
    /// [`RigError::Structure`] if M is not positive definite, the undamped modes do not converge,
    /// or a beam has no modes.
    pub fn new(structure: &Structure) -> Result<Self, RigError> {
        structure.complete()?;
        let fail = |what| RigError::Structure { configuration: structure.configuration(), what };
        let n = structure.order();
        let factor =
            structure.mass.clone().cholesky().ok_or(fail("the mass matrix is not positive definite"))?;
        let inverse = factor
            .l()
            .solve_lower_triangular(&DMatrix::identity(n, n))
            .ok_or(fail("the mass matrix has no inverse"))?;
        let symmetric = |matrix: &DMatrix<f64>| {
            let reduced = &inverse * matrix * inverse.transpose();
            (&reduced + reduced.transpose()) * 0.5
        };
        let eigen = SymmetricEigen::try_new(symmetric(&structure.stiffness), f64::EPSILON, 10_000)
            .ok_or(fail("the undamped modes do not converge"))?;
        let shapes = inverse.transpose() * &eigen.eigenvectors;
        let damping = shapes.transpose() * &structure.damping * &shapes;
        let frequencies = eigen.eigenvalues.map(|square| square.max(0.0).sqrt());
        let softest = SOFTEST * frequencies.max();
        // A completely free structure has only zero frequencies; then any positive scale works.
        let scale = frequencies.map(|omega| if softest > 0.0 { omega.max(softest) } else { 1.0 });
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        for i in 0..n {
            a[(i, n + i)] = scale[i];
            a[(n + i, i)] = -frequencies[i] * frequencies[i] / scale[i];
        }
        let symmetric_damping = (&damping + damping.transpose()) * 0.5;
        a.view_mut((n, n), (n, n)).copy_from(&-symmetric_damping);
        Ok(Self { a, shapes, scale, frequencies })
    }

    /// Number of states, 2n.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// Undamped circular frequencies (rad/s), from K and M alone, in the order of the states.
    pub fn undamped_rad_s(&self) -> &DVector<f64> {
        &self.frequencies
    }

    /// Row (2n) for the displacement along the row `seen` (n) of the structure.
    pub fn displacement(&self, seen: &DVector<f64>) -> DVector<f64> {
        let n = self.scale.len();
        let modal = self.shapes.tr_mul(seen);
        DVector::from_fn(2 * n, |i, _| if i < n { modal[i] / self.scale[i] } else { 0.0 })
    }

    /// Row (2n) for the velocity along the row `seen` (n) of the structure.
    pub fn velocity(&self, seen: &DVector<f64>) -> DVector<f64> {
        let n = self.scale.len();
        let modal = self.shapes.tr_mul(seen);
        DVector::from_fn(2 * n, |i, _| if i < n { 0.0 } else { modal[i - n] })
    }

    /// Column b (2n) of a force along the row `pushed` (n) of the structure.
    pub fn input(&self, pushed: &DVector<f64>) -> DVector<f64> {
        self.velocity(pushed)
    }

    /// Displacements and velocities (n each) of the structure's coordinates in the state `x` (2n).
    pub fn motion(&self, x: &DVector<f64>) -> [DVector<f64>; 2] {
        let n = self.scale.len();
        let displacements = DVector::from_fn(n, |i, _| x[i] / self.scale[i]);
        [&self.shapes * displacements, &self.shapes * x.rows(n, n)]
    }

    /// The state (2n) with these displacements and velocities (n each) of a structure with this
    /// mass matrix.
    pub fn state(&self, mass: &DMatrix<f64>, [at, moving]: &[DVector<f64>; 2]) -> DVector<f64> {
        let n = self.scale.len();
        // the shapes are normalised to unit modal mass
        let [at, moving] = [at, moving].map(|own| self.shapes.tr_mul(&(mass * own)));
        DVector::from_fn(2 * n, |i, _| if i < n { at[i] * self.scale[i] } else { moving[i - n] })
    }

    /// Mechanical energy (J) of the state `x` (2n).
    pub fn energy_j(&self, x: &DVector<f64>) -> f64 {
        let n = self.scale.len();
        let potential: f64 = (0..n).map(|i| x[i] * self.frequencies[i] / self.scale[i]).map(|e| e * e).sum();
        let kinetic: f64 = (n..2 * n).map(|i| x[i] * x[i]).sum();
        0.5 * (potential + kinetic)
    }
}

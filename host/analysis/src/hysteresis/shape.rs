//! Shape of a loop: a straight line, an ellipse, microslip, gross slip.
//!
//! A stuck contact in any linear structure gives T = k Δx + c Δẋ at every harmonic: a line, or an
//! ellipse if something between the measured points resonates. A slipping contact does not: its
//! loop has corners. The residual of that two-parameter fit, compared with the scatter between
//! cycles, therefore distinguishes slip from an ellipse. If the residual is too small for that, the
//! third harmonic of T distinguishes microslip from damping. The phase distinguishes an ellipse
//! from a line, and the final tangent gross slip from microslip.
//!
//! Source of dissipation in a loop that looks like a straight line or a thin ellipse: friction or a
//! dashpot.
//!
//! Under Δx = X cos θ a dashpot gives a force along −sin θ only. A contact that begins to slip
//! gives −sin²θ sgn(sin θ), whose third harmonic is a fifth of its fundamental with the opposite
//! sign, and nearly so for any law of microslip. The quadrature part of the third harmonic of T
//! therefore distinguishes microslip from damping at energies where the loop's residual from an
//! ellipse is still within the nonlinearity of the instruments.

use super::cycles::{Harmonics, Scatter};
use super::loops::Cycle;
use super::loops::{fundamental_stiffness, harmonics};
use super::stick::{final_tangent, first_part, slope_over, strokes};
use num_complex::Complex;
use serde::Serialize;

/// The shape of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A straight line: the contact sticks, and k_eq is k_T.
    Stuck,
    /// An ellipse without visible slip: a resonance hidden between the measured points, damping, or
    /// a force shifted in time. It has no k_T.
    Elliptical,
    /// Part of the contact slips.
    Microslip,
    /// All of it slips: the force has reached a plateau.
    GrossSlip,
}

/// The figures from which the shape was determined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShapeEvidence {
    /// rms residual of T = k Δx + c Δẋ on the averaged loop, over the rms of T.
    pub nonlinearity: f64,
    /// The part of `nonlinearity` explained by noise, from the scatter between cycles.
    pub nonlinearity_noise: f64,
    /// Phase by which Δx lags T at the fundamental, degrees.
    pub phase_deg: f64,
    /// Harmonics 2…5 of T over its fundamental.
    pub harmonics: [f64; 4],
    /// Tangent at the end of the strokes over the stiffness after the reversal.
    pub final_tangent: f64,
    /// Cause of the dissipation: friction or a dashpot; `None` with too few cycles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadratures: Option<Quadratures>,
}

impl ShapeEvidence {
    /// Whether the deviation from an ellipse exceeds the noise.
    pub(super) fn bends(&self) -> bool {
        self.nonlinearity > NONLINEAR.max(SIGNIFICANT * self.nonlinearity_noise)
    }

    /// Whether noise could hide slip: the residual exceeds the nonlinearity of instruments, but not
    /// the noise threshold.
    pub(super) fn is_unsure(&self) -> bool {
        self.nonlinearity > NONLINEAR && !self.bends()
    }
}

/// A smaller residual may be the nonlinearity of the instruments.
const NONLINEAR: f64 = 0.01;

/// The residual must exceed the noise by this factor to count as slip.
const SIGNIFICANT: f64 = 4.0;

/// A joint's own damping gives a few degrees of phase (1 % of loss per 0.6°); a resonance between
/// the measured points gives tens.
const ELLIPSE_DEG: f64 = 10.0;

/// On a plateau the tangent is below this fraction of the initial one.
const PLATEAU: f64 = 0.05;

/// Determines the shape from the averaged loop and the scatter of the cycles about it.
pub(super) fn shape(
    mean: &Cycle,
    scatter: &Scatter,
    quadratures: Option<Quadratures>,
) -> (Shape, ShapeEvidence) {
    let (k, c) = linear_fit(mean);
    let residual: Vec<f64> = (0..mean.force_n.len())
        .map(|i| mean.force_n[i] - k * mean.displacement_m[i] - c * mean.velocity_m_per_s[i])
        .collect();
    let force = rms(&mean.force_n);
    // the mean of n cycles has 1/n of their variance; the scatter about that mean has only (n −
    // 1)/n of it
    let others = scatter.cycles.saturating_sub(1).max(1) as f64;
    let nonlinearity_noise = (scatter.variance(k, c) / others).sqrt() / force;
    let strokes = strokes(mean);
    let initial = slope_over(mean, &strokes, first_part(mean, &strokes)).unwrap_or(k);
    let evidence = ShapeEvidence {
        nonlinearity: rms(&residual) / force,
        nonlinearity_noise,
        phase_deg: fundamental_stiffness(mean).arg().to_degrees(),
        harmonics: harmonics(mean),
        final_tangent: final_tangent(mean, &strokes, initial),
        quadratures,
    };
    let begins_to_slip = evidence.quadratures.is_some_and(|q| q.slips());
    let shape = if evidence.bends() {
        if evidence.final_tangent < PLATEAU { Shape::GrossSlip } else { Shape::Microslip }
    } else if begins_to_slip {
        Shape::Microslip
    } else if evidence.phase_deg.abs() > ELLIPSE_DEG {
        Shape::Elliptical
    } else {
        Shape::Stuck
    };
    (shape, evidence)
}

/// k and c of T = k Δx + c Δẋ by least squares.
fn linear_fit(cycle: &Cycle) -> (f64, f64) {
    let (mut xx, mut vv, mut xv, mut xt, mut vt) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for i in 0..cycle.force_n.len() {
        let (x, v, t) = (cycle.displacement_m[i], cycle.velocity_m_per_s[i], cycle.force_n[i]);
        xx += x * x;
        vv += v * v;
        xv += x * v;
        xt += x * t;
        vt += v * t;
    }
    let determinant = xx * vv - xv * xv;
    ((xt * vv - vt * xv) / determinant, (vt * xx - xt * xv) / determinant)
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}

/// Fewest cycles from which a scatter is estimated.
const FEWEST_CYCLES: usize = 4;

/// The third harmonic counts if it exceeds this many of its standard deviations,
const SIGNIFICANT_THIRD: f64 = 5.0;

/// and this fraction of the fundamental,
const LEAST: f64 = 4e-4;

/// and if friction explains at least this fraction of the dissipation. The fraction is 0 for a
/// dashpot alone.
const SHARE: f64 = 0.3;

/// Quadratures of T against Δx, from cycle to cycle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quadratures {
    /// Quadrature of T at the fundamental over |T₁|: the phase, rad, by which Δx lags T.
    pub first: f64,
    /// Its standard deviation.
    pub first_std: f64,
    /// Quadrature of T at the third harmonic over |T₁|, without the contribution of the stiffness
    /// acting on Δx₃.
    pub third: f64,
    /// Its standard deviation.
    pub third_std: f64,
}

impl Quadratures {
    /// From the harmonics of the average cycle and of each cycle; `None` with too few cycles, or if
    /// nothing moves.
    pub(super) fn of(mean: &Harmonics, cycles: &[Harmonics]) -> Option<Self> {
        let ([x1, _], [t1, _]) = (mean.displacement, mean.force);
        let turn = Complex::from_polar(1.0, -x1.arg());
        let (cube, stiffness, force) = (turn.powi(3), (t1 / x1).re, t1.norm());
        if !stiffness.is_finite() || force <= 0.0 {
            return None;
        }
        // both noises count; that of Δx is the larger because integration amplifies it
        let quadratures = |own: &Harmonics| {
            let ([x1, x3], [t1, t3]) = (own.displacement, own.force);
            [((t1 - x1 * stiffness) * turn).im / force, ((t3 - x3 * stiffness) * cube).im / force]
        };
        let own: Vec<[f64; 2]> = cycles.iter().map(quadratures).collect();
        if own.len() < FEWEST_CYCLES {
            return None;
        }
        let n = own.len() as f64;
        let over = |i: usize| {
            let mean = own.iter().map(|q| q[i]).sum::<f64>() / n;
            let variance = own.iter().map(|q| (q[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean, (variance / n).sqrt())
        };
        let ((first, first_std), (third, third_std)) = (over(0), over(1));
        Some(Self { first, first_std, third, third_std })
    }

    /// The fraction of the dissipation that friction explains: 1 for microslip, 0 for a dashpot.
    pub fn friction_share(&self) -> f64 {
        -5.0 * self.third / self.first
    }

    /// Whether slip is significant.
    pub fn slips(&self) -> bool {
        self.third < -LEAST.max(SIGNIFICANT_THIRD * self.third_std)
            && self.first > 0.0
            && self.friction_share() > SHARE
    }
}

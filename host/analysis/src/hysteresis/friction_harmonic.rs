//! Source of dissipation in a loop that looks like a straight line or a thin ellipse: friction or a
//! dashpot.
//!
//! Under Δx = X cos θ a dashpot gives a force along −sin θ only. A contact that begins to slip
//! gives −sin²θ sgn(sin θ), whose third harmonic is a fifth of its fundamental with the opposite
//! sign, and nearly so for any law of microslip. The quadrature part of the third harmonic of T
//! therefore distinguishes microslip from damping at energies where the loop's residual from an
//! ellipse is still within the nonlinearity of the instruments.

use super::harmonics::Harmonics;
use num_complex::Complex;
use serde::Serialize;

/// Fewest cycles from which a scatter is estimated.
const FEWEST_CYCLES: usize = 4;

/// The third harmonic counts if it exceeds this many of its standard deviations,
const SIGNIFICANT: f64 = 5.0;

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
        self.third < -LEAST.max(SIGNIFICANT * self.third_std)
            && self.first > 0.0
            && self.friction_share() > SHARE
    }
}

//! A force of limited duration (half-sine contact or constant force), and its exact effect on one
//! mode.

use std::f64::consts::{FRAC_PI_2, PI};

use num_complex::Complex;

/// A sin(Ω (t − start) + phase) from `start_s` to `end_s`, in newton.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceSegment {
    /// Start (s).
    pub start_s: f64,
    /// End (s).
    pub end_s: f64,
    /// A (N).
    pub amplitude_n: f64,
    /// Ω (rad/s).
    pub omega: f64,
    /// Phase at the start (rad).
    pub phase: f64,
}

impl ForceSegment {
    /// One elastic contact.
    pub fn half_sine(start_s: f64, width_s: f64, peak_n: f64) -> Self {
        Self { start_s, end_s: start_s + width_s, amplitude_n: peak_n, omega: PI / width_s, phase: 0.0 }
    }

    /// A constant force.
    pub fn steady(start_s: f64, end_s: f64, force_n: f64) -> Self {
        Self { start_s, end_s, amplitude_n: force_n, omega: 0.0, phase: FRAC_PI_2 }
    }

    /// Duration (s).
    pub fn width_s(&self) -> f64 {
        self.end_s - self.start_s
    }

    /// The part that had begun by `now_s`: all of an elastic contact, a constant force up to that
    /// time.
    pub fn until(&self, now_s: f64) -> Option<Self> {
        let end_s = if self.omega > 0.0 { self.end_s } else { self.end_s.min(now_s) };
        (self.start_s <= now_s).then_some(Self { end_s, ..*self })
    }

    /// Argument of the sine at `t_s` (rad).
    pub fn angle(&self, t_s: f64) -> f64 {
        self.omega * (t_s - self.start_s) + self.phase
    }

    /// The force at `t_s` (N), zero outside.
    pub fn value_n(&self, t_s: f64) -> f64 {
        if t_s < self.start_s || t_s > self.end_s { 0.0 } else { self.amplitude_n * self.angle(t_s).sin() }
    }

    /// The part of `from_s..to_s` in which it acts.
    pub fn overlap(&self, from_s: f64, to_s: f64) -> Option<(f64, f64)> {
        let (a, b) = (self.start_s.max(from_s), self.end_s.min(to_s));
        (a < b).then_some((a, b))
    }

    /// The same force on a clock whose zero is at `zero_s`.
    #[must_use]
    pub fn seen_from(&self, zero_s: f64) -> Self {
        Self { start_s: self.start_s - zero_s, end_s: self.end_s - zero_s, ..*self }
    }

    /// ∫ e^{λ (to − τ)} f(τ) dτ over `from_s..to_s` (N s), exactly: what a mode z' = λ z + f has
    /// gained by `to_s`.
    pub fn gained(&self, lambda: Complex<f64>, from_s: f64, to_s: f64) -> Complex<f64> {
        let Some((a, b)) = self.overlap(from_s, to_s) else { return Complex::ZERO };
        let h = b - a;
        let turn = Complex::new(0.0, self.omega);
        let at_end = Complex::cis(self.angle(b));
        // sin = (e^{iψ} − e^{−iψ}) / 2i, and ∫ e^{λ(b−τ)} e^{±iψ(τ)} dτ = e^{±iψ(b)} h φ((λ ∓ iΩ)
        // h).
        let plus = at_end * phi((lambda - turn) * h);
        let minus = at_end.conj() * phi((lambda + turn) * h);
        let decay = if b < to_s { (lambda * (to_s - b)).exp() } else { Complex::ONE };
        decay * (plus - minus) * Complex::new(0.0, -0.5 * self.amplitude_n * h)
    }
}

/// φ(x) = (eˣ − 1) / x, accurate to rounding even near zero.
pub fn phi(x: Complex<f64>) -> Complex<f64> {
    if x.norm_sqr() > 0.25 {
        return (x.exp() - 1.0) / x;
    }
    // Σ xᵏ / (k + 1)!: at |x| ≤ 1/2 the sixteenth term is below 1e-18.
    (1..=16).rev().fold(Complex::ONE, |sum, k| sum * x / f64::from(k + 1) + 1.0)
}

/// φ₂(x) = (eˣ − 1 − x) / x², accurate to rounding even near zero: for a force that rises linearly
/// from zero.
pub fn phi_rising(x: Complex<f64>) -> Complex<f64> {
    if x.norm_sqr() > 0.25 {
        return (phi(x) - 1.0) / x;
    }
    // Σ xᵏ / (k + 2)!
    0.5 * (1..=16).rev().fold(Complex::ONE, |sum, k| sum * x / f64::from(k + 2) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phi_is_smooth_where_its_two_forms_meet() {
        for angle in [0.0, 1.0, 2.0, 3.0] {
            let x = Complex::from_polar(0.5, angle);
            // Both forms lose at most a few roundings at |x| = 1/2.
            assert!((phi(x * (1.0 - 1e-12)) - phi(x * (1.0 + 1e-12))).norm() < 1e-11);
            assert!((phi(x) - (x.exp() - 1.0) / x).norm() < 1e-15);
            assert!((phi_rising(x * (1.0 - 1e-12)) - phi_rising(x * (1.0 + 1e-12))).norm() < 1e-11);
            assert!((phi_rising(x) - (x.exp() - 1.0 - x) / (x * x)).norm() < 2e-15);
        }
    }

    #[test]
    fn gained_agrees_with_a_fine_sum() {
        let segment = ForceSegment::half_sine(1e-3, 4.1e-4, 50.0);
        let lambda = Complex::new(-300.0, 7000.0);
        let (from, to) = (0.9e-3, 1.5e-3);
        let steps = 200_000;
        let h = (to - from) / f64::from(steps);
        let mut sum: Complex<f64> = Complex::ZERO;
        for k in 0..steps {
            let t = from + (f64::from(k) + 0.5) * h;
            sum += (lambda * (to - t)).exp() * (segment.value_n(t) * h);
        }
        let exact = segment.gained(lambda, from, to);
        // The midpoint sum's own error, (Ωh)²/24 with a kink at each end, is below 1e-9.
        assert!((sum - exact).norm() < 1e-8 * exact.norm());
        // Pieces add up: e^{λh} carries the first to the end of the second.
        let mid = 1.2e-3;
        let pieces =
            segment.gained(lambda, from, mid) * (lambda * (to - mid)).exp() + segment.gained(lambda, mid, to);
        assert!((pieces - exact).norm() < 1e-13 * exact.norm());
    }
}

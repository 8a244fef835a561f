//! H1, H2 and Hv of one line from S_ff (real), S_xf = Σ X F* and S_xx (real), all sums over the
//! same hits.
//!
//! Where the force or the cross-spectrum is zero, the estimate is 0 (and so is the coherence).

use num_complex::Complex;

/// S_xf / S_ff: biased low by noise in the force.
pub fn h1(s_ff: f64, s_xf: Complex<f64>) -> Complex<f64> {
    if s_ff == 0.0 { Complex::default() } else { s_xf / s_ff }
}

/// S_xx / S_fx: biased high by noise in the response.
pub fn h2(s_xf: Complex<f64>, s_xx: f64) -> Complex<f64> {
    if s_xf.norm_sqr() == 0.0 { Complex::default() } else { s_xx / s_xf.conj() }
}

/// Total least squares for noise in both, where κ = `noise_ratio` is the response's noise power
/// over the force's, (SI/N)²: (S_xx − κ S_ff + √((S_xx − κ S_ff)² + 4 κ |S_xf|²)) / (2 S_fx).
///
/// `None` uses κ = S_xx / S_ff on each line, i.e. noise in proportion to the signals. This gives
/// the phase of the cross-spectrum with the geometric mean of |H1| and |H2|, and does not depend on
/// units. κ → ∞ is H1, κ → 0 is H2.
pub fn hv(s_ff: f64, s_xf: Complex<f64>, s_xx: f64, noise_ratio: Option<f64>) -> Complex<f64> {
    let cross = s_xf.norm_sqr();
    if cross == 0.0 || s_ff == 0.0 {
        return Complex::default();
    }
    let Some(kappa) = noise_ratio else { return s_xf / cross.sqrt() * (s_xx / s_ff).sqrt() };
    let difference = s_xx - kappa * s_ff;
    let root = difference.hypot(2.0 * kappa.sqrt() * cross.sqrt());
    // for a negative difference the sum would suffer from cancellation: use the equivalent quotient
    let sum = if difference >= 0.0 { difference + root } else { 4.0 * kappa * cross / (root - difference) };
    sum / (2.0 * s_xf.conj())
}

/// |H|²(1 − γ²)/(2 n γ²): variance of the real part of H1, and of its imaginary part (Bendat and
/// Piersol). Infinite at γ² = 0.
pub fn variance_of_part(h1: Complex<f64>, coherence: f64, hits: usize) -> f64 {
    if coherence == 0.0 {
        return f64::INFINITY;
    }
    h1.norm_sqr() * (1.0 - coherence).max(0.0) / (2.0 * hits as f64 * coherence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        #[test]
        fn hv_lies_between_h1_and_h2(
            s_ff in 1e-6..1e6f64, s_xx in 1e-6..1e6f64, coherence in 1e-6..0.999_999f64, phase in 0.0..6.2f64, k in 1e-9..1e9f64,
        ) {
            let s_xf = Complex::from_polar((coherence * s_ff * s_xx).sqrt(), phase);
            for ratio in [None, Some(k)] {
                let v = hv(s_ff, s_xf, s_xx, ratio);
                prop_assert!(v.norm() >= h1(s_ff, s_xf).norm() * (1.0 - 1e-9));
                prop_assert!(v.norm() <= h2(s_xf, s_xx).norm() * (1.0 + 1e-9));
                prop_assert!((v / s_xf).im.abs() <= 1e-9 * (v / s_xf).norm());
            }
            // noise in proportion to the signals corresponds to one value of the ratio
            let same = hv(s_ff, s_xf, s_xx, Some(s_xx / s_ff));
            prop_assert!((same - hv(s_ff, s_xf, s_xx, None)).norm() <= 1e-9 * same.norm());
        }
    }

    #[test]
    fn nothing_is_made_of_nothing() {
        let zero = Complex::default();
        assert_eq!((h1(0.0, zero), h2(zero, 1.0), hv(0.0, zero, 1.0, Some(1.0))), (zero, zero, zero));
    }
}

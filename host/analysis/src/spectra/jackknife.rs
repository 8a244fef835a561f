//! The variance of H1 from the hits themselves, by leaving out one hit at a time.
//!
//! The coherence formula assumes that the force spectra of all hits have the same shape and that
//! the hits differ by noise only; the jackknife also includes other variations between hits (aim, a
//! loosening joint).

use num_complex::Complex;

/// Variance of the real part of H1, which equals that of its imaginary part, at one line: half of
/// (n − 1)/n Σ |H₍₋ᵢ₎ − H̄|². NaN below two hits.
pub fn variance_of_part(force: &[Complex<f64>], response: &[Complex<f64>]) -> f64 {
    let n = force.len().min(response.len());
    if n < 2 {
        return f64::NAN;
    }
    let s_ff: f64 = force.iter().map(Complex::norm_sqr).sum();
    let s_xf: Complex<f64> = response.iter().zip(force).map(|(x, f)| x * f.conj()).sum();
    if s_ff == 0.0 {
        return f64::INFINITY;
    }
    let without: Vec<Complex<f64>> =
        response.iter().zip(force).map(|(x, f)| (s_xf - x * f.conj()) / (s_ff - f.norm_sqr())).collect();
    let mean = without.iter().sum::<Complex<f64>>() / n as f64;
    let scatter: f64 = without.iter().map(|h| (h - mean).norm_sqr()).sum();
    0.5 * (n as f64 - 1.0) / n as f64 * scatter
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_forces_give_the_variance_of_a_mean() {
        let force = vec![Complex::new(2.0, 0.0); 4];
        let h = [1.0, 2.0, 4.0, 9.0];
        let response: Vec<_> = h.iter().map(|h| Complex::new(2.0 * h, 0.0)).collect();
        // mean 4, squares 9 + 4 + 0 + 25 = 38; variance of the mean 38 / (3 · 4), half of it for
        // each part
        assert!((variance_of_part(&force, &response) - 38.0 / 24.0).abs() < 1e-12);
        assert!(variance_of_part(&force[..1], &response[..1]).is_nan());
    }
}

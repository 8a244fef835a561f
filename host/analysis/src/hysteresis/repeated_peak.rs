//! Checks whether a peak of Im Δx/T is present in every hit, or is noise.
//!
//! Of several hundred lines one is always the largest. Where T is weak the noise of Δx/T is also
//! largest, so in a noisy measurement the largest line lies there and looks like a resonance.
//! Independent groups of hits, which share only the structure, distinguish the two.

use super::compliance::ContactCompliance;

/// Fewest groups of hits needed to estimate their scatter.
pub const FEWEST_GROUPS: usize = 3;
/// Standard errors by which a peak must exceed the noise: the largest of 600 lines of noise reaches
/// 4 in one of thirty measurements.
pub const CLEAR: f64 = 5.0;
/// The noise is averaged over lines within this distance, Hz: a few groups at a single line give a
/// poor estimate of the scatter.
const NEAR_HZ: f64 = 5.0;

/// |Im D| at `peak_hz` over its standard error, from independent groups of hits on the same lines.
/// `None` with fewer than [`FEWEST_GROUPS`].
pub fn over_noise(groups: &[ContactCompliance], peak_hz: f64) -> Option<f64> {
    if groups.len() < FEWEST_GROUPS {
        return None;
    }
    let smooth: Vec<Vec<(f64, f64)>> = groups.iter().map(|own| near(own, peak_hz)).collect();
    let lines = smooth.iter().map(Vec::len).min()?;
    let n = groups.len() as f64;
    // mean and its variance, line by line
    let at = |l: usize| {
        let mean = smooth.iter().map(|own| own[l].1).sum::<f64>() / n;
        let scatter: f64 = smooth.iter().map(|own| (own[l].1 - mean).powi(2)).sum();
        (smooth[0][l].0, mean, scatter / (n * (n - 1.0)))
    };
    let told: Vec<(f64, f64, f64)> = (0..lines).map(at).collect();
    let peak = told.iter().min_by(|a, b| (a.0 - peak_hz).abs().total_cmp(&(b.0 - peak_hz).abs()))?;
    let around = told.iter().map(|(_, _, variance)| variance).sum::<f64>() / lines as f64;
    let variance = around.max(peak.2);
    (variance > 0.0).then(|| peak.1.abs() / variance.sqrt())
}

/// Frequency and smoothed imaginary part of the lines around `peak_hz`.
fn near(compliance: &ContactCompliance, peak_hz: f64) -> Vec<(f64, f64)> {
    let lines = compliance.smoothed();
    lines.into_iter().filter(|(f, _)| (f - peak_hz).abs() <= NEAR_HZ).map(|(f, d)| (f, d.im)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Four groups of hits on a contact of compliance 1, with large noise near 120 Hz, and
    /// optionally a mode at 200 Hz.
    fn groups(mode: f64, seed: u64) -> Vec<ContactCompliance> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let frequency_hz: Vec<f64> = (0..=700).map(|l| 80.0 + 0.5 * f64::from(l)).collect();
        let mut group = || {
            let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
            let line = |f: &f64| {
                let loud = 0.02 + 2.0 / (1.0 + (f - 120.0).powi(2) / 9.0);
                let resonance = mode / Complex::new(1.0 - (f / 200.0).powi(2), 0.03);
                Complex::new(1.0 + loud * noise(), loud * noise()) + resonance
            };
            frequency_hz.iter().map(line).collect()
        };
        (0..4)
            .map(|_| ContactCompliance { frequency_hz: frequency_hz.clone(), compliance_m_per_n: group() })
            .collect()
    }

    fn mean(groups: &[ContactCompliance]) -> ContactCompliance {
        let sum = |l: usize| groups.iter().map(|g| g.compliance_m_per_n[l]).sum::<Complex<f64>>() / 4.0;
        let frequency_hz = groups[0].frequency_hz.clone();
        ContactCompliance { compliance_m_per_n: (0..frequency_hz.len()).map(sum).collect(), frequency_hz }
    }

    #[test]
    fn noise_does_not_repeat_and_a_mode_does() {
        let mut looked_like_one = 0;
        for seed in 0..200 {
            let quiet = groups(0.0, seed);
            let peak = mean(&quiet).imaginary_peak().expect("lines enough");
            looked_like_one += u32::from(peak.stands_out());
            let clear = over_noise(&quiet, peak.frequency_hz).expect("four groups");
            assert!(clear < CLEAR, "noise of seed {seed}: {clear}");
            let ringing = groups(0.1, seed);
            assert!(over_noise(&ringing, 200.0).expect("four groups") > CLEAR);
        }
        assert!(looked_like_one > 150, "the noise is loud enough to mislead: {looked_like_one}");
    }

    #[test]
    fn two_groups_tell_no_scatter() {
        assert_eq!(over_noise(&groups(0.1, 1)[..2], 200.0), None);
    }
}

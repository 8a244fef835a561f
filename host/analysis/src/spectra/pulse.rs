//! Where the hammer's main pulse is in a force record, and how high it really is.

use crate::median::middle;
use crate::vectors::{all_finite, largest};

/// Fraction of the peak that bounds the pulse.
const EDGE: f64 = 0.02;

/// A block of samples whose rms is one estimate of the noise; the median over the record is robust against pulses.
const NOISE_BLOCK: usize = 64;

/// The main pulse: the highest of the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulse {
    /// Sample of the largest value.
    pub peak_sample: usize,
    /// First sample above 2 % of the peak (or the noise, where that is higher).
    pub start: usize,
    /// First sample after the pulse.
    pub end: usize,
    /// Peak of the band-limited signal above the offset, N: half-millisecond pulses are some twenty samples, and the
    /// largest of them may be a per cent below the true peak.
    pub peak_n: f64,
    /// Resting level of the record, N.
    pub offset_n: f64,
    /// Noise of the record, N rms.
    pub noise_n: f64,
}

impl Pulse {
    /// Finds the pulse; none in an empty or constant record or one with values that are not numbers.
    pub fn locate(force_n: &[f64]) -> Option<Pulse> {
        if !all_finite(force_n) {
            return None;
        }
        let offset_n = middle(force_n)?;
        let noise_n = middle(&rms_of_blocks(force_n, offset_n))?;
        let highest = largest(force_n);
        let peak_sample = force_n.iter().position(|v| *v == highest)?;
        let top = highest - offset_n;
        if top <= 0.0 {
            return None;
        }
        let edge = (EDGE * top).max(4.0 * noise_n).min(0.5 * top);
        let inside = |i: &usize| force_n[*i] - offset_n >= edge;
        let start = (0..=peak_sample).rev().take_while(inside).last().unwrap_or(peak_sample);
        let end = (peak_sample..force_n.len()).take_while(inside).last().unwrap_or(peak_sample) + 1;
        let peak_n = band_limited_peak(force_n, peak_sample) - offset_n;
        Some(Pulse { peak_sample, start, end, peak_n, offset_n, noise_n })
    }

    /// Samples from start to end.
    pub fn width(&self) -> usize {
        self.end - self.start
    }
}

/// Root mean square about `offset` of each block.
fn rms_of_blocks(x: &[f64], offset: f64) -> Vec<f64> {
    // a sum waits for its own last addition: those of several blocks do not wait for one another
    const TOGETHER: usize = 8;
    let rms = |sum: f64, count: usize| (sum / count as f64).sqrt();
    let mut all = Vec::with_capacity(x.len().div_ceil(NOISE_BLOCK));
    let mut groups = x.chunks_exact(TOGETHER * NOISE_BLOCK);
    for group in groups.by_ref() {
        let mut sums = [0.0; TOGETHER];
        for i in 0..NOISE_BLOCK {
            for (block, sum) in sums.iter_mut().enumerate() {
                *sum += (group[block * NOISE_BLOCK + i] - offset).powi(2);
            }
        }
        all.extend(sums.map(|sum| rms(sum, NOISE_BLOCK)));
    }
    let rest = groups.remainder().chunks(NOISE_BLOCK);
    all.extend(rest.map(|b| rms(b.iter().map(|v| (v - offset).powi(2)).sum(), b.len())));
    all
}

/// The largest value within one sample of `peak` of the record interpolated sixteenfold by a windowed sinc.
fn band_limited_peak(x: &[f64], peak: usize) -> f64 {
    const STEPS: i32 = 16;
    const REACH: i32 = 16;
    (-STEPS..=STEPS)
        .map(|step| {
            let t = f64::from(step) / f64::from(STEPS);
            (-REACH..=REACH)
                .map(|k| {
                    // constant beyond the record's ends
                    let at = peak.saturating_add_signed(k as isize).min(x.len() - 1);
                    x[at] * sinc(t - f64::from(k)) * sinc((t - f64::from(k)) / f64::from(REACH + 1))
                })
                .sum()
        })
        .fold(x[peak], f64::max)
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn half_sine(peak: f64, start: f64, width: f64, n: usize) -> Vec<f64> {
        (0..n)
            .map(|i| {
                let t = (i as f64 - start) / width;
                if (0.0..1.0).contains(&t) { peak * (std::f64::consts::PI * t).sin() } else { 0.0 }
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(11), ..ProptestConfig::default() })]

        #[test]
        fn the_peak_does_not_depend_on_where_the_samples_fall(start in 250.0..251.0f64, width in 15.0..40.0f64) {
            let pulse = Pulse::locate(&half_sine(50.0, start, width, 1000)).expect("a pulse");
            // a half sine's corners are not band-limited: a few parts in a thousand at fifteen samples
            prop_assert!((pulse.peak_n / 50.0 - 1.0).abs() < 5e-3, "{}", pulse.peak_n);
            prop_assert!((pulse.start as f64 - start).abs() < 2.0 && (pulse.end as f64 - start - width).abs() < 2.0);
        }
    }

    #[test]
    fn no_pulse_in_nothing() {
        assert_eq!(Pulse::locate(&[]), None);
        assert_eq!(Pulse::locate(&[1.0; 100]), None);
        assert_eq!(Pulse::locate(&[0.0, f64::NAN, 1.0]), None);
    }
}

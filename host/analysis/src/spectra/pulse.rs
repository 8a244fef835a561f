//! Where the hammer's main pulse is in a force record, and how high it really is.

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
        if force_n.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let offset_n = middle(force_n)?;
        let mut rms: Vec<f64> = force_n
            .chunks(NOISE_BLOCK)
            .map(|b| (b.iter().map(|v| (v - offset_n).powi(2)).sum::<f64>() / b.len() as f64).sqrt())
            .collect();
        let at = rms.len() / 2;
        let noise_n = *rms.select_nth_unstable_by(at, f64::total_cmp).1;
        let (peak_sample, top) =
            force_n.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        let top = top - offset_n;
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

fn middle(values: &[f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let mut sorted = values.to_vec();
    let at = sorted.len() / 2;
    Some(*sorted.select_nth_unstable_by(at, f64::total_cmp).1)
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

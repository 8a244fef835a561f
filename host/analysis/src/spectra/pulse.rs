//! Finds the hammer's main pulse in a force record, and its true height.
//!
//! It also detects faults of a record that should contain one hit: a force of the wrong sign, a
//! record that begins or ends within the pulse, and several hits in one record.

use crate::median::middle;
use crate::vectors::{all_finite, largest};
use std::ops::Range;

/// Fraction of the peak that bounds the pulse.
const EDGE: f64 = 0.02;

/// The feet of the pulse extend down to this fraction of the peak, or to the noise,
const FOOT: f64 = 1e-3;

/// but no further than this many widths from the edges.
const LONGEST_FOOT: usize = 4;

/// The force has the wrong sign if it falls this many times further below its resting level than it
/// rises above it. The undershoot of an AC-coupled cell is a small fraction of its pulse.
const REVERSED: f64 = 2.0;

/// Another pulse counts as a separate hit if it has at least this fraction of the highest one
const OWN_HIT: f64 = 0.3;

/// and occurs this long after the one before, s. A bouncing hammer returns within a tenth of a
/// second.
const OWN_HIT_AFTER_S: f64 = 0.25;

/// Samples per block; the rms of each block is one estimate of the noise, and their median over the
/// record is robust against pulses.
const NOISE_BLOCK: usize = 64;

/// The main pulse: the highest of the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulse {
    /// Sample of the largest value.
    pub peak_sample: usize,
    /// First sample above 2 % of the peak (or above the noise, if that is higher).
    pub start: usize,
    /// First sample after the pulse.
    pub end: usize,
    /// Peak of the band-limited signal above the offset, N: a half-millisecond pulse has only about
    /// twenty samples, and the largest of them may be one per cent below the true peak.
    pub peak_n: f64,
    /// Resting level of the record, N.
    pub offset_n: f64,
    /// Noise of the record, N rms.
    pub noise_n: f64,
}

impl Pulse {
    /// Finds the pulse; `None` in an empty or constant record or one with values that are not
    /// finite.
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

    /// Number of samples from start to end.
    pub fn width(&self) -> usize {
        self.end - self.start
    }

    /// The samples that contain the whole pulse, including its feet, in the record in which it was
    /// found.
    pub fn whole(&self, force_n: &[f64]) -> Range<usize> {
        let top = force_n[self.peak_sample] - self.offset_n;
        let level = (FOOT * top).max(2.0 * self.noise_n);
        let foot = |i: &usize| force_n[*i] - self.offset_n > level;
        let most = LONGEST_FOOT * self.width();
        let before = (0..self.start).rev().take(most).take_while(foot).count();
        let after = (self.end..force_n.len()).take(most).take_while(foot).count();
        // the part below the level: an exponential tail that ends in noise of 1 % of the peak has 4
        // % of its impulse there; after one more width, less than a thousandth
        let (ahead, behind) = (self.width().div_ceil(2) + 2, self.width() + 2);
        let first = self.start.saturating_sub(before + ahead);
        first..(self.end + after + behind).min(force_n.len())
    }

    /// The impulse of the force outside the samples `kept`, as a fraction of the pulse's impulse:
    /// the larger of the impulses before and after, each within twice the length of `kept`. 0 where
    /// it does not exceed the noise.
    pub fn impulse_outside(&self, force_n: &[f64], kept: Range<usize>) -> f64 {
        let sum = |range: Range<usize>| -> f64 { force_n[range].iter().map(|f| f - self.offset_n).sum() };
        let reach = 2 * kept.len();
        let own = sum(self.start..self.end);
        let beside =
            [kept.start.saturating_sub(reach)..kept.start, kept.end..(kept.end + reach).min(force_n.len())];
        let part = |range: Range<usize>| {
            let by_chance = 4.0 * self.noise_n * (range.len() as f64).sqrt();
            let found = sum(range).abs();
            if found > by_chance { found / own } else { 0.0 }
        };
        beside.into_iter().map(part).fold(0.0, f64::max)
    }
}

/// The negative peak of the force, N, relative to its resting level, if the sign is inverted, i.e.
/// the force falls during the hit.
pub fn reversed_peak_n(force_n: &[f64]) -> Option<f64> {
    let turned: Vec<f64> = force_n.iter().map(|f| -f).collect();
    let fall = Pulse::locate(&turned)?;
    let rise = Pulse::locate(force_n).map_or(0.0, |pulse| pulse.peak_n);
    (fall.peak_n > 10.0 * fall.noise_n && fall.peak_n > REVERSED * rise).then_some(-fall.peak_n)
}

/// Start times of the hits of a record, s, if it contains more than one.
pub fn several_hits_s(force_n: &[f64], fs_hz: f64) -> Option<Vec<f64>> {
    let main = Pulse::locate(force_n)?;
    let apart = (OWN_HIT_AFTER_S * fs_hz).ceil() as usize;
    let level = main.offset_n + (OWN_HIT * main.peak_n).max(10.0 * main.noise_n);
    let mut starts: Vec<usize> = Vec::new();
    let mut last_above: Option<usize> = None;
    for (i, _) in force_n.iter().enumerate().filter(|(_, f)| **f >= level) {
        if last_above.is_none_or(|last| i - last > apart) {
            starts.push(i);
        }
        last_above = Some(i);
    }
    (starts.len() > 1).then(|| starts.into_iter().map(|start| start as f64 / fs_hz).collect())
}

/// Root mean square about `offset` of each block.
fn rms_of_blocks(x: &[f64], offset: f64) -> Vec<f64> {
    // several sums in parallel, since each addition to a single sum waits for the one before
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

/// The largest value within one sample of `peak`, with the record interpolated sixteenfold by a
/// windowed sinc.
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
            // the corners of a half sine are not band-limited: a few parts in a thousand at fifteen
            // samples
            prop_assert!((pulse.peak_n / 50.0 - 1.0).abs() < 5e-3, "{}", pulse.peak_n);
            prop_assert!((pulse.start as f64 - start).abs() < 2.0 && (pulse.end as f64 - start - width).abs() < 2.0);
        }
    }

    fn hann(peak: f64, start: f64, width: f64, n: usize) -> Vec<f64> {
        let inside = |t: f64| (0.0..1.0).contains(&t);
        let value = |t: f64| 0.5 * peak * (1.0 - (2.0 * std::f64::consts::PI * t).cos());
        let t = |i: usize| (i as f64 - start) / width;
        (0..n).map(|i| if inside(t(i)) { value(t(i)) } else { 0.0 }).collect()
    }

    #[test]
    fn the_whole_pulse_has_its_impulse_whatever_its_shape_and_width() {
        let gauss = |width: f64| -> Vec<f64> {
            (0..4000).map(|i| 30.0 * (-((f64::from(i) - 1000.0) / width).powi(2)).exp()).collect()
        };
        // a soft tip that releases slowly
        let tail = |width: f64| -> Vec<f64> {
            let t = |i: i32| (f64::from(i) - 1000.0) / width;
            (0..4000).map(|i| if t(i) < 0.0 { 0.0 } else { 30.0 * t(i) * (-2.0 * t(i)).exp() }).collect()
        };
        for width in [5.0, 20.0, 90.0, 300.0] {
            for force in [
                half_sine(50.0, 1000.3, width, 4000),
                hann(50.0, 1000.3, width, 4000),
                gauss(width),
                tail(width),
            ] {
                let pulse = Pulse::locate(&force).expect("a pulse");
                let kept = pulse.whole(&force);
                let all: f64 = force.iter().sum();
                let inside: f64 = force[kept.clone()].iter().sum();
                assert!((inside / all - 1.0).abs() < 2e-3, "{width}: {inside} of {all}");
                assert!(pulse.impulse_outside(&force, kept.clone()) < 2e-3);
                let half = pulse.impulse_outside(&force, kept.start..pulse.peak_sample);
                assert!(half > 0.2, "{width}: {half}");
            }
        }
    }

    #[test]
    fn a_reversed_force_is_told_from_an_undershoot() {
        let mut force = hann(25.0, 300.0, 20.0, 4000);
        assert_eq!(reversed_peak_n(&force), None);
        // an AC-coupled cell undershoots by a tenth
        for (i, f) in force.iter_mut().enumerate().skip(320) {
            *f -= 2.5 * (-((i - 320) as f64) / 400.0).exp();
        }
        assert_eq!(reversed_peak_n(&force), None);
        let turned: Vec<f64> = force.iter().map(|f| 3.0 - f).collect();
        let peak_n = reversed_peak_n(&turned).expect("reversed");
        assert!((peak_n + 25.0).abs() < 0.5, "{peak_n}");
        assert_eq!(reversed_peak_n(&[1.0; 100]), None);
    }

    #[test]
    fn hits_are_counted_and_a_bounce_is_not_one() {
        let add = |one: &mut Vec<f64>, other: Vec<f64>| {
            one.iter_mut().zip(other).for_each(|(a, b)| *a += b);
        };
        let mut force = hann(25.0, 300.0, 8.0, 10_000);
        add(&mut force, hann(15.0, 700.0, 8.0, 10_000));
        assert_eq!(several_hits_s(&force, 5120.0), None, "a bounce after 78 ms");
        add(&mut force, hann(20.0, 4000.0, 8.0, 10_000));
        add(&mut force, hann(26.0, 9000.0, 8.0, 10_000));
        let hits = several_hits_s(&force, 5120.0).expect("three");
        assert_eq!(hits.len(), 3);
        assert!((hits[1] - 4002.0 / 5120.0).abs() < 2e-3, "{hits:?}");
    }

    #[test]
    fn no_pulse_in_nothing() {
        assert_eq!(Pulse::locate(&[]), None);
        assert_eq!(Pulse::locate(&[1.0; 100]), None);
        assert_eq!(Pulse::locate(&[0.0, f64::NAN, 1.0]), None);
    }
}

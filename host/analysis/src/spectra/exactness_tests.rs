//! A known system must be recovered exactly: FRFs of a synthetic oscillator on s = σ + iω.

use super::*;
use num_complex::Complex;
use std::f64::consts::{PI, TAU};

const FS: f64 = 4096.0;
const N: usize = 4096;

/// Force: half sine of `width` samples from `start`; response: the force convolved with a decaying
/// sine.
fn record(start: usize, width: usize, delay: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let force: Vec<f64> = (0..N)
        .map(|i| {
            if (start..start + width).contains(&i) {
                50.0 * (PI * (i - start) as f64 / width as f64).sin()
            } else {
                0.0
            }
        })
        .collect();
    let h: Vec<f64> = (0..N)
        .map(|i| {
            let t = i as f64 / FS;
            (-30.0 * t).exp() * (TAU * 200.0 * t).cos()
        })
        .collect();
    let mut x = vec![0.0; N];
    for (i, f) in force.iter().enumerate().filter(|(_, f)| **f != 0.0) {
        for j in (i + delay)..N {
            x[j] += f * h[j - i - delay];
        }
    }
    (force, x, h)
}

/// Σ h e^(−s n Δt): the sampled system's transfer function.
fn exact(h: &[f64], s: Complex<f64>) -> Complex<f64> {
    h.iter().enumerate().map(|(i, h)| h * (-s * (i as f64 / FS)).exp()).sum()
}

fn records(start: usize, delay: usize) -> (ImpactRecords, Vec<f64>) {
    let (force, x, h) = record(start, 20, delay);
    let records = ImpactRecords {
        fs_hz: FS,
        force_n: vec![force],
        response: vec![vec![x]],
        quantity: MotionQuantity::Velocity,
    };
    (records, h)
}

#[test]
fn weighting_both_is_exact_on_s_and_weighting_one_is_not() {
    let (records, h) = records(100, 0);
    let mut settings = FrfSettings::default();
    settings.windowing.sigma_per_s = 20.0;
    settings.windowing.force_after_s = 0.01;
    let error = |settings: &FrfSettings| {
        let y = estimate(&records, &[true], settings).expect("one hit");
        let s = Complex::new(20.0, TAU * y.frequency_hz()[180]);
        ((y.h1(180, 0) - exact(&h, s)) / exact(&h, s)).norm()
    };
    // The record's end truncates e^(−50 t): 1e-22 after one second. What is left is rounding.
    assert!(error(&settings) < 1e-10, "{:e}", error(&settings));
    settings.windowing.force_weighting = ForceWeighting::Rectangular;
    // About σ times half the pulse's width of 4.9 ms.
    assert!(error(&settings) > 0.02, "{:e}", error(&settings));
}

#[test]
fn a_late_channel_is_put_right() {
    let (records, h) = records(100, 3);
    let mut settings = FrfSettings::default();
    settings.windowing.sigma_per_s = 5.0;
    settings.windowing.force_after_s = 0.01;
    settings.delay_s = vec![3.0 / FS];
    let y = estimate(&records, &[true], &settings).expect("one hit");
    let s = Complex::new(5.0, TAU * y.frequency_hz()[300]);
    // the record's end truncates e^(−35 t)
    assert!(((y.h1(300, 0) - exact(&h, s)) / exact(&h, s)).norm() < 1e-10);
}

#[test]
fn a_single_hit_has_no_coherence_and_no_variance() {
    let (records, _) = records(100, 0);
    let y = estimate(&records, &[true], &FrfSettings::default()).expect("one hit");
    assert!(y.coherence(200, 0).is_nan() && y.variance(200, 0).is_nan());
    assert_eq!(estimate(&records, &[false], &FrfSettings::default()), Err(SpectraError::NoHits));
}

/// The variance formula compared with the scatter of many simulated averages.
#[test]
fn the_variance_formula_predicts_the_scatter() {
    use proptest::test_runner::{RngAlgorithm, TestRng};
    use rand_like::Gauss;
    let mut noise = Gauss(TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let (force, x, _) = record(50, 20, 0);
    let (force, x) = (force[..512].to_vec(), x[..512].to_vec());
    let line = 20;
    let mut parts = Vec::new();
    let (mut predicted, mut left_out) = (0.0, 0.0);
    let trials = 150;
    for _ in 0..trials {
        let mut average = SpectraAverage::new(FS, 512, 1).with_jackknife();
        for _ in 0..16 {
            let noisy = x.iter().map(|x| x + 20.0 * noise.next()).collect();
            average.add(&force, &[noisy]).expect("alike");
        }
        let y = average.finish(0.0, &[]).expect("hits");
        parts.push(y.h1(line, 0).re);
        predicted += y.variance(line, 0) / f64::from(trials);
        left_out += y.jackknife().expect("asked for")[line][0] / f64::from(trials);
    }
    let mean = parts.iter().sum::<f64>() / parts.len() as f64;
    let seen = parts.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / parts.len() as f64;
    // a variance from 150 trials is known to 12 %; the limit is three times that
    assert!((seen / predicted - 1.0).abs() < 0.36, "seen {seen:e}, predicted {predicted:e}");
    assert!((seen / left_out - 1.0).abs() < 0.36, "seen {seen:e}, jackknife {left_out:e}");
}

#[test]
fn a_band_is_a_part_of_the_whole_and_the_force_stays_whole() {
    let (records, _) = records(100, 3);
    for jackknife in [false, true] {
        let whole = FrfSettings { jackknife, delay_s: vec![3.0 / FS], ..FrfSettings::default() };
        let all = estimate(&records, &[true], &whole).expect("one hit");
        for [low_hz, high_hz] in [[0.0, f64::MAX], [10.0, 100.0], [10.1, 10.2], [1e9, 2e9]] {
            let settings = FrfSettings { band_hz: Some([low_hz, high_hz]), ..whole.clone() };
            let sums = estimate::summed(&records, &[true], &settings).expect("one hit");
            let part = sums.finish(2.3, &settings.delay_s).expect("one hit");
            // compare as text, because the NaN variance of a single hit is not equal to itself
            assert_eq!(format!("{part:?}"), format!("{:?}", all.band(low_hz, high_hz)));
            let force = sums.force(2.3).expect("one hit");
            assert_eq!(force.force_spectrum(), all.force_spectrum());
        }
    }
}

#[test]
fn zero_padding_adds_lines_and_moves_none() {
    let (records, h) = records(100, 0);
    let settings = FrfSettings { transform_samples: Some(4 * N), ..FrfSettings::default() };
    let mut plain = FrfSettings::default();
    plain.windowing.force_after_s = 0.01;
    let mut settings = FrfSettings { windowing: plain.windowing, ..settings };
    let y = estimate(&records, &[true], &settings).expect("one hit");
    let unpadded = estimate(&records, &[true], &plain).expect("one hit");
    assert!((y.h1(4 * 180, 0) - unpadded.h1(180, 0)).norm() < 1e-12 * y.h1(4 * 180, 0).norm());
    // a line between the others is exact too, because the response has decayed before the record
    // ends
    let s = Complex::new(2.3, TAU * y.frequency_hz()[721]);
    assert!(((y.h1(721, 0) - exact(&h, s)) / exact(&h, s)).norm() < 1e-10);
    settings.transform_samples = Some(N - 1);
    assert_eq!(
        estimate(&records, &[true], &settings),
        Err(SpectraError::Padding { transform: N - 1, samples: N })
    );
}

#[test]
fn a_force_without_mean_leaves_no_nan_at_zero_frequency() {
    let mut average = SpectraAverage::new(4.0, 4, 1);
    for _ in 0..2 {
        average.add(&[1.0, -1.0, 1.0, -1.0], &[vec![1.0, 0.0, 0.0, 0.0]]).expect("alike");
    }
    let y = average.finish(0.0, &[]).expect("hits");
    for l in 0..2 {
        assert_eq!(
            (y.h1(l, 0).norm(), y.h2(l, 0).norm(), y.hv(l, 0, None).norm(), y.coherence(l, 0)),
            (0.0, 0.0, 0.0, 0.0)
        );
        assert_eq!(y.variance(l, 0), f64::INFINITY);
    }
    assert!((y.h1(2, 0).re - 0.25).abs() < 1e-15);
}

#[test]
fn a_hit_that_is_not_a_number_leaves_the_average_as_it_was() {
    let mut average = SpectraAverage::new(4.0, 4, 1);
    average.add(&[1.0, 0.0, 0.0, 0.0], &[vec![1.0, 2.0, 0.0, 0.0]]).expect("alike");
    let before = average.finish(0.0, &[]).expect("a hit").rows(CrossSpectra::h1);
    let error = average.add(&[1.0, 5.0, 0.0, 0.0], &[vec![1.0, 2.0, f64::NAN, 0.0]]);
    assert_eq!(error, Err(SpectraError::NotFinite { sample: 2 }));
    assert_eq!(average.finish(0.0, &[]).expect("a hit").rows(CrossSpectra::h1), before);
    // written directly into the transforms, so the hit is partly included and the average keeps
    // returning the error
    let response = [f64::INFINITY; 4];
    let error = average.add_with(|f| f.fill(1.0), |_| fft::Windowed::plain(&response));
    assert_eq!(error, Err(SpectraError::NotFinite { sample: 0 }));
    assert_eq!(average.finish(0.0, &[]), Err(SpectraError::NotFinite { sample: 0 }));
}

/// Normal deviates from proptest's generator.
mod rand_like {
    use proptest::prelude::Rng;
    pub(super) struct Gauss<R>(pub(super) R);
    impl<R: Rng> Gauss<R> {
        pub(super) fn next(&mut self) -> f64 {
            // the sum of twelve uniform deviates has variance one
            (0..12).map(|_| self.0.next_u32() as f64 / u32::MAX as f64).sum::<f64>() - 6.0
        }
    }
}

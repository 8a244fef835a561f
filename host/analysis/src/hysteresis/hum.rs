//! The mains' hum at the loop's own frequency.
//!
//! There it cannot be told from the excitation: it is as steady, and every cycle holds it alike. But hum comes with
//! harmonics, and those that do not fall on the loop's own stand free in the spectrum of the whole record.

use super::finding::LoopFinding;
use super::line_sums::{line_sum, turns};
use super::record::{HysteresisRecord, RelativeMotion};
use crate::parallel::{join, prelude::*};
use crate::transforms::forward;
use num_complex::Complex;
use std::f64::consts::TAU;

/// The mains of the world, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Multiples that are looked at.
const MULTIPLES: usize = 10;

/// The mains wander by so much of their frequency.
const WANDER: f64 = 2e-3;

/// Longest stretch that is looked at, s.
const LONGEST_S: f64 = 4.0;

/// Widths of a line (1/duration) that a Blackman-Harris window needs to tell two lines apart.
const APART: f64 = 5.0;

/// A line stands out if its power is this many times the mean of its surroundings: noise alone does once in 10⁷ lines
/// (F distribution of 2 and 2 `SURROUNDINGS` degrees of freedom; the window correlates neighbours in pairs).
const STANDS_OUT: f64 = 25.0;

/// Lines on each side that tell what the surroundings are.
const SURROUNDINGS: i32 = 24;

/// A frequency lies on a line to this part of a line's width, by which no amplitude changes more.
const ON_A_LINE: f64 = 1e-6;

/// Less than this part of the fundamental moves nothing that matters.
const MATTERS: f64 = 2e-3;

/// Looks for hum in a record whose loop runs at `frequency_hz`.
pub(super) fn at_the_loop(record: &HysteresisRecord, frequency_hz: f64) -> Option<LoopFinding> {
    let samples = record.force_n.len().min((LONGEST_S * record.fs_hz) as usize);
    let line_hz = record.fs_hz / samples as f64;
    let multiple = |mains: f64| (frequency_hz / mains).round() * mains;
    // what is no further off than a line's width, or than the mains wander, does not average out
    let near = |mains: &f64| {
        let at = multiple(*mains);
        at > 0.0 && (frequency_hz - at).abs() < line_hz + WANDER * at
    };
    let candidates: Vec<f64> = MAINS_HZ.into_iter().filter(near).collect();
    if candidates.is_empty() {
        return None;
    }
    let (RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
    | RelativeMotion::Displacement { a_m: a, b_m: b }) = &record.motion;
    let relative = || a[..samples].iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    let (force, relative) = join(|| windowed(&record.force_n[..samples]), || windowed(&relative()));
    let strongest = |mains: f64| {
        let of = |signal: &[f64]| part(signal, record.fs_hz, frequency_hz, mains);
        let (force, relative) = join(|| of(&force), || of(&relative));
        force.max(relative)
    };
    candidates
        .into_iter()
        .map(|mains_hz| LoopFinding::Hum { mains_hz, at_hz: multiple(mains_hz), part: strongest(mains_hz) })
        .find(|found| matches!(found, LoopFinding::Hum { part, .. } if *part > MATTERS))
}

/// The strongest multiple of the mains that stands free, over the fundamental; 0 if none stands out.
fn part(signal: &[f64], fs_hz: f64, frequency_hz: f64, mains_hz: f64) -> f64 {
    let line_hz = fs_hz / signal.len() as f64;
    let fft = forward(signal.len());
    let mut spectrum = fft.make_output_vec();
    // lengths are the plan's own, so that nothing can fail
    if fft.process(&mut signal.to_vec(), &mut spectrum).is_err() {
        return 0.0;
    }
    let amplitude = |f: f64| match line_at(f / line_hz) {
        Some(line) if line < spectrum.len() => spectrum[line].norm(),
        _ => line_sum(signal, -TAU * f / fs_hz).norm(),
    };
    let fundamental = amplitude(frequency_hz);
    let free = |f: &f64| {
        let harmonic = (f / frequency_hz).round() * frequency_hz;
        (f - harmonic).abs() > 2.0 * APART * line_hz + WANDER * f && *f < 0.45 * fs_hz
    };
    let multiples: Vec<f64> = (1..=MULTIPLES).map(|m| m as f64 * mains_hz).filter(free).collect();
    let found: Vec<Option<f64>> = multiples
        .into_par_iter()
        .map(|f| {
            // the mains are a little off: the largest of the lines nearby
            let reach = (WANDER * f / line_hz).ceil() as i32;
            let here = (-reach..=reach).map(|o| amplitude(f + f64::from(o) * line_hz)).fold(0.0, f64::max);
            let next = APART as i32 + reach;
            let beside = (next..next + SURROUNDINGS).flat_map(|o| [-o, o]);
            let around: Vec<f64> = beside
                .map(|o| f + f64::from(o) * line_hz)
                .filter(|f| *f > APART * line_hz && free(f))
                .filter_map(|f| spectrum.get((f / line_hz).round() as usize).map(Complex::norm_sqr))
                .collect();
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            (here * here > STANDS_OUT * mean).then_some(here / fundamental)
        })
        .collect();
    found.into_iter().flatten().fold(0.0, f64::max)
}

/// The line of the spectrum at this many widths of a line, if it lies on one: multiples of the mains do in whole seconds.
fn line_at(widths: f64) -> Option<usize> {
    let line = widths.round();
    ((widths - line).abs() < ON_A_LINE).then_some(line as usize)
}

/// Mean taken off, and a Blackman-Harris window put on: 92 dB between lines that are five widths apart.
fn windowed(x: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let half = Complex::from_polar(1.0, 0.5 * TAU / n);
    let turns = turns(0..x.len(), TAU / n);
    x.iter()
        .zip(&turns)
        .map(|(v, turn)| {
            // cosines of twice and three times the angle by that of the angle
            let c = (half * turn).re;
            let (c2, c3) = (2.0 * c * c - 1.0, c * (4.0 * c * c - 3.0));
            (v - mean) * (0.35875 - 0.48829 * c + 0.14128 * c2 - 0.01168 * c3)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FS_HZ: f64 = 51_200.0;

    /// Some 0.6 s of 200 Hz in noise, with this part of hum at 150 Hz.
    fn in_noise(seed: u64, hum: f64) -> Vec<f64> {
        samples_in_noise(30_721, seed, hum)
    }

    fn samples_in_noise(samples: u32, seed: u64, hum: f64) -> Vec<f64> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let signal: Vec<f64> = (0..samples)
            .map(|i| {
                let turns = TAU * f64::from(i) / FS_HZ;
                let noise: f64 = StandardNormal.sample(&mut rng);
                (200.0 * turns).sin() + hum * (150.0 * turns).sin() + 0.15 * noise
            })
            .collect();
        windowed(&signal)
    }

    #[test]
    fn noise_is_no_hum_and_hum_is_found_in_it() {
        for seed in 0..100 {
            for mains in MAINS_HZ {
                let found = part(&in_noise(seed, 0.0), FS_HZ, 200.0, mains);
                assert!(found == 0.0, "seed {seed}: {found} at {mains} Hz");
            }
        }
        for seed in 0..20 {
            let found = part(&in_noise(seed, 0.02), FS_HZ, 200.0, 50.0);
            assert!((found - 0.02).abs() < 0.005, "seed {seed}: {found}");
        }
    }

    /// In 0.6 s multiples of 50 Hz are lines of the spectrum; a sample more, and each is summed by itself.
    #[test]
    fn lines_of_the_spectrum_say_what_sums_say() {
        for seed in 0..20 {
            let [on, off] = [30_720, 30_721].map(|samples| {
                assert_eq!(line_at(50.0 * f64::from(samples) / FS_HZ).is_some(), samples == 30_720);
                part(&samples_in_noise(samples, seed, 0.02), FS_HZ, 200.0, 50.0)
            });
            // one sample of 30 000, and a line's place by 3e-3 of its width
            assert!((on / off - 1.0).abs() < 1e-3, "seed {seed}: {on} {off}");
        }
    }
}

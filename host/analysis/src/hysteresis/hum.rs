//! Mains hum at the loop's own frequency.
//!
//! At that frequency hum cannot be distinguished from the excitation: it is as steady, and
//! identical in every cycle. But hum has harmonics, and those that do not coincide with the loop's
//! own harmonics are isolated in the spectrum of the whole record.

use super::dominant_frequency::{line_sum, turns};
use super::loop_analysis::LoopFinding;
use super::record::{HysteresisRecord, RelativeMotion};
use crate::parallel::{join, prelude::*};
use crate::spectra::fft::forward;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Mains frequencies in use, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Number of multiples that are checked.
const MULTIPLES: usize = 10;

/// Relative variation of the mains frequency.
const WANDER: f64 = 2e-3;

/// Longest part of the record that is used, s.
const LONGEST_S: f64 = 4.0;

/// Line widths (1/duration) that a Blackman-Harris window needs to separate two lines.
const APART: f64 = 5.0;

/// A line stands out if its power is this many times the mean of its surroundings: noise alone
/// exceeds it once in 10⁷ lines (F distribution of 2 and 2 `SURROUNDINGS` degrees of freedom; the
/// window correlates neighbours in pairs).
const STANDS_OUT: f64 = 25.0;

/// Lines on each side that determine the level of the surroundings.
const SURROUNDINGS: i32 = 24;

/// Tolerance, in line widths, for a frequency to count as lying on a line; it changes no amplitude
/// by a larger fraction.
const ON_A_LINE: f64 = 1e-6;

/// Hum below this fraction of the fundamental has no effect worth reporting.
const MATTERS: f64 = 2e-3;

/// Looks for hum in a record whose loop runs at `frequency_hz`.
pub(super) fn at_the_loop(record: &HysteresisRecord, frequency_hz: f64) -> Option<LoopFinding> {
    let samples = record.force_n.len().min((LONGEST_S * record.fs_hz) as usize);
    let line_hz = record.fs_hz / samples as f64;
    let multiple = |mains: f64| (frequency_hz / mains).round() * mains;
    // hum averages out unless it is within a line's width, or within the mains' variation, of the
    // loop's frequency
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

/// The strongest isolated multiple of the mains frequency over the fundamental; 0 if none stands
/// out.
fn part(signal: &[f64], fs_hz: f64, frequency_hz: f64, mains_hz: f64) -> f64 {
    let line_hz = fs_hz / signal.len() as f64;
    let fft = forward(signal.len());
    let mut spectrum = fft.make_output_vec();
    // buffer lengths match the FFT plan, so this cannot fail
    if fft.process(&mut signal.to_vec(), &mut spectrum).is_err() {
        return 0.0;
    }
    let amplitude = |f: f64| amplitude(signal, &spectrum, f, fs_hz);
    let fundamental = amplitude(frequency_hz);
    let free = |f: &f64| {
        let harmonic = (f / frequency_hz).round() * frequency_hz;
        (f - harmonic).abs() > 2.0 * APART * line_hz + WANDER * f && *f < 0.45 * fs_hz
    };
    let multiples: Vec<f64> = (1..=MULTIPLES).map(|m| m as f64 * mains_hz).filter(free).collect();
    let found: Vec<Option<f64>> = multiples
        .into_par_iter()
        .map(|f| {
            // the mains frequency may be slightly off: take the largest of the lines nearby
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

/// |X| at `f`: from the signal's spectrum if that has a line there, as for multiples of the mains
/// frequency in whole seconds, otherwise by direct summation.
fn amplitude(signal: &[f64], spectrum: &[Complex<f64>], f: f64, fs_hz: f64) -> f64 {
    // a real signal has the same magnitude at −f
    let widths = (f * signal.len() as f64 / fs_hz).abs();
    match spectrum.get(widths.round() as usize) {
        Some(line) if (widths - widths.round()).abs() < ON_A_LINE => line.norm(),
        _ => line_sum(signal, -TAU * f / fs_hz).norm(),
    }
}

/// Removes the mean and applies a Blackman-Harris window: 92 dB between lines that are five widths
/// apart.
fn windowed(x: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let half = Complex::from_polar(1.0, 0.5 * TAU / n);
    let turns = turns(0..x.len(), TAU / n);
    x.iter()
        .zip(&turns)
        .map(|(v, turn)| {
            // cosines of two and three times the angle, computed from that of the angle
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

    /// 0.6 s of 200 Hz plus one sample.
    const SAMPLES: u32 = 30_721;

    /// 200 Hz in noise, with this fraction of hum at 150 Hz.
    fn in_noise(samples: u32, seed: u64, hum: f64) -> Vec<f64> {
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
                let found = part(&in_noise(SAMPLES, seed, 0.0), FS_HZ, 200.0, mains);
                assert!(found == 0.0, "seed {seed}: {found} at {mains} Hz");
            }
        }
        for seed in 0..20 {
            let found = part(&in_noise(SAMPLES, seed, 0.02), FS_HZ, 200.0, 50.0);
            assert!((found - 0.02).abs() < 0.005, "seed {seed}: {found}");
        }
    }

    /// In 0.6 s, multiples of 50 Hz are lines of the spectrum.
    #[test]
    fn a_line_of_the_spectrum_is_the_sum_that_it_stands_for() {
        let signal = in_noise(SAMPLES - 1, 1, 0.02);
        let fft = forward(signal.len());
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut signal.clone(), &mut spectrum).expect("lengths are the plan's own");
        let summed = |f: f64| line_sum(&signal, -TAU * f / FS_HZ).norm();
        for f in [50.0, 150.0, 200.0, 450.0] {
            let line = (f * signal.len() as f64 / FS_HZ).round() as usize;
            let found = amplitude(&signal, &spectrum, f, FS_HZ);
            assert_eq!(found.to_bits(), spectrum[line].norm().to_bits(), "{f} Hz");
            // rounding of both, relative to the highest line
            assert!((found - summed(f)).abs() < 1e-12 * summed(200.0), "{f} Hz: {found} {}", summed(f));
        }
        let beside = 150.3;
        assert_eq!(amplitude(&signal, &spectrum, beside, FS_HZ).to_bits(), summed(beside).to_bits());
    }

    /// The hum found does not depend on the method used: one sample more or less.
    #[test]
    fn lines_of_the_spectrum_say_what_sums_say() {
        for seed in 0..20 {
            let [on, off] = [SAMPLES - 1, SAMPLES]
                .map(|samples| part(&in_noise(samples, seed, 0.02), FS_HZ, 200.0, 50.0));
            // one sample of 30 000, and a shift of the line by 3e-3 of its width
            assert!((on / off - 1.0).abs() < 1e-3, "seed {seed}: {on} {off}");
        }
    }
}

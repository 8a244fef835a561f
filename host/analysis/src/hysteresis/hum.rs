//! The mains' hum at the loop's own frequency.
//!
//! There it cannot be told from the excitation: it is as steady, and every cycle holds it alike. But hum comes with
//! harmonics, and those that do not fall on the loop's own stand free in the spectrum of the whole record.

use super::finding::LoopFinding;
use super::record::{HysteresisRecord, RelativeMotion};
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

/// A line stands out above the median of its surroundings by this factor: noise alone does once in 10¹⁰ lines.
const STANDS_OUT: f64 = 6.0;

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
    let relative: Vec<f64> = a[..samples].iter().zip(b).map(|(a, b)| a - b).collect();
    let signals = [windowed(&record.force_n[..samples]), windowed(&relative)];
    let strongest = |mains: f64| {
        signals.iter().map(|signal| part(signal, record.fs_hz, frequency_hz, mains)).fold(0.0, f64::max)
    };
    candidates
        .into_iter()
        .map(|mains_hz| LoopFinding::Hum { mains_hz, at_hz: multiple(mains_hz), part: strongest(mains_hz) })
        .find(|found| matches!(found, LoopFinding::Hum { part, .. } if *part > MATTERS))
}

/// The strongest multiple of the mains that stands free, over the fundamental; 0 if none stands out.
fn part(signal: &[f64], fs_hz: f64, frequency_hz: f64, mains_hz: f64) -> f64 {
    let line_hz = fs_hz / signal.len() as f64;
    let amplitude = |f: f64| {
        let step = Complex::from_polar(1.0, -TAU * f / fs_hz);
        let mut wheel = Complex::new(1.0, 0.0);
        let mut sum = Complex::default();
        for value in signal {
            sum += wheel * value;
            wheel *= step;
        }
        sum.norm()
    };
    let fundamental = amplitude(frequency_hz);
    let free = |f: &f64| {
        let harmonic = (f / frequency_hz).round() * frequency_hz;
        (f - harmonic).abs() > 2.0 * APART * line_hz + WANDER * f && *f < 0.45 * fs_hz
    };
    (1..=MULTIPLES)
        .map(|m| m as f64 * mains_hz)
        .filter(free)
        .filter_map(|f| {
            // the mains are a little off: the largest of the lines nearby
            let reach = (WANDER * f / line_hz).ceil() as i32;
            let here = (-reach..=reach).map(|o| amplitude(f + f64::from(o) * line_hz)).fold(0.0, f64::max);
            let mut around: Vec<f64> = [-8.0, -7.0, -6.0, -5.0, 5.0, 6.0, 7.0, 8.0]
                .map(|o| amplitude(f + (o + f64::from(reach) * f64::signum(o)) * line_hz))
                .to_vec();
            around.sort_by(f64::total_cmp);
            (here > STANDS_OUT * around[around.len() / 2]).then_some(here / fundamental)
        })
        .fold(0.0, f64::max)
}

/// Mean taken off, and a Blackman-Harris window put on: 92 dB between lines that are five widths apart.
fn windowed(x: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    x.iter()
        .enumerate()
        .map(|(i, v)| {
            let turn = TAU * (i as f64 + 0.5) / n;
            let window =
                0.35875 - 0.48829 * turn.cos() + 0.14128 * (2.0 * turn).cos() - 0.01168 * (3.0 * turn).cos();
            (v - mean) * window
        })
        .collect()
}

//! Loops of the decay after an impact.
//!
//! The record is cut into cycles of the dominant mode, starting at the onset of motion; each gives
//! the least-squares slope of T on Δx. The first cycles have the largest amplitude and contain all
//! modes simultaneously: their slope is that of a first-cycle loop, not the contact's stiffness,
//! and is reported as such.

use super::HysteresisError;
use super::cycles::open_record;
use super::frequency::{dominant_frequency, turns};
use super::loops::{slope, swing};
use super::record::Relative;
use crate::median::middle;
use crate::vectors::wide;
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Number of cycles whose slopes are averaged to the record's k: the first two, which are still
/// well above noise and follow the pulse.
pub(super) const FIRST_CYCLES: usize = 2;

/// One cycle of the decay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DecayCycle {
    /// First sample of the record that belongs to it.
    pub first_sample: usize,
    /// First sample after it.
    pub end_sample: usize,
    /// Least-squares slope of T on Δx, N/m.
    pub stiffness_n_per_m: f64,
    /// Coefficient of determination of that line.
    pub r_squared: f64,
    /// Half the swing of Δx, m.
    pub amplitude_m: f64,
    /// Phase by which Δx lags T at the mode, degrees.
    pub phase_deg: f64,
    /// Frequency of the dominant mode in this cycle, Hz (phase advance of T to the next cycle).
    pub frequency_hz: f64,
}

/// The decay, cut into cycles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Decay {
    pub(super) frequency_hz: f64,
    pub(super) cycles: Vec<DecayCycle>,
    /// From the start of the record to the end of the last cycle.
    pub(super) displacement_m: Vec<f64>,
    /// Phase by which Δx lags T at the mode over the first cycles, degrees.
    pub(super) phase_deg: f64,
}

/// Cuts a decaying record into its cycles, and reports the first `most` of them (at least
/// [`FIRST_CYCLES`]).
///
/// # Errors
/// When nothing moves, or there is no whole cycle of the dominant mode after the onset.
pub(super) fn decay(
    motion: &Relative,
    force_n: &[f64],
    fs_hz: f64,
    most: usize,
) -> Result<Decay, HysteresisError> {
    let signal = match motion {
        Relative::Velocity(v) | Relative::Displacement(v) => v,
    };
    let start = onset(signal).min(onset(force_n));
    let frequency_hz = dominant_frequency(&force_n[start..], fs_hz).ok_or(HysteresisError::NoMotion)?;
    let period = fs_hz / frequency_hz;
    let whole = ((force_n.len() - start) as f64 / period).floor() as usize;
    if whole == 0 {
        return Err(HysteresisError::NoCycle {
            frequency_hz,
            samples: force_n.len() - start,
            points: period as usize,
        });
    }
    // the frequency of a cycle also needs the next cycle
    let cut = whole.min(most.saturating_add(1));
    let edges: Vec<usize> = (0..=cut).map(|c| start + (c as f64 * period).round() as usize).collect();
    let end = edges[cut];
    let displacement_m = match motion {
        Relative::Velocity(v) => {
            // A stuck contact returns to its initial position: the mean velocity over whole cycles
            // to the end of the record is the sensor's offset.
            let until = start + (whole as f64 * period) as usize;
            let offset = v[start..until].iter().sum::<f64>() / (until - start) as f64;
            open_record(&v[..end], offset, 1.0 / fs_hz)
        }
        Relative::Displacement(x) => x[..end].to_vec(),
    };
    // force and displacement are multiplied by the same phase factors
    let turns = turns(start..end, -TAU * frequency_hz / fs_hz);
    let tone = |x: &[f64], from: usize, to: usize| -> Complex<f64> {
        let mean = x[from..to].iter().sum::<f64>() / (to - from) as f64;
        x[from..to].iter().zip(&turns[from - start..to - start]).map(|(x, turn)| (x - mean) * turn).sum()
    };
    let tones: Vec<Complex<f64>> = edges.windows(2).map(|e| tone(force_n, e[0], e[1])).collect();
    let cycles = edges
        .windows(2)
        .enumerate()
        .take(most)
        .map(|(c, e)| {
            let (x, t) = (&displacement_m[e[0]..e[1]], &force_n[e[0]..e[1]]);
            let stiffness_n_per_m = slope(x, t);
            let advance = tones.get(c + 1).map_or(0.0, |next| (next / tones[c]).arg());
            DecayCycle {
                first_sample: e[0],
                end_sample: e[1],
                stiffness_n_per_m,
                r_squared: stiffness_n_per_m * slope(t, x),
                amplitude_m: 0.5 * swing(x),
                phase_deg: (tones[c] / tone(&displacement_m, e[0], e[1])).arg().to_degrees(),
                frequency_hz: frequency_hz * (1.0 + advance / TAU),
            }
        })
        .collect();
    let end = edges[FIRST_CYCLES.min(whole)];
    let phase_deg = (tone(force_n, start, end) / tone(&displacement_m, start, end)).arg().to_degrees();
    Ok(Decay { frequency_hz, cycles, displacement_m, phase_deg })
}

/// First sample above the threshold: 5 % of the largest deviation, or six times the white noise,
/// whichever is larger.
fn onset(x: &[f64]) -> usize {
    let rest = middle(&x[x.len() - x.len() / 4 - 1..]).unwrap_or(0.0);
    let largest = x.iter().map(|v| (v - rest).abs()).fold(0.0, f64::max);
    let part = 0.05 * largest;
    let limit =
        if noise_is_below(x, part / 6.0) { part } else { part.max(6.0 * noise(x)).min(0.5 * largest) };
    x.iter().position(|v| (v - rest).abs() >= limit).unwrap_or(0)
}

/// Second differences of white noise have √6 times its rms; their median magnitude is 0.6745 of
/// that.
const MEDIAN: f64 = 0.6745 * 2.449_489_742_783_178;

fn second_difference(w: &[f64]) -> f64 {
    (w[0] - 2.0 * w[1] + w[2]).abs()
}

/// Rms of a record's white noise.
fn noise(x: &[f64]) -> f64 {
    let second: Vec<f64> = x.windows(3).map(second_difference).collect();
    middle(&second).unwrap_or(0.0) / MEDIAN
}

/// Whether the noise is certainly below this; counting is much cheaper than finding the median.
fn noise_is_below(x: &[f64], rms: f64) -> bool {
    // margin for rounding
    let limit = rms * MEDIAN * (1.0 - 1e-9);
    let below: usize = wide(|| x.windows(3).map(|w| usize::from(second_difference(w) < limit)).sum());
    below > x.len().saturating_sub(2) / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn counting_says_what_the_median_says() {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut dice = || -> f64 { StandardNormal.sample(&mut stream) };
        for count in [3, 4, 5, 1000, 5001] {
            let x: Vec<f64> = (0..count).map(|_| 0.3 * dice()).collect();
            let rms = noise(&x);
            assert!(count < 1000 || (rms / 0.3 - 1.0).abs() < 0.1, "{rms}");
            assert!(noise_is_below(&x, rms * (1.0 + 1e-6)) && !noise_is_below(&x, rms), "{count}");
        }
        // nothing to count
        assert!(!noise_is_below(&[1.0, 2.0], 1.0) && noise(&[1.0, 2.0]) == 0.0);
    }

    #[test]
    fn the_onset_is_where_motion_stands_out_of_noise() {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(5);
        for scatter in [0.0, 1e-3, 0.05] {
            let mut dice = || -> f64 { StandardNormal.sample(&mut stream) };
            let motion = |i: usize| if i < 500 { 0.0 } else { ((i - 500) as f64 / 20.0).sin() };
            let x: Vec<f64> = (0..2000).map(|i| motion(i) + scatter * dice()).collect();
            let at = onset(&x);
            // six standard deviations of 0.05 are reached after six samples
            assert!((500..510).contains(&at), "{scatter}: {at}");
        }
    }
}

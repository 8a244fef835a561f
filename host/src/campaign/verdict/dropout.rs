//! Dropouts and spikes of a vibrometer: jumps that no structure makes.
//!
//! A lost beam leaves steps of milliseconds and spikes of single samples, on top of whatever broadband noise the spot has. Plain noise
//! is no reason to refuse a hit (averaging takes it out, and some directions hardly move), jumps are. Third differences of block
//! means remove smooth motion; blocks of 1, 4, 8 and 16 samples make steps stand out of noise. Each difference is compared
//! with the median of its surroundings, so that neither the level of noise nor a decaying mode counts.

use crate::spectra::Pulse;

/// The strongest jump found.
pub(super) struct Burst {
    /// Where, sample.
    pub(super) sample: usize,
    /// How many times the robust scale around it.
    pub(super) ratio: f64,
}

/// Block lengths, samples.
const BLOCKS: [usize; 4] = [1, 4, 8, 16];

/// After the hit the structure itself moves in steps (contact, high modes); from here on it is smooth, s.
const SETTLED_S: f64 = 0.010;

/// Within that time only single-sample spikes are looked for, from this many milliseconds after the pulse on.
const QUIET_AFTER_PULSE_S: f64 = 0.001;

/// Surroundings: this many differences, s of record for single samples.
const SURROUNDINGS: usize = 512;

/// The strongest jump whose ratio exceeds `limit`.
pub(super) fn find(x: &[f64], fs_hz: f64, pulse: &Pulse, limit: f64) -> Option<Burst> {
    let step = quantum(x);
    let settled = pulse.end + (SETTLED_S * fs_hz) as usize;
    let quiet = pulse.end + (QUIET_AFTER_PULSE_S * fs_hz) as usize;
    let mut worst: Option<Burst> = None;
    for block in BLOCKS {
        let differences = third_differences(x, block);
        let scale = local_scale(&differences, (SURROUNDINGS / block).max(64), step / (block as f64).sqrt());
        for (i, (d, s)) in differences.iter().zip(&scale).enumerate() {
            // the difference spans four blocks
            let (from, to) = (i * block, (i + 4) * block);
            let far = from >= settled || to <= pulse.start;
            let near = block == 1 && from >= quiet;
            let ratio = d / s;
            if (far || near) && ratio > limit && worst.as_ref().is_none_or(|w| ratio > w.ratio) {
                worst = Some(Burst { sample: from + 2 * block, ratio });
            }
        }
    }
    worst
}

fn third_differences(x: &[f64], block: usize) -> Vec<f64> {
    let means: Vec<f64> = x.chunks_exact(block).map(|b| b.iter().sum::<f64>() / block as f64).collect();
    means.windows(4).map(|w| (w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3]).abs()).collect()
}

/// The converter's step: the smallest difference between neighbours. A quiet, coarse channel has a median difference of zero.
pub(super) fn quantum(x: &[f64]) -> f64 {
    let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    x.windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|d| *d > 1e-9 * largest)
        .fold(f64::INFINITY, f64::min)
        .min(largest)
}

/// Median of the differences around each, at least the record's median and `floor`.
fn local_scale(differences: &[f64], width: usize, floor: f64) -> Vec<f64> {
    let whole = middle(differences).max(floor).max(f64::MIN_POSITIVE);
    let hop = (width / 4).max(1);
    let mut out = Vec::with_capacity(differences.len());
    for start in (0..differences.len()).step_by(hop) {
        let end = (start + hop).min(differences.len());
        let (from, to) = (
            (start + hop / 2).saturating_sub(width / 2),
            (start + hop / 2 + width / 2).min(differences.len()),
        );
        let local = middle(&differences[from..to]).max(whole);
        out.extend(std::iter::repeat_n(local, end - start));
    }
    out
}

fn middle(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut sorted = values.to_vec();
    let at = sorted.len() / 2;
    *sorted.select_nth_unstable_by(at, f64::total_cmp).1
}

//! A second pulse in the force record.
//!
//! The force cell rings after the hit (about 3 % at 6 kHz), as high as the smallest rebound that
//! must be found. A rebound, however, is a pulse of the bolt on the same structure, so it has the
//! main pulse's width; a matched filter of that width passes it fully and almost suppresses ringing
//! at several times its bandwidth (a half sine of 0.41 ms passes 0.5 % at 6 kHz).

use crate::spectra::Pulse;
use std::f64::consts::PI;

/// A pulse other than the main one.
pub(super) struct Second {
    /// Its first sample.
    pub(super) start: usize,
    /// Its height relative to the main pulse.
    pub(super) fraction: f64,
    /// The smallest fraction that counts in this record.
    pub(super) limit: f64,
}

/// A valley below this fraction of a hump's height separates it from the main pulse, even if the
/// force does not fall to zero in it.
const VALLEY: f64 = 0.7;

/// Block length for the median baseline: no pulse fills half a block, and slow drift of the
/// amplifier is removed.
const BASELINE_BLOCK: usize = 512;

/// The strongest second pulse, if one reaches `limit` of the main pulse's height (and six times the
/// noise). After the main pulse it counts if it starts at least `from` samples after that pulse's
/// start (start to start, or peak to peak).
pub(super) fn find(force_n: &[f64], pulse: &Pulse, limit: f64, from: usize) -> Option<Second> {
    if let Some(second) = hump(force_n, pulse, limit) {
        return Some(second);
    }
    let width = pulse.width().clamp(6, 400);
    let shape: Vec<f64> = (0..width).map(|i| (PI * (i as f64 + 0.5) / width as f64).sin()).collect();
    let energy: f64 = shape.iter().map(|h| h * h).sum();
    let limit = limit.max(6.0 * pulse.noise_n / energy.sqrt() / pulse.peak_n);
    let rest = above_baseline(force_n);
    // Two samples of margin: the pulse's foot below 2 % is not a second pulse.
    let before = 0..(pulse.start.saturating_sub(2 + width));
    // a pulse whose width differs from the filter's is found slightly early
    let soonest = (pulse.start + from).saturating_sub(width / 8).max(pulse.end + 2);
    let after = soonest..rest.len().saturating_sub(width);
    let filtered = filtered(&rest, &shape);
    before
        .chain(after)
        .map(|start| (start, filtered[start] / energy / pulse.peak_n))
        .filter(|(_, fraction)| *fraction >= limit)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(start, fraction)| Second { start, fraction, limit })
}

/// Correlation of `shape` with the record, from each sample at which it fits.
fn filtered(rest: &[f64], shape: &[f64]) -> Vec<f64> {
    let mut products = vec![0.0; (rest.len() + 1).saturating_sub(shape.len())];
    // in blocks, so that the sums stay in the L1 cache and vectorise
    for (at, sums) in products.chunks_mut(512).enumerate().map(|(n, sums)| (512 * n, sums)) {
        for (k, h) in shape.iter().enumerate() {
            for (sum, f) in sums.iter_mut().zip(&rest[at + k..]) {
                *sum += f * h;
            }
        }
    }
    products
}

/// Two humps within the main pulse (the bolt stayed in contact and struck again before it left).
fn hump(force_n: &[f64], pulse: &Pulse, limit: f64) -> Option<Second> {
    let inside = &force_n[pulse.start..pulse.end];
    let height = |i: usize| inside[i] - pulse.offset_n;
    let peak = pulse.peak_sample - pulse.start;
    let side = |order: &mut dyn Iterator<Item = usize>| {
        let mut valley = f64::INFINITY;
        let mut best: Option<(usize, f64)> = None;
        for i in order {
            valley = valley.min(height(i));
            let rise = height(i) - valley;
            // the rise must be a separate hump, not ringing on a flank: well above the limit, and
            // above the valley
            if valley < VALLEY * height(i)
                && rise > 5.0 * limit * pulse.peak_n
                && best.is_none_or(|(_, h)| h < height(i))
            {
                best = Some((i, height(i)));
            }
        }
        best
    };
    let before = side(&mut (0..peak).rev());
    let after = side(&mut (peak..inside.len()));
    before.into_iter().chain(after).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, h)| Second {
        start: pulse.start + i,
        fraction: h / pulse.peak_n,
        limit: 5.0 * limit,
    })
}

/// The record minus a baseline through the medians of its blocks.
fn above_baseline(force_n: &[f64]) -> Vec<f64> {
    let centres: Vec<(f64, f64)> = force_n
        .chunks(BASELINE_BLOCK)
        .enumerate()
        .map(|(b, block)| {
            let mut sorted = block.to_vec();
            let at = sorted.len() / 2;
            let middle = *sorted.select_nth_unstable_by(at, f64::total_cmp).1;
            ((b * BASELINE_BLOCK) as f64 + block.len() as f64 / 2.0, middle)
        })
        .collect();
    force_n
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let t = i as f64;
            let right = centres.partition_point(|c| c.0 < t);
            let base = match (right.checked_sub(1).map(|l| centres[l]), centres.get(right)) {
                (Some((t0, v0)), Some(&(t1, v1))) => v0 + (v1 - v0) * (t - t0) / (t1 - t0),
                (Some((_, v)), None) | (None, Some(&(_, v))) => v,
                (None, None) => 0.0,
            };
            f - base
        })
        .collect()
}

//! Dropouts and spikes of a vibrometer: jumps that no structure makes.
//!
//! A lost beam causes steps of milliseconds and spikes of single samples, in addition to the
//! broadband noise of the spot. Plain noise is no reason to refuse a hit (averaging reduces it, and
//! some directions hardly move), jumps are. Third differences of block means remove smooth motion;
//! with blocks of 1, 4, 8 and 16 samples, steps exceed the noise. Each difference is compared with
//! the median of its surroundings, so that neither the noise level nor a decaying mode counts. With
//! very little noise (simulations, 24-bit recordings), a mode that decays fast exceeds that median
//! too: a jump must also exceed the few differences before or after it, which a smooth motion does
//! not, and must not be smaller than those on the other side, as those of a decaying mode are.
//!
//! Decides whether a jump in a response is motion of the structure or an artefact of the
//! vibrometer.
//!
//! A contact that starts or stops sliding changes the force, and with it the acceleration,
//! abruptly: the velocity has a kink, or bends. A lost beam changes the reading itself, for a few
//! samples or from then on. Both models are fitted to the samples around the jump, together with a
//! smooth motion; the one with the smaller residual decides.

use crate::median::middle;
use crate::spectra::Pulse;
use nalgebra::{DMatrix, DVector};

/// The strongest jump found.
pub(super) struct Burst {
    /// Position, sample.
    pub(super) sample: usize,
    /// Ratio to the robust scale of its surroundings.
    pub(super) ratio: f64,
}

/// Block lengths, samples.
const BLOCKS: [usize; 4] = [1, 4, 8, 16];

/// Right after the hit the structure itself moves in steps (contact, high modes); from this time
/// after the pulse its motion is smooth, s.
const SETTLED_S: f64 = 0.010;

/// Before that, only single-sample spikes are searched for, from this time after the pulse, s.
const QUIET_AFTER_PULSE_S: f64 = 0.001;

/// The pulse's foot, which is below the force's noise, already moves a quiet response: at least
/// this many samples before the pulse are skipped.
const FOOT: usize = 16;

/// The larger neighbour of a jump's largest difference is at least this part of it (0.5 without
/// noise).
const NEIGHBOUR: f64 = 0.3;

/// Third differences on each side of the largest one of a jump that the jump itself contributes to.
const OWN: usize = 3;

/// ... and number of differences beyond them that define the usual size.
const NEXT: usize = 12;

/// A jump exceeds the largest of them by this fraction of the limit: for noise, the largest of
/// twelve is 2.5 times the median.
const JUMP: f64 = 1.0 / 3.0;

/// Length of the surroundings: this many differences for single samples, fewer for longer blocks.
const SURROUNDINGS: usize = 512;

/// The strongest jump whose ratio exceeds `limit`.
pub(super) fn find(x: &[f64], fs_hz: f64, pulse: &Pulse, limit: f64) -> Option<Burst> {
    let step = quantum(x);
    let settled = pulse.end + (SETTLED_S * fs_hz) as usize;
    let quiet = pulse.end + (QUIET_AFTER_PULSE_S * fs_hz) as usize;
    let foot = pulse.start.saturating_sub(pulse.width().max(FOOT));
    let mut worst: Option<Burst> = None;
    for block in BLOCKS {
        let differences = third_differences(x, block);
        let floor = step / (block as f64).sqrt();
        let whole = middle(&differences).unwrap_or(0.0).max(floor).max(f64::MIN_POSITIVE);
        let width = (SURROUNDINGS / block).max(64);
        let hop = (width / 4).max(1);
        for (start, part) in differences.chunks(hop).enumerate().map(|(n, part)| (n * hop, part)) {
            // the scale is never below the whole record's: if nothing exceeds the limit with that
            // one, the surroundings need not be evaluated
            if part.iter().fold(0.0, |most: f64, d| most.max(*d)) / whole <= limit {
                continue;
            }
            let s = local_scale(&differences, start, hop, width).max(whole);
            for (i, d) in (start..).zip(part) {
                // the difference spans four blocks
                let (from, to) = (i * block, (i + 4) * block);
                // what comes before must not reach into the pulse, where every difference is large
                let far = from >= settled && from >= pulse.end + (OWN + NEXT) * block || to <= foot;
                let near = block == 1 && from >= quiet;
                let ratio = d / s;
                let worse = ratio > limit && worst.as_ref().is_none_or(|w| ratio > w.ratio);
                if worse && (far || near && !moves(x, i)) && is_jump(&differences, i, limit * JUMP) {
                    worst = Some(Burst { sample: from + 2 * block, ratio });
                }
            }
        }
    }
    worst
}

/// Whether the difference at `i` exceeds `times` the largest of those on its quieter side (the
/// signal is smooth before or after a jump) and is no smaller than the largest on the other side.
fn is_jump(differences: &[f64], i: usize, times: f64) -> bool {
    let before = &differences[i.saturating_sub(OWN + NEXT)..i.saturating_sub(OWN)];
    let from = (i + OWN + 1).min(differences.len());
    let after = &differences[from..(from + NEXT).min(differences.len())];
    let largest = |part: &[f64]| part.iter().fold(0.0f64, |most, d| most.max(*d));
    let quieter = [before, after].into_iter().filter(|part| part.len() == NEXT).map(largest).reduce(f64::min);
    // of a step and of a spike, at least one neighbour is half as large; a beat at a quarter of the
    // block rate has only every second difference
    let neighbours = [i.checked_sub(1), Some(i + 1)].into_iter().flatten();
    let neighbour = neighbours.filter_map(|at| differences.get(at)).fold(0.0f64, |most, d| most.max(*d));
    neighbour > NEIGHBOUR * differences[i]
        && differences[i] > times * quieter.unwrap_or(0.0)
        && differences[i] >= largest(before).max(largest(after))
}

/// Whether the jump at this third difference is motion of the structure itself.
fn moves(x: &[f64], third: usize) -> bool {
    // the difference spans four samples
    let from = (third + 2).saturating_sub(LOOKED_AT / 2);
    x.get(from..from + LOOKED_AT).is_some_and(is_motion)
}

/// |Δ³| of the means of blocks.
pub(super) fn third_differences(x: &[f64], block: usize) -> Vec<f64> {
    let means: Vec<f64> = match block {
        1 => return thirds(x),
        _ => x.chunks_exact(block).map(|b| b.iter().sum::<f64>() / block as f64).collect(),
    };
    thirds(&means)
}

fn thirds(x: &[f64]) -> Vec<f64> {
    x.windows(4).map(|w| (w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3]).abs()).collect()
}

/// The converter's step: the smallest nonzero difference between neighbours. For a quiet, coarse
/// channel the median difference would be zero.
pub(super) fn quantum(x: &[f64]) -> f64 {
    let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    x.windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|d| *d > 1e-9 * largest)
        .fold(f64::INFINITY, f64::min)
        .min(largest)
}

/// Median of the differences around the `hop` ones that start at `start`.
fn local_scale(differences: &[f64], start: usize, hop: usize, width: usize) -> f64 {
    let centre = start + hop / 2;
    let to = (centre + width / 2).min(differences.len());
    middle(&differences[centre.saturating_sub(width / 2)..to]).unwrap_or(0.0)
}

/// Number of samples evaluated, with the jump in the middle.
pub(super) const LOOKED_AT: usize = 12;
/// The jump is searched for up to this far from the middle, samples.
const REACH: usize = 3;

/// Whether the jump in the middle of these samples is motion of the structure.
pub(super) fn is_motion(x: &[f64]) -> bool {
    if x.len() != LOOKED_AT {
        return false;
    }
    let x = DVector::from_column_slice(x);
    let middle = (LOOKED_AT - 1) as f64 / 2.0;
    let places = || (LOOKED_AT / 2 - REACH)..(LOOKED_AT / 2 + REACH);
    let least = |left: &mut dyn Iterator<Item = f64>| left.fold(f64::INFINITY, f64::min);
    // a kink and a bend, also between two samples
    let after = |i: usize, start: f64| (i as f64 - start).max(0.0);
    let mut own = (0..=4 * REACH - 2).map(|half| {
        let start = middle - (REACH as f64 - 0.5) + 0.5 * half as f64;
        left(&x, 2, |i, n| power(after(i, start), 1 + n))
    });
    // a single-sample spike that the filter before the converter has spread over its neighbours
    let mut spikes = places().map(|at| left(&x, 3, |i, n| f64::from(u8::from(i + 1 == at + n))));
    // a step, within one sample
    let mut steps =
        places().map(|at| left(&x, 2, |i, n| f64::from(u8::from(if n == 0 { i >= at } else { i == at }))));
    least(&mut own) <= least(&mut spikes).min(least(&mut steps))
}

fn power(x: f64, n: usize) -> f64 {
    (0..n).map(|_| x).product()
}

/// Residual of a fit with a cubic and `count` functions of the sample, as a variance per degree of
/// freedom.
fn left(x: &DVector<f64>, count: usize, function: impl Fn(usize, usize) -> f64) -> f64 {
    const CUBIC: usize = 4;
    let half = (LOOKED_AT - 1) as f64 / 2.0;
    let columns = CUBIC + count;
    let model = DMatrix::from_fn(LOOKED_AT, columns, |i, n| {
        if n < CUBIC { power((i as f64 - half) / half, n) } else { function(i, n - CUBIC) }
    });
    let q = model.qr().q();
    let residual = x - &q * q.tr_mul(x);
    residual.norm_squared() / (LOOKED_AT - columns) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const FS: f64 = 51_200.0;

    /// A decaying mode with a little noise, and a disturbance 6 ms after the pulse.
    fn found(odd: impl Fn(usize) -> f64) -> Option<Burst> {
        let pulse =
            Pulse { peak_sample: 210, start: 200, end: 220, peak_n: 50.0, offset_n: 0.0, noise_n: 0.01 };
        let mut seed = 3_u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let x: Vec<f64> = (0..8_000)
            .map(|i| {
                let t = i as f64 / FS;
                (-30.0 * t).exp() * (1_200.0 * t).sin() + 1e-3 * noise() + odd(i)
            })
            .collect();
        find(&x, FS, &pulse, 12.0)
    }

    #[test]
    fn spikes_and_steps_are_found_and_what_a_contact_does_is_motion() {
        const AT: usize = 520;
        assert!(found(|_| 0.0).is_none());
        let spike = found(|i| if i == AT { 0.05 } else { 0.0 });
        assert!(spike.is_some_and(|burst| burst.sample.abs_diff(AT) < 4));
        assert!(found(|i| if i >= AT { 0.05 } else { 0.0 }).is_some());
        // the contact stops sliding: the acceleration changes from here on
        assert!(found(|i| 0.05 * i.saturating_sub(AT) as f64).is_none());
        let between = |i: usize| if i > AT { 0.05 * ((i - AT) as f64 - 0.4) } else { 0.0 };
        assert!(found(between).is_none());
        // the force changes abruptly
        assert!(found(|i| 0.02 * (i.saturating_sub(AT) as f64).powi(2).min(400.0)).is_none());
        // a spike spread by the filter before the converter
        let spread = |i: usize| [0.2, 1.0, 0.2].get(i.wrapping_sub(AT)).map_or(0.0, |part| 0.08 * part);
        assert!(found(spread).is_some());
    }
}

#[cfg(test)]
mod motion_tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// How many of 200 are classified as motion: a jump of size 1 on a slow motion, with noise of a
    /// thirtieth.
    fn taken(jump: impl Fn(f64) -> f64) -> usize {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let mut one = || {
            let (size, phase) = (2.0 * draw(), 3.0 * draw());
            let x: Vec<f64> = (0..LOOKED_AT)
                .map(|i| {
                    let t = i as f64;
                    size * (0.15 * t + phase).sin() + draw() / 30.0 + jump(t - 6.0)
                })
                .collect();
            is_motion(&x)
        };
        (0..200).filter(|_| one()).count()
    }

    #[test]
    fn what_a_contact_does_is_motion_and_what_a_beam_does_is_not() {
        // three in a hundred may be misclassified this close to the limit
        for motion in
            [taken(|t| t.max(0.0)), taken(|t| (t + 0.4).max(0.0)), taken(|t| 0.5 * t.max(0.0).powi(2))]
        {
            assert!(motion >= 194, "{motion}");
        }
        let spread = |t: f64| {
            if t == 0.0 {
                1.0
            } else if t.abs() == 1.0 {
                0.2
            } else {
                0.0
            }
        };
        let step = |t: f64| if t >= 0.0 { 1.0 } else { 0.0 };
        let half = |t: f64| if t == 0.0 { 0.5 } else { step(t) };
        for jump in [taken(|t| if t == 0.0 { 1.0 } else { 0.0 }), taken(spread), taken(step), taken(half)] {
            assert!(jump <= 6, "{jump}");
        }
    }

    #[test]
    fn a_contact_of_15_n_under_a_hit_of_50_n_moves() {
        // codes of the 3-D vibrometer while the contact slides and sticks again
        for x in [
            [-44.0, 67.0, 245.0, 419.0, 540.0, 552.0, 478.0, 468.0, 500.0, 498.0, 503.0, 537.0],
            [-52.0, 83.0, 270.0, 442.0, 542.0, 524.0, 447.0, 458.0, 479.0, 477.0, 491.0, 531.0],
            [-40.0, 105.0, 299.0, 468.0, 559.0, 536.0, 457.0, 469.0, 487.0, 488.0, 499.0, 550.0],
            [10.0, 177.0, 357.0, 489.0, 568.0, 592.0, 583.0, 646.0, 712.0, 756.0, 762.0, 741.0],
        ] {
            assert!(is_motion(&x), "{x:?}");
        }
    }
}

//! Overload: values at the end of the range, or a flat top below it (an amplifier before the
//! converter, or an imported record with unknown range).

use super::dropout::third_differences;
use crate::median::middle;
use crate::spectra::Pulse;

/// Evidence of clipping.
pub(super) struct Clipped {
    /// Level of the plateau, in the signal's unit.
    pub(super) level: f64,
    /// Full scale if it is known, else the same level.
    pub(super) limit: f64,
    samples: usize,
}

impl Clipped {
    pub(super) fn sentence(&self, channel: &str, unit: &str) -> String {
        format!(
            "the {channel} stays at {:.4} {unit} for {} samples: it reached the end of its range",
            self.level, self.samples
        )
    }
}

/// Fraction of full scale that counts as full scale: includes a converter's last step or two.
const AT_RANGE: f64 = 0.999;

/// Relative distance from the maximum within which samples belong to one flat top. The top of a
/// half sine stays within it for 3 % of the pulse.
const FLAT: f64 = 1e-3;

/// Force at its range, or flat for at least three samples and an eighth of the pulse's width at
/// half height.
pub(super) fn force(force_n: &[f64], pulse: &Pulse, range_n: Option<f64>) -> Option<Clipped> {
    if let Some(range) = range_n {
        let samples = force_n.iter().filter(|f| f.abs() >= AT_RANGE * range).count();
        if samples > 0 {
            return Some(Clipped { level: range, limit: range, samples });
        }
    }
    let top = force_n[pulse.peak_sample];
    let height = top - pulse.offset_n;
    let slack = (FLAT * height).max(2.5 * pulse.noise_n).min(0.02 * height);
    let mut longest = 0;
    let mut run = 0;
    for f in &force_n[pulse.start..pulse.end] {
        run = if top - f <= slack { run + 1 } else { 0 };
        longest = longest.max(run);
    }
    let half =
        force_n[pulse.start..pulse.end].iter().filter(|f| **f - pulse.offset_n >= 0.5 * height).count();
    // With noise the slack is wider and covers more of a round top: its share of the width at half
    // height is 0.95 √(slack / height).
    let round = 0.95 * (slack / height).sqrt() * half as f64;
    let needed = (0.12 * half as f64).max(1.8 * round).max(3.0);
    (longest as f64 >= needed).then_some(Clipped { level: top, limit: top, samples: longest })
}

/// A response at the end of its range.
pub(super) fn response(x: &[f64], range: f64) -> Option<Clipped> {
    let samples = x.iter().filter(|v| v.abs() >= AT_RANGE * range).count();
    (samples > 0).then_some(Clipped { level: range, limit: range, samples })
}

/// A plateau has at least this many samples ...
const SHORTEST: usize = 4;

/// ... and all plateaus together this many. A sharp peak just after the hit may be level for half
/// as long: among 500 clean simulated hits, three were so for four to six samples.
const IN_ALL: usize = 12;

/// A level that is reached this often is a limit, however short each visit ...
const VISITS: usize = 3;

/// ... of at least this many samples: if three samples of a smooth peak are level, the next two
/// fall by nine times the level's width, which is less than [`CORNER`].
const SHORTEST_VISIT: usize = 3;

/// Relative difference below which the positive and negative limits are equal: an amplifier's
/// supplies are symmetric.
const ALIKE: f64 = 0.02;

/// Samples within this many steps of the converter are one level: covers rounding and the noise of
/// the stages after the saturated one.
const LEVEL_STEPS: f64 = 3.0;

/// Minimum depth of a corner, in widths of the level: a smooth peak falls by three widths over
/// another half of its length; a corner falls far more.
const CORNER: f64 = 10.0;

/// ... and at least this many times the noise's rms: with noise, the highest samples may be level
/// by chance.
const NOISE: f64 = 6.0;

/// Detects a response that stays at its highest or lowest value below full scale, with corners at
/// both ends: an amplifier or decoder before the converter is saturated. `step` is the converter's
/// step. A slow mode is flat at its peak too, but round.
pub(super) fn plateau(x: &[f64], step: f64) -> Option<Clipped> {
    let largest = x.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    // only a few steps in total: undecidable
    if largest < 100.0 * step {
        return None;
    }
    let slack = LEVEL_STEPS * step;
    let corner = CORNER * slack;
    // cheap test first: few signals pass it, and only for those the noise is estimated
    standing(x, largest, slack, corner)?;
    standing(x, largest, slack, corner.max(NOISE * noise(x)))
}

/// Finds plateaus within `slack` of the signal's highest or lowest value, with corners at least
/// `fall` deep.
fn standing(x: &[f64], largest: f64, slack: f64, fall: f64) -> Option<Clipped> {
    let sides = [1.0, -1.0].map(|sign| Plateaus::of(x, sign, slack, fall));
    let [above, below] = &sides;
    // an amplifier has a positive and a negative limit, and a ring-down reaches both alternately
    let alike = (above.top - below.top).abs() <= slack.max(ALIKE * largest);
    let both = [above.visits.as_slice(), &below.visits].concat();
    let found = [(above, alike.then_some(both.as_slice())), (below, None)];
    found.into_iter().find_map(|(side, visits)| {
        let visits = visits.unwrap_or(&side.visits);
        let plateaus: usize = visits.iter().filter(|samples| **samples >= SHORTEST).sum();
        let clipped = plateaus >= IN_ALL || visits.len() >= VISITS;
        let level = side.sign * side.top;
        clipped.then(|| Clipped { level, limit: level, samples: visits.iter().sum() })
    })
}

/// Samples skipped together.
const BLOCK: usize = 64;

/// The plateaus of a signal at its highest or lowest value.
struct Plateaus {
    sign: f64,
    /// That value times the sign.
    top: f64,
    /// Length of each visit with corners at both ends, samples.
    visits: Vec<usize>,
}

impl Plateaus {
    fn of(x: &[f64], sign: f64, slack: f64, fall: f64) -> Self {
        let top = x.iter().fold(f64::NEG_INFINITY, |most, v| most.max(sign * v));
        let (mut start, mut visits) = (None, Vec::new());
        let near = |v: &f64| top - sign * v <= slack;
        let mut i = 0;
        while i <= x.len() {
            // few blocks come near the extreme value: skip the others as a whole
            if start.is_none() {
                let away = x[i..]
                    .chunks_exact(BLOCK)
                    .take_while(|block| !block.iter().fold(false, |any, v| any | near(v)));
                i += BLOCK * away.count();
            }
            let inside = x.get(i).is_some_and(near);
            match (inside, start) {
                (true, None) => start = Some(i),
                (false, Some(from)) => {
                    start = None;
                    let half = (i - from).div_ceil(2);
                    let fallen = |at: Option<usize>| {
                        at.and_then(|at| x.get(at)).is_some_and(|v| top - sign * v > fall)
                    };
                    if i - from >= SHORTEST_VISIT
                        && fallen((from + 1).checked_sub(half + 1))
                        && fallen(Some(i - 1 + half))
                    {
                        visits.push(i - from);
                    }
                }
                _ => {}
            }
            i += 1;
        }
        Self { sign, top, visits }
    }
}

/// Rms of white noise on the motion, from the median of third differences, which have 20 times its
/// power.
fn noise(x: &[f64]) -> f64 {
    // the median of |x| is 0.6745 σ
    middle(&third_differences(x, 1)).unwrap_or(0.0) / (20f64.sqrt() * 0.6745)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring-down of 700 Hz at 51.2 kHz with amplitude `peak`, clipped at ±`limit`, quantised in
    /// steps of a converter.
    fn ring_down(peak: f64, limit: f64, decay_per_s: f64, step: f64) -> Vec<f64> {
        let at = |i: usize| {
            let t = i as f64 / 51_200.0;
            let v = peak * (-decay_per_s * t).exp() * (2.0 * std::f64::consts::PI * 700.0 * t).sin();
            (v.clamp(-limit, limit) / step).round() * step
        };
        (0..4096).map(at).collect()
    }

    #[test]
    fn plateaus_of_both_signs_count_together() {
        let step = 1e-3;
        let mut x = ring_down(10.0, 20.0, 400.0, step);
        for v in &mut x {
            *v *= 0.5;
        }
        // three plateaus of 5, 3 and 10 samples at one level, two positive and one negative, each
        // with corners
        for (from, samples, sign) in [(40, 5, 1.0), (120, 3, 1.0), (80, 10, -1.0)] {
            x[from - 4..from + samples + 4].fill(0.0);
            x[from..from + samples].fill(6.0 * sign);
        }
        let found = plateau(&x, step).expect("clipped");
        assert_eq!((found.samples, found.level), (18, 6.0));
        // two of them may be a sharp peak
        x[120..123].fill(0.0);
        x[80..90].fill(-5.8);
        x[80..84].fill(0.0);
        assert!(plateau(&x, step).is_none());
    }

    #[test]
    fn an_amplifier_that_cuts_both_ways_is_found_and_a_clean_ring_down_is_not() {
        let step = 10.0 / 32_768.0;
        for limit in [5.0, 7.0, 8.5] {
            assert!(plateau(&ring_down(10.0, limit, 60.0, step), step).is_some(), "cut at {limit}");
        }
        for decay in [0.0, 0.1, 1.0, 10.0, 300.0] {
            for peak in [0.1, 0.5, 3.0, 9.9] {
                assert!(plateau(&ring_down(peak, 20.0, decay, step), step).is_none(), "{peak}, {decay}/s");
            }
        }
    }
}

//! Overload: values at the range, or a flat top below it (an amplifier in front of the converter, or a foreign record whose
//! range nobody wrote down).

use crate::spectra::Pulse;

/// Evidence of clipping.
pub(super) struct Clipped {
    /// Level at which the signal stands, in its unit.
    pub(super) level: f64,
    /// Full scale where it is known, else the level again.
    pub(super) limit: f64,
    samples: usize,
}

impl Clipped {
    pub(super) fn sentence(&self, channel: &str, unit: &str) -> String {
        format!(
            "the {channel} stands at {:.4} {unit} for {} samples: it ran into its range",
            self.level, self.samples
        )
    }
}

/// A converter's last step or two below full scale count as full scale.
const AT_RANGE: f64 = 0.999;

/// Samples this close to the top, relative to it, are one flat top. The top of a half sine stays within it for 3 % of the pulse.
const FLAT: f64 = 1e-3;

/// Force at its range, or flat for three samples and an eighth of the pulse's width at half height.
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
    // Wider slack under noise keeps more of a round top: its share of the width at half height is 0.95 √(slack / height).
    let round = 0.95 * (slack / height).sqrt() * half as f64;
    let needed = (0.12 * half as f64).max(1.8 * round).max(3.0);
    (longest as f64 >= needed).then_some(Clipped { level: top, limit: top, samples: longest })
}

/// A response at its range.
pub(super) fn response(x: &[f64], range: f64) -> Option<Clipped> {
    let samples = x.iter().filter(|v| v.abs() >= AT_RANGE * range).count();
    (samples > 0).then_some(Clipped { level: range, limit: range, samples })
}

/// A plateau has at least this many samples ...
const SHORTEST: usize = 4;

/// ... and all plateaus together this many. A sharp top of a structure that was just hit may stand level for half as long: among 500
/// clean simulated hits, three did for four to six samples.
const IN_ALL: usize = 12;

/// Samples within this many steps of the converter are one level: rounding and the noise of what comes after the saturated stage.
const LEVEL_STEPS: f64 = 3.0;

/// A smooth top falls by three times the level's width over one more half of its length; a corner by far more.
const CORNER: f64 = 10.0;

/// ... and by more than noise would, rms: where there is noise, its highest samples may stand level by chance.
const NOISE: f64 = 6.0;

/// A response that stands at its highest or lowest value below full scale, with corners at both ends: an amplifier or decoder before
/// the converter is saturated. `step` is the converter's step. A slow mode is flat at its top too, but round.
pub(super) fn plateau(x: &[f64], step: f64) -> Option<Clipped> {
    let largest = x.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    // a few steps in all: nothing can be told
    if largest < 100.0 * step {
        return None;
    }
    let noise = noise(x);
    [1.0, -1.0].into_iter().find_map(|sign| {
        let top = x.iter().fold(f64::NEG_INFINITY, |most, v| most.max(sign * v));
        let slack = LEVEL_STEPS * step;
        let fall = (CORNER * slack).max(NOISE * noise);
        let (mut start, mut level) = (None, 0);
        for i in 0..=x.len() {
            let inside = x.get(i).is_some_and(|v| top - sign * v <= slack);
            match (inside, start) {
                (true, None) => start = Some(i),
                (false, Some(from)) => {
                    start = None;
                    let half = (i - from).div_ceil(2);
                    let fallen = |at: Option<usize>| {
                        at.and_then(|at| x.get(at)).is_some_and(|v| top - sign * v > fall)
                    };
                    if i - from >= SHORTEST
                        && fallen((from + 1).checked_sub(half + 1))
                        && fallen(Some(i - 1 + half))
                    {
                        level += i - from;
                    }
                }
                _ => {}
            }
        }
        (level >= IN_ALL).then_some(Clipped { level: sign * top, limit: sign * top, samples: level })
    })
}

/// Rms of white noise under the motion: from the median of third differences, which have 20 times its power.
fn noise(x: &[f64]) -> f64 {
    let mut differences: Vec<f64> =
        x.windows(4).map(|w| (w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3]).abs()).collect();
    let middle = differences.len() / 2;
    if differences.is_empty() {
        return 0.0;
    }
    // the median of |x| is 0.6745 σ
    *differences.select_nth_unstable_by(middle, f64::total_cmp).1 / (20f64.sqrt() * 0.6745)
}

//! Accepts or refuses a hit, based on the *raw* record.
//!
//! It runs before windowing: the rectangular force window hides the second pulse of a double hit
//! while the response contains it, and averaging bad hits increased the median FRF error from 0.6 %
//! to 25 %. Each check has its own file and needs only this one record; the first that fails gives
//! the verdict, in the order gap, mistimed (a force of the wrong sign, or a pulse that the record
//! does not contain completely), overload, double hit, weak, strong, noisy, mistimed. (One reason
//! suffices to refuse a hit; a defect found by an earlier check would corrupt the values of the
//! later ones.)
//!
//! A new verdict is a new [`Verdict`], a file with its check here, and its place in
//! [`judge`](fn@judge). The limits are [`Limits`]: the double-hit threshold is `rebound_fraction`,
//! which a plan sets (`limits.rebound_ratio`) and [`judge::ByRecord`] passes on.

mod clipping;
mod double_hit;
mod dropout;
pub mod judge;
pub mod others;
#[cfg(test)]
mod synthetic_tests;

use crate::spectra::{ImpactRecords, Pulse, reversed_peak_n, several_hits_s};
use serde::{Deserialize, Serialize};

/// Kind of verdict. Only [`Verdict::Good`] hits enter an average.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Verdict {
    /// Usable.
    #[serde(rename = "good")]
    Good,
    /// More than one pulse.
    #[serde(rename = "double hit")]
    DoubleHit,
    /// Force or response reached the end of its range.
    #[serde(rename = "overload")]
    Overload,
    /// Dropouts or spikes in a response.
    #[serde(rename = "noisy")]
    Noisy,
    /// No pulse, or one too low.
    #[serde(rename = "weak")]
    Weak,
    /// A pulse too high.
    #[serde(rename = "strong")]
    Strong,
    /// The record does not contain the pulse as it should: at another time, only a part of it, or
    /// with the wrong sign.
    #[serde(rename = "mistimed")]
    Mistimed,
    /// Samples are missing.
    #[serde(rename = "gap")]
    Gap,
    /// A person refused it; no check gives this verdict.
    #[serde(rename = "dropped")]
    Dropped,
}

impl Verdict {
    /// Every kind, good first.
    pub const ALL: [Self; 9] = [
        Self::Good,
        Self::DoubleHit,
        Self::Overload,
        Self::Noisy,
        Self::Weak,
        Self::Strong,
        Self::Mistimed,
        Self::Gap,
        Self::Dropped,
    ];

    /// The kind with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::DoubleHit => "double hit",
            Verdict::Overload => "overload",
            Verdict::Noisy => "noisy",
            Verdict::Weak => "weak",
            Verdict::Strong => "strong",
            Verdict::Mistimed => "mistimed",
            Verdict::Gap => "gap",
            Verdict::Dropped => "dropped",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// A verdict with its evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The kind.
    pub kind: Verdict,
    /// The measured value that it is based on, in the unit stated in `sentence`.
    pub measure: f64,
    /// The limit for that value, in the same unit.
    pub limit: f64,
    /// Both as a sentence.
    pub sentence: String,
    /// Peak of the band-limited force, N; 0 without a pulse.
    pub peak_n: f64,
    /// Start of the pulse from the record's start, s; 0 without a pulse.
    pub start_s: f64,
}

impl Judgement {
    /// A verdict on a record without a pulse.
    pub fn without_pulse(kind: Verdict, measure: f64, limit: f64, sentence: String) -> Self {
        Self { kind, measure, limit, sentence, peak_n: 0.0, start_s: 0.0 }
    }
}

/// Limits of all checks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Limits {
    /// A second pulse counts from this fraction of the main one's height. Rebounds of 2 % and more
    /// must be found; the ringing of a force cell (3 % at 6 kHz) leaves less than 0.3 % in the
    /// matched filter.
    pub rebound_fraction: f64,
    /// A second pulse counts if it starts at least this long after the first, s; 0 counts all.
    pub rebound_after_s: f64,
    /// A pulse below this fraction of the reference peak is weak.
    pub weak_fraction: f64,
    /// A pulse above this fraction of the reference peak is strong.
    pub strong_fraction: f64,
    /// A jump in a response counts as a dropout from this multiple of the robust scale of its
    /// surroundings. Gaussian noise of 10⁵ samples reaches about 7, dropouts of a vibrometer 12 and
    /// more.
    pub dropout_ratio: f64,
    /// Full scale of the force channel, N; `None` if unknown, as in imported records.
    pub force_range_n: Option<f64>,
    /// Full scale of the response channels, SI; `None` if unknown, as in imported records.
    pub response_range: Option<f64>,
    /// Expected start of the pulse, s from the record's start; `None` if the trigger follows the
    /// force itself.
    pub expected_start_s: Option<f64>,
    /// Tolerance of that start, s.
    pub start_tolerance_s: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            rebound_fraction: 0.012,
            rebound_after_s: 0.0,
            weak_fraction: 0.4,
            strong_fraction: 2.0,
            dropout_ratio: 10.0,
            force_range_n: None,
            response_range: None,
            expected_start_s: None,
            start_tolerance_s: 2e-3,
        }
    }
}

/// One raw hit.
#[derive(Debug, Clone, Copy)]
pub struct RawHit<'a> {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Force, N.
    pub force_n: &'a [f64],
    /// Responses \[channel\]\[sample\], SI.
    pub responses: &'a [Vec<f64>],
    /// Samples that the acquisition lost within this record.
    pub missing_samples: u64,
}

/// Judges one hit. `reference_peak_n` is the target peak (or the median of the set); without it,
/// weak means no pulse above noise.
pub fn judge(hit: RawHit<'_>, limits: &Limits, reference_peak_n: Option<f64>) -> Judgement {
    let pulse = Pulse::locate(hit.force_n);
    let verdict = |kind, measure, limit, sentence: String| Judgement {
        peak_n: pulse.map_or(0.0, |p| p.peak_n),
        start_s: pulse.map_or(0.0, |p| p.start as f64 / hit.fs_hz),
        ..Judgement::without_pulse(kind, measure, limit, sentence)
    };
    let broken = std::iter::once(hit.force_n)
        .chain(hit.responses.iter().map(Vec::as_slice))
        .map(|x| x.iter().filter(|v| !v.is_finite()).count())
        .max()
        .unwrap_or(0);
    let missing = hit.missing_samples as f64 + broken as f64;
    if missing > 0.0 {
        return verdict(Verdict::Gap, missing, 0.0, format!("{missing} samples are missing from the record"));
    }
    if let Some(peak_n) = reversed_peak_n(hit.force_n) {
        let sentence = format!(
            "the force's sign is the wrong way round: peak {peak_n:.1} N; a push is positive, so multiply the force by -1"
        );
        return verdict(Verdict::Mistimed, peak_n, 0.0, sentence);
    }
    let Some(pulse) = pulse else {
        return verdict(Verdict::Weak, 0.0, 0.0, "there is no force pulse at all".into());
    };
    // The largest of about 10⁵ noise samples reaches 4.5 times the rms.
    let floor = 10.0 * pulse.noise_n;
    if pulse.peak_n < floor {
        let sentence =
            format!("the highest force of {:.3} N is not above noise ({floor:.3} N)", pulse.peak_n);
        return verdict(Verdict::Weak, pulse.peak_n, floor, sentence);
    }
    for (at, end) in [(0, "begins"), (hit.force_n.len() - 1, "ends")] {
        if (pulse.start..pulse.end).contains(&at) {
            let height =
                (hit.force_n[at] - pulse.offset_n) / (hit.force_n[pulse.peak_sample] - pulse.offset_n);
            let sentence = format!(
                "the record {end} within the pulse: its {} sample has {:.0} % of the peak, and the rest of the pulse is missing; \
                 record from before the hit until after it",
                if at == 0 { "first" } else { "last" },
                100.0 * height
            );
            return verdict(Verdict::Mistimed, height, 0.0, sentence);
        }
    }
    if let Some(hits_s) = several_hits_s(hit.force_n, hit.fs_hz) {
        let times: Vec<String> = hits_s.iter().take(12).map(|t| format!("{t:.3}")).collect();
        let more = if hits_s.len() > 12 { ", …" } else { "" };
        let sentence = format!(
            "the record holds {} hits, at {}{more} s: cut it into one record for each, from before its hit to before the next \
             (docs/own-data.md shows how)",
            hits_s.len(),
            times.join(", ")
        );
        return verdict(Verdict::DoubleHit, hits_s.len() as f64, 1.0, sentence);
    }
    if let Some(found) = clipping::force(hit.force_n, &pulse, limits.force_range_n) {
        return verdict(Verdict::Overload, found.level, found.limit, found.sentence("force", "N"));
    }
    if let Some(range) = limits.response_range {
        for (channel, x) in hit.responses.iter().enumerate() {
            if let Some(found) = clipping::response(x, range) {
                let name = format!("response {channel}");
                return verdict(Verdict::Overload, found.level, found.limit, found.sentence(&name, "in SI"));
            }
        }
    }
    for (channel, x) in hit.responses.iter().enumerate() {
        if let Some(found) = clipping::plateau(x, dropout::quantum(x)) {
            let name = format!("response {channel}");
            return verdict(Verdict::Overload, found.level, found.limit, found.sentence(&name, "in SI"));
        }
    }
    let from = (limits.rebound_after_s * hit.fs_hz) as usize;
    if let Some(second) = double_hit::find(hit.force_n, &pulse, limits.rebound_fraction, from) {
        let after_ms = 1e3 * (second.start as f64 - pulse.start as f64) / hit.fs_hz;
        let sentence = format!(
            "a second pulse of {:.2} N ({:.1} % of the first), {after_ms:.2} ms from the first",
            second.fraction * pulse.peak_n,
            100.0 * second.fraction
        );
        return verdict(Verdict::DoubleHit, second.fraction, second.limit, sentence);
    }
    if let Some(reference) = reference_peak_n {
        let (low, high) = (limits.weak_fraction * reference, limits.strong_fraction * reference);
        if pulse.peak_n < low {
            let sentence = format!("a peak of {:.2} N is below {low:.2} N", pulse.peak_n);
            return verdict(Verdict::Weak, pulse.peak_n, low, sentence);
        }
        if pulse.peak_n > high {
            let sentence = format!("a peak of {:.2} N is above {high:.2} N", pulse.peak_n);
            return verdict(Verdict::Strong, pulse.peak_n, high, sentence);
        }
    }
    for (channel, x) in hit.responses.iter().enumerate() {
        if let Some(burst) = dropout::find(x, hit.fs_hz, &pulse, limits.dropout_ratio) {
            let sentence = format!(
                "response {channel} jumps at {:.2} ms by {:.0} times the scatter around it: a dropout or spike, not motion",
                1e3 * burst.sample as f64 / hit.fs_hz,
                burst.ratio
            );
            return verdict(Verdict::Noisy, burst.ratio, limits.dropout_ratio, sentence);
        }
    }
    if let Some(expected) = limits.expected_start_s {
        let late = pulse.start as f64 / hit.fs_hz - expected;
        // a soft pulse may cross the trigger level anywhere on its flank
        let tolerance = limits.start_tolerance_s.max(pulse.width() as f64 / hit.fs_hz);
        if late.abs() > tolerance {
            let sentence = format!("the pulse starts {:.2} ms from where it should", 1e3 * late);
            return verdict(Verdict::Mistimed, late.abs(), tolerance, sentence);
        }
    }
    let limit = reference_peak_n.map_or(floor, |r| limits.weak_fraction * r);
    verdict(Verdict::Good, pulse.peak_n, limit, format!("one clean pulse of {:.2} N", pulse.peak_n))
}

/// Judges every hit of a set. The reference peak is `target_n`, or the median of the set's peaks.
pub fn judge_all(records: &ImpactRecords, limits: &Limits, target_n: Option<f64>) -> Vec<Judgement> {
    let reference = target_n.or_else(|| {
        let mut peaks: Vec<f64> =
            records.force_n.iter().filter_map(|f| Pulse::locate(f)).map(|p| p.peak_n).collect();
        peaks.sort_by(f64::total_cmp);
        peaks.get(peaks.len() / 2).copied()
    });
    records
        .force_n
        .iter()
        .zip(&records.response)
        .map(|(force_n, responses)| {
            let hit = RawHit { fs_hz: records.fs_hz, force_n, responses, missing_samples: 0 };
            judge(hit, limits, reference)
        })
        .collect()
}

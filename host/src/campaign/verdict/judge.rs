//! Judging a record: the trait, and its implementation.

use super::others::{self, Others};
use super::{Judgement, Limits, RawHit, Verdict};
use crate::campaign::plan::{Cell, Plan};
use crate::device::channels::ChannelMap;
use crate::device::stream::Recording;
use jointrig_protocol::channel::{Quantity, Role};

/// Judges records. It works on the raw record, before anything is derived from it.
pub trait Judge {
    /// Judges one record of `cell`; `others` are the cell's good records so far. Called once per
    /// record, in order of measurement.
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement;
}

/// Judges by the raw record itself ([`super::judge`](fn@super::judge)): hammer force and all motion
/// channels of the record, in SI units.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByRecord;

impl Judge for ByRecord {
    fn judge(
        &mut self,
        _: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        let si = |place: usize| channels.to_si(place, recording.channel(place));
        let force_n = channels.place(Role::HammerForce).map(si).unwrap_or_default();
        let places = channels.channels.iter().enumerate().filter(|(_, channel)| is_motion(channel.quantity));
        let (names, responses): (Vec<&str>, Vec<Vec<f64>>) =
            places.map(|(place, channel)| (channel.name.as_str(), si(place))).unzip();
        let (wanted, given) = (plan.force.get_ref(), plan.limits.get_ref());
        let limits = Limits {
            // margin, so that noise does not hide a rebound exactly at the limit
            rebound_fraction: 0.6 * given.rebound_ratio,
            rebound_after_s: given.rebound_after_s,
            weak_fraction: given.weak_n / wanted.target_n,
            strong_fraction: given.strong_n / wanted.target_n,
            force_range_n: channels
                .place(Role::HammerForce)
                .and_then(|place| recording.channel(place).of().full_scale(&channels.channels[place])),
            response_range: None,
            expected_start_s: Some(recording.trigger_index as f64 / channels.fs_hz()),
            ..Limits::default()
        };
        let missing = recording.gaps.iter().map(ExactSizeIterator::len).sum::<usize>() as u64;
        let hit = RawHit {
            fs_hz: channels.fs_hz(),
            force_n: &force_n,
            responses: &responses,
            missing_samples: missing,
        };
        let found = super::judge(hit, &limits, Some(wanted.target_n));
        let judged =
            |kind, measure, limit, sentence| Judgement { kind, measure, limit, sentence, ..found.clone() };
        // a channel at the end of its converter's range spoils the record whatever the hammer did;
        // ranges differ between channels, so each is checked in its own codes, where it has codes
        if missing == 0
            && let Some((name, touched)) = over_range(channels, recording)
        {
            let sentence = format!("channel {name} is at the end of its range for {touched} samples");
            return judged(Verdict::Overload, touched as f64, 1.0, sentence);
        }
        if found.kind == Verdict::Good
            && let Some((name, ratio)) = noisier(channels, recording, others, given.noise_ratio)
        {
            let limit = given.noise_ratio;
            let sentence = format!(
                "channel {name} is {ratio:.1} times as noisy as in the cell's other records (at most {limit:.1})"
            );
            return judged(Verdict::Noisy, ratio, limit, sentence);
        }
        match found.kind {
            Verdict::Noisy | Verdict::Overload => {
                Judgement { sentence: name_responses(&found.sentence, &names), ..found }
            }
            _ => found,
        }
    }
}

/// The channel whose noise exceeds `limit` times its usual noise, and the ratio; the worst if there
/// are several.
fn noisier<'a>(
    channels: &'a ChannelMap,
    recording: &Recording,
    others: &Others,
    limit: f64,
) -> Option<(&'a str, f64)> {
    let noise = others::channel_noise(channels, &recording.samples);
    let ratios = channels.channels.iter().zip(noise).enumerate().filter_map(|(place, (channel, noise))| {
        let usual = others.usual_noise(place).filter(|usual| *usual > 0.0)?;
        Some((channel.name.as_str(), noise / usual))
    });
    ratios.filter(|(_, ratio)| *ratio > limit).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether a channel measures motion, and is checked for dropouts, spikes and plateaus.
fn is_motion(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Velocity | Quantity::Acceleration | Quantity::Displacement)
}

/// The first channel with more than one code at an end of its range, and their number. A single one
/// may be chance.
fn over_range<'a>(channels: &'a ChannelMap, recording: &Recording) -> Option<(&'a str, usize)> {
    channels.channels.iter().enumerate().find_map(|(place, channel)| {
        let touched = recording.channel(place).at_the_ends(channel.bits);
        (touched > 1).then_some((channel.name.as_str(), touched))
    })
}

/// Inserts the channels' names where the analysis, which knows only indices, writes `response N`.
fn name_responses(sentence: &str, names: &[&str]) -> String {
    names.iter().enumerate().rev().fold(sentence.to_owned(), |text, (place, name)| {
        text.replace(&format!("response {place}"), &format!("response {name}"))
    })
}

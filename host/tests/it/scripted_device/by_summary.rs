//! A judge for tests whose records are not real hits: it uses the device's own summary of the shot.

use jointrig_protocol::channel::Role;

use jointrig::campaign::plan::{Cell, Plan};
use jointrig::campaign::verdict::judge::Judge;
use jointrig::campaign::verdict::others::Others;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::device::channels::ChannelMap;
use jointrig::device::stream::Recording;

/// Judges by the device's own summary of the shot and by the range of the codes; needs no signal
/// processing.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByShotSummary;

impl Judge for ByShotSummary {
    fn judge(
        &mut self,
        _: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        _: &Others,
    ) -> Judgement {
        let (shot, limits) = (&recording.shot, plan.limits.get_ref());
        let peak_n = f64::from(shot.peak_n);
        let missing: usize = recording.gaps.iter().map(ExactSizeIterator::len).sum();
        let judged = |kind, measure, limit, sentence| Judgement {
            peak_n,
            ..Judgement::without_pulse(kind, measure, limit, sentence)
        };
        if missing > 0 {
            return judged(Verdict::Gap, missing as f64, 0.0, format!("{missing} samples are missing"));
        }
        for (place, channel) in recording.samples.each().enumerate() {
            let touched = channel.at_the_ends(16);
            // a single code at the end of the range may be chance, two are a flat top
            if touched > 1 {
                let name = channels.channels.get(place).map_or("?", |channel| channel.name.as_str());
                let sentence = format!("channel {name} is at the end of its range for {touched} samples");
                return judged(Verdict::Overload, touched as f64, 1.0, sentence);
            }
        }
        let (peak, rebound) = (f64::from(shot.peak_n), f64::from(shot.rebound_ratio));
        let after = f64::from(shot.rebound_after) / f64::from(channels.rate_hz.max(1));
        if channels.place(Role::HammerForce).is_none() || peak < limits.weak_n {
            judged(
                Verdict::Weak,
                peak,
                limits.weak_n,
                format!("peak {peak:.1} N, at least {:.1} N wanted", limits.weak_n),
            )
        } else if peak > limits.strong_n {
            judged(
                Verdict::Strong,
                peak,
                limits.strong_n,
                format!("peak {peak:.1} N, at most {:.1} N wanted", limits.strong_n),
            )
        } else if rebound >= limits.rebound_ratio && after >= limits.rebound_after_s {
            let sentence =
                format!("a second contact of {:.1} % after {:.1} ms", rebound * 100.0, after * 1e3);
            judged(Verdict::DoubleHit, rebound, limits.rebound_ratio, sentence)
        } else {
            judged(Verdict::Good, peak, plan.force.get_ref().target_n, format!("peak {peak:.1} N"))
        }
    }
}

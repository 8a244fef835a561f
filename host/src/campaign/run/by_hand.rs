//! A manual hit: no shot is ordered; the host monitors the force until a person strikes.
//!
//! Nothing is armed, and the coil stays off. A person cannot be prevented from striking before the
//! structure is at rest, so the motion before each hit is measured: a hit that came too early is
//! stored with that verdict, and refused.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use jointrig_protocol::channel::Role;
use jointrig_protocol::shot::{Phase, Shot};

use super::shot::{Outcome, QuietLimits, STEPS_PER_RING, Shooter, no_shot};
use crate::campaign::watch::{Seen, Watchers};
use crate::device::channels::ChannelMap;
use crate::device::error::DeviceError;
use crate::device::session::Session;

/// Time over which the motion before a hit is measured, s: two periods of the slowest mode of
/// interest.
const BEFORE_S: f64 = 0.075;
/// Samples up to this long before the trigger are free of the hit, s: the force rises to the
/// trigger's level in less.
const CLEAR_S: f64 = 0.001;
/// Samples in one mean: suppresses the converter's noise and keeps motion below 1 kHz.
const MEAN: usize = 24;
/// Factor on the limits that apply to the coil: a person cannot see when the last residual motion
/// has decayed.
pub(super) const ALLOWANCE: f64 = 3.0;
/// Start of the sentence for a hit that came too early: its verdict depends on the motion before
/// the record, not on the record itself.
pub(in crate::campaign) const TOO_EARLY: &str = "struck before the structure was at rest";

impl Shooter {
    /// Waits until a person strikes, for at most `patience_s` of the device's time. The
    /// acknowledgement is held when this returns.
    ///
    /// # Errors
    /// The device refuses or is disconnected.
    pub fn await_hand(
        &mut self,
        session: &mut Session,
        channels: &ChannelMap,
        patience_s: f64,
        quiet: &QuietLimits,
        stop: &AtomicBool,
        watch: &Watchers,
    ) -> Result<Outcome, DeviceError> {
        self.number += 1;
        let begin = self.begin(session)?;
        let last = begin + (patience_s * self.rate_hz) as u64;
        let step = (self.ring / STEPS_PER_RING).max(1);
        let before = (BEFORE_S * self.rate_hz) as u64;
        let mut from = begin;
        let trigger = loop {
            let reach = from + step;
            session.hold_acknowledgement(Some(reach));
            if session.wait_until(reach, |_| stop.load(Ordering::Relaxed))? {
                return Ok(Outcome::Interrupted);
            }
            if let Some(found) = self.contact(session, channels, from..reach)? {
                break found;
            }
            if reach > last {
                self.ready_at = reach;
                return Ok(Outcome::NobodyStruck);
            }
            from = reach;
            session.forget_before(from.saturating_sub(self.pre.max(before) + step));
        };
        watch.saw(&Seen::Recording);
        let end = trigger + self.post;
        session.hold_acknowledgement(Some(end));
        session.wait_for(end)?;
        self.ready_at = end;
        let clear = trigger - ((CLEAR_S * self.rate_hz) as u64).min(trigger - begin);
        let moved = moving(session, channels, quiet, clear.saturating_sub(before).max(begin)..clear)?;
        let recording = Box::new(self.collect(session, &self.struck(session, channels, trigger)?)?);
        session.forget_before(end.saturating_sub(self.pre.max(before)));
        Ok(match moved {
            Some((place, ratio)) => Outcome::TooEarly { recording, place, ratio },
            None => Outcome::Recorded(recording),
        })
    }

    /// The first scan of the range at which the force reaches the trigger's level.
    fn contact(
        &self,
        session: &Session,
        channels: &ChannelMap,
        range: Range<u64>,
    ) -> Result<Option<u64>, DeviceError> {
        let Some(force) = channels.place(Role::HammerForce) else { return Ok(None) };
        let level_n = f64::from(self.trigger.level_n);
        let (samples, _) = session.cut(range.clone())?;
        let force_n = channels.to_si(force, samples.channel(force));
        let found = force_n.iter().position(|force_n| *force_n >= level_n);
        Ok(found.map(|scan| range.start + scan as u64))
    }

    /// The shot summary that a device would report for this hit.
    fn struck(&self, session: &Session, channels: &ChannelMap, trigger: u64) -> Result<Shot, DeviceError> {
        let listened = trigger..trigger + u64::from(self.trigger.listen_scans).min(self.post);
        let peak_n = match channels.place(Role::HammerForce) {
            None => 0.0,
            Some(force) => {
                let (samples, _) = session.cut(listened)?;
                channels.to_si(force, samples.channel(force)).into_iter().fold(0.0, f64::max)
            }
        };
        let none = no_shot(self.number, 0);
        Ok(Shot { phase: Phase::Done, fired_at: trigger, trigger, peak_n: peak_n as f32, ..none })
    }
}

/// The channel with the largest ratio of motion to its limit, and that ratio; `None` if no
/// channel exceeds its limit.
fn moving(
    session: &Session,
    channels: &ChannelMap,
    quiet: &QuietLimits,
    range: Range<u64>,
) -> Result<Option<(usize, f64)>, DeviceError> {
    let (samples, _) = session.cut(range)?;
    let ratio = |(place, limit): (usize, &f32)| {
        (place, rms_of_means(&channels.to_si(place, samples.channel(place))) / f64::from(*limit))
    };
    let bounded = quiet.iter().enumerate().filter(|(_, limit)| **limit > 0.0);
    Ok(bounded.map(ratio).filter(|(_, ratio)| *ratio > 1.0).max_by(|a, b| a.1.total_cmp(&b.1)))
}

/// Rms of the means of neighbouring samples about their overall mean: slow motion, without offset
/// and broadband noise.
fn rms_of_means(signal: &[f64]) -> f64 {
    let means: Vec<f64> =
        signal.chunks_exact(MEAN).map(|part| part.iter().sum::<f64>() / MEAN as f64).collect();
    let count = means.len().max(1) as f64;
    let offset = means.iter().sum::<f64>() / count;
    (means.iter().map(|mean| (mean - offset).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_motion_counts_and_offset_and_noise_do_not() {
        let at = |i: usize| i as f64 / 51_200.0;
        let slow: Vec<f64> =
            (0..3_840).map(|i| 5.0 + (2.0 * std::f64::consts::PI * 200.0 * at(i)).sin()).collect();
        assert!((rms_of_means(&slow) - 0.5f64.sqrt()).abs() < 0.02);
        let noise: Vec<f64> = (0..3_840).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!(rms_of_means(&noise) < 1e-12);
        assert_eq!(rms_of_means(&[]), 0.0);
    }
}

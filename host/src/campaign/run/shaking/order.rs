//! The orders of one level: sent to the device, and renewed as long as the level lasts.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use jointrig_protocol::answer::{Info, Shaker};
use jointrig_protocol::request::Shake;

use super::LevelOptions;
use super::error::{ShakeError, Shortfall};
use crate::campaign::plan::level::{Held, Level};
use crate::device::channels::ChannelMap;
use crate::device::session::Session;
use jointrig_protocol::event::Reason;

/// Validity of an order, ms of the device's clock.
const VALID_MS: u32 = 10_000;

/// Interval between renewals, s of the device's clock. A virtual board may be ahead of the host by
/// half its ring buffer.
const RENEW_S: f64 = 3.0;

/// Slew rate: the drive's amplitude changes by at most its full scale in half a second.
const SLEW_PER_S: f64 = 2.0;

/// The current order, and when it is renewed.
pub struct Orders {
    order: Shake,
    level: Level,
    rate_hz: u32,
    renew_at: u64,
    channels: ChannelMap,
    stop: Arc<AtomicBool>,
}

impl Orders {
    pub fn new(channels: &ChannelMap, info: &Info, level: &Level, options: &LevelOptions) -> Self {
        let full_v = f64::from(info.drive_v);
        let (amplitude_v, slew) = match level.held {
            Held::Drive => (level.amplitude, level.amplitude),
            _ => (options.most_drive_v.unwrap_or(full_v), full_v),
        };
        let limits = options.limits.of(channels).into_iter().map(|limit| limit as f32).collect();
        let order = Shake {
            step: Shake::step_of(level.frequency_hz, channels.rate_hz),
            control: level.held.control(level.amplitude),
            amplitude_v: amplitude_v as f32,
            slew_v_per_s: (SLEW_PER_S * slew) as f32,
            valid_ms: VALID_MS,
            limits,
        };
        Self {
            order,
            level: *level,
            rate_hz: channels.rate_hz,
            renew_at: 0,
            channels: channels.clone(),
            stop: options.stop.clone(),
        }
    }

    /// Sends the first order; returns a scan from which it is in effect.
    pub fn begin(&mut self, session: &mut Session) -> Result<u64, ShakeError> {
        let _ = session.shaker_stopped();
        session.shake(self.order.clone())?;
        let now = session.status()?.next_scan;
        self.renew_at = now + (RENEW_S * f64::from(self.rate_hz)) as u64;
        Ok(now)
    }

    /// The drive's largest amplitude, V.
    pub fn most_drive_v(&self) -> f64 {
        f64::from(self.order.amplitude_v)
    }

    /// Scans per second.
    pub fn rate_hz(&self) -> f64 {
        f64::from(self.rate_hz)
    }

    /// Changes the frequency with continuous phase.
    pub fn tune(&mut self, session: &mut Session, frequency_hz: f64) -> Result<(), ShakeError> {
        self.order.step = Shake::step_of(frequency_hz, self.rate_hz);
        self.renew(session)
    }

    /// Waits for `scan`, and keeps renewing the order meanwhile. Renewal follows the scans that
    /// have arrived, not those that were evaluated, so that the order does not expire if the host
    /// lags behind; a virtual board waits for such a host.
    ///
    /// # Errors
    /// The user interrupts, the shaker stopped, or the device is disconnected.
    pub fn go_on(&mut self, session: &mut Session, scan: u64) -> Result<(), ShakeError> {
        session.hold_acknowledgement(Some(scan));
        loop {
            if session.expected()? >= self.renew_at {
                self.renew(session)?;
            }
            let next = scan.min(self.renew_at);
            let stop = &self.stop;
            if session.wait_until(next, |_| stop.load(Ordering::Relaxed))? {
                return Err(ShakeError::Interrupted);
            }
            if let Some(reason) = session.shaker_stopped() {
                return Err(self.stopped(Some(reason)));
            }
            if next == scan {
                return Ok(());
            }
        }
    }

    /// Renews the order, unless the shaker has stopped unnoticed: a renewal must not start it
    /// again.
    fn renew(&mut self, session: &mut Session) -> Result<(), ShakeError> {
        self.still_runs(session)?;
        session.shake(self.order.clone())?;
        self.renew_at = session.expected()? + (RENEW_S * f64::from(self.rate_hz)) as u64;
        Ok(())
    }

    /// Checks that the shaker runs as ordered.
    pub fn still_runs(&self, session: &mut Session) -> Result<(), ShakeError> {
        match session.status()?.shaker {
            Shaker::Slewing | Shaker::Steady => Ok(()),
            Shaker::Resting | Shaker::Stopping => {
                let reason = session.shaker_stopped();
                Err(self.stopped(reason))
            }
        }
    }

    fn stopped(&self, reason: Option<Reason>) -> ShakeError {
        if reason == Some(Reason::Weak) {
            return ShakeError::Short(Shortfall::Weak { drive_v: f64::from(self.order.amplitude_v) });
        }
        let limit = |channel: u8| self.order.limits.get(usize::from(channel)).copied().unwrap_or(0.0);
        ShakeError::Stopped {
            level: self.level.to_string(),
            why: super::error::in_words(reason, &self.channels, limit),
        }
    }
}

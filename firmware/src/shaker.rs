//! The shaker: a sine whose amplitude never jumps, for a bounded time, within limits.
//!
//! ```text
//! Resting ──shake──▶ Slewing ──there──▶ Steady ──shake──▶ Slewing …
//!    ▲                  │ asked, expired, over a limit, host silent, guard open, stream ended │
//!    └──── at rest ◀── Stopping ◀──────────────────────────────────────────────────────────────┘
//! ```
//!
//! Like the hammer's, this state machine is driven by scans only. Each delivered block yields as
//! many codes as it has scans, which the acquisition task passes to the drive; when the controller
//! stops supplying codes, the drive is at rest. Only the emergency stop does not ramp: it disables
//! the drive immediately.

use heapless::Vec;
use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::Channel;
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::limits::{CHANNEL_CAPACITY, SHAKE_RAMP_MS, SHAKE_SCANS_PER_CYCLE, SHAKE_VALID_CAP_MS};
use jointrig_protocol::request::{Control, Shake};

use crate::hammer::Scanned;
use crate::ruler::scans_in_ms;
use crate::scales::{UnitsPerCode, as_built};
use crate::servo::{Gauges, Servo, Trouble, sine};

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Resting,
    Running { until: u64 },
    Stopping,
}

/// A channel with a limit.
#[derive(Clone, Copy, Debug)]
struct Bound {
    channel: u8,
    code: u16,
}

/// The shaker's state machine.
pub struct Shaker<'a> {
    channels: &'a [Channel],
    rate_hz: u32,
    full_scale_v: f32,
    units_per_code: UnitsPerCode,
    state: State,
    /// The angle of the next scan, in units of 2⁻³² turn.
    angle: u32,
    step: u32,
    amplitude_v: f32,
    ordered_v: f32,
    /// Change of the amplitude per scan, V.
    slew_v: f32,
    bounds: Vec<Bound, CHANNEL_CAPACITY>,
    servo: Option<Servo>,
}

impl<'a> Shaker<'a> {
    /// A shaker at rest. A `full_scale_v` of 0 means a board without a shaker.
    pub fn new(channels: &'a [Channel], rate_hz: u32, full_scale_v: f32) -> Self {
        Self {
            channels,
            rate_hz,
            full_scale_v,
            units_per_code: as_built(channels),
            state: State::Resting,
            angle: 0,
            step: 0,
            amplitude_v: 0.0,
            ordered_v: 0.0,
            slew_v: 0.0,
            bounds: Vec::new(),
            servo: None,
        }
    }

    /// Uses these scales from the next request on.
    pub(crate) fn judge_by(&mut self, scales: &UnitsPerCode) {
        self.units_per_code.clone_from(scales);
    }

    /// Its state, in the protocol's terms.
    pub fn state(&self) -> answer::Shaker {
        match self.state {
            State::Resting => answer::Shaker::Resting,
            State::Running { .. } if self.amplitude_v == self.ordered_v => answer::Shaker::Steady,
            State::Running { .. } => answer::Shaker::Slewing,
            State::Stopping => answer::Shaker::Stopping,
        }
    }

    /// Present amplitude of the drive, V.
    pub fn amplitude_v(&self) -> f32 {
        self.amplitude_v
    }

    /// Last measured amplitude of the controlled quantity, m or N; 0 when the drive itself is
    /// controlled.
    pub fn controlled(&self) -> f32 {
        self.servo.as_ref().map_or(0.0, Servo::measured)
    }

    /// Whether the drive needs codes.
    pub fn moves(&self) -> bool {
        self.state != State::Resting
    }

    /// Largest slew rate of the amplitude, V/s.
    fn fastest_v_per_s(&self) -> f32 {
        self.full_scale_v * 1000.0 / SHAKE_RAMP_MS as f32
    }

    /// Accepts a request; from rest, the sine begins at its zero crossing. A refused request
    /// changes nothing.
    ///
    /// # Errors
    /// [`Refusal::Unsupported`] without a shaker, or without the channels that measure the quantity
    /// to be controlled; [`Refusal::OutOfBounds`] states which bound is violated.
    pub fn shake(&mut self, now: u64, order: &Shake) -> Result<Option<Event>, Refusal> {
        if self.full_scale_v <= 0.0 {
            return Err(Refusal::Unsupported);
        }
        let refuse = |sentence| Err(crate::sentence::out_of_bounds(sentence));
        if order.step == 0 || order.step > u32::MAX / SHAKE_SCANS_PER_CYCLE {
            return refuse("the shaker's frequency must be above 0 and at most a tenth of the scan rate");
        }
        // written so that NaN is refused, too
        if !(order.amplitude_v >= 0.0 && order.amplitude_v <= self.full_scale_v) {
            return refuse("the shaker's amplitude must be 0 to the full scale of its drive");
        }
        if !(order.slew_v_per_s > 0.0 && order.slew_v_per_s <= self.fastest_v_per_s()) {
            return refuse("the shaker's slew must be above 0 and at most full scale in 50 ms");
        }
        if order.valid_ms == 0 || order.valid_ms > SHAKE_VALID_CAP_MS {
            return refuse("an order to the shaker must be valid for 1 to 60000 ms");
        }
        if order.limits.len() > self.units_per_code.len()
            || order.limits.iter().any(|limit| !(limit.is_finite() && *limit >= 0.0))
        {
            return refuse(
                "the shaker's limits must be finite, not negative, and no more than there are channels",
            );
        }
        let target = match order.control {
            Control::Drive => order.amplitude_v,
            Control::Displacement { amplitude_m: target } | Control::Force { amplitude_n: target } => target,
        };
        if !(target.is_finite() && (target > 0.0 || order.control == Control::Drive)) {
            return refuse("the controlled amplitude must be above 0");
        }
        let gauges = Gauges { channels: self.channels, units_per_code: &self.units_per_code };
        let mut servo = Servo::new(&gauges, self.rate_hz, order.control, order.step, order.amplitude_v);
        if servo.is_none() && order.control != Control::Drive {
            return Err(Refusal::Unsupported);
        }
        let was_resting = self.state == State::Resting;
        if was_resting {
            self.angle = 0;
            self.amplitude_v = 0.0;
        }
        self.step = order.step;
        self.ordered_v = match (&mut servo, &self.servo) {
            (None, _) => order.amplitude_v,
            // a renewed or changed request continues from the present drive; not `clamp`, whose
            // panic can format floats, which takes 16 kB of flash
            (Some(servo), Some(before)) if !was_resting => {
                servo.continues(before);
                self.ordered_v.max(servo.first_v()).min(order.amplitude_v)
            }
            (Some(servo), _) => servo.first_v(),
        };
        self.servo = servo;
        self.slew_v = order.slew_v_per_s / self.rate_hz as f32;
        self.bounds = self.bounds_of(&order.limits);
        self.state = State::Running { until: now + scans_in_ms(order.valid_ms, self.rate_hz) };
        Ok(was_resting.then_some(Event::ShakerRuns))
    }

    fn bounds_of(&self, limits: &[f32]) -> Vec<Bound, CHANNEL_CAPACITY> {
        let codes = limits.iter().zip(&self.units_per_code).map(|(limit, unit)| limit / unit.abs());
        let bounds = codes.enumerate().filter(|(_, code)| *code > 0.0);
        // a limit beyond the converter's range saturates to its end, which is never exceeded
        bounds.map(|(channel, code)| Bound { channel: channel as u8, code: code as u16 }).collect()
    }

    /// Starts the ramp to rest, if the shaker is running.
    pub fn stop(&mut self, reason: Reason) -> Option<Event> {
        if !matches!(self.state, State::Running { .. }) {
            return None;
        }
        self.state = State::Stopping;
        self.ordered_v = 0.0;
        self.slew_v = self.fastest_v_per_s() / self.rate_hz as f32;
        Some(Event::ShakerStops(reason))
    }

    /// Sets the state to rest immediately, because the drive was disabled. There is no ramp.
    pub fn halt(&mut self, reason: Reason) -> Option<Event> {
        let told = match self.state {
            State::Running { .. } => Some(Event::ShakerStops(reason)),
            // the reason was reported when the stop began
            State::Stopping => Some(Event::ShakerRests),
            State::Resting => None,
        };
        self.state = State::Resting;
        self.amplitude_v = 0.0;
        told
    }

    /// Evaluates one block and writes as many codes as it has scans. Returns events for what
    /// changed.
    pub fn block(&mut self, block: &impl Scanned, codes: &mut [i16]) -> [Option<Event>; 2] {
        let end = block.first_scan() + block.scans() as u64;
        let mut stops = None;
        if let State::Running { until } = self.state {
            if let Some(bound) = self.exceeded(block) {
                stops = self.stop(Reason::Limit { channel: bound.channel });
            } else if end >= until {
                stops = self.stop(Reason::Expired);
            }
        }
        let code_per_v = f32::from(i16::MAX) / self.full_scale_v;
        for (scan, code) in codes.iter_mut().enumerate() {
            if stops.is_none() {
                stops = self.correct(block, scan);
            }
            // the amplitude is at most full scale, so the product is a valid code; it is rounded to
            // the nearest
            let exact = self.amplitude_v * code_per_v * sine(self.angle);
            *code = (exact + 0.5_f32.copysign(exact)) as i16;
            self.angle = self.angle.wrapping_add(self.step);
            self.amplitude_v = if self.amplitude_v < self.ordered_v {
                (self.amplitude_v + self.slew_v).min(self.ordered_v)
            } else {
                (self.amplitude_v - self.slew_v).max(self.ordered_v)
            };
        }
        let rests = self.state == State::Stopping && self.amplitude_v <= 0.0;
        if rests {
            self.state = State::Resting;
        }
        [stops, rests.then_some(Event::ShakerRests)]
    }

    /// Passes one scan to the amplitude controller and applies its result. The measured quantity
    /// need not be in phase with the drive.
    fn correct(&mut self, block: &impl Scanned, scan: usize) -> Option<Event> {
        let State::Running { .. } = self.state else { return None };
        let servo = self.servo.as_mut()?;
        match servo.feed(block, scan, self.angle, self.step, self.ordered_v) {
            Ok(None) => None,
            Ok(Some(wanted_v)) => {
                self.ordered_v = wanted_v;
                None
            }
            Err(Trouble::Runaway) => self.stop(Reason::Runaway),
            Err(Trouble::Weak) => self.stop(Reason::Weak),
        }
    }

    fn exceeded(&self, block: &impl Scanned) -> Option<Bound> {
        let over = |bound: &&Bound| {
            (0..block.scans())
                .any(|scan| block.code(scan, usize::from(bound.channel)).unsigned_abs() > bound.code)
        };
        self.bounds.iter().find(over).copied()
    }
}

#[cfg(test)]
#[path = "shaker_tests.rs"]
mod tests;

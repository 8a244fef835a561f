//! The shaker: a sine whose amplitude never jumps, for a bounded time, within limits.
//!
//! ```text
//! Resting ──shake──▶ Slewing ──there──▶ Steady ──shake──▶ Slewing …
//!    ▲                  │ asked, expired, over a limit, host silent, guard open, stream ended │
//!    └──── at rest ◀── Stopping ◀──────────────────────────────────────────────────────────────┘
//! ```
//!
//! Like the hammer's, this machine is driven by scans alone. Each delivered block yields the codes of as many scans,
//! which the acquisition task hands to the drive; a controller that stops giving codes leaves the drive at
//! rest. The emergency stop is the one thing that does not ramp: it takes the drive away at once.

use heapless::Vec;
use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::Channel;
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::limits::{MAX_CHANNELS, SHAKE_RAMP_MS, SHAKE_SCANS_PER_CYCLE, SHAKE_VALID_CAP_MS};
use jointrig_protocol::request::{Control, Shake};

use crate::hammer::Scanned;
use crate::servo::{Servo, Trouble};
use crate::sine::sine;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Resting,
    Running { until: u64 },
    Stopping,
}

/// A channel that must stay within bounds.
#[derive(Clone, Copy, Debug)]
struct Bound {
    channel: u8,
    code: u16,
}

/// The machine.
pub struct Shaker<'a> {
    channels: &'a [Channel],
    rate_hz: u32,
    full_scale_v: f32,
    units_per_code: Vec<f32, MAX_CHANNELS>,
    state: State,
    /// The angle of the next scan, in parts of 2³² of a turn.
    angle: u32,
    step: u32,
    amplitude_v: f32,
    ordered_v: f32,
    /// Change of the amplitude from one scan to the next, V.
    slew_v: f32,
    bounds: Vec<Bound, MAX_CHANNELS>,
    servo: Option<Servo>,
}

impl<'a> Shaker<'a> {
    /// At rest. A `full_scale_v` of 0 is a board without a shaker.
    pub fn new(channels: &'a [Channel], rate_hz: u32, full_scale_v: f32) -> Self {
        Self {
            channels,
            rate_hz,
            full_scale_v,
            units_per_code: channels.iter().map(|channel| channel.units_per_code().abs() as f32).collect(),
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

    /// What it does, in the protocol's words.
    pub fn state(&self) -> answer::Shaker {
        match self.state {
            State::Resting => answer::Shaker::Resting,
            State::Running { .. } if self.amplitude_v == self.ordered_v => answer::Shaker::Steady,
            State::Running { .. } => answer::Shaker::Slewing,
            State::Stopping => answer::Shaker::Stopping,
        }
    }

    /// Amplitude of the drive now, V.
    pub fn amplitude_v(&self) -> f32 {
        self.amplitude_v
    }

    /// Amplitude that was last measured of what is controlled, m or N; 0 when the drive itself is.
    pub fn controlled(&self) -> f32 {
        self.servo.as_ref().map_or(0.0, Servo::measured)
    }

    /// Whether the drive wants codes.
    pub fn moves(&self) -> bool {
        self.state != State::Resting
    }

    /// Fastest change of the amplitude, V/s.
    fn fastest_v_per_s(&self) -> f32 {
        self.full_scale_v * 1000.0 / SHAKE_RAMP_MS as f32
    }

    /// Accepts an order; from rest, the sine begins at its zero. An order that is refused changes nothing.
    ///
    /// # Errors
    /// [`Refusal::Unsupported`] without a shaker, or without the channels that measure what is to be controlled;
    /// [`Refusal::OutOfBounds`] says which bound.
    pub fn shake(&mut self, now: u64, order: &Shake) -> Result<Option<Event>, Refusal> {
        if self.full_scale_v <= 0.0 {
            return Err(Refusal::Unsupported);
        }
        let refuse = |sentence| Err(crate::requests::out_of_bounds(sentence));
        if order.step == 0 || order.step > u32::MAX / SHAKE_SCANS_PER_CYCLE {
            return refuse("the shaker's frequency must be above 0 and at most a tenth of the scan rate");
        }
        // written so that what is not a number is refused, too
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
        let mut servo = Servo::new(self.channels, self.rate_hz, order.control, order.step, order.amplitude_v);
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
            // an order renewed or changed goes on from the drive that it finds; not by clamp, whose panic can print
            // floats and with that costs 16 kB of flash
            (Some(servo), Some(before)) if !was_resting => {
                servo.continues(before);
                self.ordered_v.max(servo.first_v()).min(order.amplitude_v)
            }
            (Some(servo), _) => servo.first_v(),
        };
        self.servo = servo;
        self.slew_v = order.slew_v_per_s / self.rate_hz as f32;
        self.bounds = self.bounds_of(&order.limits);
        self.state =
            State::Running { until: now + u64::from(order.valid_ms) * u64::from(self.rate_hz) / 1000 };
        Ok(was_resting.then_some(Event::ShakerRuns))
    }

    fn bounds_of(&self, limits: &[f32]) -> Vec<Bound, MAX_CHANNELS> {
        let codes = limits.iter().zip(&self.units_per_code).map(|(limit, unit)| limit / unit);
        let bounds = codes.enumerate().filter(|(_, code)| *code > 0.0);
        // a limit beyond the converter's range saturates to its end, which is never exceeded
        bounds.map(|(channel, code)| Bound { channel: channel as u8, code: code as u16 }).collect()
    }

    /// Begins to come to rest, if it runs.
    pub fn stop(&mut self, reason: Reason) -> Option<Event> {
        if !matches!(self.state, State::Running { .. }) {
            return None;
        }
        self.state = State::Stopping;
        self.ordered_v = 0.0;
        self.slew_v = self.fastest_v_per_s() / self.rate_hz as f32;
        Some(Event::ShakerStops(reason))
    }

    /// Is at rest at once: the drive was taken away. Nothing ramps.
    pub fn halt(&mut self, reason: Reason) -> Option<Event> {
        let ran = matches!(self.state, State::Running { .. });
        self.state = State::Resting;
        self.amplitude_v = 0.0;
        ran.then_some(Event::ShakerStops(reason))
    }

    /// Judges one block, and writes the codes of as many scans. Events tell what changed.
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
            // the amplitude is at most full scale, so that the product is a code; it is rounded to the nearest
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

    /// Lets the controller see a scan, and follows it. What it measures need not be in phase with what is driven.
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
mod tests {
    extern crate std;
    use jointrig_protocol::channel::{Axis, Name, Quantity, Role};
    use std::vec::Vec as List;

    use super::*;

    const RATE: u32 = 51_200;
    const FULL_V: f32 = 10.0;

    /// A block whose only channel shows one code.
    struct Block {
        first: u64,
        scans: usize,
        code: i16,
    }

    impl Scanned for Block {
        fn first_scan(&self) -> u64 {
            self.first
        }

        fn scans(&self) -> usize {
            self.scans
        }

        fn code(&self, _scan: usize, _channel: usize) -> i16 {
            self.code
        }
    }

    fn shaker(full_scale_v: f32) -> Shaker<'static> {
        let channel = Channel {
            name: Name::new(),
            role: Role::Response(Axis::Z),
            quantity: Quantity::Velocity,
            units_per_volt: 0.005,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        Shaker::new(std::vec![channel].leak(), RATE, full_scale_v)
    }

    fn order(frequency_hz: f64, amplitude_v: f32) -> Shake {
        Shake {
            step: Shake::step_of(frequency_hz, RATE),
            control: Control::Drive,
            amplitude_v,
            slew_v_per_s: 100.0,
            valid_ms: 1000,
            limits: Vec::new(),
        }
    }

    /// Lets so many blocks of 24 scans pass; the codes, and what was told.
    fn run(shaker: &mut Shaker, now: &mut u64, blocks: u32, code: i16) -> (List<i16>, List<Event>) {
        let (mut all, mut told) = (List::new(), List::new());
        for _ in 0..blocks {
            let mut codes = [0; 24];
            if shaker.moves() {
                let block = Block { first: *now, scans: 24, code };
                told.extend(shaker.block(&block, &mut codes).into_iter().flatten());
            }
            all.extend(codes);
            *now += 24;
        }
        (all, told)
    }

    #[test]
    fn the_sine_has_the_frequency_and_amplitude_that_were_ordered() {
        let (mut shaker, mut now) = (shaker(FULL_V), 0);
        assert_eq!(shaker.shake(now, &order(200.0, 5.0)), Ok(Some(Event::ShakerRuns)));
        // 0.05 s of rise at 100 V/s, then whole cycles of 256 scans
        run(&mut shaker, &mut now, 2560 / 24 + 1, 0);
        assert_eq!(shaker.state(), answer::Shaker::Steady);
        let (codes, told) = run(&mut shaker, &mut now, 32 * 4, 0);
        assert!(told.is_empty());
        let whole = 256 * 12;
        let (mut re, mut im, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (i, code) in codes[..whole].iter().enumerate() {
            let (angle, value) = (i as f64 / 256.0 * core::f64::consts::TAU, f64::from(*code));
            re += value * angle.cos() / (whole as f64 / 2.0);
            im += value * angle.sin() / (whole as f64 / 2.0);
            square += value * value / whole as f64;
        }
        let amplitude = re.hypot(im);
        // a code of rounding scatters over the sum and vanishes in it
        assert!((amplitude - 0.5 * 32767.0).abs() < 0.1, "{amplitude}");
        // all that is not the sine: rounding to codes is 0.29 rms
        let rest = (square - amplitude * amplitude / 2.0).max(0.0).sqrt();
        assert!(rest < 0.4, "{rest}");
    }

    #[test]
    fn the_amplitude_never_jumps_whatever_is_ordered() {
        let (mut shaker, mut now) = (shaker(FULL_V), 0);
        let mut all = List::new();
        // the fastest slew, and a frequency so low that the codes show the amplitude's own change
        let fast = |frequency, amplitude| Shake { slew_v_per_s: 200.0, ..order(frequency, amplitude) };
        for (frequency, amplitude) in [(100.0, 10.0), (130.0, 0.1), (90.0, 10.0), (90.0, 0.0)] {
            shaker.shake(now, &fast(frequency, amplitude)).expect("an order within bounds");
            all.extend(run(&mut shaker, &mut now, 140, 0).0);
        }
        shaker.shake(now, &fast(100.0, 10.0)).expect("an order within bounds");
        all.extend(run(&mut shaker, &mut now, 150, 0).0);
        assert_eq!(shaker.stop(Reason::Asked), Some(Event::ShakerStops(Reason::Asked)));
        let (codes, told) = run(&mut shaker, &mut now, 120, 0);
        all.extend(codes);
        assert_eq!(told, [Event::ShakerRests]);
        // slope of the fastest sine, 2 pi 130 Hz, plus the slew of full scale in 50 ms, plus rounding
        let steepest = 32767.0 * (core::f64::consts::TAU * 130.0 + 1.0 / 0.05) / f64::from(RATE) + 1.0;
        for pair in all.windows(2) {
            assert!(f64::from(pair[1] - pair[0]).abs() <= steepest, "{pair:?}");
        }
        assert_eq!(all.last(), Some(&0));
    }

    #[test]
    fn an_order_expires_into_a_ramp() {
        let (mut shaker, mut now) = (shaker(FULL_V), 1_000_000);
        shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
        let (_, told) = run(&mut shaker, &mut now, 51_200 / 24, 0);
        assert!(told.is_empty());
        let (_, told) = run(&mut shaker, &mut now, 200, 0);
        assert_eq!(told, [Event::ShakerStops(Reason::Expired), Event::ShakerRests]);
        assert_eq!((shaker.state(), shaker.amplitude_v()), (answer::Shaker::Resting, 0.0));
        // renewed in time, it goes on
        shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
        for _ in 0..5 {
            assert!(run(&mut shaker, &mut now, 1500, 0).1.is_empty());
            assert_eq!(shaker.shake(now, &order(200.0, 5.0)), Ok(None));
        }
    }

    #[test]
    fn a_channel_beyond_its_limit_stops_it() {
        let (mut shaker, mut now) = (shaker(FULL_V), 0);
        // 0.01 m/s of 0.05 m/s full scale
        let mut limited = order(200.0, 5.0);
        limited.limits.push(0.01).expect("room for a limit");
        shaker.shake(now, &limited).expect("an order within bounds");
        assert!(run(&mut shaker, &mut now, 100, -6_553).1.is_empty());
        let (_, told) = run(&mut shaker, &mut now, 1, -6_555);
        assert_eq!(told, [Event::ShakerStops(Reason::Limit { channel: 0 })]);
        assert_eq!(shaker.state(), answer::Shaker::Stopping);
    }

    #[test]
    fn orders_out_of_bounds_change_nothing() {
        let mut shaker = shaker(FULL_V);
        let good = order(200.0, 5.0);
        let mut many = good.clone();
        many.limits.extend([0.0; 2]);
        let bad = [
            Shake { step: 0, ..good.clone() },
            Shake { step: Shake::step_of(5121.0, RATE), ..good.clone() },
            Shake { amplitude_v: 10.01, ..good.clone() },
            Shake { amplitude_v: -1.0, ..good.clone() },
            Shake { amplitude_v: f32::NAN, ..good.clone() },
            Shake { slew_v_per_s: 201.0, ..good.clone() },
            Shake { slew_v_per_s: 0.0, ..good.clone() },
            Shake { slew_v_per_s: f32::NAN, ..good.clone() },
            Shake { valid_ms: 0, ..good.clone() },
            Shake { valid_ms: SHAKE_VALID_CAP_MS + 1, ..good.clone() },
            many,
        ];
        for order in bad {
            assert!(matches!(shaker.shake(0, &order), Err(Refusal::OutOfBounds(_))), "{order:?}");
            assert!(!shaker.moves());
        }
        assert_eq!(super::tests::shaker(0.0).shake(0, &good), Err(Refusal::Unsupported));
        assert_eq!(shaker.shake(0, &good), Ok(Some(Event::ShakerRuns)));
    }

    #[test]
    fn an_emergency_leaves_nothing_to_ramp() {
        let (mut shaker, mut now) = (shaker(FULL_V), 0);
        shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
        run(&mut shaker, &mut now, 200, 0);
        assert_eq!(shaker.halt(Reason::EmergencyStop), Some(Event::ShakerStops(Reason::EmergencyStop)));
        assert!(!shaker.moves());
        assert_eq!(shaker.halt(Reason::EmergencyStop), None);
        // and the next order begins from nothing
        shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
        let (codes, _) = run(&mut shaker, &mut now, 1, 0);
        // 24 scans at 100 V/s are 0.047 V
        assert!(codes.iter().all(|code| code.abs() <= 154), "{codes:?}");
    }
}

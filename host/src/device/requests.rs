//! Requests of a session's user, and waiting for their results: among them the shaker's, and those
//! of synchronisation with another recorder (the clock that times the scans, and edges that both
//! record).
//!
//! The shaker is ordered, renewed and brought to rest from here. An order is valid for a limited
//! time of the device's clock and must be renewed by another [`Session::shake`]. A session that
//! ends while the shaker may be moving orders it to rest. If the process is killed, the device does
//! so itself after one second without a message.

use super::channels::ChannelMap;
use super::claims;
use super::error::DeviceError;
use super::inbox::Starting;
use super::samples::Samples;
use super::session::{Session, TRIES, patience};
use super::stream::{Accounts, ScanLayout, Stream};
use super::tap::Tap;
use jointrig_protocol::answer::{Answer, Info, Shaker, Status};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::frame::Kind;
use jointrig_protocol::limits::CHANNEL_CAPACITY;
use jointrig_protocol::request::{Fire, Numbered, Request, Shake, Stage, Trigger};
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Sync};
use std::ops::Range;
use std::time::{Duration, Instant};

/// Minor protocol version that introduced scales.
const SCALES_SINCE: u16 = 1;

/// Minor protocol version that introduced slow values.
const SLOW_SINCE: u16 = 1;

/// Longest wait for a first byte within one pump.
const POLL: Duration = Duration::from_millis(20);

/// Slowest progress of a running stream, relative to the host's clock.
const SLOWEST: f64 = 1e-3;

fn name(request: &Request) -> &'static str {
    match request {
        Request::Info => "info",
        Request::Channel { .. } => "channel",
        Request::Status => "status",
        Request::Start => "start",
        Request::Stop => "stop",
        Request::Resend { .. } => "resend",
        Request::Trigger(_) => "trigger",
        Request::LoadCells { .. } => "load cells",
        Request::Arm { .. } => "arm",
        Request::Disarm => "disarm",
        Request::Fire(_) => "fire",
        Request::Stage(_) => "stage",
        Request::EmergencyStop => "emergency stop",
        Request::Shake(_) => "shake",
        Request::Rest => "rest",
        Request::Scales { .. } => "scales",
        Request::Slow => "slow",
        Request::Clock(_) => "clock",
        Request::Sync => "sync",
        Request::Mark => "mark",
    }
}

impl Session {
    /// Sends a request, repeats it under the same number until it is answered, and returns the
    /// answer.
    ///
    /// # Errors
    /// A refusal, no answer, a broken link.
    pub fn ask(&mut self, request: Request) -> Result<Answer, DeviceError> {
        let asked = name(&request);
        let number = self.next_number;
        self.next_number += 1;
        let numbered = Numbered { number, request };
        for patience in patience() {
            self.waiting = Some(number);
            self.link
                .send_value(Kind::Request, &numbered)
                .map_err(|error| self.broken("sending a request", error))?;
            let until = Instant::now() + patience;
            while let Some(left) = until.checked_duration_since(Instant::now()) {
                self.pump(left.min(POLL))?;
                if let Some(reply) = self.reply.take() {
                    return reply.outcome.map_err(|refusal| DeviceError::Refused {
                        address: self.address.clone(),
                        request: asked,
                        refusal: Box::new(refusal),
                    });
                }
            }
        }
        self.waiting = None;
        Err(DeviceError::NoAnswer { address: self.address.clone(), request: asked, tries: TRIES })
    }

    pub(super) fn wrong(&self, request: &'static str, got: &Answer) -> DeviceError {
        DeviceError::WrongAnswer { address: self.address.clone(), request, got: format!("{got:?}") }
    }

    pub(super) fn ask_done(&mut self, request: Request) -> Result<(), DeviceError> {
        let asked = name(&request);
        match self.ask(request)? {
            Answer::Done => Ok(()),
            other => Err(self.wrong(asked, &other)),
        }
    }

    /// The device's description.
    pub fn info(&mut self) -> Result<Info, DeviceError> {
        match self.ask(Request::Info)? {
            Answer::Info(info) => {
                claims::of_info(&info, &self.hello).map_err(|what| self.nonsense(what))?;
                self.rate_hz = f64::from(info.scan_rate_hz);
                self.inbox.log.know_build(info.build);
                Ok(info)
            }
            other => Err(self.wrong("info", &other)),
        }
    }

    /// Requests the description of every channel of the scan. The map's id is 0.
    pub fn channels(&mut self, info: &Info) -> Result<ChannelMap, DeviceError> {
        let mut channels = Vec::with_capacity(info.channels.into());
        for index in 0..info.channels {
            match self.ask(Request::Channel { index })? {
                Answer::Channel(channel) => {
                    claims::of_channel(&channel, &channels).map_err(|what| self.nonsense(what))?;
                    channels.push(channel);
                }
                other => return Err(self.wrong("channel", &other)),
            }
        }
        let exact_hz = self.recorder().map(|recorder| recorder.rate_hz);
        let exact_hz = exact_hz.filter(|rate| *rate != f64::from(info.scan_rate_hz));
        Ok(ChannelMap { id: 0, rate_hz: info.scan_rate_hz, exact_hz, channels })
    }

    /// Makes the device apply the scales of these channels to trigger, quiet check, limits and
    /// amplitudes instead of its built-in sensitivities; `device` holds the scales that it reports
    /// itself ([`Session::channels`]). It forgets them when the session ends.
    ///
    /// # Errors
    /// The firmware is too old ([`DeviceError::TooOld`]), or the device refuses: a scale differs
    /// from the built-in one by more than a factor of 100.
    pub fn calibrate(&mut self, device: &ChannelMap, calibrated: &ChannelMap) -> Result<(), DeviceError> {
        fn scales(map: &ChannelMap) -> impl Iterator<Item = f32> {
            // no device has more channels than a request has scales
            map.channels.iter().take(CHANNEL_CAPACITY).map(|channel| channel.units_per_volt)
        }
        if scales(device).eq(scales(calibrated)) && !self.scaled {
            return Ok(());
        }
        if self.hello.minor < SCALES_SINCE {
            return Err(DeviceError::TooOld {
                address: self.address.clone(),
                speaks: (self.hello.major, self.hello.minor),
                needs: (self.hello.major, SCALES_SINCE),
                what: "receive the calibration of its sensors, so that it uses the values it was built with",
            });
        }
        self.scaled = true;
        self.ask_done(Request::Scales { units_per_volt: scales(calibrated).collect() })
    }

    /// The device's status.
    pub fn status(&mut self) -> Result<Status, DeviceError> {
        match self.ask(Request::Status)? {
            Answer::Status(status) => Ok(status),
            other => Err(self.wrong("status", &other)),
        }
    }

    /// The device's slow values: the specimen's temperature, the supplies of its sensors. `None`
    /// for a device without them (protocol 1.0).
    pub fn slow(&mut self) -> Result<Option<Slow>, DeviceError> {
        if self.hello.minor < SLOW_SINCE {
            return Ok(None);
        }
        match self.ask(Request::Slow)? {
            Answer::Slow(slow) => {
                claims::of_slow(&slow).map_err(|what| self.nonsense(what))?;
                Ok(Some(slow))
            }
            other => Err(self.wrong("slow", &other)),
        }
    }

    /// The specimen's temperature, °C, where the device measures it.
    pub fn temperature_c(&mut self) -> Result<Option<f64>, DeviceError> {
        Ok(self.slow()?.and_then(|slow| slow.temperature_c).map(f64::from))
    }

    /// Attaches a tap to the next stream ([`Session::start`]).
    pub fn watch(&mut self, tap: Tap) {
        self.inbox.tap = Some(tap);
    }

    /// Starts a new stream of scans of `channels` channels; returns its epoch and first scan.
    pub fn start(&mut self, layout: impl Into<ScanLayout>) -> Result<(u32, u64), DeviceError> {
        if let Some(tap) = self.inbox.stream.take().and_then(Stream::into_tap) {
            self.inbox.tap = Some(tap);
        }
        let (ring_scans, rate_hz) = (self.hello().ring_scans, self.rate_hz);
        let (number, layout) = (self.next_number, layout.into());
        self.inbox.starting = Some(Starting { number, layout, ring_scans, rate_hz });
        match self.ask(Request::Start)? {
            Answer::Started { epoch, first_scan, .. } => Ok((epoch, first_scan)),
            other => Err(self.wrong("start", &other)),
        }
    }

    /// Ends the stream, fetches its missing scans, and completes its accounts with the device's
    /// counters.
    ///
    /// # Errors
    /// A broken link, a restarted device, or missing scans that do not arrive
    /// (see [`Session::wait_for`]).
    pub fn finish(&mut self) -> Result<Accounts, DeviceError> {
        let Some(stream) = &self.inbox.stream else { return Ok(Accounts::default()) };
        let epoch = stream.epoch();
        self.hold_acknowledgement(None);
        self.ended = true;
        self.ask_done(Request::Stop)?;
        let status = self.status()?;
        if status.epoch != epoch {
            return Err(self.restarted());
        }
        let end = self.end_of_stream(&status);
        self.wait_for(end)?;
        if let Some(stream) = &mut self.inbox.stream {
            stream.note_tail(end, true);
        }
        Ok(self.accounts())
    }

    /// Waits until every scan before `scan` has arrived or is known to be lost. Time is the
    /// device's: the wait for a slow or virtual device lasts as long as it makes progress.
    ///
    /// # Errors
    /// A broken link, a restarted device, almost no progress for 30 s, a scan more than an hour
    /// ahead.
    pub fn wait_for(&mut self, scan: u64) -> Result<(), DeviceError> {
        self.wait_until(scan, |_| false).map(|_| ())
    }

    /// Waits as [`Session::wait_for`] does, or until `stop`, called after each reception, returns
    /// true; returns whether it did.
    ///
    /// # Errors
    /// As [`Session::wait_for`].
    pub fn wait_until(
        &mut self,
        scan: u64,
        mut stop: impl FnMut(&Self) -> bool,
    ) -> Result<bool, DeviceError> {
        // a virtual board that waits for an acknowledgement would otherwise send nothing until the
        // line counts as idle
        self.acknowledge()?;
        let mut progress = (self.expected()?, Instant::now());
        if scan.saturating_sub(progress.0) > (claims::AHEAD_S * self.rate_hz) as u64 {
            let (now, hours) = (progress.0, claims::AHEAD_S / 3600.0);
            return Err(self.nonsense(format!(
                "says that something happens at scan {scan}, more than {hours} h after scan {now}, which came last"
            )));
        }
        // virtual time may be slow, but runs at no less than a thousandth of real time
        let least = (self.stalled.as_secs_f64() * self.rate_hz * SLOWEST).max(1.0) as u64;
        loop {
            if stop(self) {
                return Ok(true);
            }
            let expected = self.expected()?;
            if expected >= scan {
                return Ok(false);
            }
            if expected - progress.0 >= least {
                progress = (expected, Instant::now());
            } else if progress.1.elapsed() > self.stalled {
                return Err(DeviceError::Stalled {
                    address: self.address.clone(),
                    seconds: self.stalled.as_secs(),
                    got: expected - progress.0,
                    scan: expected,
                });
            }
            self.pump(POLL)?;
        }
    }

    /// Sets how long almost no new scans may arrive before a running stream counts as stalled; 30 s
    /// by default.
    pub fn stalls_after(&mut self, quiet: Duration) {
        self.stalled = quiet;
    }

    /// The next scan that has not arrived.
    pub fn expected(&self) -> Result<u64, DeviceError> {
        let stream = self.inbox.stream.as_ref();
        stream.map(Stream::expected).ok_or_else(|| DeviceError::NoStream { address: self.address.clone() })
    }

    /// The samples of each channel in `range`, and its gaps; see [`Stream::cut`].
    pub fn cut(&self, range: Range<u64>) -> Result<(Samples, Vec<Range<usize>>), DeviceError> {
        let stream = self.inbox.stream.as_ref();
        stream
            .map(|stream| stream.cut(range))
            .ok_or_else(|| DeviceError::NoStream { address: self.address.clone() })
    }

    /// Number of scans in `range` that are lost for good.
    pub fn lost_in(&self, range: &Range<u64>) -> u64 {
        let lost = self.inbox.stream.as_ref().map_or(&[][..], Stream::lost);
        let within = |lost: &Range<u64>| lost.end.min(range.end).saturating_sub(lost.start.max(range.start));
        lost.iter().map(within).sum()
    }

    /// Releases the samples before `scan`.
    pub fn forget_before(&mut self, scan: u64) {
        if let Some(stream) = &mut self.inbox.stream {
            stream.forget_before(scan);
        }
    }

    /// Sets how the force pulse is recognised.
    pub fn set_trigger(&mut self, trigger: Trigger) -> Result<(), DeviceError> {
        self.ask_done(Request::Trigger(trigger))
    }

    /// Sets the load cells' 3 × 3 calibration matrix, row-major, dimensionless.
    pub fn set_load_cells(&mut self, matrix: [f32; 9]) -> Result<(), DeviceError> {
        self.ask_done(Request::LoadCells { matrix })
    }

    /// Allows one shot within `valid_ms` of device time.
    pub fn arm(&mut self, valid_ms: u32) -> Result<(), DeviceError> {
        self.ask_done(Request::Arm { valid_ms })
    }

    /// Cancels arming and any shot whose coil is not on yet.
    pub fn disarm(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Disarm)
    }

    /// Requests one shot of the hammer.
    pub fn fire(&mut self, fire: Fire) -> Result<(), DeviceError> {
        match self.ask(Request::Fire(fire))? {
            Answer::Scheduled { .. } => Ok(()),
            other => Err(self.wrong("fire", &other)),
        }
    }

    /// Sets the positions of hammer and laser on a virtual rig; returns the first scan for which
    /// they hold.
    pub fn stage(&mut self, stage: Stage) -> Result<u64, DeviceError> {
        match self.ask(Request::Stage(stage))? {
            Answer::Staged { at_scan } => Ok(at_scan),
            other => Err(self.wrong("stage", &other)),
        }
    }
}

impl Session {
    /// Orders a sine, or renews or changes the current one.
    ///
    /// # Errors
    /// The device refuses it (no shaker, open guard, out of bounds) or does not answer.
    pub fn shake(&mut self, order: Shake) -> Result<(), DeviceError> {
        // set before the answer: if the answer is lost, the shaker may be moving
        self.shakes = true;
        self.ask_done(Request::Shake(order))
    }

    /// Orders the shaker to rest, over a ramp. [`Session::shaker_rests`] reports when it is at
    /// rest.
    ///
    /// # Errors
    /// The device does not answer; the shaker then comes to rest by itself.
    pub fn rest(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Rest)?;
        self.shakes = false;
        Ok(())
    }

    /// Whether the shaker is at rest now.
    ///
    /// # Errors
    /// The device does not answer.
    pub fn shaker_rests(&mut self) -> Result<bool, DeviceError> {
        Ok(self.status()?.shaker == Shaker::Resting)
    }

    /// Why the shaker stopped since the last call, if it did. Other events stay in the queue.
    pub fn shaker_stopped(&mut self) -> Option<Reason> {
        let mut reason = None;
        self.inbox.events.retain(|numbered| match numbered.event {
            Event::ShakerStops(why) => {
                reason = Some(why);
                false
            }
            Event::ShakerRuns | Event::ShakerRests => false,
            _ => true,
        });
        reason
    }

    /// Orders the shaker to rest without waiting for an answer; called when a session ends.
    pub(super) fn rest_at_last(&mut self) {
        if self.shakes
            && let Err(error) = self.background(Request::Rest)
        {
            log::warn!("{error}; the shaker comes to rest by itself, one second after the last command");
        }
    }
}

/// Minor protocol version that introduced clocks and edges.
const SINCE: u16 = 2;
/// Timeout for the check of a clock, which takes some ms of device time.
const MEASURED_WITHIN: Duration = Duration::from_secs(5);

impl Session {
    /// Current clock and edges; `None` for a device without them (protocol 1.1 and before).
    pub fn sync(&mut self) -> Result<Option<Sync>, DeviceError> {
        if self.hello.minor < SINCE {
            return Ok(None);
        }
        match self.ask(Request::Sync)? {
            Answer::Sync(sync) => Ok(Some(sync)),
            other => Err(self.wrong("sync", &other)),
        }
    }

    /// Selects the clock for the scans of later streams, and waits until it was checked
    /// successfully.
    ///
    /// # Errors
    /// The check fails ([`DeviceError::Clock`] has the reason), the firmware is too old, or the
    /// device has no sync port.
    pub fn take_clock(&mut self, clock: Clock) -> Result<Sync, DeviceError> {
        if self.hello.minor < SINCE {
            return Err(DeviceError::TooOld {
                address: self.address.clone(),
                speaks: (self.hello.major, self.hello.minor),
                needs: (self.hello.major, SINCE),
                what: "use an external clock or report edges at its sync input, as the plan's [sync] asks",
            });
        }
        self.ask_done(Request::Clock(clock))?;
        let give_up = Instant::now() + MEASURED_WITHIN;
        loop {
            let fault = match self.sync()? {
                Some(sync) if sync.clock == clock && sync.fault.is_none() => return Ok(sync),
                Some(Sync { fault: Some(fault), .. }) => fault,
                // another clock is in use
                _ => return Err(self.nonsense("does not use the clock that it was told to use".into())),
            };
            if fault != ClockFault::Unproven || Instant::now() > give_up {
                return Err(DeviceError::Clock { address: self.address.clone(), fault });
            }
        }
    }

    /// Emits one pulse at the sync output as soon as possible; its edge later appears in
    /// [`Session::edges`].
    ///
    /// # Errors
    /// No stream is running, or the device has no sync port.
    pub fn pulse_output(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Mark)
    }

    /// Edges at the sync input and output since the last call.
    pub fn edges(&mut self) -> Vec<Edge> {
        std::mem::take(&mut self.inbox.edges)
    }
}

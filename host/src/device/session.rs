//! A session with a device: handshake, requests that are executed exactly once, and a complete
//! stream of samples.
//!
//! [`Session::pump`] does everything that the link needs; every function that waits calls it.
//!
//! - **Requests** carry a number and are repeated under the *same* number until they are answered;
//!   the device answers a duplicate from memory. Only one is pending at a time.
//! - **Samples** are assembled by [`Stream`]. Missing ones are requested again, each time under a
//!   new number, because a repeated request does no harm.
//! - **Acknowledgements** are cumulative and never pass the scan at which they are held
//!   ([`Session::hold_acknowledgement`]). The time of a virtual board stops half a ring beyond that
//!   scan, which makes a campaign repeatable. While the line is idle, the acknowledgement is
//!   repeated as the host's sign of life.
//!
//! Timeouts are wall-clock time; they only decide when to ask again, never what is measured.

use std::hash::{BuildHasher, Hasher};
use std::io;
use std::ops::Range;
use std::time::{Duration, Instant};

use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::answer::{self, Refusal, Status};
use jointrig_protocol::frame::Kind;
use jointrig_protocol::hello::{Hello, Mismatch};
use jointrig_protocol::request::{Numbered, Request};
use jointrig_protocol::shot::Shot;

use super::claims;
use super::error::DeviceError;
use super::inbox::Inbox;
use super::link::Link;
use super::logs::{DeviceLog, Tables};
use super::stream::{Accounts, Stream};
use super::transport::{Recorder, Simulated, Transport};

/// The line counts as idle when nothing arrived for this long.
const IDLE: Duration = Duration::from_millis(20);

/// Missing scans are requested again after this long without any byte …
const RESEND_IDLE: Duration = Duration::from_millis(50);

/// … or after this much time of the scan clock, s.
const RESEND_CLOCK_S: f64 = 0.05;

/// The device's status is requested when the line is idle for this long.
const STATUS_IDLE: Duration = Duration::from_millis(100);

/// A gap that was requested this many times without success is recorded as lost.
const RESEND_TRIES: u32 = 100;

/// A running stream counts as stalled when almost no new scans arrive for this long.
const STALLED: Duration = Duration::from_secs(30);

/// A request that the session makes itself and no caller waits for.
#[derive(Clone, Debug)]
enum Errand {
    Resend { number: u32, range: Range<u64>, asked: Instant, newest: u64, answered: bool },
    Status { number: u32, asked: Instant },
}

/// An open session.
pub struct Session {
    pub(super) link: Link,
    pub(super) inbox: Inbox,
    pub(super) address: String,
    simulated: Option<Simulated>,
    pub(super) hello: Hello,
    pub(super) next_number: u32,
    /// Number of the request that a caller waits for.
    pub(super) waiting: Option<u32>,
    pub(super) reply: Option<answer::Numbered>,
    pub(super) rate_hz: f64,
    pub(super) stalled: Duration,
    pub(super) ended: bool,
    /// Number of statuses that reported an unrequested end of the stream.
    ends_told: u32,
    /// Whether the device was given scales other than its own.
    pub(super) scaled: bool,
    /// Whether the shaker may be moving because of this session's order.
    pub(super) shakes: bool,
    errand: Option<Errand>,
    resend_tries: (u64, u32),
    tail: Option<u64>,
    hold: Option<u64>,
    acknowledged: u64,
    last_bytes: Instant,
    last_ack: Instant,
    last_errand: Instant,
}

impl Session {
    /// Performs the handshake over `transport`. `address` is the device's name in errors.
    ///
    /// # Errors
    /// No answer, or another version; the error names both.
    pub fn open(transport: Box<dyn Transport>, address: &str) -> Result<Self, DeviceError> {
        let now = Instant::now();
        let log = DeviceLog::of(address, transport.image());
        let simulated = transport.simulated();
        let packets = transport.keeps_packets();
        let hello = Hello { packets, ..Hello::host(nonce()) };
        let mut session = Self {
            link: Link::new(transport),
            inbox: Inbox::new(hello.session, log),
            address: address.into(),
            simulated,
            hello,
            next_number: 1,
            waiting: None,
            reply: None,
            rate_hz: 51_200.0,
            stalled: STALLED,
            ended: false,
            ends_told: 0,
            scaled: false,
            shakes: false,
            errand: None,
            resend_tries: (0, 0),
            tail: None,
            hold: None,
            acknowledged: 0,
            last_bytes: now,
            last_ack: now,
            last_errand: now,
        };
        session.shake_hands()?;
        Ok(session)
    }

    fn shake_hands(&mut self) -> Result<(), DeviceError> {
        let ours = self.hello;
        // a zero first: it ends an incomplete frame of an earlier session
        self.link.end_frame().map_err(|error| self.broken("shaking hands", error))?;
        for patience in patience() {
            self.link
                .send(Kind::Hello, &ours.to_bytes())
                .map_err(|error| self.broken("shaking hands", error))?;
            let until = Instant::now() + patience;
            while let Some(left) = until.checked_duration_since(Instant::now()) {
                self.receive(left.min(IDLE))?;
                match self.inbox.hello.take() {
                    Some(Ok(theirs)) if theirs.session == ours.session || theirs.role == ours.role => {
                        ours.check(&theirs).map_err(|mismatch| self.mismatch(mismatch))?;
                        claims::of_hello(&theirs).map_err(|what| self.nonsense(what))?;
                        self.hello = theirs;
                        return Ok(());
                    }
                    Some(Err(mismatch)) => return Err(self.mismatch(mismatch)),
                    _ => {}
                }
            }
        }
        Err(DeviceError::NoAnswer { address: self.address.clone(), request: "hello", tries: TRIES })
    }

    /// The rig's description when the device is simulated in this process.
    pub fn simulated(&self) -> Option<&Simulated> {
        self.simulated.as_ref()
    }

    /// What is known about a recorder whose samples come over a bridge.
    pub fn recorder(&mut self) -> Option<Recorder> {
        self.link.transport().recorder()
    }

    /// Sentences about such a recorder since the last call, each of which a person should read.
    pub fn remarks(&mut self) -> Vec<String> {
        self.link.transport().take_remarks()
    }

    /// The device's name in errors.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Sets where the table of the device's log strings is searched for; call it before
    /// [`Session::info`], which reports the build. Otherwise only an emulator's image is searched.
    pub fn look_for_log_tables(&mut self, tables: Tables) {
        self.inbox.log.tables = tables;
    }

    /// The device's log since the last call, one string of level and text per line; the last few
    /// hundred are kept.
    pub fn log_lines(&mut self) -> Vec<String> {
        self.inbox.log.lines()
    }

    /// Bytes of the device's log that could not be decoded: damaged, or without a table.
    pub fn undecoded_log_bytes(&self) -> u64 {
        self.inbox.log.undecoded()
    }

    /// The device's hello.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Scans that the device can send again.
    pub fn ring_scans(&self) -> u64 {
        u64::from(self.hello.ring_scans)
    }

    /// The newest report on the last shot.
    pub fn shot(&self) -> Option<Shot> {
        self.inbox.shot
    }

    /// Counts of received, recovered and lost scans so far.
    pub fn accounts(&self) -> Accounts {
        self.inbox.stream.as_ref().map(Stream::accounts).unwrap_or_default()
    }

    /// (good, damaged) frames received.
    pub fn frames(&self) -> (u64, u64) {
        (self.link.frames(), self.link.bad())
    }

    /// Never acknowledges beyond scan `at` until this is called again; a virtual board then stops
    /// at most half a ring beyond it. `None` removes the limit.
    pub fn hold_acknowledgement(&mut self, at: Option<u64>) {
        self.hold = at;
    }

    /// Moves bytes: reads what is available (waiting at most `timeout` for the first byte),
    /// processes it, and sends what the link needs (acknowledgements, repeated requests).
    ///
    /// # Errors
    /// The link broke, or the device restarted.
    pub fn pump(&mut self, timeout: Duration) -> Result<(), DeviceError> {
        self.receive(timeout)?;
        while let Some(answer) = self.inbox.answers.pop_front() {
            self.sort(answer)?;
        }
        self.acknowledge()?;
        if self.waiting.is_none() {
            self.run_errands()?;
        }
        Ok(())
    }

    fn begin_stream(&mut self, first_scan: u64) {
        self.acknowledged = first_scan;
        self.errand = None;
        self.tail = None;
        self.hold = None;
        self.ended = false;
        self.ends_told = 0;
    }

    fn receive(&mut self, timeout: Duration) -> Result<(), DeviceError> {
        let inbox = &mut self.inbox;
        match self.link.receive(timeout, |frame| inbox.take(frame)) {
            Ok(true) => self.last_bytes = Instant::now(),
            Ok(false) => {}
            Err(error) => return Err(self.broken("reading", error)),
        }
        if let Some(what) = self.inbox.nonsense.take() {
            return Err(self.nonsense(what));
        }
        match self.inbox.clock_fault.take() {
            Some(fault) => Err(DeviceError::Clock { address: self.address.clone(), fault }),
            None => Ok(()),
        }
    }

    fn sort(&mut self, answer: answer::Numbered) -> Result<(), DeviceError> {
        let asked = self.waiting.or(match &self.errand {
            Some(Errand::Resend { number, .. } | Errand::Status { number, .. }) => Some(*number),
            None => None,
        });
        if asked == Some(answer.number)
            && let Some(status) = Inbox::status_of(&answer)
        {
            self.inbox.note_status(status);
            self.check_epoch(status)?;
            self.tail = Some(self.end_of_stream(status));
        }
        if self.waiting == Some(answer.number) {
            self.waiting = None;
            if let Ok(answer::Answer::Started { first_scan, .. }) = answer.outcome {
                self.begin_stream(first_scan);
            }
            self.reply = Some(answer);
            return Ok(());
        }
        let Some(stream) = &mut self.inbox.stream else { return Ok(()) };
        match &mut self.errand {
            Some(Errand::Resend { number, range, answered, newest, .. }) if *number == answer.number => {
                match answer.outcome {
                    Ok(_) => {
                        *answered = true;
                        *newest = stream.newest();
                    }
                    Err(Refusal::Gone { oldest }) => {
                        // the device does not even hold the first scan: advance by at least one
                        // scan so that this ends
                        let end = if oldest > range.start { oldest.min(range.end) } else { range.end };
                        stream.mark_lost(range.start..end);
                        self.errand = None;
                    }
                    Err(Refusal::WrongEpoch { .. } | Refusal::NotStreaming) if !self.ended => {
                        return Err(self.restarted());
                    }
                    Err(refusal) => log::warn!("{}: scans were not sent again: {refusal}", self.address),
                }
            }
            Some(Errand::Status { number, .. }) if *number == answer.number => self.errand = None,
            _ => {}
        }
        Ok(())
    }

    /// The scan after the stream's last one. After the end of a stream the converter may run on;
    /// those scans do not belong to it.
    pub(super) fn end_of_stream(&self, status: &Status) -> u64 {
        let stream = self.inbox.stream.as_ref().filter(|stream| self.ended && stream.epoch() == status.epoch);
        let counters = &status.counters;
        stream.map_or(status.next_scan, |stream| {
            stream.first_scan() + counters.scans_produced + counters.scans_missed
        })
    }

    fn check_epoch(&mut self, status: &Status) -> Result<(), DeviceError> {
        let Some(stream) = self.inbox.stream.as_ref().filter(|_| !self.ended) else { return Ok(()) };
        // answers may overtake events: the reason why a stream ended may arrive after the first
        // status that reports its end
        self.ends_told += u32::from(!status.streaming);
        if self.ends_told > 1 || status.epoch != stream.epoch() { Err(self.restarted()) } else { Ok(()) }
    }

    pub(super) fn acknowledge(&mut self) -> Result<(), DeviceError> {
        let Some(stream) = &self.inbox.stream else { return Ok(()) };
        let up_to =
            self.hold.map_or(stream.expected(), |at| at.min(stream.expected())).max(self.acknowledged);
        let fresh = up_to - self.acknowledged;
        let step = (self.ring_scans() / 16).max(1);
        let now = Instant::now();
        let due = fresh >= step || (fresh > 0 && self.hold == Some(up_to));
        let idle = now - self.last_bytes >= IDLE && now - self.last_ack >= IDLE;
        // a slow but steady flow of data never makes the line idle, but the device must still
        // receive a sign of life
        let silent = now - self.last_ack >= 10 * IDLE;
        if due || idle || silent {
            let bytes = Acknowledge { epoch: stream.epoch(), next_scan: up_to }.to_bytes();
            self.acknowledged = up_to;
            self.last_ack = now;
            self.link.send(Kind::Acknowledge, &bytes).map_err(|error| self.broken("acknowledging", error))?;
        }
        Ok(())
    }

    /// Requests missing scans, and the status when the line stays idle.
    fn run_errands(&mut self) -> Result<(), DeviceError> {
        let Some(stream) = &mut self.inbox.stream else { return Ok(()) };
        let now = Instant::now();
        let idle = now - self.last_bytes;
        if idle >= IDLE
            && let Some(next_scan) = self.tail.take()
        {
            stream.note_tail(next_scan, self.ended);
        }
        let (missing, newest) = (stream.missing(), stream.newest());
        match &self.errand {
            Some(Errand::Resend { range, asked, newest: then, answered, .. }) => {
                let clock = (RESEND_CLOCK_S * self.rate_hz) as u64
                    + if *answered { 0 } else { u64::from(self.hello.ring_scans) / 2 };
                let waited = (idle >= RESEND_IDLE && now - *asked >= RESEND_IDLE) || newest - then >= clock;
                let arrived = missing.as_ref().is_none_or(|missing| missing.start >= range.end);
                if !arrived && !waited {
                    return Ok(());
                }
            }
            Some(Errand::Status { asked, .. }) if now - *asked < 2 * STATUS_IDLE && missing.is_none() => {
                return Ok(());
            }
            _ => {}
        }
        self.errand = None;
        if let Some(range) = missing {
            self.ask_again(range, now, newest)
        } else if idle >= STATUS_IDLE && now - self.last_errand >= STATUS_IDLE {
            let number = self.background(Request::Status)?;
            self.last_errand = now;
            self.errand = Some(Errand::Status { number, asked: now });
            Ok(())
        } else {
            Ok(())
        }
    }

    fn ask_again(&mut self, range: Range<u64>, asked: Instant, newest: u64) -> Result<(), DeviceError> {
        self.resend_tries.1 = if self.resend_tries.0 == range.start { self.resend_tries.1 + 1 } else { 1 };
        self.resend_tries.0 = range.start;
        let Some(stream) = &mut self.inbox.stream else { return Ok(()) };
        if self.resend_tries.1 > RESEND_TRIES {
            log::error!("scans {range:?} were requested {RESEND_TRIES} times and never arrived");
            stream.mark_lost(range);
            return Ok(());
        }
        let scans = u32::try_from(range.end - range.start).unwrap_or(u32::MAX);
        let epoch = stream.epoch();
        let number = self.background(Request::Resend { epoch, first_scan: range.start, scans })?;
        self.errand = Some(Errand::Resend { number, range, asked, newest, answered: false });
        Ok(())
    }

    /// Sends a request that no caller waits for.
    pub(super) fn background(&mut self, request: Request) -> Result<u32, DeviceError> {
        let number = self.next_number;
        self.next_number += 1;
        self.link
            .send_value(Kind::Request, &Numbered { number, request })
            .map_err(|error| self.broken("asking", error))?;
        Ok(number)
    }

    pub(super) fn broken(&self, doing: &'static str, source: io::Error) -> DeviceError {
        DeviceError::Link { address: self.address.clone(), doing, source }
    }

    pub(super) fn nonsense(&self, what: String) -> DeviceError {
        DeviceError::Nonsense { address: self.address.clone(), what }
    }

    fn mismatch(&self, mismatch: Mismatch) -> DeviceError {
        DeviceError::Version { address: self.address.clone(), mismatch }
    }

    pub(super) fn restarted(&self) -> DeviceError {
        let epoch = self.inbox.stream.as_ref().map_or(0, Stream::epoch);
        DeviceError::Restarted { address: self.address.clone(), epoch }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.rest_at_last();
    }
}

/// How often a request is sent before the device counts as not answering.
pub(super) const TRIES: u32 = 10;

/// Wait of each try: 200 ms, increasing, so that a loaded computer is not mistaken for a dead
/// device.
pub(super) fn patience() -> impl Iterator<Item = Duration> {
    (0..TRIES).map(|attempt| Duration::from_millis(200 * u64::from(1 + attempt)))
}

/// A number that differs between sessions; it only serves to recognise this session's answers.
fn nonce() -> u32 {
    let mut hasher = std::hash::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    hasher.finish() as u32
}

//! A scripted device for tests: it implements the protocol, streams, retransmits, and fires a
//! simulated hammer.
//!
//! Its time advances while it is read and stops half a ring ahead of the acknowledgement, as a
//! virtual board's does. Samples depend only on (cell, attempt, scan since the coil was switched
//! on).

use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::answer::{self, Answer, Counters, Hammer, Info, Refusal, Reset, Shaker, Status};
use jointrig_protocol::block::{GAP, Header, RESENT};
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::event::{self, Event, Loss};
use jointrig_protocol::frame::{Accumulator, Kind, Writer};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::request::{Fire, Numbered, Request, Stage};
use jointrig_protocol::shot::{Phase, Shot};
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::Sync;

use jointrig::device::transport::Transport;

pub const RING: u32 = 8_192;
pub const RATE: u32 = 51_200;
const BLOCK: u64 = 48;
const FLIGHT: u64 = 300;
const ROLES: [Role; 5] = [
    Role::HammerForce,
    Role::Response(Axis::X),
    Role::Response(Axis::Y),
    Role::Response(Axis::Z),
    Role::SpecimenA,
];

/// The device; its fields are the script.
#[allow(clippy::struct_excessive_bools, reason = "each is one thing that a device may do wrong")]
pub struct Fake {
    /// Blocks that begin here are dropped in the device and reported.
    pub drops: Range<u64>,
    /// Every shot with a shorter pulse misses, µs.
    pub reach_us: u32,
    /// Peak force per µs of pulse above `reach_us`, N.
    pub newtons_per_us: f32,
    /// Longest pulse of its coil, µs.
    pub coil_cap_us: u32,
    /// After this many requests the cable is disconnected.
    pub dies_after: Option<u32>,
    /// Payloads of log frames; one is sent before each answer, cyclically.
    pub says: Vec<Vec<u8>>,
    /// After this many requests it restarts: its stream and its memory are lost.
    pub restarts_after: Option<u32>,
    /// Whether it remembers a stage.
    pub stage_known: bool,
    pub hello: Hello,
    /// Changes its description of itself, and of a channel.
    pub info: fn(&mut Info),
    pub channel: fn(&mut Channel),
    /// Changes its report of a shot that hit.
    pub tells_shot: fn(&mut Shot),
    /// Scans that it reports as lost at each block, whatever it sends.
    pub loses: Option<Range<u64>>,
    /// Delay before each block; it sends one at a time.
    pub slow: Option<Duration>,
    /// Its time advances whatever the host acknowledges, as that of a real device on USB does.
    pub free_running: bool,
    /// A minute passes without the host while the shot of this order waits, counted from 1.
    pub stalls_at_order: Option<u32>,
    /// A minute passes without the host before the arming after this order.
    pub stalls_after_order: Option<u32>,
    /// The link breaks once while the shot of this order waits.
    pub cut_at_order: Option<u32>,
    /// Number of shots that were ordered, whatever their outcome.
    pub orders: Arc<AtomicU32>,
    accumulator: Accumulator,
    out: VecDeque<u8>,
    memory: VecDeque<(u32, Vec<u8>)>,
    last_number: u32,
    streaming: bool,
    epoch: u32,
    next_scan: u64,
    sent_up_to: u64,
    dropped: u64,
    acknowledged: u64,
    ring: VecDeque<(u64, Vec<i16>)>,
    events: u32,
    fire: Option<Fire>,
    armed: bool,
    shot: Option<Shot>,
    cell: u64,
    attempt: u32,
    fired_attempt: u32,
}

impl Default for Fake {
    fn default() -> Self {
        Self {
            drops: 0..0,
            reach_us: 1_000,
            newtons_per_us: 0.025,
            coil_cap_us: 8_000,
            dies_after: None,
            says: Vec::new(),
            restarts_after: None,
            stage_known: true,
            hello: Hello::device(0, 5, RING),
            info: |_| (),
            channel: |_| (),
            tells_shot: |_| (),
            loses: None,
            slow: None,
            free_running: false,
            stalls_at_order: None,
            stalls_after_order: None,
            cut_at_order: None,
            orders: Arc::default(),
            accumulator: Accumulator::new(),
            out: VecDeque::new(),
            memory: VecDeque::new(),
            last_number: 0,
            streaming: false,
            epoch: 5,
            next_scan: 0,
            sent_up_to: 0,
            dropped: 0,
            acknowledged: 0,
            ring: VecDeque::new(),
            events: 0,
            fire: None,
            armed: false,
            shot: None,
            cell: 0,
            attempt: 0,
            fired_attempt: 0,
        }
    }
}

impl Fake {
    /// A device with `change` applied to its script.
    pub fn scripted(change: impl FnOnce(&mut Self)) -> Self {
        let mut fake = Self::default();
        change(&mut fake);
        fake
    }

    fn take(&mut self, kind: Kind, payload: &[u8]) {
        match kind {
            Kind::Hello => {
                let theirs = Hello::from_bytes(payload).expect("a host's hello");
                if theirs.session != self.hello.session {
                    self.memory.clear();
                    self.last_number = 0;
                    // was in transit when the link broke, and the next host received it before the
                    // hello
                    self.cancel();
                    self.streaming = false;
                }
                self.hello.session = theirs.session;
                let bytes = self.hello.to_bytes();
                self.send(Kind::Hello, &bytes);
            }
            Kind::Acknowledge => {
                let ack = Acknowledge::from_bytes(payload).expect("an acknowledgement");
                if ack.epoch == self.epoch {
                    self.acknowledged = self.acknowledged.max(ack.next_scan);
                }
            }
            Kind::Request => {
                let asked: Numbered = postcard::from_bytes(payload).expect("a request");
                self.answer(asked);
            }
            _ => panic!("a host does not send {kind:?}"),
        }
    }

    fn answer(&mut self, asked: Numbered) {
        if let Some(left) = &mut self.dies_after {
            *left = left.saturating_sub(1);
        }
        if let Some(left) = &mut self.restarts_after {
            *left = left.saturating_sub(1);
            if *left == 0 {
                self.restarts_after = None;
                self.epoch += 1;
                (self.streaming, self.armed, self.fire, self.shot) = (false, false, None, None);
                self.memory.clear();
                self.ring.clear();
            }
        }
        if let Some((_, wire)) = self.memory.iter().find(|(number, _)| *number == asked.number) {
            self.out.extend(wire.clone());
            return;
        }
        assert!(asked.number > self.last_number, "numbers increase");
        self.last_number = asked.number;
        if !self.says.is_empty() {
            let payload = self.says[asked.number as usize % self.says.len()].clone();
            self.send(Kind::Log, &payload);
        }
        let mut again = Vec::new();
        let outcome = self.carry_out(asked.request, &mut again);
        let numbered = answer::Numbered { number: asked.number, outcome };
        let wire = Writer::new(Kind::Answer).seal_value(&numbered).expect("fits").to_vec();
        self.out.extend(&wire);
        self.memory.push_back((asked.number, wire));
        if self.memory.len() > 8 {
            self.memory.pop_front();
        }
        for (first, codes) in again {
            self.send_block(first, &codes, RESENT);
        }
    }

    #[expect(clippy::result_large_err, reason = "the protocol's own type")]
    fn carry_out(&mut self, request: Request, again: &mut Vec<(u64, Vec<i16>)>) -> Result<Answer, Refusal> {
        Ok(match request {
            Request::Info => Answer::Info(changed(
                self.info,
                Info {
                    board: "fake".parse().expect("short"),
                    serial: "1".parse().expect("short"),
                    version: "0.1.0".parse().expect("short"),
                    target: "test".parse().expect("short"),
                    build: 1,
                    channels: ROLES.len() as u8,
                    scan_rate_hz: RATE,
                    ring_scans: self.hello.ring_scans,
                    coil_cap_us: self.coil_cap_us,
                    stage: self.stage_known,
                    drive_v: 0.0,
                    reset: Reset::Power,
                },
            )),
            Request::Channel { index } => {
                let role = *ROLES.get(usize::from(index)).ok_or(Refusal::NoSuchChannel)?;
                let force = role == Role::HammerForce;
                Answer::Channel(changed(
                    self.channel,
                    Channel {
                        name: format!("ch{index}").as_str().try_into().expect("short"),
                        role,
                        quantity: if force { Quantity::Force } else { Quantity::Velocity },
                        units_per_volt: if force { 32.768 } else { 0.001 },
                        range_v: 10.0,
                        delay_ns: 0,
                        bits: 16,
                    },
                ))
            }
            Request::Shake(_) | Request::Rest | Request::Clock(_) | Request::Mark => {
                return Err(Refusal::Unsupported);
            }
            Request::Slow => Answer::Slow(Slow::default()),
            Request::Sync => Answer::Sync(Sync::default()),
            Request::Status => {
                let ordered = self.orders.load(Ordering::Relaxed);
                let idle = self.shot.is_none_or(|shot| shot.phase == Phase::Done);
                if idle && self.stalls_after_order.take_if(|at| *at == ordered).is_some() {
                    self.stall();
                }
                Answer::Status(Status {
                    epoch: self.epoch,
                    streaming: self.streaming,
                    next_scan: self.next_scan,
                    oldest_scan: self.ring.front().map_or(0, |(first, _)| *first),
                    hammer: if self.armed { Hammer::Armed } else { Hammer::Disarmed },
                    armed_for_ms: 0,
                    interlock_closed: true,
                    emergency_stop: false,
                    friction_n: 0.0,
                    shot: self.shot,
                    shaker: Shaker::Resting,
                    drive_v: 0.0,
                    controlled: 0.0,
                    counters: Counters {
                        scans_produced: self.next_scan,
                        scans_dropped: self.dropped,
                        ..Counters::default()
                    },
                })
            }
            Request::Start => {
                self.epoch += 1;
                self.streaming = true;
                (self.next_scan, self.sent_up_to, self.acknowledged) = (0, 0, 0);
                self.ring.clear();
                Answer::Started { epoch: self.epoch, map: 0, first_scan: 0 }
            }
            Request::Stop => {
                self.streaming = false;
                Answer::Done
            }
            Request::Resend { epoch, first_scan, scans } => {
                if epoch != self.epoch {
                    return Err(Refusal::WrongEpoch { current: self.epoch });
                }
                let end = first_scan + u64::from(scans);
                let oldest = self.ring.front().map_or(self.next_scan, |(first, _)| *first);
                if self.drops.contains(&first_scan) {
                    return Err(Refusal::Gone { oldest: self.drops.end });
                }
                if first_scan < oldest {
                    return Err(Refusal::Gone { oldest });
                }
                let wanted = |first: u64| first < end && first + BLOCK > first_scan;
                again.extend(self.ring.iter().filter(|(first, _)| wanted(*first)).cloned());
                Answer::Resending { first_scan, scans }
            }
            Request::Arm { .. } => {
                if self.fire.is_some() {
                    return Err(Refusal::Busy);
                }
                self.armed = true;
                Answer::Done
            }
            Request::Fire(fire) => {
                if !self.armed {
                    return Err(Refusal::NotArmed);
                }
                assert!(
                    self.free_running || fire.not_before >= self.next_scan,
                    "the device has passed not_before"
                );
                let last = self.shot.map_or(0, |shot| shot.number);
                if fire.number <= last {
                    return Err(Refusal::ShotRepeated { last });
                }
                let number = fire.number;
                self.orders.fetch_add(1, Ordering::Relaxed);
                self.shot = Some(shot(&fire, Phase::Waiting));
                self.fire = Some(fire);
                self.armed = false;
                Answer::Scheduled { number }
            }
            Request::Stage(Stage { configuration, impact, response, attempt }) => {
                let mut hasher = DefaultHasher::new();
                (configuration as u8, impact, response).hash(&mut hasher);
                self.cell = hasher.finish();
                self.attempt = attempt;
                Answer::Staged { at_scan: self.next_scan }
            }
            Request::Trigger(_)
            | Request::LoadCells { .. }
            | Request::Scales { .. }
            | Request::Disarm
            | Request::EmergencyStop => Answer::Done,
        })
    }

    fn send(&mut self, kind: Kind, payload: &[u8]) {
        let mut wire = [0; jointrig_protocol::limits::MAX_WIRE];
        let frame = jointrig_protocol::frame::encode(kind, payload, &mut wire).expect("fits");
        self.out.extend(frame.iter());
    }

    fn send_block(&mut self, first: u64, codes: &[i16], flags: u8) {
        let header = Header { flags, map: 0, scans: BLOCK as u8, epoch: self.epoch, first_scan: first };
        let mut payload = header.to_bytes().to_vec();
        payload.extend(codes.iter().flat_map(|code| code.to_le_bytes()));
        self.send(Kind::Samples, &payload);
    }

    fn event(&mut self, event: Event) {
        let numbered = event::Numbered { number: self.events, at_scan: self.next_scan, event };
        self.events += 1;
        let wire = Writer::new(Kind::Event).seal_value(&numbered).expect("fits").to_vec();
        self.out.extend(wire);
    }

    /// Cancels a waiting shot.
    fn cancel(&mut self) {
        self.armed = false;
        if self.fire.take().is_some()
            && let Some(shot) = &mut self.shot
        {
            shot.phase = Phase::Cancelled;
            let shot = *shot;
            self.event(Event::Shot(shot));
        }
    }

    /// The host stalls for a minute: all scans leave the ring unsent, and the silence cancels a
    /// waiting shot.
    fn stall(&mut self) {
        let (first, scans) = (self.next_scan, 60 * RATE);
        self.next_scan += u64::from(scans);
        self.dropped += u64::from(scans);
        self.ring.clear();
        self.event(Event::Lost { epoch: self.epoch, first_scan: first, scans, why: Loss::LinkSlow });
        self.cancel();
    }

    /// One more block of scans, if the acknowledgement allows.
    fn advance(&mut self) -> bool {
        let held = !self.free_running && self.next_scan + BLOCK > self.acknowledged + u64::from(RING) / 2;
        if !self.streaming || held {
            return false;
        }
        let ordered = self.orders.load(Ordering::Relaxed);
        if self.fire.is_some() && self.stalls_at_order.take_if(|at| *at == ordered).is_some() {
            self.stall();
        }
        let first = self.next_scan;
        if let Some(lost) = self.loses.clone() {
            let (epoch, why) = (self.epoch, Loss::LinkSlow);
            let scans = (lost.end - lost.start) as u32;
            self.event(Event::Lost { epoch, first_scan: lost.start, scans, why });
        }
        self.hammer(first);
        let codes: Vec<i16> = (first..first + BLOCK)
            .flat_map(|scan| (0..ROLES.len()).map(move |place| (scan, place)))
            .map(|(scan, place)| self.code(scan, place))
            .collect();
        self.next_scan += BLOCK;
        if self.drops.contains(&first) {
            self.dropped += BLOCK;
            let (epoch, why) = (self.epoch, Loss::LinkSlow);
            self.event(Event::Lost { epoch, first_scan: first, scans: BLOCK as u32, why });
            return true;
        }
        let flags = if self.sent_up_to == first { 0 } else { GAP };
        self.sent_up_to = self.next_scan;
        self.send_block(first, &codes, flags);
        self.ring.push_back((first, codes));
        while self.ring.len() as u64 * BLOCK > u64::from(RING) {
            self.ring.pop_front();
        }
        true
    }

    fn hammer(&mut self, scan: u64) {
        if let Some(fire) = self.fire.take_if(|fire| fire.not_before < scan + BLOCK) {
            self.fired_attempt = self.attempt;
            self.attempt += 1;
            let peak = (fire.pulse_us as f32 - self.reach_us as f32) * self.newtons_per_us;
            let at = fire.not_before.max(scan);
            let mut shot = Shot { fired_at: at, ..shot(&fire, Phase::Firing) };
            if peak > 0.0 {
                (shot.trigger, shot.peak_n) = (at + FLIGHT, peak);
            }
            self.shot = Some(shot);
            self.event(Event::Shot(shot));
        } else if let Some(mut shot) = self.shot.filter(|shot| shot.phase == Phase::Firing)
            && scan > shot.fired_at + FLIGHT + 600
        {
            shot.phase = if shot.trigger > 0 { Phase::Done } else { Phase::Missed };
            (self.tells_shot)(&mut shot);
            self.shot = Some(shot);
            self.event(Event::Shot(shot));
        }
    }

    fn code(&self, scan: u64, place: usize) -> i16 {
        let Some(shot) = self.shot.filter(|shot| shot.fired_at > 0) else { return 0 };
        let since = scan.wrapping_sub(shot.fired_at).cast_signed();
        let mut hasher = DefaultHasher::new();
        (self.cell, self.fired_attempt, since, place).hash(&mut hasher);
        let noise = (hasher.finish() % 9) as i16 - 4;
        let t = since - FLIGHT.cast_signed();
        let pulse = if shot.trigger > 0 && (0..20).contains(&t) {
            (std::f32::consts::PI * t as f32 / 20.0).sin() * shot.peak_n * 100.0
        } else {
            0.0
        };
        let ring = if shot.trigger > 0 && t > 0 && place > 0 {
            1_000.0 * (-(t as f32) / 800.0).exp() * (t as f32 * 0.1).sin()
        } else {
            0.0
        };
        noise + if place == 0 { pulse as i16 } else { ring as i16 }
    }
}

fn changed<T>(change: fn(&mut T), mut what: T) -> T {
    change(&mut what);
    what
}

fn shot(fire: &Fire, phase: Phase) -> Shot {
    Shot {
        number: fire.number,
        phase,
        fired_at: 0,
        trigger: 0,
        pulse_us: fire.pulse_us,
        peak_n: 0.0,
        width_us: 200.0,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    }
}

impl Transport for Fake {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.dies_after == Some(0) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let ordered = self.orders.load(Ordering::Relaxed);
        if self.fire.is_some() && self.cut_at_order.take_if(|at| *at == ordered).is_some() {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let blocks = if let Some(wait) = self.slow.filter(|_| self.streaming) {
            std::thread::sleep(wait);
            1
        } else {
            8
        };
        for _ in 0..blocks {
            if !self.advance() {
                break;
            }
        }
        if self.out.is_empty() {
            std::thread::sleep(timeout);
            return Ok(0);
        }
        let count = buf.len().min(self.out.len());
        for (place, byte) in buf.iter_mut().zip(self.out.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let mut accumulator = std::mem::take(&mut self.accumulator);
            let (used, found) = accumulator.feed(rest);
            rest = &rest[used..];
            if let Some(Ok(frame)) = found {
                let (kind, payload) = (frame.kind, frame.payload.to_vec());
                self.take(kind, &payload);
            }
            self.accumulator = accumulator;
        }
        Ok(())
    }
}

/// A device that outlives its session: the next session uses the same device.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Fake>>);

impl Shared {
    pub fn new(fake: Fake) -> Self {
        Self(Arc::new(Mutex::new(fake)))
    }
}

impl Transport for Shared {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.lock().expect("one session at a time").read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.lock().expect("one session at a time").write_all(bytes)
    }
}

//! A minimal host for tests of the virtual board: requests, acknowledgements, samples.
#![allow(clippy::unwrap_used, dead_code, reason = "test support; each test file uses a part of it")]

pub mod scenarios;

use std::any::Any;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

#[cfg(unix)]
use jointrig_hil_sim::board::qemu::QemuBoard;
use jointrig_hil_sim::board::{Controls, Options, VirtualBoard};
use jointrig_hil_sim::link::HostEnd;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::answer::{self, Answer, Refusal, Status};
use jointrig_protocol::block::Block;
use jointrig_protocol::event::{self, Event};
use jointrig_protocol::frame::{Kind, encode};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::MAX_WIRE;
use jointrig_protocol::packet::Reader;
use jointrig_protocol::request::{self, Configuration, Fire, Request, Stage};
use jointrig_protocol::shot::{Phase, Shot};

/// A coil pulse for about 50 N on the default rig, from cold (as stated in its description).
pub const PULSE_US: u32 = 3_500;
/// Scans of a record before its trigger.
const BEFORE: u64 = 256;
/// Scans of a record.
const LENGTH: u64 = 20_480;

/// A running board, its controls and observations, and its link.
pub type Started = (Box<dyn Any>, Arc<Controls>, HostEnd);

/// The native board with this rig.
pub fn native(config: &RigConfig) -> Started {
    let options = Options { seed: 3, ..Options::default() };
    let (board, link) = VirtualBoard::start_with(config, &options).unwrap();
    let controls = Arc::clone(board.controls());
    (Box::new(board), controls, link)
}

/// The image for QEMU; prints a message if there is none.
pub fn image() -> Option<PathBuf> {
    let image = std::env::var_os("JOINTRIG_MPS2_IMAGE").map(PathBuf::from);
    if image.is_none() {
        eprintln!("left out: JOINTRIG_MPS2_IMAGE names no image; `cargo xtask test` builds one and sets it");
    }
    image
}

/// The emulated board with this rig, running an [`image`].
#[cfg(unix)]
pub fn emulated(image: &Path, config: &RigConfig) -> Started {
    let options = Options { seed: 3, ..Options::default() };
    let (board, link) = QemuBoard::start_with(image, config, &options).unwrap();
    let controls = Arc::clone(board.controls());
    (Box::new(board), controls, link)
}

pub struct SmallHost {
    link: HostEnd,
    reader: Reader,
    number: u32,
    pub hello: Option<Hello>,
    answers: Vec<answer::Numbered>,
    pub events: Vec<Event>,
    pub epoch: u32,
    pub first_scan: u64,
    pub next_scan: u64,
    /// Codes of all scans since the stream's start, scan by scan.
    pub codes: Vec<i16>,
    pub channels: usize,
    /// The host never acknowledges beyond this scan.
    pub hold_at: u64,
    /// The scan after the last received one.
    pub latest: u64,
    /// Missing scans before `latest`, as (first, end).
    pub gaps: Vec<(u64, u64)>,
    /// A shot is expected, whose record will be read.
    shooting: bool,
    /// An earlier host of the link may have read half of the first frame.
    within_frame: bool,
}

impl SmallHost {
    /// Shakes hands, and reads COBS.
    pub fn new(link: HostEnd) -> Self {
        Self::reading(link, false)
    }

    /// Shakes hands over the link of an earlier host, in a new session.
    pub fn again(earlier: Self, session: u32) -> Self {
        Self::in_session(earlier.link, false, session, true)
    }

    /// Shakes hands; reads packets if `packets` is set.
    pub fn reading(link: HostEnd, packets: bool) -> Self {
        Self::in_session(link, packets, 99, false)
    }

    fn in_session(link: HostEnd, packets: bool, session: u32, within_frame: bool) -> Self {
        let mut host = Self {
            link,
            reader: Reader::new(),
            number: 0,
            hello: None,
            answers: Vec::new(),
            events: Vec::new(),
            epoch: 0,
            first_scan: 0,
            next_scan: 0,
            codes: Vec::new(),
            channels: 10,
            hold_at: u64::MAX,
            latest: 0,
            gaps: Vec::new(),
            shooting: false,
            within_frame,
        };
        host.send(Kind::Hello, &Hello { packets, ..Hello::host(session) }.to_bytes());
        host.until("a Hello", |host| host.hello.is_some());
        host
    }

    /// The bare link.
    pub fn into_link(self) -> HostEnd {
        self.link
    }

    /// Disconnects the link, and reconnects it.
    pub fn cut(&mut self) {
        self.link.cut();
    }

    pub fn send(&mut self, kind: Kind, payload: &[u8]) {
        let mut wire = [0; MAX_WIRE];
        self.link.write_all(encode(kind, payload, &mut wire).unwrap()).unwrap();
    }

    pub fn send_raw(&mut self, bytes: &[u8]) {
        self.link.write_all(bytes).unwrap();
    }

    /// Reads for a while and acknowledges what came in order.
    pub fn pump(&mut self) {
        let mut bytes = vec![0; 1 << 16];
        let count = self.link.read(&mut bytes, Duration::from_millis(5)).unwrap();
        let mut rest = &bytes[..count];
        let before = self.next_scan;
        while !rest.is_empty() {
            let (used, frame) = self.reader.feed(rest);
            rest = &rest[used..];
            let Some(frame) = frame else { continue };
            if std::mem::take(&mut self.within_frame) && frame.is_err() {
                continue;
            }
            let frame = frame.unwrap();
            match frame.kind {
                Kind::Hello => self.hello = Some(Hello::from_bytes(frame.payload).unwrap()),
                Kind::Answer => {
                    let answer: answer::Numbered = postcard::from_bytes(frame.payload).unwrap();
                    // blocks follow immediately
                    if let Ok(Answer::Started { epoch, first_scan, .. }) = answer.outcome {
                        (self.epoch, self.first_scan, self.next_scan) = (epoch, first_scan, first_scan);
                        self.latest = first_scan;
                        self.gaps.clear();
                        self.codes.clear();
                    }
                    self.answers.push(answer);
                }
                Kind::Event => {
                    let event = postcard::from_bytes::<event::Numbered>(frame.payload).unwrap().event;
                    if let Event::Shot(shot) = &event
                        && shot.phase == Phase::Listening
                        && self.shooting
                    {
                        // Events overtake the blocks to which they refer. If the host acknowledged
                        // beyond the record's end, the board might pass the next shot's scan before
                        // it receives the order for that shot.
                        self.hold_at = self.hold_at.min(end_of_record(shot));
                    }
                    self.events.push(event);
                }
                Kind::Samples => {
                    let block = Block::from_payload(frame.payload).unwrap();
                    if block.header.epoch == self.epoch {
                        let first = block.header.first_scan;
                        if first > self.latest {
                            self.gaps.push((self.latest, first));
                            // lost permanently: this host's record starts again after the gap
                            (self.first_scan, self.next_scan) = (first, first);
                            self.codes.clear();
                        }
                        if first == self.next_scan {
                            self.codes.extend(block.codes());
                            self.next_scan = block.end_scan();
                        }
                        self.latest = self.latest.max(block.end_scan());
                    }
                }
                _ => {}
            }
        }
        if self.next_scan != before {
            self.acknowledge();
        }
    }

    pub fn acknowledge(&mut self) {
        let acknowledge = Acknowledge { epoch: self.epoch, next_scan: self.next_scan.min(self.hold_at) };
        self.send(Kind::Acknowledge, &acknowledge.to_bytes());
    }

    /// Lets a held board continue.
    pub fn release(&mut self) {
        self.hold_at = u64::MAX;
        self.acknowledge();
    }

    /// Reads `scans` more scans.
    pub fn go_on(&mut self, scans: u64) {
        let end = self.next_scan + scans;
        self.until("scans", |host| host.next_scan >= end);
    }

    /// The phases of all reported shots.
    pub fn phases(&self) -> Vec<Phase> {
        let phase = |event: &Event| if let Event::Shot(shot) = event { Some(shot.phase) } else { None };
        self.events.iter().filter_map(phase).collect()
    }

    pub fn until(&mut self, what: &str, mut done: impl FnMut(&Self) -> bool) {
        let give_up = Instant::now() + Duration::from_mins(1);
        while !done(self) {
            self.pump();
            assert!(Instant::now() < give_up, "waited in vain for {what}");
        }
    }

    pub fn ask(&mut self, request: Request) -> Result<Answer, Refusal> {
        self.number += 1;
        let number = self.number;
        self.ask_as(number, request)
    }

    pub fn ask_as(&mut self, number: u32, request: Request) -> Result<Answer, Refusal> {
        self.answers.retain(|answer| answer.number != number);
        let mut bytes = [0; 400];
        let used = postcard::to_slice(&request::Numbered { number, request }, &mut bytes).unwrap();
        self.send(Kind::Request, used);
        self.until("an answer", |host| host.answers.iter().any(|answer| answer.number == number));
        let at = self.answers.iter().position(|answer| answer.number == number).unwrap();
        self.answers.remove(at).outcome
    }

    pub fn status(&mut self) -> Status {
        match self.ask(Request::Status) {
            Ok(Answer::Status(status)) => status,
            other => panic!("no status but {other:?}"),
        }
    }

    pub fn start(&mut self) {
        assert!(matches!(self.ask(Request::Start), Ok(Answer::Started { .. })));
    }

    pub fn stage(&mut self, configuration: Configuration, impact: &str, response: &str, attempt: u32) -> u64 {
        let (impact, response) = (impact.try_into().unwrap(), response.try_into().unwrap());
        // the board must not pass the shot's scan before it receives the order
        self.hold_at = self.next_scan;
        match self.ask(Request::Stage(Stage { configuration, impact, response, attempt })) {
            Ok(Answer::Staged { at_scan }) => at_scan,
            other => panic!("not staged: {other:?}"),
        }
    }

    /// Number of scans by which `not_before` must be ahead of a held acknowledgement, so that the
    /// device cannot have passed it.
    pub fn lead(&self) -> u64 {
        u64::from(self.hello.unwrap().ring_scans / 2) + 64
    }

    pub fn order(number: u32, pulse_us: u32, not_before: u64) -> Fire {
        Fire {
            number,
            pulse_us,
            not_before,
            quiet_limits: heapless::Vec::new(),
            quiet_window: 0,
            quiet_patience: 51_200,
        }
    }

    /// Arms, fires and waits for the end of the shot.
    pub fn shoot(&mut self, order: Fire) -> Shot {
        self.shooting = true;
        assert_eq!(self.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
        let number = order.number;
        assert_eq!(self.ask(Request::Fire(order)), Ok(Answer::Scheduled { number }));
        self.release();
        loop {
            let shot = self.status().shot.unwrap();
            if shot.number == number
                && matches!(shot.phase, Phase::Done | Phase::Missed | Phase::NotQuiet | Phase::Cancelled)
            {
                self.shooting = false;
                return shot;
            }
            self.pump();
        }
    }

    /// The record of a shot: every channel, scan by scan.
    pub fn record(&mut self, shot: &Shot) -> Vec<i16> {
        let end = end_of_record(shot);
        self.hold_at = end;
        self.until("the record's end", |host| host.next_scan >= end);
        let at = |scan: u64| (scan - self.first_scan) as usize * self.channels;
        self.codes[at(shot.trigger - BEFORE)..at(end)].to_vec()
    }

    /// Records of two hits in one cell and one in another. With `dawdle`, the host is slow and the
    /// board must wait.
    pub fn three_shots(&mut self, dawdle: bool) -> Vec<Vec<i16>> {
        self.start();
        let mut records = Vec::new();
        let mut from = self.stage(Configuration::Ajb, "AZ3", "B3", 0);
        for number in 1..=3 {
            if number == 3 {
                from = self.stage(Configuration::B, "BY1", "B4", 0);
            }
            if dawdle {
                // the board's time must stop meanwhile
                (0..20).for_each(|_| self.pump());
            }
            let shot = self.shoot(Self::order(number, PULSE_US, from + self.lead()));
            assert_eq!(shot.phase, Phase::Done);
            records.push(self.record(&shot));
            from = self.hold_at;
        }
        records
    }
}

/// The scan after a record's last.
fn end_of_record(shot: &Shot) -> u64 {
    shot.trigger - BEFORE + LENGTH
}

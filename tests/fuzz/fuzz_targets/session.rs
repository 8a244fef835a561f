//! A whole session with a device that sends anything. The input is a list of messages: a kind, a
//! length, a payload. Some are arbitrary bytes; others are a correct device's messages with a few
//! bytes changed, so that a single error occurs in the middle of a session.
#![no_main]

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use jointrig::device::session::Session;
use jointrig::device::transport::Transport;
use jointrig_protocol::answer::{self, Answer, Counters, Hammer, Info, Reset, Shaker, Status};
use jointrig_protocol::block::Header;
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::frame::{Accumulator, Kind, encode};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::MAX_WIRE;
use jointrig_protocol::request::{self, Request};
use jointrig_protocol::slow::Slow;
use libfuzzer_sys::fuzz_target;

struct Said {
    messages: VecDeque<(u8, Vec<u8>)>,
    asked: request::Numbered,
    session: u32,
    /// The first scan of the next correct block.
    next_scan: u64,
    accumulator: Accumulator,
    out: VecDeque<u8>,
}

impl Said {
    fn new(mut input: &[u8]) -> Self {
        let mut messages = VecDeque::new();
        while let [kind, length, rest @ ..] = input {
            let (payload, rest) = rest.split_at(usize::from(*length).min(rest.len()));
            messages.push_back((*kind, payload.to_vec()));
            input = rest;
        }
        Self {
            messages,
            asked: request::Numbered { number: 0, request: Request::Info },
            session: 0,
            next_scan: 0,
            accumulator: Accumulator::new(),
            out: VecDeque::new(),
        }
    }

    fn say(&mut self, kind: Kind, payload: &[u8]) {
        let mut wire = [0; MAX_WIRE];
        if let Ok(bytes) = encode(kind, payload, &mut wire) {
            self.out.extend(bytes);
        }
    }
}

const RING: u32 = 4096;
const RATE_HZ: u32 = 51_200;
const CHANNELS: u8 = 2;
const BLOCK: u8 = 50;

/// The answer of a correct device.
fn good(asked: &request::Numbered, next_scan: u64) -> Vec<u8> {
    let answer = match &asked.request {
        Request::Info => Answer::Info(Info {
            board: "fuzz".parse().expect("short"),
            serial: "1".parse().expect("short"),
            version: "0.1.0".parse().expect("short"),
            target: "test".parse().expect("short"),
            build: 1,
            channels: CHANNELS,
            scan_rate_hz: RATE_HZ,
            ring_scans: RING,
            coil_cap_us: 8000,
            stage: false,
            drive_v: 0.0,
            reset: Reset::Power,
        }),
        Request::Channel { index } => Answer::Channel(Channel {
            name: format!("ch{index}").as_str().try_into().expect("short"),
            role: if *index == 0 { Role::HammerForce } else { Role::Response(Axis::Z) },
            quantity: if *index == 0 { Quantity::Force } else { Quantity::Velocity },
            units_per_volt: 32.768,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        }),
        Request::Slow => Answer::Slow(Slow::default()),
        Request::Status => Answer::Status(Status {
            epoch: 1,
            streaming: true,
            next_scan,
            oldest_scan: 0,
            hammer: Hammer::Disarmed,
            armed_for_ms: 0,
            interlock_closed: true,
            emergency_stop: false,
            friction_n: 0.0,
            shot: None,
            shaker: Shaker::Resting,
            drive_v: 0.0,
            controlled: 0.0,
            counters: Counters { scans_produced: next_scan, ..Counters::default() },
        }),
        Request::Start => Answer::Started { epoch: 1, map: 0, first_scan: 0 },
        _ => Answer::Done,
    };
    let answer = answer::Numbered { number: asked.number, outcome: Ok(answer) };
    postcard::to_slice(&answer, &mut [0; 512]).expect("it holds every answer").to_vec()
}

/// Changes bytes; `by` alternates between positions and XOR masks.
fn changed(mut bytes: Vec<u8>, by: &[u8]) -> Vec<u8> {
    for pair in by.chunks_exact(2) {
        let count = bytes.len().max(1);
        if let Some(byte) = bytes.get_mut(usize::from(pair[0]) % count) {
            *byte ^= pair[1];
        }
    }
    bytes
}

/// Prepends the message number, which postcard encodes in up to five bytes.
fn numbered(number: u32, rest: &[u8]) -> Vec<u8> {
    let mut bytes = postcard::to_slice(&number, &mut [0; 5]).expect("five bytes hold it").to_vec();
    bytes.extend(rest);
    bytes
}

impl Transport for Said {
    fn read(&mut self, buf: &mut [u8], _: Duration) -> io::Result<usize> {
        if self.out.is_empty() {
            let Some((kind, payload)) = self.messages.pop_front() else {
                return Err(io::ErrorKind::BrokenPipe.into());
            };
            match kind % 8 {
                0 => self.out.extend(payload),
                1 => self.say(Kind::Hello, &payload),
                2 => self.say(Kind::Answer, &numbered(self.asked.number, &payload)),
                3 => {
                    let answer = changed(good(&self.asked, self.next_scan), &payload);
                    self.say(Kind::Answer, &answer);
                }
                4 => self.say(Kind::Event, &payload),
                5 => self.say(Kind::Samples, &payload),
                6 => {
                    let header = Header { flags: 0, map: 0, scans: BLOCK, epoch: 1, first_scan: self.next_scan };
                    let mut block = header.to_bytes().to_vec();
                    block.resize(block.len() + 2 * usize::from(BLOCK) * usize::from(CHANNELS), 7);
                    self.next_scan += u64::from(BLOCK);
                    self.say(Kind::Samples, &changed(block, &payload));
                }
                _ if payload.len().is_multiple_of(2) => self.say(Kind::Log, &payload),
                _ => self.say(Kind::Answer, &payload),
            }
        }
        let count = self.out.len().min(buf.len());
        for (place, byte) in buf.iter_mut().zip(self.out.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let (used, found) = self.accumulator.feed(bytes);
            if let Some(Ok(frame)) = found {
                match frame.kind {
                    Kind::Hello => {
                        let Ok(theirs) = Hello::from_bytes(frame.payload) else { return Ok(()) };
                        // one correct Hello first: without it the session ignores everything else
                        if self.session == 0 {
                            self.session = theirs.session;
                            let hello = Hello::device(theirs.session, 5, RING).to_bytes();
                            self.say(Kind::Hello, &hello);
                        }
                    }
                    Kind::Request => {
                        if let Ok(request) = request::Numbered::read(frame.payload) {
                            self.asked = request;
                        }
                    }
                    _ => {}
                }
            }
            bytes = &bytes[used..];
        }
        Ok(())
    }
}

fuzz_target!(|input: &[u8]| {
    let Ok(mut session) = Session::open(Box::new(Said::new(input)), "fuzz:") else { return };
    session.stalls_after(Duration::from_millis(5));
    let Ok(info) = session.info() else { return };
    let Ok(map) = session.channels(&info) else { return };
    let _ = session.slow();
    let _ = session.status();
    let Ok((_, first)) = session.start(map.len()) else { return };
    let _ = session.wait_for(first.saturating_add(500));
    if let Ok((samples, gaps)) = session.cut(first..first.saturating_add(300)) {
        assert_eq!(samples.channels(), map.len());
        assert!(gaps.iter().all(|gap| gap.start <= gap.end));
    }
    let _ = session.finish();
});

//! Sorts what a device sent: samples into the stream, answers and events into their queues.

use std::collections::VecDeque;

use jointrig_protocol::answer::{self, Answer, Counters, Status};
use jointrig_protocol::block::Block;
use jointrig_protocol::event::{self, Event};
use jointrig_protocol::frame::{Frame, Kind};
use jointrig_protocol::hello::{Hello, Mismatch};
use jointrig_protocol::shot::{Phase, Shot};
use jointrig_protocol::sync::{ClockFault, Edge, Line};

use super::claims::{self, Claim};
use super::logs::DeviceLog;
use super::stream::{ScanLayout, Stream};
use super::tap::Tap;

/// Most events that wait to be read; the oldest are dropped.
const EVENTS_KEPT: usize = 256;

/// Most answers that wait; only one request and one background request are pending at a time.
const ANSWERS_KEPT: usize = 64;

/// Most edges that wait to be read: more than an input delivers in a minute. Further ones are
/// dropped.
const EDGES_KEPT: usize = 1 << 18;

/// Everything received in a session and not used yet.
///
/// Frames that arrive before the device has sent its hello for this session belong to the previous
/// session and are dropped: a cancelled shot or a failed clock of that session does not concern
/// this one.
#[derive(Default)]
pub struct Inbox {
    /// The number of this session.
    session: u32,
    /// Whether the device has sent its hello for this session.
    greeted: bool,
    /// The device's hello, or why it is invalid.
    pub hello: Option<Result<Hello, Mismatch>>,
    /// The stream being assembled.
    pub stream: Option<Stream>,
    /// The stream that was requested and has not begun.
    pub starting: Option<Starting>,
    /// The tap for the next stream.
    pub tap: Option<Tap>,
    /// Answers in the order of arrival.
    pub answers: VecDeque<answer::Numbered>,
    /// Events for the session's user.
    pub events: VecDeque<event::Numbered>,
    /// Edges at the sync input and output that were not read yet.
    pub edges: Vec<Edge>,
    /// A fault of the external clock.
    pub clock_fault: Option<ClockFault>,
    /// The newest report on the last shot.
    pub shot: Option<Shot>,
    /// The newest counters of the device.
    pub counters: Option<Counters>,
    /// Events lost in transmission, counted from gaps in their numbers.
    pub events_lost: u64,
    next_event: Option<u32>,
    /// Numbers of the newest edges at the input and at the output.
    edge_numbers: [Option<u32>; 2],
    /// Sample blocks of another stream, or unreadable ones.
    pub strangers: u64,
    /// The highest epoch among these blocks.
    pub stranger_epoch: Option<u32>,
    /// The first impossible statement of the device.
    pub nonsense: Option<String>,
    /// The device's log.
    pub log: DeviceLog,
}

/// A stream that was requested. Its first blocks follow the answer immediately, so it must begin as
/// soon as the answer arrives.
pub struct Starting {
    /// The request's number.
    pub number: u32,
    /// The words of a scan.
    pub layout: ScanLayout,
    /// Scans that the device can send again.
    pub ring_scans: u32,
    /// Scans per second, Hz.
    pub rate_hz: f64,
}

impl Inbox {
    /// An empty inbox for the session of this number, with the device's log.
    pub fn new(session: u32, log: DeviceLog) -> Self {
        Self { session, log, ..Self::default() }
    }

    /// Sorts one frame.
    pub fn take(&mut self, frame: Frame<'_>) {
        if !self.greeted && matches!(frame.kind, Kind::Samples | Kind::Answer | Kind::Event) {
            log::debug!("a frame of an earlier session was ignored");
            return;
        }
        match frame.kind {
            Kind::Samples => self.take_block(frame.payload),
            Kind::Answer => match postcard::from_bytes(frame.payload) {
                Ok(answer) => self.take_answer(answer),
                Err(error) => log::warn!("an answer that cannot be read was dropped: {error}"),
            },
            Kind::Event => match postcard::from_bytes(frame.payload) {
                Ok(event) => self.take_event(event),
                Err(error) => log::warn!("an event that cannot be read was dropped: {error}"),
            },
            Kind::Hello => {
                let hello = Hello::from_bytes(frame.payload);
                self.greeted |= hello.as_ref().is_ok_and(|theirs| theirs.session == self.session);
                self.hello = Some(hello);
            }
            Kind::Log => self.log.take(frame.payload),
            Kind::Request | Kind::Acknowledge => log::debug!("a frame that only a host sends was ignored"),
        }
    }

    fn take_answer(&mut self, answer: answer::Numbered) {
        if let Ok(said) = &answer.outcome
            && !self.holds(claims::of_answer(said))
        {
            return;
        }
        if let Ok(Answer::Started { epoch, map, first_scan }) = answer.outcome
            && let Some(starting) = self.starting.take_if(|starting| starting.number == answer.number)
        {
            let Starting { layout, ring_scans, rate_hz, .. } = starting;
            let mut stream = Stream::new(epoch, map, first_scan, layout, ring_scans);
            stream.tapped(self.tap.take(), rate_hz);
            self.stream = Some(stream);
        }
        if self.answers.len() == ANSWERS_KEPT {
            self.answers.pop_front();
        }
        self.answers.push_back(answer);
    }

    /// Whether a statement of the device is possible; an impossible one is noted, and ends the
    /// session.
    fn holds(&mut self, claim: Claim) -> bool {
        let holds = claim.is_ok();
        self.nonsense = self.nonsense.take().or(claim.err());
        holds
    }

    fn take_block(&mut self, payload: &[u8]) {
        let Some(block) = Block::from_payload(payload) else {
            self.strangers += 1;
            return;
        };
        // without a stream these belong to an earlier session
        let Some(stream) = &mut self.stream else { return };
        if !stream.take(&block) {
            self.strangers += 1;
            self.stranger_epoch = self.stranger_epoch.max(Some(block.header.epoch));
        }
    }

    fn take_event(&mut self, event: event::Numbered) {
        if !self.holds(claims::of_event(&event)) {
            return;
        }
        if let Some(next) = self.next_event {
            let jump = event.number.wrapping_sub(next);
            if jump > u32::MAX / 2 {
                return; // an older event or a duplicate
            }
            self.events_lost += u64::from(jump);
        }
        self.next_event = Some(event.number.wrapping_add(1));
        match &event.event {
            Event::Lost { epoch, first_scan, scans, why } => {
                log::warn!("the device lost {scans} scans from {first_scan} on ({why:?})");
                if let Some(stream) = self.stream.as_mut().filter(|stream| stream.epoch() == *epoch) {
                    let lost = *first_scan..first_scan.saturating_add(u64::from(*scans));
                    if !stream.mark_lost(lost) {
                        self.nonsense = Some(
                            "reports more losses than a stream can store, all of them ahead of its scans"
                                .into(),
                        );
                    }
                }
            }
            Event::Counters(counters) => self.counters = Some(*counters),
            Event::Shot(shot) => self.note_shot(shot),
            Event::Clock(fault) => self.clock_fault = Some(*fault),
            Event::Edge(edge) => self.note_edge(*edge),
            _ => {
                log::debug!("event at scan {}: {:?}", event.at_scan, event.event);
                if self.events.len() == EVENTS_KEPT {
                    self.events.pop_front();
                }
                self.events.push_back(event);
            }
        }
    }

    fn note_edge(&mut self, edge: Edge) {
        let lost = self.edge_numbers[usize::from(edge.line != Line::Input)]
            .replace(edge.number)
            .map_or(0, |before| edge.number.wrapping_sub(before).wrapping_sub(1));
        if lost > 0 {
            log::warn!(
                "{lost} edges of the sync port were not reported before {edge:?}: they came too fast, or the link lost them"
            );
        }
        if self.edges.len() < EDGES_KEPT {
            self.edges.push(edge);
        }
    }

    /// Notes the counters and the shot in a status.
    pub fn note_status(&mut self, status: &Status) {
        self.counters = Some(status.counters);
        if let Some(shot) = &status.shot {
            self.note_shot(shot);
        }
    }

    /// The status inside an answer, if it is one.
    pub fn status_of(answer: &answer::Numbered) -> Option<&Status> {
        match &answer.outcome {
            Ok(Answer::Status(status)) => Some(status),
            _ => None,
        }
    }

    /// Notes a shot's phase. Events may overtake one another on a bad link, so a shot never goes
    /// back to an earlier phase.
    fn note_shot(&mut self, shot: &Shot) {
        let newer = self
            .shot
            .is_none_or(|known| (known.number, rank(known.phase)) <= (shot.number, rank(shot.phase)));
        if newer {
            self.shot = Some(*shot);
        }
    }
}

fn rank(phase: Phase) -> u8 {
    match phase {
        Phase::Waiting => 0,
        Phase::Firing => 1,
        Phase::Listening => 2,
        Phase::Done | Phase::Missed | Phase::NotQuiet | Phase::Cancelled => 3,
    }
}

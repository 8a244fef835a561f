//! What a device sent, sorted: samples into the stream, answers and events into their queues.

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
use super::stream::Stream;
use super::tap::Tap;

/// Events that wait for somebody to read them; the oldest go first when nobody does.
const EVENTS_KEPT: usize = 256;

/// Answers that wait; one request is under way at a time, and one errand.
const ANSWERS_KEPT: usize = 64;

/// Edges that wait to be taken: more than an input gives in a minute. Those of a session that takes none are not wanted.
const EDGES_KEPT: usize = 1 << 18;

/// Everything that arrived in a session and was not used yet.
///
/// What arrives before the device has greeted this session is left over from the session before, and is
/// dropped: a cancelled shot or a failed clock of that session says nothing about this one.
#[derive(Default)]
pub struct Inbox {
    /// The number of this session.
    session: u32,
    /// Whether the device has greeted this session.
    greeted: bool,
    /// The other end's introduction, or why it is none.
    pub hello: Option<Result<Hello, Mismatch>>,
    /// The stream being put together.
    pub stream: Option<Stream>,
    /// The stream that was asked for and has not begun.
    pub starting: Option<Starting>,
    /// Hung on the next stream.
    pub tap: Option<Tap>,
    /// Answers in the order of arrival.
    pub answers: VecDeque<answer::Numbered>,
    /// Events that concern whoever uses the session.
    pub events: VecDeque<event::Numbered>,
    /// Edges at the sync input and output that nobody has taken yet.
    pub edges: Vec<Edge>,
    /// The external clock is not good any more.
    pub clock_fault: Option<ClockFault>,
    /// The newest word on the last shot.
    pub shot: Option<Shot>,
    /// The newest counters of the device.
    pub counters: Option<Counters>,
    /// Events that were lost on the way, from the jumps of their numbers.
    pub events_lost: u64,
    next_event: Option<u32>,
    /// Numbers of the newest edges of the input and of the output.
    edge_numbers: [Option<u32>; 2],
    /// Sample blocks of another stream, or unreadable ones.
    pub strangers: u64,
    /// The highest epoch among the strangers.
    pub stranger_epoch: Option<u32>,
    /// The first thing that it said and that cannot be.
    pub nonsense: Option<String>,
    /// What the device logs.
    pub log: DeviceLog,
}

/// A stream that was asked for: its first blocks follow the answer closely, so that it must begin the
/// moment the answer is seen.
pub struct Starting {
    /// The request's number.
    pub number: u32,
    /// Channels in a scan.
    pub channels: usize,
    /// Scans that the device can send again.
    pub ring_scans: u32,
    /// Scans per second, Hz.
    pub rate_hz: f64,
}

impl Inbox {
    /// Empty, for the session of this number with a device that logs.
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
            let Starting { channels, ring_scans, rate_hz, .. } = starting;
            let mut stream = Stream::new(epoch, map, first_scan, channels, ring_scans);
            stream.tapped(self.tap.take(), rate_hz);
            self.stream = Some(stream);
        }
        if self.answers.len() == ANSWERS_KEPT {
            self.answers.pop_front();
        }
        self.answers.push_back(answer);
    }

    /// Whether something can be as the device says; what cannot is noted, for the session to end on.
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
        // without a stream these are the rest of an earlier session's
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
                return; // an old one, twice
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
                            "reports more losses than a stream has room for, all of them ahead of its scans"
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
                "{lost} edges of the sync port were not told before {edge:?}: they came too fast, or the link lost them"
            );
        }
        if self.edges.len() < EDGES_KEPT {
            self.edges.push(edge);
        }
    }

    /// Notes what a status says in passing.
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

    /// Events overtake one another on a bad link: a shot only ever goes forward.
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

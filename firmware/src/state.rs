//! The state shared by the tasks: one [`Core`] behind one mutex, two signals that wake other tasks,
//! and the stored replies that make requests idempotent.
//!
//! A host repeats a request with the same number until it receives a reply. A request that was
//! already carried out is answered from here without acting again; a number too old to be
//! recognised as a repeat is refused.

use crate::fmt::warning;
use crate::hammer::{Outcome, Scanned};
use crate::logs::Tap;
use crate::ring::{CHANNEL_MAP, Out, Range, Ring, Slot};
use crate::ruler::InStep;
use crate::safety::Safety;
use crate::scales::Friction;
use crate::scales::{UnitsPerCode, as_built, as_told};
use crate::sentence::{Sentence, Tell, out_of_bounds};
use core::cell::RefCell;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::signal::Signal;
use heapless::{Deque, String};
use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::answer::{Answer, Counters, Info, Numbered, Refusal, Reset, Status};
use jointrig_protocol::block::RESENT;
use jointrig_protocol::channel::{Channel, Name, words_per_scan};
use jointrig_protocol::event::{Event, Loss, Reason};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;
use jointrig_protocol::shot::Phase;
use jointrig_protocol::sync::Line;
use jointrig_protocol::{answer, event, limits};
use nalgebra::Matrix3;

/// Capacity for replies waiting for the link.
const ANSWERS: usize = 8;
/// Capacity for ranges waiting to be retransmitted.
const RESENDS: usize = 8;

/// Properties that do not change while the device runs.
#[derive(Clone, Debug)]
pub struct Facts<'a> {
    /// Name of the board.
    pub board: Name,
    /// Serial number.
    pub serial: Name,
    /// Target triple of this build.
    pub target: String<40>,
    /// Identifies the build and its table of log strings.
    pub build: u64,
    /// Scans per second.
    pub scan_rate_hz: u32,
    /// The channels of a scan, in order: 1 to [`limits::CHANNEL_CAPACITY`].
    pub channels: &'a [Channel],
    /// Longest coil pulse of the board, µs.
    pub coil_cap_us: u32,
    /// Whether the board has a stage.
    pub stage: bool,
    /// Full scale of the shaker's drive, V; 0 without a shaker.
    pub drive_v: f32,
    /// Whether the board has sync input, sync output and clock input.
    pub sync: bool,
    /// Cause of the last reset.
    pub reset: Reset,
    /// Distinguishes this start from all others: one more than the last start's number, or a number
    /// never used before. Its low 16 bits are the high 16 bits of the first stream's epoch.
    pub boot: u32,
}

/// Everything that the tasks of one device share.
pub struct Core<'a, M: RawMutex> {
    pub(crate) facts: Facts<'a>,
    /// 16-bit words per scan.
    pub(crate) words: usize,
    pub(crate) logs: Option<&'a Tap<M>>,
    pub(crate) state: Mutex<M, RefCell<State<'a>>>,
    /// There is something to transmit.
    pub(crate) to_send: Signal<M, ()>,
    /// A stream has begun, or the acknowledgement has moved.
    pub(crate) may_run: Signal<M, ()>,
}

/// What the tasks share. The fields are private: a task asks for what it needs by name.
pub(crate) struct State<'a> {
    /// Everything that moves, and everything that forbids motion.
    safety: Safety<'a>,
    /// Scan clock, sync input and output.
    in_step: InStep,
    friction: Option<Friction>,
    /// Mean of T over the last block, N; while streaming, computed on request.
    friction_n: f32,
    /// The session has sent its own scales.
    scales_told: bool,
    /// Blocks of the stream.
    ring: Ring<'a>,
    epoch: u32,
    /// Streams begun since the device started.
    streams: u32,
    /// The scan up to which the host has everything.
    acknowledged: u64,
    resends: Deque<Range, RESENDS>,
    counters: Counters,
    /// The session agreed on, if any.
    session: Option<u32>,
    /// The session whose greeting must be answered.
    hello_due: Option<u32>,
    /// The host reads packets, so packets are sent.
    packets: bool,
    memory: Memory,
    answers: Deque<answer::Numbered, ANSWERS>,
}

impl<'a, M: RawMutex> Core<'a, M> {
    /// A device at rest: disarmed, not streaming.
    ///
    /// `slots` is the memory of the ring: at least a second of all channels.
    ///
    /// # Panics
    /// When there are no channels, more than [`limits::CHANNEL_CAPACITY`], or no slots: a
    /// programming error of the board that cannot be handled at run time.
    pub fn new(facts: Facts<'a>, slots: &'a mut [Slot]) -> Self {
        let words = words_per_scan(facts.channels);
        assert!(limits::scans_per_block(words).is_some(), "too few or too many channels");
        assert!(!slots.is_empty(), "the ring needs memory");
        let state = State {
            safety: Safety::new(facts.channels, facts.scan_rate_hz, facts.coil_cap_us, facts.drive_v),
            in_step: InStep::default(),
            friction: Friction::new(facts.channels),
            friction_n: 0.0,
            scales_told: false,
            ring: Ring::new(slots, 2 * words),
            epoch: facts.boot,
            streams: 0,
            acknowledged: 0,
            resends: Deque::new(),
            counters: Counters::default(),
            session: None,
            hello_due: None,
            packets: false,
            memory: Memory::new(),
            answers: Deque::new(),
        };
        Self {
            facts,
            words,
            logs: None,
            state: Mutex::new(RefCell::new(state)),
            to_send: Signal::new(),
            may_run: Signal::new(),
        }
    }

    /// Adds log lines for the host, which a board's logger puts into `tap`.
    #[must_use]
    pub fn with_logs(mut self, tap: &'a Tap<M>) -> Self {
        self.logs = Some(tap);
        self
    }

    /// For a coil that needs a longer pause between two pulses than
    /// [`crate::hammer::PAUSE_MS`], ms.
    #[must_use]
    pub fn with_coil_pause(self, pause_ms: u32) -> Self {
        self.with(|state| state.safety.pause_for(pause_ms));
        self
    }

    /// The hammer's state, for a board that reports it.
    pub fn hammer(&self) -> answer::Hammer {
        self.with(|state| state.safety.hammer().state())
    }

    pub(crate) fn with<R>(&self, f: impl FnOnce(&mut State<'a>) -> R) -> R {
        self.state.lock(|state| f(&mut state.borrow_mut()))
    }

    /// Takes the present states of guard and emergency stop, from a board whose inputs trigger
    /// interrupts; callable from any task, whatever acquisition is doing. The host is informed of a
    /// change even when no blocks arrive.
    ///
    /// Returns whether the caller must cut the coil's current immediately. Acquisition gets the
    /// same order, so that it is carried out even if one of the two is stuck.
    #[must_use]
    pub fn see_inputs(&self, interlock_closed: bool, emergency_stop: bool) -> bool {
        let danger = self.with(|state| state.safety.see_inputs(interlock_closed, emergency_stop));
        self.to_send.signal(());
        danger
    }

    /// Scans that can be retransmitted.
    pub fn ring_scans(&self) -> u32 {
        self.with(|state| state.ring.capacity_scans())
    }

    pub(crate) fn info(&self) -> Info {
        let mut version = Name::new();
        // only a version of more than 24 characters would be cut here
        let _ = version.push_str(env!("CARGO_PKG_VERSION"));
        Info {
            board: self.facts.board.clone(),
            serial: self.facts.serial.clone(),
            version,
            target: self.facts.target.clone(),
            build: self.facts.build,
            channels: self.facts.channels.len() as u8,
            scan_rate_hz: self.facts.scan_rate_hz,
            ring_scans: self.ring_scans(),
            coil_cap_us: self.facts.coil_cap_us,
            stage: self.facts.stage,
            drive_v: self.facts.drive_v,
            reset: self.facts.reset,
        }
    }
}

/// Reports of a board: faults of its parts, and how its last run ended.
impl<M: RawMutex> Core<'_, M> {
    /// Reports a fault of a part of the board. Without a host, the event waits for one.
    pub fn report_fault(&self, what: &(impl Tell + ?Sized)) {
        let text = Sentence::of(what);
        warning!("fault: {}", text.as_str());
        self.with(|state| state.safety.say(Event::Fault(text.into_string())));
        self.to_send.signal(());
    }

    /// Reports that the previous run ended in a panic with this message.
    pub fn report_panic(&self, what: &(impl Tell + ?Sized)) {
        let text = Sentence::of(what);
        warning!("the last run ended in a panic: {}", text.as_str());
        self.with(|state| state.safety.say(Event::Panic(text.into_string())));
        self.to_send.signal(());
    }
}

impl<'a> State<'a> {
    /// Everything that moves.
    #[inline]
    pub fn safety(&mut self) -> &mut Safety<'a> {
        &mut self.safety
    }

    /// Scan clock, sync input and output.
    #[inline]
    pub fn in_step(&mut self) -> &mut InStep {
        &mut self.in_step
    }
}

/// The session.
impl State<'_> {
    /// Notes a valid frame of the host.
    pub fn hear_frame(&mut self) {
        self.counters.frames_in += 1;
        self.safety.host_was_heard();
    }

    /// Counts a frame that is damaged, or that no host sends.
    pub fn count_bad_frame(&mut self) {
        self.counters.frames_bad += 1;
    }

    /// The session agreed on, if any.
    pub fn session(&self) -> Option<u32> {
        self.session
    }

    /// Notes that the greeting of this session must be answered.
    pub fn owe_hello(&mut self, session: u32) {
        self.hello_due = Some(session);
    }

    /// Begins a session, or none when its host was refused: discards the requests of the session
    /// before, and stops its actions.
    pub fn begin_session(&mut self, session: Option<u32>, packets: bool, channels: &[Channel]) {
        self.packets = packets;
        self.safety.end_stream(Reason::StreamEnded);
        self.answers.clear();
        self.resends.clear();
        // only after hammer and shaker have reported how they came to rest
        self.safety.forget_events();
        self.ring.forget_losses();
        self.memory = Memory::new();
        self.forget_scales(channels);
        self.in_step.forget();
        self.session = session;
    }

    /// Whether a request was carried out before.
    pub fn recall(&self, number: u32) -> Seen {
        self.memory.look_up(number)
    }

    /// Stores the reply to a request that was carried out.
    pub fn remember(&mut self, answer: &answer::Numbered) {
        self.memory.keep(answer);
    }

    /// Queues a reply. A full queue drops it: the host asks again, and the reply is stored.
    pub fn queue_answer(&mut self, answer: answer::Numbered) {
        drop(self.answers.push_back(answer));
    }
}

/// The scales used for hammer, shaker and load cells: those of the board, or those sent in the
/// session.
impl State<'_> {
    /// Uses these scales from now on.
    ///
    /// # Errors
    /// [`Refusal::OutOfBounds`]; [`Refusal::HammerArmed`] or [`Refusal::ShakerRuns`] while
    /// something may move based on the old scales.
    pub fn take_scales(&mut self, channels: &[Channel], units_per_volt: &[f32]) -> Result<(), Refusal> {
        let scales = as_told(channels, units_per_volt)?;
        self.safety.may_be_rescaled()?;
        self.judge_by(&scales);
        self.scales_told = true;
        Ok(())
    }

    /// Restores the built-in scales if a session has changed them.
    fn forget_scales(&mut self, channels: &[Channel]) {
        if core::mem::take(&mut self.scales_told) {
            self.judge_by(&as_built(channels));
        }
    }

    fn judge_by(&mut self, scales: &UnitsPerCode) {
        self.safety.judge_by(scales);
        if let Some(friction) = &mut self.friction {
            friction.judge_by(scales);
        }
    }

    /// Sets the load cells' calibration matrix, in rows.
    ///
    /// # Errors
    /// [`Refusal::Unsupported`] without three load cells.
    pub fn calibrate(&mut self, matrix: &[f32; 9]) -> Result<(), Refusal> {
        let friction = self.friction.as_mut().ok_or(Refusal::Unsupported)?;
        friction.calibrate(&Matrix3::from_row_slice(matrix));
        Ok(())
    }
}

/// The stream.
impl State<'_> {
    /// Starts a new stream with a new epoch; the scan index continues.
    ///
    /// # Errors
    /// [`Refusal::Clock`] while the scan clock cannot be relied on.
    pub fn start_stream(&mut self, boot: u32) -> Result<Answer, Refusal> {
        if let Some(fault) = self.in_step.now().fault {
            return Err(Refusal::Clock(fault));
        }
        self.safety.begin_stream();
        // each device start has 65536 epochs; after that they run into the next start's range
        // instead of repeating
        self.epoch = (boot << 16).wrapping_add(self.streams);
        self.streams = self.streams.wrapping_add(1);
        self.ring.restart(self.epoch);
        self.resends.clear();
        self.counters.scans_produced = 0;
        self.counters.scans_sent = 0;
        self.counters.scans_resent = 0;
        self.counters.scans_dropped = 0;
        self.counters.scans_missed = 0;
        let first_scan = self.safety.next_scan();
        self.acknowledged = first_scan;
        Ok(Answer::Started { epoch: self.epoch, map: CHANNEL_MAP, first_scan })
    }

    /// Notes that the host has everything up to a scan of this epoch.
    pub fn acknowledge(&mut self, acknowledge: &Acknowledge) {
        if self.safety.is_streaming() && acknowledge.epoch == self.epoch {
            // limited to what was produced: a faulty host must not let the front end run further
            // ahead
            let produced = acknowledge.next_scan.min(self.safety.next_scan());
            self.acknowledged = self.acknowledged.max(produced);
        }
    }

    /// Whether a front end that can be held may run: in a stream, no more than half a ring ahead of
    /// the host's acknowledgement, or while a clock is being measured.
    pub fn may_scan(&self) -> bool {
        let ahead = self.safety.next_scan().saturating_sub(self.acknowledged);
        let runs = self.safety.is_streaming() && ahead < u64::from(self.ring.capacity_scans() / 2);
        runs || self.in_step.is_measured()
    }

    /// Queues scans to be sent again.
    ///
    /// # Errors
    /// A [`Refusal`] when they are not in the ring, or when the queue is full.
    pub fn resend(&mut self, epoch: u32, first_scan: u64, scans: u32) -> Result<Answer, Refusal> {
        if epoch != self.epoch {
            return Err(Refusal::WrongEpoch { current: self.epoch });
        }
        let oldest = self.ring.oldest_scan().ok_or(Refusal::NotStreaming)?;
        let end = first_scan.saturating_add(u64::from(scans)).min(self.safety.next_scan());
        if first_scan < oldest {
            return Err(Refusal::Gone { oldest });
        }
        if first_scan >= end {
            return Err(out_of_bounds("no such scans have been produced yet"));
        }
        let range = Range { first_scan, scans: end - first_scan };
        // a full queue is refused; the host asks again
        self.resends.push_back(range).map_err(|_| Refusal::Busy)?;
        Ok(Answer::Resending { first_scan, scans: (end - first_scan) as u32 })
    }

    /// The counters, as reported to the host.
    pub fn counters(&self) -> Counters {
        Counters { events_dropped: self.safety.events_dropped(), ..self.counters }
    }

    /// Notes how many log lines were dropped.
    pub fn note_dropped_logs(&mut self, dropped: u32) {
        self.counters.logs_dropped = dropped;
    }

    /// The state of everything, for a device with `words` 16-bit words per scan.
    pub fn status(&mut self, words: usize) -> Status {
        let friction_n = self.friction_of_last_block(words);
        let safety = &self.safety;
        Status {
            epoch: self.epoch,
            streaming: safety.is_streaming(),
            next_scan: safety.next_scan(),
            oldest_scan: self.ring.oldest_scan().unwrap_or(safety.next_scan()),
            hammer: safety.hammer().state(),
            armed_for_ms: safety.hammer().armed_for_ms(safety.next_scan()),
            interlock_closed: safety.interlock_closed(),
            emergency_stop: safety.emergency_stop(),
            friction_n,
            shot: safety.hammer().shot(),
            shaker: safety.shaker().state(),
            drive_v: safety.shaker().amplitude_v(),
            controlled: safety.shaker().controlled(),
            counters: self.counters(),
        }
    }

    /// Mean of T over the last block, N.
    fn friction_of_last_block(&mut self, words: usize) -> f32 {
        if self.safety.is_streaming()
            && let (Some(friction), Some(samples)) = (&self.friction, self.ring.newest())
        {
            self.friction_n = friction.mean_of(samples.as_chunks().0, words);
        }
        self.friction_n
    }
}

/// One block of acquisition.
impl State<'_> {
    /// Accounts for scans that the front end did not deliver; the scan index advances over them.
    #[inline(never)]
    pub fn lose_scans(&mut self, missed: u32) {
        self.safety.scans_are_lost();
        self.counters.scans_missed += u64::from(missed);
        if self.safety.is_streaming() {
            let range = Range { first_scan: self.safety.next_scan(), scans: u64::from(missed) };
            self.ring.report(range, Loss::FrontEnd);
        }
        self.safety.advance(u64::from(missed));
    }

    /// Lets the hammer evaluate a block; its outcome is carried out by [`Self::follow`].
    #[inline]
    pub fn judge(&mut self, block: &impl Scanned) -> Option<Outcome> {
        self.safety.judge(block, self.friction.as_ref())
    }

    /// Keeps a block of `scans` scans: in the ring while streaming, otherwise only its mean
    /// friction. `pairs` are the codes of its `samples`.
    #[inline]
    pub fn keep(
        &mut self,
        flags: u8,
        scans: usize,
        samples: &[u8; BLOCK_SAMPLE_BYTES],
        pairs: &[[u8; 2]],
        words: usize,
    ) {
        if self.safety.is_streaming() {
            let dropped = self.ring.push(self.safety.next_scan(), flags, scans as u8, samples);
            self.counters.scans_dropped += dropped;
            self.counters.scans_produced += scans as u64;
        } else if let Some(friction) = &self.friction {
            // while streaming, the ring holds the last block and the mean is computed on request
            self.friction_n = friction.mean_of(pairs, words);
        }
    }

    /// Carries out the hammer's outcome, and marks its shot at the sync output.
    #[inline]
    pub fn follow(&mut self, outcome: &Outcome) {
        self.safety.follow(outcome);
        match outcome.shot.map(|shot| shot.phase) {
            Some(Phase::Firing) => self.in_step.mark(Line::Fired),
            Some(Phase::Listening) => self.in_step.mark(Line::Trigger),
            _ => {}
        }
    }

    /// Blocks that wait for the link.
    #[inline]
    pub fn unsent_blocks(&self) -> u64 {
        self.ring.unsent()
    }
}

/// What waits for the link, the most urgent first.
impl State<'_> {
    /// Takes the answer to a greeting.
    pub fn take_hello(&mut self, boot: u32) -> Option<Hello> {
        let session = self.hello_due.take()?;
        let device = Hello::device(session, boot, self.ring.capacity_scans());
        Some(Hello { packets: self.packets, ..device })
    }

    /// Whether packets are sent instead of COBS.
    pub fn sends_packets(&self) -> bool {
        self.packets
    }

    /// Whether replies, events or the report of a loss are waiting.
    #[inline]
    pub fn has_words(&self) -> bool {
        !self.answers.is_empty() || self.safety.has_events() || self.ring.has_loss()
    }

    /// Whether scans must be sent again.
    #[inline]
    pub fn has_resends(&self) -> bool {
        !self.resends.is_empty()
    }

    /// Takes the oldest reply.
    pub fn take_answer(&mut self) -> Option<answer::Numbered> {
        self.answers.pop_front()
    }

    /// Takes the oldest loss, or else the oldest event.
    pub fn take_event(&mut self) -> Option<event::Numbered> {
        self.take_loss().or_else(|| self.safety.take_event())
    }

    /// The event for the oldest loss of scans that has not been reported to the host.
    fn take_loss(&mut self) -> Option<event::Numbered> {
        let (range, why) = self.ring.take_loss()?;
        let scans = u32::try_from(range.scans).unwrap_or(u32::MAX);
        warning!("{} scans from {} were lost", scans, range.first_scan);
        let lost = Event::Lost { epoch: self.epoch, first_scan: range.first_scan, scans, why };
        Some(self.safety.number(lost))
    }

    /// The next block that must be sent again.
    pub fn take_resent(&mut self) -> Option<Out<'_>> {
        while let Some(range) = self.resends.front_mut() {
            let end = range.first_scan + range.scans;
            match self.ring.at_or_after(range.first_scan, RESENT) {
                Some((out, after)) if out.header.first_scan < end => {
                    self.counters.scans_resent += u64::from(out.header.scans);
                    range.scans = end.saturating_sub(after);
                    range.first_scan = after;
                    if after >= end {
                        self.resends.pop_front();
                    }
                    return Some(out);
                }
                // it left the ring since then: the host asks again, and the answer says so
                _ => drop(self.resends.pop_front()),
            }
        }
        None
    }

    /// The next new block.
    #[inline]
    pub fn take_unsent(&mut self) -> Option<Out<'_>> {
        let out = self.ring.next_unsent()?;
        self.counters.scans_sent += u64::from(out.header.scans);
        Some(out)
    }
}

/// Number of stored replies. A host has one outstanding request at a time; eight cover any
/// reordering of repeats.
pub const REMEMBERED: usize = 8;

/// How to treat a request with a given number.
#[derive(Debug, PartialEq)]
pub enum Seen {
    /// Not carried out yet: do it.
    New,
    /// Already carried out: send this reply again.
    Before(Numbered),
    /// Too old to decide.
    Stale,
}

/// The last replies of one session.
#[derive(Default)]
pub struct Memory {
    answers: Deque<Numbered, REMEMBERED>,
}

impl Memory {
    /// Empty: a new session.
    pub const fn new() -> Self {
        Self { answers: Deque::new() }
    }

    /// Looks up a number.
    pub fn look_up(&self, number: u32) -> Seen {
        if let Some(answer) = self.answers.iter().find(|answer| answer.number == number) {
            return Seen::Before(answer.clone());
        }
        // when full, a number lower than all stored ones may have been carried out and removed
        let forgotten = self.answers.is_full() && self.answers.iter().all(|answer| number < answer.number);
        if forgotten { Seen::Stale } else { Seen::New }
    }

    /// Stores a reply; removes the oldest when full.
    pub fn keep(&mut self, answer: &Numbered) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // there is space: the oldest was removed if necessary
        let _ = self.answers.push_back(answer.clone());
    }
}

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;

#[cfg(test)]
mod memory_tests {
    use super::*;
    use jointrig_protocol::answer::{Answer, Refusal};

    fn answer(number: u32) -> Numbered {
        Numbered {
            number,
            outcome: if number.is_multiple_of(2) { Ok(Answer::Done) } else { Err(Refusal::Busy) },
        }
    }

    #[test]
    fn a_repeat_is_answered_from_memory_and_an_old_number_is_stale() {
        let mut memory = Memory::new();
        assert_eq!(memory.look_up(1), Seen::New);
        for number in 1..=20 {
            assert_eq!(memory.look_up(number), Seen::New);
            memory.keep(&answer(number));
            assert_eq!(memory.look_up(number), Seen::Before(answer(number)));
        }
        assert_eq!(memory.look_up(13), Seen::Before(answer(13)));
        assert_eq!(memory.look_up(12), Seen::Stale);
        assert_eq!(memory.look_up(1), Seen::Stale);
    }

    #[test]
    fn a_late_request_that_was_never_carried_out_is_new() {
        let mut memory = Memory::new();
        for number in [1, 2, 4, 5] {
            memory.keep(&answer(number));
        }
        assert_eq!(memory.look_up(3), Seen::New);
    }
}

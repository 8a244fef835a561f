//! The state shared by the tasks: one [`Core`] behind one mutex, and two signals that wake other
//! tasks.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Instant;
use heapless::{Deque, String};
use jointrig_protocol::answer::{self, Counters, Info, Refusal, Reset};
use jointrig_protocol::channel::{Channel, Name, Role};
use jointrig_protocol::event::{self, Event, Reason};
use jointrig_protocol::limits;
use jointrig_protocol::shot::Phase;
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::Line;

use crate::events::Events;
use crate::fmt::{info, warning};
use crate::friction::Friction;
use crate::hammer::{CoilOrder, Hammer, Outcome};
use crate::logs::Tap;
use crate::memory::Memory;
use crate::ring::{Range, Ring, Slot};
use crate::ruler::InStep;
use crate::sentence::{Sentence, Tell};
use crate::shaker::Shaker;

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
    /// The channels of a scan, in order: 1 to 16.
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
    pub(crate) logs: Option<&'a Tap<M>>,
    pub(crate) state: Mutex<M, RefCell<State<'a>>>,
    /// There is something to transmit.
    pub(crate) to_send: Signal<M, ()>,
    /// A stream has begun, or the acknowledgement has moved.
    pub(crate) may_run: Signal<M, ()>,
}

#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own, true or not")]
pub(crate) struct State<'a> {
    pub ring: Ring<'a>,
    pub hammer: Hammer,
    pub shaker: Shaker<'a>,
    pub friction: Option<Friction>,
    pub friction_n: f32,
    pub memory: Memory,
    /// The session agreed on, if any.
    pub session: Option<u32>,
    pub hello_due: Option<u32>,
    /// The host reads packets, so packets are sent.
    pub packets: bool,
    pub answers: Deque<answer::Numbered, ANSWERS>,
    pub events: Events,
    pub resends: Deque<Range, RESENDS>,
    pub counters: Counters,
    pub streaming: bool,
    pub epoch: u32,
    /// Streams begun since the device started.
    pub streams: u32,
    pub next_scan: u64,
    pub acknowledged: u64,
    pub last_heard: Instant,
    /// Time of the last delivery of the front end.
    pub last_block: Instant,
    pub interlock_closed: bool,
    pub emergency_stop: bool,
    /// An order for the coil from outside the acquisition task.
    pub coil: Option<CoilOrder>,
    /// The drive must go to rest immediately.
    pub drive_off: bool,
    /// Last measured temperature and sensor supplies.
    pub slow: Slow,
    /// Index of the excitation force channel.
    pub excitation: Option<usize>,
    /// The session has sent its own scales.
    pub scales_told: bool,
    /// Scan clock, sync input and output.
    pub in_step: InStep,
}

impl<'a, M: RawMutex> Core<'a, M> {
    /// A device at rest: disarmed, not streaming.
    ///
    /// `slots` is the memory of the ring: at least a second of all channels.
    ///
    /// # Panics
    /// When there are no channels, more than 16, or no slots: a programming error of the board that
    /// cannot be handled at run time.
    pub fn new(facts: Facts<'a>, slots: &'a mut [Slot]) -> Self {
        assert!(limits::scans_per_block(facts.channels.len()).is_some(), "a scan has 1 to 16 channels");
        assert!(!slots.is_empty(), "the ring needs memory");
        let hammer = Hammer::new(facts.channels, facts.scan_rate_hz, facts.coil_cap_us);
        let state = State {
            ring: Ring::new(slots, 2 * facts.channels.len()),
            hammer,
            shaker: Shaker::new(facts.channels, facts.scan_rate_hz, facts.drive_v),
            friction: Friction::new(facts.channels),
            friction_n: 0.0,
            memory: Memory::new(),
            session: None,
            hello_due: None,
            packets: false,
            answers: Deque::new(),
            events: Events::new(),
            resends: Deque::new(),
            counters: Counters::default(),
            streaming: false,
            epoch: facts.boot,
            streams: 0,
            next_scan: 0,
            acknowledged: 0,
            last_heard: Instant::from_ticks(0),
            last_block: Instant::from_ticks(0),
            // closed and released until the board reports otherwise, at the latest with the first
            // block
            interlock_closed: true,
            emergency_stop: false,
            coil: None,
            drive_off: false,
            slow: Slow::default(),
            excitation: facts.channels.iter().position(|channel| channel.role == Role::Excitation),
            scales_told: false,
            in_step: InStep::default(),
        };
        Self {
            facts,
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
        let danger = !interlock_closed || emergency_stop;
        self.with(|state| {
            state.heed(interlock_closed, emergency_stop);
            if danger {
                // independently of the state machine's state
                state.coil = Some(CoilOrder::Off);
            }
            // also when the stop is already latched: the code that muted the drive waits for this
            // order
            state.drive_off |= emergency_stop;
        });
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
        self.with(|state| state.say(Event::Fault(text.into_string())));
        self.to_send.signal(());
    }

    /// Reports that the previous run ended in a panic with this message.
    pub fn report_panic(&self, what: &(impl Tell + ?Sized)) {
        let text = Sentence::of(what);
        warning!("the last run ended in a panic: {}", text.as_str());
        self.with(|state| state.say(Event::Panic(text.into_string())));
        self.to_send.signal(());
    }
}

impl State<'_> {
    /// Queues an event and counts those that a full queue drops.
    pub fn say(&mut self, event: Event) {
        self.counters.events_dropped += self.events.push(self.next_scan, event);
    }

    /// Reports the result of a step of the hammer, and stores its order for the coil.
    #[inline]
    pub fn tell(&mut self, outcome: &Outcome) {
        if outcome.coil.is_some() {
            self.coil = outcome.coil;
        }
        if outcome.shot.is_some() || outcome.disarmed.is_some() {
            self.tell_of_hammer(outcome);
        }
    }

    #[inline(never)]
    fn tell_of_hammer(&mut self, outcome: &Outcome) {
        if let Some(shot) = outcome.shot {
            info!("shot {} is {:?}", shot.number, shot.phase);
            match shot.phase {
                Phase::Firing => self.mark(Line::Fired),
                Phase::Listening => self.mark(Line::Trigger),
                _ => {}
            }
            self.say(Event::Shot(shot));
        }
        if let Some(reason) = outcome.disarmed {
            info!("hammer disarmed: {:?}", reason);
            self.say(Event::Disarmed(reason));
        }
    }

    /// Disarms the hammer.
    pub fn disarm(&mut self, reason: Reason) {
        let outcome = self.hammer.disarm(reason);
        self.tell(&outcome);
    }

    /// Brings everything that moves to rest: the hammer is disarmed, the shaker ramps down.
    pub fn bring_to_rest(&mut self, reason: Reason) {
        self.disarm(reason);
        let stops = self.shaker.stop(reason);
        self.tell_of_shaker(stops);
    }

    /// Queues events of the shaker.
    pub fn tell_of_shaker(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            self.say(event);
        }
    }

    /// Whether the hammer may be armed or fired.
    pub fn may_strike(&self) -> Result<(), Refusal> {
        self.may_move()?;
        if self.shaker.moves() { Err(Refusal::ShakerRuns) } else { self.is_fed(self.hammer.force_channel()) }
    }

    /// Whether the shaker may run.
    pub fn may_shake(&self) -> Result<(), Refusal> {
        self.may_move()?;
        match self.hammer.state() {
            answer::Hammer::Disarmed | answer::Hammer::HoldOff => self.is_fed(self.excitation),
            _ => Err(Refusal::HammerArmed),
        }
    }

    /// Whether any motion is allowed: the common check before arming, before a shot and before the
    /// shaker.
    pub fn may_move(&self) -> Result<(), Refusal> {
        if !self.streaming {
            return Err(Refusal::NotStreaming);
        }
        if self.emergency_stop {
            return Err(Refusal::EmergencyStop);
        }
        if !self.interlock_closed {
            return Err(Refusal::Interlock);
        }
        Ok(())
    }

    /// Acts on the present states of guard and emergency stop. Releasing the stop has no effect
    /// here: that requires a reset at the rig.
    pub fn heed(&mut self, interlock_closed: bool, pressed: bool) {
        if pressed && !self.emergency_stop {
            self.stop_everything();
        }
        if interlock_closed != self.interlock_closed {
            self.interlock_closed = interlock_closed;
            self.say(Event::Interlock(interlock_closed));
        }
        if !interlock_closed {
            self.bring_to_rest(Reason::Interlock);
        }
    }

    /// Latches the emergency stop, disarms the hammer and halts the shaker.
    pub fn stop_everything(&mut self) {
        if !self.emergency_stop {
            warning!("emergency stop");
            self.emergency_stop = true;
            self.say(Event::EmergencyStop(true));
        }
        self.disarm(Reason::EmergencyStop);
        let stops = self.shaker.halt(Reason::EmergencyStop);
        self.tell_of_shaker(stops);
        // independently of the state machines' states
        self.coil = Some(CoilOrder::Off);
        self.drive_off = true;
    }

    /// Mean of T over the last block, N.
    pub fn friction_of_last_block(&mut self, channels: usize) -> f32 {
        if self.streaming
            && let (Some(friction), Some(samples)) = (&self.friction, self.ring.newest())
        {
            self.friction_n = friction.mean_of(samples.as_chunks().0, channels);
        }
        self.friction_n
    }

    /// The event for the oldest loss of scans that has not been reported to the host.
    pub fn take_loss(&mut self) -> Option<event::Numbered> {
        let (range, why) = self.ring.take_loss()?;
        let scans = u32::try_from(range.scans).unwrap_or(u32::MAX);
        warning!("{} scans from {} were lost", scans, range.first_scan);
        let lost = Event::Lost { epoch: self.epoch, first_scan: range.first_scan, scans, why };
        Some(self.events.number(self.next_scan, lost))
    }
}

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;

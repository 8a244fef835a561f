//! Safety: what moves, what stops it, and what may start it again, in one file.
//!
//! `Safety` owns hammer and shaker and the orders for coil and drive. Its fields are private: the
//! rest of the firmware can arm, fire or shake only through the methods here, each of which asks
//! first whether motion is allowed. The state machines themselves ([`crate::hammer`],
//! [`crate::shaker`]) hold the bounds of one motion: validity, caps, limits, ramps.
//!
//! # States that forbid motion
//!
//! | state | set by | cleared by |
//! |---|---|---|
//! | emergency stop | `heed`, `stop_everything` | `poll_inputs` |
//! | guard open | `heed` | `heed` |
//! | K1 has failed | [`Relay::see`] | the board's next start |
//! | K1 is unproven | the board's start, [`Relay::see`] | [`Relay::see`] |
//! | no stream | the board's start, `end_stream` | `begin_stream` |
//! | a sensor is not fed | `take_slow` | `take_slow` |
//! | the shaker moves: no shot | `shake` | its ramp's end, `stop_everything`, `drive_ran_dry` |
//! | the hammer is armed: no shaker | `arm` | its shot, its expiry, no quiet, `disarm` |
//! | hold-off, pause of the coil | the end of a shot, a pulse (hammer.rs) | scans that pass |
//!
//! - Emergency stop: set by the button or by the host's request; cleared only at the rig, when the
//!   button is released and its key is turned. No request clears it.
//! - Guard open: a board also reports this while K1 is not sound. K1 is proven when it was seen to
//!   drop while the chain was open.
//! - No stream: set when the host ends it, when a session begins, and when an external clock fails.
//! - A sensor is fed by its constant-current supply: that of the hammer forbids shots, that of the
//!   shaker its motion.
//! - Clearing a state starts no motion: when it was set, what it forbids was brought to rest, and
//!   the next motion needs a new request.
//! - At the board's start, guard and stop count as closed and released. Hammer and shaker act only
//!   on blocks, and the inputs are read before each of them.
//!
//! # Events that end motion
//!
//! | event | noticed by | after | method |
//! |---|---|---|---|
//! | the host is silent | the task `watch` | 1 s | `check_silence` |
//! | no scans arrive | the task `watch` | 0.1 s | `check_silence` |
//! | scans are lost, converters out of step | acquisition | one block | `scans_are_lost` |
//! | the external clock fails | acquisition | one block | `clock_fails` |
//! | the drive has run dry | acquisition | at once | `drive_ran_dry` |
//! | the link is cut | reception | at once | `bring_to_rest` |
//! | a session begins, a stream begins or ends | reception | at once | `bring_to_rest` |
//!
//! The silence of the host is counted from its last valid frame (`host_was_heard`), that of the
//! front end from its last delivery, good or not (`scans_arrived`). Converters that are out of step
//! deliver no scans until they are aligned again; each delivery states how many are missing.
//!
//! # Order within a block
//!
//! 1. Inputs: K1, slow values, reset of the emergency stop, stop, guard. A stop whose button is
//!    pressed is not reset.
//! 2. Lost scans bring everything to rest before the block that follows them is evaluated.
//! 3. The hammer evaluates the block, then the shaker; then the scan index advances.
//! 4. The hammer's outcome becomes an order for the coil. It never replaces an order to switch off
//!    by a pulse: whatever gives that order has disarmed the hammer before.
//! 5. `take_orders`: the coil first; then the drive goes to rest, or else plays its codes.
//!
//! What stops both disarms the hammer before it stops the shaker; the emergency stop is latched
//! before either, and cuts coil and drive after them. The hardware of coil and drive waits for none
//! of this (docs/safety.md).
//!
//! # The relay K1
//!
//! [`Relay`] monitors whether the relay that supplies the coil's 24 V (K1) follows the guard chain.
//! Its force-guided contacts cannot contradict each other: while a power contact is welded, the
//! normally closed contact stays open (EN 61810-3). A board therefore reads that contact back. Each
//! time the chain opens, the relay must be seen to drop, or no further motion is allowed. After a
//! start it must have been seen to drop once, because its earlier state is unknown.

use embassy_time::Instant;
use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::event::{self, Event, Reason};
use jointrig_protocol::limits::{LINK_SILENCE_MS, SCAN_SILENCE_MS};
use jointrig_protocol::request::{Fire, Shake, Trigger};
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::ClockFault;

use crate::events::Events;
use crate::fmt::{info, warning};
use crate::hammer::{CoilOrder, Hammer, Outcome, Scanned};
use crate::scales::Friction;
use crate::scales::UnitsPerCode;
use crate::shaker::Shaker;
use crate::supplies::Supplies;

/// Everything that moves, and everything that forbids motion.
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own, true or not")]
pub(crate) struct Safety<'a> {
    hammer: Hammer,
    shaker: Shaker<'a>,
    /// Index of the excitation force channel.
    excitation: Option<usize>,
    supplies: Supplies,
    streaming: bool,
    interlock_closed: bool,
    emergency_stop: bool,
    /// An order for the coil that acquisition must carry out.
    coil: Option<CoilOrder>,
    /// The drive must go to rest immediately.
    drive_off: bool,
    /// Time of the last valid frame from the host.
    last_heard: Instant,
    /// Time of the last delivery of the front end.
    last_block: Instant,
    /// Index of the next scan: the time of every decision and of every event.
    next_scan: u64,
    events: Events,
    events_dropped: u32,
}

/// What the shaker made of a block.
#[derive(Clone, Copy, Default)]
pub(crate) struct Driven {
    /// Codes for the drive.
    pub codes: usize,
    /// The shaker is at rest after these codes.
    pub last: bool,
}

/// Orders that acquisition must carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Orders {
    /// For the coil.
    pub coil: Option<CoilOrder>,
    /// The drive must go to rest immediately.
    pub drive_off: bool,
}

impl<'a> Safety<'a> {
    /// Everything at rest.
    pub fn new(channels: &'a [Channel], rate_hz: u32, coil_cap_us: u32, drive_v: f32) -> Self {
        Self {
            hammer: Hammer::new(channels, rate_hz, coil_cap_us),
            shaker: Shaker::new(channels, rate_hz, drive_v),
            excitation: channels.iter().position(|channel| channel.role == Role::Excitation),
            supplies: Supplies::default(),
            streaming: false,
            // closed and released until the board reports otherwise, at the latest with the first
            // block
            interlock_closed: true,
            emergency_stop: false,
            coil: None,
            drive_off: false,
            last_heard: Instant::from_ticks(0),
            last_block: Instant::from_ticks(0),
            next_scan: 0,
            events: Events::new(),
            events_dropped: 0,
        }
    }
}

/// Permission.
impl Safety<'_> {
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

    /// Whether the hammer may be armed or fired.
    fn may_strike(&self) -> Result<(), Refusal> {
        self.may_move()?;
        if self.shaker.moves() {
            Err(Refusal::ShakerRuns)
        } else {
            self.supplies.is_fed(self.hammer.force_channel())
        }
    }

    /// Whether the shaker may run.
    fn may_shake(&self) -> Result<(), Refusal> {
        self.may_move()?;
        match self.hammer.state() {
            answer::Hammer::Disarmed | answer::Hammer::HoldOff => self.supplies.is_fed(self.excitation),
            _ => Err(Refusal::HammerArmed),
        }
    }

    /// Whether the scales may change: not while something may move based on the old ones.
    pub fn may_be_rescaled(&self) -> Result<(), Refusal> {
        match self.hammer.state() {
            answer::Hammer::Disarmed | answer::Hammer::HoldOff => {}
            _ => return Err(Refusal::HammerArmed),
        }
        if self.shaker.moves() { Err(Refusal::ShakerRuns) } else { Ok(()) }
    }

    /// Whether a stage may position hammer and laser.
    pub fn may_be_positioned(&self) -> Result<(), Refusal> {
        match self.hammer.state() {
            answer::Hammer::Waiting | answer::Hammer::Firing | answer::Hammer::Listening => {
                Err(Refusal::Busy)
            }
            _ if self.shaker.moves() => Err(Refusal::ShakerRuns),
            _ => Ok(()),
        }
    }
}

/// Motion, as the host requests it.
impl Safety<'_> {
    /// Allows one shot until `valid_ms` from now.
    pub fn arm(&mut self, valid_ms: u32) -> Result<(), Refusal> {
        self.may_strike()?;
        self.hammer.arm(self.next_scan, valid_ms)?;
        self.say(Event::Armed);
        Ok(())
    }

    /// Accepts one shot.
    pub fn fire(&mut self, order: &Fire) -> Result<(), Refusal> {
        self.may_strike()?;
        self.hammer.fire(order)
    }

    /// Lets the shaker run, or renews or changes its order.
    pub fn shake(&mut self, order: &Shake) -> Result<(), Refusal> {
        self.may_shake()?;
        let runs = self.shaker.shake(self.next_scan, order)?;
        self.say_all(runs);
        Ok(())
    }

    /// Sets the shortest pause between two pulses of the coil, ms.
    pub fn pause_for(&mut self, pause_ms: u32) {
        self.hammer.pause_for(pause_ms);
    }

    /// Sets how a shot's pulse is recognised.
    pub fn set_trigger(&mut self, trigger: Trigger) -> Result<(), Refusal> {
        self.hammer.set_trigger(trigger)
    }

    /// Uses these scales from now on, after [`Self::may_be_rescaled`] or with everything at rest.
    pub fn judge_by(&mut self, scales: &UnitsPerCode) {
        self.hammer.judge_by(scales);
        self.shaker.judge_by(scales);
    }

    /// Allows motion during a stream that begins now; nothing moves yet.
    pub fn begin_stream(&mut self) {
        self.bring_to_rest(Reason::StreamEnded);
        self.streaming = true;
    }
}

/// Stops.
impl Safety<'_> {
    /// Disarms the hammer.
    pub fn disarm(&mut self, reason: Reason) {
        let outcome = self.hammer.disarm(reason);
        self.follow(&outcome);
    }

    /// Starts the shaker's ramp to rest.
    pub fn ramp_down(&mut self, reason: Reason) {
        let stops = self.shaker.stop(reason);
        self.say_all(stops);
    }

    /// Brings everything that moves to rest: the hammer is disarmed, the shaker ramps down.
    pub fn bring_to_rest(&mut self, reason: Reason) {
        self.disarm(reason);
        self.ramp_down(reason);
    }

    /// Ends the stream, and with it all motion.
    pub fn end_stream(&mut self, reason: Reason) {
        self.bring_to_rest(reason);
        self.streaming = false;
    }

    /// Ends the stream because the scan clock cannot be relied on.
    pub fn clock_fails(&mut self, fault: ClockFault) {
        self.end_stream(Reason::Clock);
        self.say(Event::Clock(fault));
    }

    /// Stops because the front end lost scans: nothing may move without their data.
    pub fn scans_are_lost(&mut self) {
        self.bring_to_rest(Reason::FrontEnd);
    }

    /// Stops the shaker, whose drive is already at rest because its codes came too late.
    pub fn drive_ran_dry(&mut self) {
        let stops = self.shaker.halt(Reason::RanDry);
        self.say_all(stops);
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
        self.say_all(stops);
        // independently of the state machines' states
        self.coil = Some(CoilOrder::Off);
        self.drive_off = true;
    }
}

/// Guard, emergency stop, sensors.
impl Safety<'_> {
    /// Acts on the inputs as acquisition reads them with every block. `reset` is the key at the
    /// rig, which releases an emergency stop whose button is no longer pressed.
    pub fn poll_inputs(&mut self, interlock_closed: bool, pressed: bool, reset: bool) {
        if self.emergency_stop && !pressed && reset {
            self.emergency_stop = false;
            self.say(Event::EmergencyStop(false));
        }
        self.heed(interlock_closed, pressed);
    }

    /// Acts on the inputs as an interrupt read them, whatever acquisition is doing. Returns whether
    /// the caller must cut the coil's current; acquisition gets the same order.
    pub fn see_inputs(&mut self, interlock_closed: bool, pressed: bool) -> bool {
        let danger = !interlock_closed || pressed;
        self.heed(interlock_closed, pressed);
        if danger {
            // independently of the state machine's state
            self.coil = Some(CoilOrder::Off);
        }
        // also when the stop is already latched: the code that muted the drive waits for this order
        self.drive_off |= pressed;
        danger
    }

    /// Acts on the present states of guard and emergency stop. Releasing the stop has no effect
    /// here: that requires a reset at the rig.
    fn heed(&mut self, interlock_closed: bool, pressed: bool) {
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

    /// Stores the measured values. If the force sensor of the hammer is missing, the hammer is
    /// disarmed; if that of the shaker is missing, the shaker comes to rest.
    #[inline(never)]
    pub fn take_slow(&mut self, slow: Slow) {
        self.supplies.take(slow);
        if let Err(Refusal::Supply { channel, .. }) = self.supplies.is_fed(self.hammer.force_channel()) {
            self.disarm(Reason::Supply { channel });
        }
        if let Err(Refusal::Supply { channel, .. }) = self.supplies.is_fed(self.excitation) {
            self.ramp_down(Reason::Supply { channel });
        }
    }
}

/// Silence of the host and of the front end.
impl Safety<'_> {
    /// Notes a valid frame of the host.
    pub fn host_was_heard(&mut self) {
        self.last_heard = Instant::now();
    }

    /// Notes a delivery of the front end.
    #[inline]
    pub fn scans_arrived(&mut self) {
        self.last_block = Instant::now();
    }

    /// Brings everything to rest when the host or the front end has been silent for too long.
    pub fn check_silence(&mut self) {
        use answer::{Hammer, Shaker};
        let silent = Instant::now().saturating_duration_since(self.last_heard).as_millis();
        let armed = matches!(self.hammer.state(), Hammer::Armed | Hammer::Waiting | Hammer::Firing);
        let shakes = matches!(self.shaker.state(), Shaker::Slewing | Shaker::Steady);
        if (armed || shakes) && silent >= u64::from(LINK_SILENCE_MS) {
            warning!("the host is silent: everything comes to rest");
            self.bring_to_rest(Reason::LinkLost);
        }
        let blind = Instant::now().saturating_duration_since(self.last_block).as_millis();
        if (armed || shakes) && blind >= u64::from(SCAN_SILENCE_MS) {
            warning!("no scans: everything comes to rest");
            // the ramp needs the next block for its codes; without blocks the drive is already at
            // rest
            self.bring_to_rest(Reason::FrontEnd);
        }
    }
}

/// One block of acquisition, in the order of the calls.
impl Safety<'_> {
    /// Lets the hammer evaluate a block; its outcome is carried out by [`Self::follow`].
    #[inline]
    pub fn judge(&mut self, block: &impl Scanned, friction: Option<&Friction>) -> Option<Outcome> {
        // a disarmed hammer yields no outcome, which saves handling an empty one of 80 bytes
        (!self.hammer.is_disarmed()).then(|| self.hammer.block(block, friction))
    }

    /// Lets the shaker evaluate a block and write its codes.
    #[inline]
    pub fn drive(&mut self, block: &impl Scanned, codes: &mut [i16]) -> Driven {
        if !self.shaker.moves() {
            return Driven::default();
        }
        let scans = block.scans();
        let events = self.shaker.block(block, &mut codes[..scans]);
        self.say_all(events.into_iter().flatten());
        Driven { codes: scans, last: !self.shaker.moves() }
    }

    /// Advances the scan index, over delivered or lost scans.
    #[inline]
    pub fn advance(&mut self, scans: u64) {
        self.next_scan += scans;
    }

    /// Reports the result of a step of the hammer, and stores its order for the coil.
    #[inline]
    pub fn follow(&mut self, outcome: &Outcome) {
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
            self.say(Event::Shot(shot));
        }
        if let Some(reason) = outcome.disarmed {
            info!("hammer disarmed: {:?}", reason);
            self.say(Event::Disarmed(reason));
        }
    }

    /// Takes the orders that must be carried out now.
    #[inline]
    pub fn take_orders(&mut self) -> Orders {
        Orders { coil: self.coil.take(), drive_off: core::mem::take(&mut self.drive_off) }
    }
}

/// Observation.
impl<'a> Safety<'a> {
    /// The hammer, to be looked at.
    pub fn hammer(&self) -> &Hammer {
        &self.hammer
    }

    /// The shaker, to be looked at.
    pub fn shaker(&self) -> &Shaker<'a> {
        &self.shaker
    }

    /// The last measured values.
    pub fn slow(&self) -> &Slow {
        self.supplies.latest()
    }

    /// Whether the guard is closed.
    pub fn interlock_closed(&self) -> bool {
        self.interlock_closed
    }

    /// Whether the emergency stop is latched.
    pub fn emergency_stop(&self) -> bool {
        self.emergency_stop
    }

    /// Whether a stream runs.
    #[inline]
    pub fn is_streaming(&self) -> bool {
        self.streaming
    }

    /// Index of the next scan.
    #[inline]
    pub fn next_scan(&self) -> u64 {
        self.next_scan
    }
}

/// Events for the host.
impl Safety<'_> {
    /// Queues an event and counts those that a full queue drops.
    pub fn say(&mut self, event: Event) {
        self.events_dropped += self.events.push(self.next_scan, event);
    }

    fn say_all(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            self.say(event);
        }
    }

    /// Whether events wait.
    #[inline]
    pub fn has_events(&self) -> bool {
        !self.events.is_empty()
    }

    /// Takes the oldest event.
    pub fn take_event(&mut self) -> Option<event::Numbered> {
        self.events.pop()
    }

    /// Numbers an event that is sent without being queued here.
    pub fn number(&mut self, event: Event) -> event::Numbered {
        self.events.number(self.next_scan, event)
    }

    /// Drops the events of the session before; to be called after everything has come to rest.
    pub fn forget_events(&mut self) {
        self.events.begin_session();
    }

    /// Counts an event that could not be sent.
    pub fn count_dropped_event(&mut self) {
        self.events_dropped += 1;
    }

    /// Events dropped since the start.
    pub fn events_dropped(&self) -> u32 {
        self.events_dropped
    }
}

/// Longest time in which the relay may drop or pull in, µs: about 20 ms with a diode and Zener
/// diode across its coil, and the same again for bouncing contacts.
pub const WITHIN_US: u64 = 50_000;

/// RelayFault of the relay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelayFault {
    /// It has not been seen to drop since the start, or since a brief opening of the chain.
    Unproven,
    /// The chain opened and the relay did not drop: a contact is welded, or the wire of its return
    /// contact is disconnected.
    Stays,
    /// The chain closed and the relay did not pull in.
    Rests,
}

impl RelayFault {
    /// The fault, and what the operator must do.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            RelayFault::Unproven => {
                "open the guard once: K1 was not seen to drop since the start or the last opening"
            }
            RelayFault::Stays => {
                "K1 does not drop: welded, or its return contact is off. Replace it, start the board again"
            }
            RelayFault::Rests => {
                "K1 does not pull though guard and stop are closed: its coil or the chain. Start the board again"
            }
        }
    }
}

/// State of the relay, as its return contact shows it.
#[derive(Clone, Copy, Debug)]
pub struct Relay {
    chain_closed: bool,
    /// Time of the last change of the chain, µs.
    since_us: u64,
    /// Seen to drop since the chain last opened.
    proven: bool,
    failed: Option<RelayFault>,
}

impl Default for Relay {
    fn default() -> Self {
        Self::new()
    }
}

impl Relay {
    /// State after a start: unknown.
    #[must_use]
    pub const fn new() -> Self {
        Self { chain_closed: false, since_us: 0, proven: false, failed: None }
    }

    /// Evaluates the present states of chain and return contact, and returns whether motion is
    /// allowed.
    ///
    /// # Errors
    /// The fault of the relay. A failure stays until the next start.
    pub fn see(&mut self, chain_closed: bool, dropped: bool, now_us: u64) -> Result<bool, RelayFault> {
        if chain_closed != self.chain_closed {
            (self.chain_closed, self.since_us) = (chain_closed, now_us);
            if !chain_closed {
                self.proven = false;
            }
        }
        let late = now_us.saturating_sub(self.since_us) > WITHIN_US;
        self.proven |= !chain_closed && dropped;
        if self.failed.is_none() && late && chain_closed == dropped {
            self.failed = Some(if chain_closed { RelayFault::Rests } else { RelayFault::Stays });
        }
        match self.failed {
            Some(fault) => Err(fault),
            None if chain_closed && !self.proven => Err(RelayFault::Unproven),
            None => Ok(chain_closed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Name, Quantity};

    /// A hammer with its force cell, and a shaker.
    fn channels() -> [Channel; 2] {
        [Role::HammerForce, Role::Excitation].map(|role| Channel {
            name: Name::new(),
            role,
            quantity: Quantity::Force,
            units_per_volt: 1.0,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        })
    }

    #[test]
    fn a_stop_is_reset_only_with_its_button_released_and_its_key_turned() {
        let channels = channels();
        let mut safety = Safety::new(&channels, 51_200, 8_000, 10.0);
        safety.begin_stream();
        // requested by the host, with the button never pressed
        safety.stop_everything();
        assert_eq!(safety.take_orders(), Orders { coil: Some(CoilOrder::Off), drive_off: true });
        for (pressed, reset) in [(false, false), (true, false), (true, true), (false, false)] {
            safety.poll_inputs(true, pressed, reset);
            safety.begin_stream();
            assert_eq!(safety.may_move(), Err(Refusal::EmergencyStop), "{pressed}, {reset}");
        }
        safety.poll_inputs(true, false, true);
        assert_eq!(safety.may_move(), Ok(()));
        assert_eq!(safety.hammer.state(), answer::Hammer::Disarmed);
    }

    #[test]
    fn what_ends_a_stream_disarms_and_forbids_the_next_arming() {
        let channels = channels();
        let mut safety = Safety::new(&channels, 51_200, 8_000, 10.0);
        assert_eq!(safety.arm(1_000), Err(Refusal::NotStreaming));
        let ends: [fn(&mut Safety<'_>); 2] =
            [|safety| safety.end_stream(Reason::StreamEnded), |safety| safety.clock_fails(ClockFault::Lost)];
        for end in ends {
            safety.begin_stream();
            assert_eq!(safety.arm(1_000), Ok(()));
            end(&mut safety);
            assert_eq!(safety.hammer.state(), answer::Hammer::Disarmed);
            assert_eq!(safety.arm(1_000), Err(Refusal::NotStreaming));
        }
        // lost scans disarm, and forbid nothing
        safety.begin_stream();
        assert_eq!(safety.arm(1_000), Ok(()));
        safety.scans_are_lost();
        assert_eq!(safety.hammer.state(), answer::Hammer::Disarmed);
        assert_eq!(safety.arm(1_000), Ok(()));
    }

    /// Evaluates every ms of these intervals: (until ms, chain closed, dropped); returns the last
    /// verdict.
    fn after(stretches: &[(u64, bool, bool)]) -> Result<bool, RelayFault> {
        let mut relay = Relay::new();
        let (mut at, mut last) = (0, Ok(false));
        for (until, chain_closed, dropped) in stretches {
            while at < *until {
                last = relay.see(*chain_closed, *dropped, 1000 * at);
                at += 1;
            }
        }
        last
    }

    #[test]
    fn after_a_start_the_guard_must_be_opened_once() {
        assert_eq!(after(&[(10_000, true, false)]), Err(RelayFault::Unproven));
        assert_eq!(after(&[(100, false, true)]), Ok(false));
        assert_eq!(
            after(&[(100, true, false), (120, false, false), (200, false, true), (300, true, false)]),
            Ok(true)
        );
    }

    #[test]
    fn a_weld_is_found_at_the_next_opening_and_stays_found() {
        let works = [(100, false, true), (120, true, true), (1_000, true, false)];
        assert_eq!(after(&works), Ok(true));
        let welded = [&works[..], &[(1_040, false, false)]].concat();
        assert_eq!(after(&welded), Ok(false), "it may take its time");
        let welded = [&works[..], &[(1_060, false, false)]].concat();
        assert_eq!(after(&welded), Err(RelayFault::Stays));
        let closed_again = [&welded[..], &[(2_000, true, false)]].concat();
        assert_eq!(after(&closed_again), Err(RelayFault::Stays));
        // the guard opens and closes before the relay could have dropped: its state is unknown, and
        // motion is not allowed
        let shortly = [&works[..], &[(1_010, false, false), (1_500, true, false)]].concat();
        assert_eq!(after(&shortly), Err(RelayFault::Unproven));
    }

    #[test]
    fn a_relay_that_does_not_pull_is_found() {
        assert_eq!(after(&[(100, false, true), (150, true, true)]), Ok(true));
        assert_eq!(after(&[(100, false, true), (160, true, true)]), Err(RelayFault::Rests));
    }

    #[test]
    fn a_return_contact_that_is_off_is_taken_for_a_weld() {
        assert_eq!(after(&[(60, false, false)]), Err(RelayFault::Stays));
    }

    #[test]
    fn sentences_fit_an_event() {
        for fault in [RelayFault::Unproven, RelayFault::Stays, RelayFault::Rests] {
            assert!(fault.sentence().len() <= jointrig_protocol::limits::SENTENCE_BYTES);
        }
    }
}

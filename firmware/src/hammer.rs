//! The hammer's state machine: disarmed, armed, waiting, firing, listening, hold-off.
//!
//! ```text
//! Disarmed ─arm─▶ Armed ─fire─▶ Waiting ─quiet─▶ Firing ─contact─▶ Listening ─▶ HoldOff
//!    ▲              │ expires      │ expires,      │ no contact                   ▲ │
//!    ├──────────────┴──────────────┘ disarm,       └──────────────────────────────┘ │
//!    │                               not quiet                                      │
//!    └──────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! It is driven by scans only, so that a shot happens at the same place in the record regardless of
//! the executor's timing. It never accesses the coil: each block yields at most one [`CoilOrder`],
//! which the acquisition task carries out. One arming allows one shot. The pulse length is bounded
//! here, again by the board's cap, and finally by the hardware.

use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::event::Reason;
use jointrig_protocol::limits::{ARM_VALID_CAP_MS, COIL_PULSE_CAP_US};
use jointrig_protocol::request::{Fire, Trigger};
use jointrig_protocol::shot::{Phase, Shot};

use crate::pulse::Pulse;
use crate::quiet::Quiet;
use crate::ruler::{ms_of_scans, scans_in_ms};
use crate::scales::Friction;
use crate::scales::{UnitsPerCode, as_built};

/// Shortest time from the end of one pulse to the next, ms. The coil driver's own pause is slightly
/// shorter (docs/WIRING.md): a pulse within that pause would be suppressed in hardware, so the shot
/// is delayed.
pub const PAUSE_MS: u32 = 600;

/// An order for the coil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoilOrder {
    /// One pulse of this many µs, starting with the next scan.
    Pulse(u32),
    /// Switch off immediately.
    Off,
}

/// Result of one block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Order for the coil.
    pub coil: Option<CoilOrder>,
    /// A shot that reached a new phase.
    pub shot: Option<Shot>,
    /// Why the hammer disarmed.
    pub disarmed: Option<Reason>,
    /// Whether the trigger lies in this block.
    pub trigger: bool,
}

/// One block of codes, as the state machine reads it.
pub trait Scanned {
    /// Index of the first scan.
    fn first_scan(&self) -> u64;
    /// Number of scans.
    fn scans(&self) -> usize;
    /// The code of a channel in scan `scan` of the block.
    fn code(&self, scan: usize, channel: usize) -> i16;
}

#[allow(clippy::large_enum_variant, reason = "there is no heap; it is large only on a PC, with 64 channels")]
enum State {
    Disarmed,
    Armed { until: u64 },
    Waiting { until: u64, from: u64, give_up: u64, quiet: Quiet },
    Firing { contact_by: u64 },
    Listening { until: u64, pulse: Pulse },
    HoldOff { until: u64 },
}

/// The hammer's state machine.
pub struct Hammer {
    rate_hz: u32,
    cap_us: u32,
    pause_ms: u32,
    force: Option<usize>,
    units_per_code: UnitsPerCode,
    trigger: Trigger,
    state: State,
    shot: Option<Shot>,
    last_number: u32,
    /// End of the hold-off time after the last shot.
    rested_at: u64,
    /// End of the coil's pause after the last pulse.
    coil_free_at: u64,
}

impl Hammer {
    /// A disarmed hammer. The force channel is the one with the role [`Role::HammerForce`]; without
    /// one, no shot is allowed.
    pub fn new(channels: &[Channel], rate_hz: u32, cap_us: u32) -> Self {
        let force = channels.iter().position(|channel| channel.role == Role::HammerForce);
        Self {
            rate_hz,
            cap_us: cap_us.min(COIL_PULSE_CAP_US),
            pause_ms: PAUSE_MS,
            force,
            units_per_code: as_built(channels),
            trigger: Trigger {
                level_n: 1.0,
                flight_scans: rate_hz / 10,
                listen_scans: rate_hz / 5,
                hold_off_scans: rate_hz / 2,
            },
            state: State::Disarmed,
            shot: None,
            last_number: 0,
            rested_at: 0,
            coil_free_at: 0,
        }
    }

    /// Waits at least this long from the end of one pulse to the next, ms, and never less than
    /// [`PAUSE_MS`].
    pub(crate) fn pause_for(&mut self, pause_ms: u32) {
        self.pause_ms = pause_ms.max(PAUSE_MS);
    }

    /// Uses these scales from now on.
    pub(crate) fn judge_by(&mut self, scales: &UnitsPerCode) {
        self.units_per_code.clone_from(scales);
    }

    /// Its state, in the protocol's terms.
    pub fn state(&self) -> answer::Hammer {
        match self.state {
            State::Disarmed => answer::Hammer::Disarmed,
            State::Armed { .. } => answer::Hammer::Armed,
            State::Waiting { .. } => answer::Hammer::Waiting,
            State::Firing { .. } => answer::Hammer::Firing,
            State::Listening { .. } => answer::Hammer::Listening,
            State::HoldOff { .. } => answer::Hammer::HoldOff,
        }
    }

    /// Index of the force channel used.
    pub fn force_channel(&self) -> Option<usize> {
        self.force
    }

    /// Whether the hammer is disarmed; blocks are then ignored.
    #[inline]
    pub fn is_disarmed(&self) -> bool {
        matches!(self.state, State::Disarmed)
    }

    /// Remaining arming, ms.
    pub fn armed_for_ms(&self, now: u64) -> u32 {
        match self.state {
            State::Armed { until } | State::Waiting { until, .. } => {
                ms_of_scans(until.saturating_sub(now), self.rate_hz)
            }
            _ => 0,
        }
    }

    /// The last shot since the device started, of any session. Its number and all lower ones are
    /// used up, so that a message about an old shot is never taken for one about a new shot.
    pub fn shot(&self) -> Option<Shot> {
        self.shot
    }

    /// Sets how the pulse is recognised.
    ///
    /// # Errors
    /// [`Refusal::OutOfBounds`] when the level is not a positive force, a time is longer than a
    /// minute or the listening time is 0; [`Refusal::Busy`] while a shot is in progress.
    pub fn set_trigger(&mut self, trigger: Trigger) -> Result<(), Refusal> {
        if matches!(self.state, State::Waiting { .. } | State::Firing { .. } | State::Listening { .. }) {
            return Err(Refusal::Busy);
        }
        let minute = self.rate_hz.saturating_mul(60);
        let longest = trigger.flight_scans.max(trigger.listen_scans).max(trigger.hold_off_scans);
        if !(trigger.level_n.is_finite() && trigger.level_n > 0.0)
            || longest > minute
            || trigger.listen_scans == 0
        {
            return Err(crate::sentence::out_of_bounds(
                "trigger: the level must be a force above 0 N, and no time longer than a minute",
            ));
        }
        self.trigger = trigger;
        Ok(())
    }

    /// Allows one shot until `valid_ms` from now.
    ///
    /// # Errors
    /// [`Refusal::OutOfBounds`] for a time of 0 or above the cap; [`Refusal::Busy`] while a shot is
    /// in progress; [`Refusal::Unsupported`] without a force channel.
    pub fn arm(&mut self, now: u64, valid_ms: u32) -> Result<(), Refusal> {
        if self.force.is_none() {
            return Err(Refusal::Unsupported);
        }
        if valid_ms == 0 || valid_ms > ARM_VALID_CAP_MS {
            return Err(crate::sentence::out_of_bounds("arming must be valid for 1 to 60000 ms"));
        }
        match self.state {
            // arming is allowed during the hold-off time: the next shot waits for its end
            State::Disarmed | State::Armed { .. } | State::HoldOff { .. } => {
                let until = now + scans_in_ms(valid_ms, self.rate_hz);
                self.state = State::Armed { until };
                Ok(())
            }
            _ => Err(Refusal::Busy),
        }
    }

    /// Accepts one shot.
    ///
    /// # Errors
    /// [`Refusal::NotArmed`], [`Refusal::Busy`], [`Refusal::PulseOutOfBounds`],
    /// [`Refusal::ShotRepeated`], or [`Refusal::OutOfBounds`] for limits that are not finite.
    pub fn fire(&mut self, order: &Fire) -> Result<(), Refusal> {
        let until = match self.state {
            State::Armed { until } => until,
            State::Disarmed | State::HoldOff { .. } => return Err(Refusal::NotArmed),
            _ => return Err(Refusal::Busy),
        };
        if order.pulse_us == 0 || order.pulse_us > self.cap_us {
            return Err(Refusal::PulseOutOfBounds { cap_us: self.cap_us });
        }
        if order.number <= self.last_number {
            return Err(Refusal::ShotRepeated { last: self.last_number });
        }
        if order.quiet_limits.iter().any(|limit| !limit.is_finite() || *limit < 0.0)
            || order.quiet_limits.len() > self.units_per_code.len()
        {
            return Err(crate::sentence::out_of_bounds(
                "quiet limits must be finite, not negative, and no more than there are channels",
            ));
        }
        self.last_number = order.number;
        let limits =
            order.quiet_limits.iter().zip(&self.units_per_code).map(|(limit, unit)| limit / unit.abs());
        let quiet = Quiet::new(limits, order.quiet_window);
        self.shot = Some(Shot {
            number: order.number,
            phase: Phase::Waiting,
            fired_at: 0,
            trigger: 0,
            pulse_us: order.pulse_us,
            peak_n: 0.0,
            width_us: 0.0,
            rebound_ratio: 0.0,
            rebound_after: 0,
            friction_peak_n: 0.0,
            quiet_ratio: 0.0,
        });
        let from = order.not_before.max(self.rested_at).max(self.coil_free_at);
        self.state = State::Waiting {
            until,
            from,
            give_up: from.saturating_add(u64::from(order.quiet_patience)),
            quiet,
        };
        Ok(())
    }

    /// Cancels the arming and a shot whose coil is not on yet; ends an active pulse unless the
    /// reason is a mere request of the host ([`Reason::Asked`]). A bolt in flight cannot be
    /// stopped, and recording of it continues.
    pub fn disarm(&mut self, reason: Reason) -> Outcome {
        let mut outcome = Outcome::default();
        match self.state {
            State::Armed { .. } => {
                self.state = State::Disarmed;
                outcome.disarmed = Some(reason);
            }
            State::Waiting { .. } => {
                self.state = State::Disarmed;
                outcome.disarmed = Some(reason);
                outcome.shot = self.shot_is(Phase::Cancelled);
            }
            State::Firing { .. } if reason != Reason::Asked => outcome.coil = Some(CoilOrder::Off),
            _ => {}
        }
        outcome
    }

    fn shot_is(&mut self, phase: Phase) -> Option<Shot> {
        if let Some(shot) = &mut self.shot {
            shot.phase = phase;
        }
        self.shot
    }

    fn rest(&mut self, now: u64) {
        self.rested_at = now + u64::from(self.trigger.hold_off_scans);
        self.state = State::HoldOff { until: self.rested_at };
    }

    /// Processes one block.
    pub fn block(&mut self, block: &impl Scanned, friction: Option<&Friction>) -> Outcome {
        let first = block.first_scan();
        let end = first + block.scans() as u64;
        match &mut self.state {
            State::Disarmed => Outcome::default(),
            State::Armed { until } => {
                if end < *until {
                    return Outcome::default();
                }
                self.disarm(Reason::Expired)
            }
            State::HoldOff { until } => {
                if end >= *until {
                    self.state = State::Disarmed;
                }
                Outcome::default()
            }
            State::Waiting { .. } => self.wait(block, end),
            State::Firing { .. } | State::Listening { .. } => self.follow(block, friction),
        }
    }

    fn wait(&mut self, block: &impl Scanned, end: u64) -> Outcome {
        let State::Waiting { until, from, give_up, quiet } = &mut self.state else {
            return Outcome::default();
        };
        let (until, give_up) = (*until, *give_up);
        let mut calm = end >= *from && !quiet.watches();
        if quiet.watches() {
            for scan in 0..block.scans() {
                if block.first_scan() + scan as u64 >= *from
                    && let Some(verdict) = quiet.feed(&|channel| block.code(scan, channel))
                {
                    calm = verdict;
                }
            }
        }
        let ratio = quiet.ratio();
        if let Some(shot) = &mut self.shot {
            shot.quiet_ratio = ratio;
        }
        if calm {
            let pulse_us = self.shot.map_or(0, |shot| shot.pulse_us);
            // at most 8 ms, so that the product fits 32 bits up to 536 kHz
            let pulse_scans = u64::from(pulse_us * self.rate_hz / 1_000_000) + 1;
            if let Some(shot) = &mut self.shot {
                shot.fired_at = end;
            }
            self.coil_free_at =
                end + pulse_scans + u64::from(self.pause_ms) * u64::from(self.rate_hz).div_ceil(1000);
            self.state =
                State::Firing { contact_by: end + pulse_scans + u64::from(self.trigger.flight_scans) };
            return Outcome {
                coil: Some(CoilOrder::Pulse(pulse_us)),
                shot: self.shot_is(Phase::Firing),
                ..Outcome::default()
            };
        }
        if end >= until {
            return self.disarm(Reason::Expired);
        }
        if end >= give_up {
            self.state = State::Disarmed;
            return Outcome {
                shot: self.shot_is(Phase::NotQuiet),
                disarmed: Some(Reason::Expired),
                ..Outcome::default()
            };
        }
        Outcome::default()
    }

    fn follow(&mut self, block: &impl Scanned, friction: Option<&Friction>) -> Outcome {
        let mut outcome = Outcome::default();
        let Some(place) = self.force else { return outcome };
        let newtons_per_code = self.units_per_code[place];
        for scan in 0..block.scans() {
            let now = block.first_scan() + scan as u64;
            let force = f32::from(block.code(scan, place)) * newtons_per_code;
            match &mut self.state {
                State::Firing { contact_by } => {
                    let contact_by = *contact_by;
                    if force > self.trigger.level_n {
                        let mut pulse = Pulse::new(1.0 / self.rate_hz as f32);
                        pulse.feed(force);
                        self.state =
                            State::Listening { until: now + u64::from(self.trigger.listen_scans), pulse };
                        if let Some(shot) = &mut self.shot {
                            shot.trigger = now;
                        }
                        outcome.trigger = true;
                        outcome.shot = self.shot_is(Phase::Listening);
                    } else if now >= contact_by {
                        self.rest(now);
                        outcome.shot = self.shot_is(Phase::Missed);
                        outcome.disarmed = Some(Reason::Fired);
                        return outcome;
                    }
                }
                State::Listening { until, pulse } => {
                    pulse.feed(force);
                    let t = friction
                        .map_or(0.0, |friction| friction.of_scan(&|channel| block.code(scan, channel)).abs());
                    let (until, felt) = (*until, pulse.felt());
                    if let Some(shot) = &mut self.shot {
                        shot.friction_peak_n = shot.friction_peak_n.max(t);
                    }
                    if now >= until {
                        if let Some(shot) = &mut self.shot {
                            shot.peak_n = felt.peak_n;
                            shot.width_us = felt.width_s * 1e6;
                            shot.rebound_ratio = felt.rebound_ratio;
                            shot.rebound_after = felt.rebound_after;
                        }
                        self.rest(now);
                        outcome.shot = self.shot_is(Phase::Done);
                        outcome.disarmed = Some(Reason::Fired);
                        return outcome;
                    }
                }
                _ => return outcome,
            }
        }
        outcome
    }
}

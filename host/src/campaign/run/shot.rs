//! One shot: armed, fired, awaited, and cut from the stream, at scans that depend only on the shots
//! before.
//!
//! A virtual board's time stops half a ring beyond the held acknowledgement, so a request made
//! while it is held at scan `D` reaches the device before scan `D + ring/2`. Every shot ends at
//! such a decision scan `D`, which is a fixed distance from the shot's own events, and the next one
//! may begin at `D + ring/2 + MARGIN`: two runs fire at the same scans, however long host, link or
//! disk take.

use std::sync::atomic::{AtomicBool, Ordering};

use jointrig_protocol::answer::Hammer;
use jointrig_protocol::limits::ARM_VALID_CAP_MS;
use jointrig_protocol::request::{Fire, Trigger};
use jointrig_protocol::shot::{Phase, Shot};

use crate::campaign::plan::Plan;
use crate::campaign::watch::{Seen, Watchers};
use crate::device::error::DeviceError;
use crate::device::session::Session;
use crate::device::stream::Recording;

/// Scans between the furthest scan that the device can have reached and the scan requested from it.
const MARGIN: u64 = 1_024;

/// Steps per ring in which the acknowledgement follows an undecided shot.
pub(super) const STEPS_PER_RING: u64 = 8;

/// A shot fired by an earlier session ends within this time of the device, s: flight and record are
/// bounded by a minute each.
const SHOT_ENDS_S: f64 = 125.0;

/// A shot's result is known at most this many steps after its end.
const STEPS_TO_KNOW: u64 = 3;

/// Result of a shot.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The hammer hit, and this is the record.
    Recorded(Box<Recording>),
    /// The bolt did not arrive.
    Missed {
        /// The shot.
        shot: Shot,
        /// Scans lost while the bolt should have arrived: if there are any, it is unknown whether
        /// it did.
        lost: u64,
    },
    /// The structure did not become quiet in time; the coil stayed off.
    NotQuiet(Shot),
    /// The device cancelled the shot (arming expired, link lost, interlock, emergency stop).
    Cancelled(Shot),
    /// A person struck before the structure was at rest after the previous hit.
    TooEarly {
        /// The record.
        recording: Box<Recording>,
        /// The channel that moved most.
        place: usize,
        /// Ratio of its motion to its limit.
        ratio: f64,
    },
    /// Nobody struck in time.
    NobodyStruck,
    /// The user requested a stop; the shot was cancelled.
    Interrupted,
}

/// Residual motion below which a shot is released, per channel in its unit (rms); 0 excludes a
/// channel.
pub type QuietLimits = Vec<f32>;

/// Fires shots on a running stream.
pub struct Shooter {
    pub(super) ring: u64,
    epoch: u32,
    pub(super) pre: u64,
    pub(super) post: u64,
    pub(super) rate_hz: f64,
    pub(super) trigger: Trigger,
    window: u16,
    patience: u64,
    pub(super) number: u32,
    pub(super) ready_at: u64,
}

impl Shooter {
    /// Configures the device for the plan's hits. `epoch` is that of the running stream.
    ///
    /// # Errors
    /// The device refuses or is disconnected.
    pub fn new(session: &mut Session, plan: &Plan, epoch: u32) -> Result<Self, DeviceError> {
        let (record, settle, times) = (plan.record.get_ref(), plan.settle.get_ref(), plan.trigger.get_ref());
        let rate_hz = f64::from(record.rate_hz);
        let scans = |seconds: f64| (seconds * rate_hz).round() as u32;
        let trigger = Trigger {
            level_n: times.level_n,
            flight_scans: scans(times.flight_s),
            listen_scans: scans(times.listen_s),
            hold_off_scans: scans(times.hold_off_s),
        };
        let number = Self::last_number(session, rate_hz)?;
        session.set_trigger(trigger)?;
        session.hold_acknowledgement(Some(session.expected()?));
        Ok(Self {
            ring: session.ring_scans(),
            epoch,
            pre: u64::from(record.pre_trigger_scans),
            post: plan.post_trigger_scans(),
            rate_hz,
            trigger,
            window: settle.window_samples,
            patience: u64::from(scans(settle.bound_s)),
            number,
            ready_at: 0,
        })
    }

    /// The number of the last shot since the device started: shots of this session have larger
    /// ones. Waits until a shot that an earlier session fired is over, because the device is busy
    /// until then.
    fn last_number(session: &mut Session, rate_hz: f64) -> Result<u32, DeviceError> {
        let begin = session.expected()?;
        loop {
            let status = session.status()?;
            let fires = matches!(status.hammer, Hammer::Waiting | Hammer::Firing | Hammer::Listening);
            let now = session.expected()?;
            if !fires || now.saturating_sub(begin) > (SHOT_ENDS_S * rate_hz) as u64 {
                return Ok(status.shot.map_or(0, |shot| shot.number));
            }
            session.wait_for(now + (session.ring_scans() / STEPS_PER_RING).max(1))?;
        }
    }

    /// The first scan at which the next shot may be fired or awaited: `ready_at`, unless more than
    /// a ring of scans has passed since then. That happens if nothing holds the device and the host
    /// stalled; a virtual board never runs on that long.
    pub(super) fn begin(&self, session: &mut Session) -> Result<u64, DeviceError> {
        if session.expected()? <= self.ready_at.saturating_add(self.ring) {
            return Ok(self.ready_at);
        }
        Ok(session.status()?.next_scan.max(self.ready_at))
    }

    /// Hammer and laser are in place from `at_scan` on, and the acknowledgement was held at or
    /// before it when that was requested: the next shot may begin at a fixed distance from it.
    pub fn staged(&mut self, at_scan: u64) {
        self.ready_at = at_scan + self.ring / 2 + MARGIN;
    }

    /// Fires once and waits for the result. The acknowledgement is held when this returns.
    ///
    /// # Errors
    /// The device refuses or is disconnected.
    pub fn shoot(
        &mut self,
        session: &mut Session,
        pulse_us: u32,
        quiet: &QuietLimits,
        stop: &AtomicBool,
        watch: &Watchers,
    ) -> Result<Outcome, DeviceError> {
        self.number += 1;
        let not_before = self.begin(session)?;
        let last = not_before + self.patience + self.flight(pulse_us);
        // arming lasts just longer than everything that the shot may wait for
        let wait = (last + self.ring).saturating_sub(session.expected()?);
        let valid_ms = (wait as f64 / self.rate_hz * 1000.0) as u32 + 1_000;
        session.arm(valid_ms.min(ARM_VALID_CAP_MS))?;
        session.fire(Fire {
            number: self.number,
            pulse_us,
            not_before,
            quiet_limits: quiet.iter().copied().take(jointrig_protocol::limits::CHANNEL_CAPACITY).collect(),
            quiet_window: if quiet.iter().any(|limit| *limit > 0.0) { self.window } else { 0 },
            quiet_patience: self.patience as u32,
        })?;
        let step = (self.ring / STEPS_PER_RING).max(1);
        let rest = STEPS_TO_KNOW * step + u64::from(self.trigger.hold_off_scans) + MARGIN;
        let mut reach = not_before + step;
        let shot = loop {
            session.hold_acknowledgement(Some(reach));
            let number = self.number;
            let decided =
                |session: &Session| session.shot().filter(|shot| shot.number == number && is_decided(shot));
            session
                .wait_until(reach, |session| stop.load(Ordering::Relaxed) || decided(session).is_some())?;
            // an event may be lost, so query the status
            let known = match decided(session) {
                Some(shot) => Some(shot),
                None => session.status()?.shot.filter(|shot| shot.number == number),
            };
            match known {
                Some(shot) if is_decided(&shot) => break shot,
                Some(shot) if stop.load(Ordering::Relaxed) && shot.phase == Phase::Waiting => {
                    session.disarm()?;
                    return Ok(Outcome::Interrupted);
                }
                // long overdue: the device has forgotten the shot
                _ if reach > last + self.ring => {
                    break Shot { phase: Phase::Cancelled, ..no_shot(number, pulse_us) };
                }
                _ => {}
            }
            let expected = session.expected()?;
            if expected > reach + self.ring {
                // the host stalled: the scan to wait for has already passed
                reach = expected;
            }
            if expected >= reach {
                reach += step;
            }
            session.forget_before(reach.saturating_sub(self.pre + 5 * step));
        };
        let decision = match shot.phase {
            Phase::Missed => shot.fired_at + self.flight(pulse_us) + rest,
            Phase::NotQuiet => not_before + self.patience + rest,
            Phase::Cancelled => reach + rest,
            _ => shot.trigger + self.post.max(u64::from(self.trigger.listen_scans) + rest),
        };
        if matches!(shot.phase, Phase::Listening | Phase::Done) {
            watch.saw(&Seen::Recording);
        }
        session.hold_acknowledgement(Some(decision));
        session.wait_for(decision)?;
        self.ready_at = decision + self.ring / 2 + MARGIN;
        let outcome = match shot.phase {
            Phase::Missed => {
                let flight = shot.fired_at..shot.fired_at + self.flight(pulse_us);
                Outcome::Missed { shot, lost: session.lost_in(&flight) }
            }
            Phase::NotQuiet => Outcome::NotQuiet(shot),
            Phase::Cancelled => Outcome::Cancelled(shot),
            _ => Outcome::Recorded(Box::new(self.collect_shot(session, &shot)?)),
        };
        session.forget_before(decision.saturating_sub(self.pre));
        Ok(outcome)
    }

    /// Cuts the record of `shot`, whose last scan has arrived, and fetches its final summary.
    fn collect_shot(&self, session: &mut Session, shot: &Shot) -> Result<Recording, DeviceError> {
        let is_final = |known: &Shot| known.number == shot.number && known.phase == Phase::Done;
        let summary = match session.shot().filter(is_final) {
            Some(known) => known,
            None => session.status()?.shot.filter(is_final).unwrap_or(*shot),
        };
        self.collect(session, &Shot { trigger: shot.trigger, ..summary })
    }

    /// Cuts the record of a hit whose last scan has arrived.
    pub(super) fn collect(&self, session: &Session, shot: &Shot) -> Result<Recording, DeviceError> {
        let first_scan = shot.trigger.saturating_sub(self.pre);
        let (samples, gaps) = session.cut(first_scan..shot.trigger + self.post)?;
        Ok(Recording {
            epoch: self.epoch,
            first_scan,
            trigger_index: (shot.trigger - first_scan) as usize,
            samples,
            gaps,
            shot: *shot,
        })
    }

    /// Scans from the start of the coil pulse until the bolt counts as lost.
    fn flight(&self, pulse_us: u32) -> u64 {
        (f64::from(pulse_us) * 1e-6 * self.rate_hz).ceil() as u64 + u64::from(self.trigger.flight_scans)
    }
}

/// Whether the shot's result is known.
fn is_decided(shot: &Shot) -> bool {
    match shot.phase {
        Phase::Waiting | Phase::Firing => false,
        Phase::Listening | Phase::Done => shot.trigger > 0,
        Phase::Missed | Phase::NotQuiet | Phase::Cancelled => true,
    }
}

pub(super) fn no_shot(number: u32, pulse_us: u32) -> Shot {
    Shot {
        number,
        phase: Phase::Waiting,
        fired_at: 0,
        trigger: 0,
        pulse_us,
        peak_n: 0.0,
        width_us: 0.0,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    }
}

//! The shaker's levels: the device controls each to its amplitude; it is recorded in steady state
//! and stored, and the shaker then ramps down to rest.
//!
//! The shaker moves only as long as a host requests it: an order is valid for ten seconds of the
//! device's clock and is renewed every three (`order`); an interrupt, an error and the end of the
//! session bring the shaker to rest. Levels that are already in the file are skipped, so an
//! interrupted run is resumed by running it again. [`ChannelLimits`] are the values above which the
//! device stops the shaker itself.
//!
//! A level is recorded once [`Meter`] reads the ordered amplitude in several windows in a row
//! ([`is_settled`]). In a sweep, the frequency changes in small steps with continuous phase; its
//! record spans from rest to rest, so that the ratio of its spectra is the structure's FRF,
//! independent of the sweep rate and of the steps.
//!
//! [`wear`] is a run of many cycles, each of which is reduced and stored.
//!
//! [`record()`] turns a stored level into a hysteresis record: only scales, sums and delays are
//! applied.

use super::answers::Edits;
use super::pulse::with_sensors;
use super::stage::same_or_accepted;
use crate::campaign::plan::level::{Held, Level, Moment};
use crate::campaign::plan::{Cell, Plan};
use crate::campaign::store::Store;
use crate::campaign::store::is_simulated_board;
use crate::campaign::store::level_table::{LevelRow, NewLevel, Settled};
use crate::campaign::store::session_table::SessionInfo;
use crate::campaign::store::stored::Hex;
use crate::campaign::watch::{Seen, Shaking, Watchers};
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::session::Session;
use crate::hysteresis::record::in_step;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};
use jointrig_protocol::answer::Info;
use jointrig_protocol::channel::{Channel, Quantity, Role};
use jointrig_protocol::request::{Configuration, Stage as StageRequest};
use num_complex::Complex;
use order::Orders;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub use error::{ShakeError, Shortfall};

mod error;
mod order;
pub mod wear;

/// Longest settling time of a level, s of the device's clock.
const SETTLE_BOUND_S: f64 = 40.0;

/// Rest between two levels, s.
const PAUSE_S: f64 = 0.3;

/// Minimum number of cycles in a record.
const FEWEST_CYCLES: f64 = 20.0;

/// Result of one level.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// It was in the file already.
    Known(LevelRow),
    /// It was measured and stored.
    Stored(LevelRow),
    /// The shaker does not reach it; the other levels may still be measured.
    Short(Level, Shortfall),
}

/// How a run ended.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Result of each level that was started, in order.
    pub outcomes: Vec<Outcome>,
    /// Whether the user ended it early.
    pub interrupted: bool,
}

/// Measures the missing levels. `tell` is called for each level when it begins (with `None`) and
/// when it is over.
///
/// # Errors
/// File or device failed, the device does not fit, or the shaker was stopped; the levels before
/// that are in the file.
pub fn run(
    store: &mut Store,
    session: &mut Session,
    options: &LevelOptions,
    tell: &mut dyn FnMut(&Store, &Level, Option<&Outcome>),
) -> Result<Summary, ShakeError> {
    run_watched(store, session, options, &Onlookers::default(), tell)
}

/// As [`run`], with observers.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    store: &mut Store,
    session: &mut Session,
    options: &LevelOptions,
    onlookers: &Onlookers,
    tell: &mut dyn FnMut(&Store, &Level, Option<&Outcome>),
) -> Result<Summary, ShakeError> {
    let known = store.levels()?;
    let Begun { plan, info, channels, session_id: id, epoch } = begin(store, session, options, onlookers)?;
    let load_cells = plan.load_cells(&channels);
    let info = &info;
    let channels = &channels;
    let mut bench = Bench { session, channels, load_cells, info, options, onlookers, session_id: id, epoch };
    let mut outcomes = Vec::new();
    let mut walked = Ok(());
    for level in &options.levels {
        if let Some(edits) = &onlookers.edits {
            edits.work_off(store)?;
        }
        if options.stop.load(Ordering::Relaxed) {
            break;
        }
        let there = |row: &&LevelRow| row.moment == options.moment && row.level().same(level) && row.whole();
        let outcome = if let Some(row) = known.iter().flatten().find(there) {
            Ok(Outcome::Known(row.clone()))
        } else {
            tell(store, level, None);
            if plan.sync.is_some() {
                // marks the start of a level
                bench.session.pulse_output()?;
            }
            let outcome = bench.measure(store, level);
            if outcome.is_ok()
                && let Some(celsius) = bench.session.temperature_c()?
            {
                store.note_temperature(id, celsius)?;
            }
            if plan.sync.is_some() {
                store.note_edges(id, &bench.session.edges())?;
            }
            bench.over(&outcome);
            outcome
        };
        match outcome {
            Ok(outcome) => {
                tell(store, level, Some(&outcome));
                outcomes.push(outcome);
            }
            Err(ShakeError::Interrupted) => break,
            Err(error) => {
                walked = Err(error);
                break;
            }
        }
    }
    // of two errors the first one is returned; a shaker whose device is disconnected comes to rest
    // by itself
    let rested = bench.come_to_rest();
    let ended = bench.session.finish();
    onlookers.watch.saw(&Seen::Ended);
    walked?;
    rested?;
    ended?;
    Ok(Summary { outcomes, interrupted: options.stop.load(Ordering::Relaxed) })
}

/// A session that is noted in the file and whose stream runs, with the assembly on the table.
struct Begun {
    plan: Plan,
    info: Info,
    /// Those of [`Plan::along_sliding`].
    channels: ChannelMap,
    session_id: i64,
    epoch: u32,
}

/// Checks that the device fits, notes the session, and starts the stream.
fn begin(
    store: &mut Store,
    session: &mut Session,
    options: &LevelOptions,
    onlookers: &Onlookers,
) -> Result<Begun, ShakeError> {
    let plan = store.plan()?;
    let info = session.info()?;
    let device = session.channels(&info)?;
    let address = session.address().to_owned();
    let unfit = |what| ShakeError::Unfit { address: address.clone(), what };
    let (planned, remarks) = with_sensors(&plan, &device).map_err(unfit)?;
    let channels = plan.along_sliding(store.calibrated(store.next_session()?, planned.clone())?);
    error::check_fit(&address, &info, &channels, options)?;
    let accepted = options.new_structure;
    let changed =
        same_or_accepted(store, &info, session.simulated(), accepted, ShakeError::AnotherStructure)?;
    session.calibrate(&device, &channels)?;
    let sync = plan.clock().map(|clock| session.take_clock(clock)).transpose()?;
    let noted = SessionInfo {
        address,
        board: info.board.as_str().into(),
        serial: info.serial.as_str().into(),
        firmware_version: info.version.as_str().into(),
        target: info.target.as_str().into(),
        build: Hex(info.build),
        schema_hash: Hex(session.hello().schema),
    };
    let session_id = store.begin_session(&noted, &planned)?;
    sync.iter().try_for_each(|sync| store.note_clock(session_id, sync))?;
    changed.iter().try_for_each(|what| store.note_another_structure(what))?;
    remarks.iter().try_for_each(|remark| store.log(remark))?;
    if let Some(simulated) = session.simulated() {
        store.note_simulated(simulated)?;
    }
    let (epoch, _) = session.start(&channels)?;
    let simulated = is_simulated_board(&info.board);
    onlookers.watch.saw(&Seen::Stream { channels: &channels, simulated });
    if info.stage {
        assemble(session, &plan)?;
    }
    Ok(Begun { plan, info, channels, session_id, epoch })
}

/// The first channel at the contact with a code at the end of its range in these scans.
fn clipped(channels: &ChannelMap, samples: &Samples, scans: Range<usize>) -> Option<String> {
    let at_contact = |place: &usize| {
        matches!(channels.channels[*place].role, Role::SpecimenA | Role::SpecimenB | Role::LoadCell)
    };
    let full = |place: &usize| {
        let own = samples.channel(*place).part(scans.start, scans.end);
        own.at_the_ends(channels.channels[*place].bits) > 0
    };
    (0..channels.len()).filter(at_contact).find(full).map(|place| channels.channels[place].name.to_string())
}

/// Selects the assembly, its joint closed, on a virtual rig.
fn assemble(session: &mut Session, plan: &Plan) -> Result<(), ShakeError> {
    let cells = plan.cells();
    let joined = |cell: &&Cell| cell.configuration == Configuration::Ajb && !plan.opens_joint(cell);
    let Some(cell) = cells.iter().find(joined) else {
        return Err(ShakeError::NoAssembly);
    };
    let name = |text: &String| {
        text.as_str().try_into().map_err(|_| ShakeError::Unfit {
            address: "the device".into(),
            what: format!("the point's name `{text}` is too long for it"),
        })
    };
    let (impact, response) = (name(&cell.impact)?, name(&cell.response)?);
    let stage = StageRequest { configuration: Configuration::Ajb, impact, response, attempt: 0 };
    session.stage(stage)?;
    session.hold_acknowledgement(None);
    Ok(())
}

/// Context shared by all levels.
struct Bench<'a> {
    session: &'a mut Session,
    channels: &'a ChannelMap,
    load_cells: Vec<(usize, f64)>,
    info: &'a Info,
    options: &'a LevelOptions,
    onlookers: &'a Onlookers,
    session_id: i64,
    epoch: u32,
}

/// The recorded range, and how the level reached its amplitude.
struct Taken {
    first_scan: u64,
    scans: u64,
    settled: Settled,
}

impl Bench<'_> {
    fn rate_hz(&self) -> f64 {
        f64::from(self.channels.rate_hz)
    }

    /// Notifies the observers of a level's result.
    fn over(&self, outcome: &Result<Outcome, ShakeError>) {
        let (recorded, say) = match outcome {
            Ok(Outcome::Stored(row) | Outcome::Known(row)) => {
                let level = row.level();
                (true, format!("{level}: recorded at {}", level.held.show(row.reached)))
            }
            Ok(Outcome::Short(level, why)) => (false, format!("{level}: {why}")),
            Err(error) => (false, error.to_string()),
        };
        self.onlookers.watch.saw(&Seen::LevelOver { recorded, say: &say });
        self.onlookers.watch.saw(&Seen::Link(self.session.accounts()));
    }

    /// Drives, records and stores the level, and comes to rest.
    fn measure(&mut self, store: &mut Store, level: &Level) -> Result<Outcome, ShakeError> {
        let taken = match self.take(level) {
            Ok(taken) => taken,
            Err(ShakeError::Short(shortfall)) => {
                self.come_to_rest()?;
                store.log(&format!("shaker, {}, {level}: {shortfall}", self.options.moment.name()))?;
                return Ok(Outcome::Short(*level, shortfall));
            }
            Err(error) => {
                // the first error is the one to report
                drop(self.come_to_rest());
                return Err(error);
            }
        };
        self.come_to_rest()?;
        let first_scan = taken.first_scan;
        // the ramp down to rest is part of a sweep's record
        let end = if level.end_hz.is_some() { self.session.expected()? } else { first_scan + taken.scans };
        let (samples, gaps) = self.session.cut(first_scan..end)?;
        let new = NewLevel {
            session: self.session_id,
            moment: self.options.moment,
            level: *level,
            settled: taken.settled,
            epoch: self.epoch,
            first_scan,
            samples,
            gaps,
        };
        let id = store.insert_level(&new)?;
        let stored = store.levels()?.into_iter().flatten().find(|row| row.id == id);
        Ok(Outcome::Stored(stored.ok_or(ShakeError::Lost(id))?))
    }

    fn take(&mut self, level: &Level) -> Result<Taken, ShakeError> {
        let (options, onlookers) = (self.options, self.onlookers);
        let mut orders = Orders::new(self.channels, self.info, level, options);
        let (limits, most_drive_v) = (options.limits.of(self.channels), orders.most_drive_v());
        let load_cells = &self.load_cells;
        onlookers.watch.saw(&Seen::Level { level, limits: &limits, most_drive_v, load_cells });
        let before = self.session.expected()?;
        let begun = orders.begin(self.session)?;
        let meter = Meter::new(self.channels, level.held, level.frequency_hz);
        let window = meter.window_scans();
        let mut amplitudes: Vec<f64> = Vec::new();
        let mut at = begun;
        let target = (level.held != crate::campaign::plan::level::Held::Drive).then_some(level.amplitude);
        while !is_settled(&amplitudes, target) {
            if (at - begun) as f64 > SETTLE_BOUND_S * self.rate_hz() {
                let last = &amplitudes[amplitudes.len().saturating_sub(SETTLED_WINDOWS)..];
                return Err(ShakeError::Short(Shortfall::NeverSettled {
                    seconds: SETTLE_BOUND_S,
                    least: last.iter().copied().fold(f64::INFINITY, f64::min) / level.amplitude,
                    most: last.iter().copied().fold(0.0, f64::max) / level.amplitude,
                }));
            }
            orders.go_on(self.session, at + window)?;
            let (samples, gaps) = self.session.cut(at..at + window)?;
            at += window;
            if gaps.is_empty() {
                let amplitude = meter.amplitude(&samples);
                amplitudes.push(amplitude);
                onlookers.watch.saw(&Seen::Shaking(Shaking {
                    at_s: (at - begun) as f64 / self.rate_hz(),
                    amplitude,
                    drive_v: f64::from(self.session.status()?.drive_v),
                    settled: is_settled(&amplitudes, target),
                    samples: &samples,
                }));
            }
            if level.end_hz.is_none() {
                self.session.forget_before(at);
            }
        }
        let largest = amplitudes.iter().copied().fold(0.0, f64::max);
        let after_s = (at - begun) as f64 / self.rate_hz();
        let drive_v = f64::from(self.session.status()?.drive_v);
        if let Some(end_hz) = level.end_hz {
            let last = amplitudes.last().copied().unwrap_or(0.0);
            let settled = Settled { reached: last, overshoot: largest / level.amplitude, after_s, drive_v };
            go(self.session, &mut orders, [level.frequency_hz, end_hz], options.sweep_hz_per_s)?;
            return Ok(Taken { first_scan: before, scans: 0, settled });
        }
        let cycles = (options.seconds * level.frequency_hz).ceil().max(FEWEST_CYCLES);
        // one scan more than the cycles take, so that whole cycles can be cut
        let scans = (cycles * self.rate_hz() / level.frequency_hz).ceil() as u64 + 1;
        orders.go_on(self.session, at + scans)?;
        orders.still_runs(self.session)?;
        let (samples, _) = self.session.cut(at..at + scans)?;
        if let Some(channel) = clipped(self.channels, &samples, 0..samples.scans()) {
            return Err(ShakeError::Short(Shortfall::Clipped { channel }));
        }
        let moved = meter.amplitude(&samples);
        // the meter measures the motion; with an open-loop drive the reached amplitude is that of
        // the drive
        let reached = if target.is_some() { moved } else { drive_v };
        if let Some(target) = target
            && (reached / target - 1.0).abs() > WITHIN
        {
            return Err(ShakeError::Short(Shortfall::Strayed { ratio: reached / target }));
        }
        let settled = Settled { reached, overshoot: largest / target.unwrap_or(moved), after_s, drive_v };
        Ok(Taken { first_scan: at, scans, settled })
    }

    /// Brings the shaker to rest, and waits until the structure is at rest too.
    fn come_to_rest(&mut self) -> Result<(), ShakeError> {
        self.session.rest()?;
        self.session.hold_acknowledgement(None);
        let pause = (PAUSE_S * self.rate_hz()) as u64;
        let until = self.session.status()?.next_scan + 20 * pause;
        loop {
            let next = self.session.expected()? + pause;
            self.session.wait_for(next)?;
            if self.session.shaker_rests()? {
                break;
            }
            if next > until {
                return Err(ShakeError::DoesNotRest { address: self.session.address().into() });
            }
        }
        // discard the stop event, which is expected here
        let _ = self.session.shaker_stopped();
        let next = self.session.status()?.next_scan + pause;
        Ok(self.session.wait_for(next)?)
    }
}

/// Shortest window, s.
const WINDOW_S: f64 = 0.1;

/// Minimum number of cycles in a window.
const WINDOW_CYCLES: f64 = 3.0;

/// Number of consecutive windows that must agree.
pub const SETTLED_WINDOWS: usize = 6;

/// Relative deviation of each window from the ordered amplitude.
pub const WITHIN: f64 = 0.02;

/// Relative deviation of the later half's mean from the earlier half's.
const DRIFT: f64 = 0.01;

/// The criterion for settled, as text.
pub const CRITERION: &str = "settled: six windows of 0.1 s in a row within 2 % of the order, the second half of them within 1 % \
    of the first";

/// Whether the last windows satisfy the criterion. Without a target (open-loop drive) they must
/// agree with each other.
pub fn is_settled(amplitudes: &[f64], target: Option<f64>) -> bool {
    let Some(from) = amplitudes.len().checked_sub(SETTLED_WINDOWS) else { return false };
    let last = &amplitudes[from..];
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let level = target.unwrap_or_else(|| mean(last));
    let (early, late) = last.split_at(SETTLED_WINDOWS / 2);
    level > 0.0
        && last.iter().all(|a| (a / level - 1.0).abs() < WITHIN)
        && (mean(late) - mean(early)).abs() < DRIFT * level
}

/// One term of the measured quantity.
struct Term {
    /// Index in the scan.
    place: usize,
    channel: Channel,
    /// From the channel's SI unit to that of the quantity.
    gain: f64,
    /// Phase correction for the channel's delay, rad.
    phase: f64,
}

/// A lock-in amplifier for the controlled quantity.
pub struct Meter {
    terms: Vec<Term>,
    frequency_hz: f64,
    turn_per_scan: f64,
    cycle_scans: f64,
}

impl Meter {
    /// Creates a meter for these channels ([`Plan::along_sliding`]); with an open-loop drive, it
    /// measures the specimens' relative displacement to determine whether the structure has
    /// settled.
    pub fn new(channels: &ChannelMap, held: Held, frequency_hz: f64) -> Self {
        let omega = TAU * frequency_hz;
        let term = |role: Role, gain: f64| {
            channels.place(role).map(|place| {
                let channel = channels.channels[place].clone();
                let phase = omega * (f64::from(channel.delay_ns) * 1e-9);
                Term { place, channel, gain, phase }
            })
        };
        let terms = match held {
            Held::Force => vec![term(Role::Excitation, 1.0)],
            Held::Displacement | Held::Drive => {
                vec![term(Role::SpecimenA, 1.0 / omega), term(Role::SpecimenB, -1.0 / omega)]
            }
        };
        let rate_hz = channels.fs_hz();
        Self {
            terms: terms.into_iter().flatten().collect(),
            frequency_hz,
            turn_per_scan: omega / rate_hz,
            cycle_scans: rate_hz / frequency_hz,
        }
    }

    /// Scans of one window: whole cycles, rounded to scans.
    pub fn window_scans(&self) -> u64 {
        let cycles = (WINDOW_S * self.frequency_hz).ceil().max(WINDOW_CYCLES);
        (cycles * self.cycle_scans).round() as u64
    }

    /// The amplitude over the whole cycles in these samples: m for velocities, N for a force.
    pub fn amplitude(&self, samples: &Samples) -> f64 {
        let scans = samples.scans();
        let cycles = (scans as f64 / self.cycle_scans).floor();
        let whole = ((cycles * self.cycle_scans).round() as usize).min(scans);
        let sum: Complex<f64> = self
            .terms
            .iter()
            .map(|Term { place, channel, gain, phase }| {
                let own = samples.channel(*place);
                let mut values = Vec::new();
                own.scaled(1.0, &mut values);
                let mean = values[..whole].iter().sum::<f64>() / whole.max(1) as f64;
                let tone: Complex<f64> = (0..whole)
                    .map(|scan| Complex::cis(-self.turn_per_scan * scan as f64) * (values[scan] - mean))
                    .sum();
                Complex::from_polar(gain * own.of().units(channel), *phase) * tone
            })
            .sum();
        2.0 * sum.norm() / whole.max(1) as f64
    }
}

/// Why a level's channels do not yield a hysteresis record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("its session has no {0}")]
pub struct Unusable(&'static str);

/// v_A, v_B and the load cells' sum, aligned in time; `channels` are those of
/// [`Plan::along_sliding`], and `cells` [`Plan::load_cells`].
///
/// # Errors
/// A channel is missing.
pub fn record(
    channels: &ChannelMap,
    cells: &[(usize, f64)],
    samples: &Samples,
    level: &Level,
) -> Result<HysteresisRecord, Unusable> {
    let velocity = |role: Role, name: &'static str| {
        channels
            .place(role)
            .filter(|place| channels.channels[*place].quantity == Quantity::Velocity)
            .ok_or(Unusable(name))
    };
    let a = velocity(Role::SpecimenA, "velocity of specimen A")?;
    let b = velocity(Role::SpecimenB, "velocity of specimen B")?;
    let (first, _) = *cells.first().ok_or(Unusable("load cell along the sliding direction"))?;
    let late = |place: usize| f64::from(channels.channels[place].delay_ns) * 1e-9;
    let fs_hz = channels.fs_hz();
    let signals = [&[(a, 1.0)][..], &[(b, 1.0)], cells].map(|places| sum(channels, samples, places));
    // all load cells share one amplifier and have the same delay
    let [a_m_per_s, b_m_per_s, force_n] = in_step(signals, [late(a), late(b), late(first)], fs_hz);
    Ok(HysteresisRecord {
        fs_hz,
        motion: RelativeMotion::Velocity { a_m_per_s, b_m_per_s },
        force_n,
        excitation_hz: level.end_hz.is_none().then_some(level.frequency_hz),
        normal_load_n: None,
    })
}

/// Samples converted per step, so that a sum of channels stays in the core's cache.
const CHUNK: usize = 1 << 14;

/// The sum of these channels in SI units, each weighted by its factor, computed on all cores.
fn sum(channels: &ChannelMap, samples: &Samples, places: &[(usize, f64)]) -> Vec<f64> {
    let Some((first, _)) = places.first() else { return Vec::new() };
    let mut sum = vec![0.0; samples.channel(*first).len()];
    sum.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sum)| {
        for (n, (place, part)) in places.iter().enumerate() {
            let Some(channel) = channels.channels.get(*place) else { continue };
            let own = samples.channel(*place).part(chunk * CHUNK, (chunk + 1) * CHUNK);
            let scale = own.of().units(channel) * part;
            if n == 0 {
                // write without reading: reading fresh memory before the first write maps each page
                // twice, with an interrupt to every core
                own.put(sum, |sum, sample| *sum = 0.0 + sample * scale);
            } else {
                own.put(sum, |sum, sample| *sum += sample * scale);
            }
        }
    });
    sum
}

/// Time at one frequency, s: the device's lock-in measures over 80 ms and restarts with each order.
const STEP_S: f64 = 0.12;

/// Sweeps from the first to the last frequency (Hz) at `hz_per_s`.
///
/// # Errors
/// The user interrupts, the shaker stopped, or the device is disconnected.
pub fn go(
    session: &mut Session,
    orders: &mut Orders,
    [first_hz, last_hz]: [f64; 2],
    hz_per_s: f64,
) -> Result<(), ShakeError> {
    let rate_hz = orders.rate_hz();
    let steps = ((last_hz - first_hz).abs() / (hz_per_s * STEP_S)).ceil().max(1.0) as u64;
    let begun = session.expected()?;
    for step in 1..=steps {
        orders.tune(session, first_hz + (last_hz - first_hz) * step as f64 / steps as f64)?;
        orders.go_on(session, begun + (step as f64 * STEP_S * rate_hz) as u64)?;
    }
    Ok(())
}

/// Fraction of full scale at which load cells and excitation stop the shaker. The vibrometers do
/// not stop it: they briefly exceed their range when a contact slips, and the device controls the
/// quantity that they measure.
const OF_FULL_SCALE: f64 = 0.95;

/// How levels are measured.
#[derive(Clone, Debug)]
pub struct LevelOptions {
    /// The levels, in order.
    pub levels: Vec<Level>,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// Shortest record, s; it is extended to whole cycles, at least twenty.
    pub seconds: f64,
    /// Rate of a sweep, Hz/s.
    pub sweep_hz_per_s: f64,
    /// The drive's largest amplitude, V; its full scale if absent.
    pub most_drive_v: Option<f64>,
    /// Limits that stop the shaker.
    pub limits: ChannelLimits,
    /// Continue even if device or rig indicate another structure than that of the file's records.
    pub new_structure: bool,
    /// Set to bring the shaker to rest and end the run.
    pub stop: Arc<AtomicBool>,
}

/// Observers and editors; none by default.
#[derive(Clone, Debug, Default)]
pub struct Onlookers {
    /// The observers.
    pub watch: Watchers,
    /// Changes to the file that persons request during the run; carried out between two levels.
    pub edits: Option<Edits>,
}

/// Limits by channel name, SI units; they apply throughout a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelLimits(pub Vec<(String, f64)>);

impl ChannelLimits {
    /// The limit of each channel, in the order of the scan; 0 for no limit.
    pub fn of(&self, channels: &ChannelMap) -> Vec<f64> {
        (0..channels.len())
            .map(|place| {
                let channel = &channels.channels[place];
                let own = self.0.iter().find(|(name, _)| name == channel.name.as_str());
                match channel.role {
                    _ if own.is_some() => own.map_or(0.0, |(_, limit)| *limit),
                    Role::LoadCell | Role::Excitation => {
                        OF_FULL_SCALE * channels.full_scale(place).unwrap_or(0.0)
                    }
                    _ => 0.0,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::samples::ChannelSamples;
    use jointrig_protocol::channel::{Channel, Quantity};

    fn map() -> ChannelMap {
        let channel = |name: &str, role, quantity, scale, delay_ns| Channel {
            name: name.parse().expect("short"),
            role,
            quantity,
            units_per_volt: scale,
            range_v: 10.0,
            delay_ns,
            bits: 16,
        };
        ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel("a", Role::SpecimenA, Quantity::Velocity, 1e-3, 20_000),
                channel("b", Role::SpecimenB, Quantity::Velocity, -1e-3, 0),
                channel("f", Role::Excitation, Quantity::Force, 44.6, 0),
            ],
        }
    }

    /// x_A = 0.2 µm at 0°, x_B = 0.1 µm at 60°: their difference is 0.173 µm, independent of the
    /// effect of delays and polarity on the codes.
    #[test]
    fn the_relative_displacement_is_measured_whatever_delay_and_polarity() {
        let map = map();
        for frequency_hz in [100.0, 187.3, 302.0] {
            let omega = TAU * frequency_hz;
            let meter = Meter::new(&map, Held::Displacement, frequency_hz);
            let scans = meter.window_scans();
            assert!(scans > 5_100);
            let velocity = |place: usize, amplitude: f64, phase: f64, scan: u64| {
                let channel = &map.channels[place];
                let t = scan as f64 / 51_200.0 - f64::from(channel.delay_ns) * 1e-9;
                (amplitude * omega * (omega * t + phase).cos() / channel.units_per_code()).round() as i16
            };
            let of = |place: usize, amplitude: f64, phase: f64| {
                ChannelSamples::I16((0..scans).map(|scan| velocity(place, amplitude, phase, scan)).collect())
            };
            let codes = [of(0, 2e-7, 0.0), of(1, 1e-7, TAU / 6.0), of(2, 0.0, 0.0)];
            let codes = Samples::new(codes.into()).expect("equally long");
            let got = meter.amplitude(&codes);
            assert!((got / (3f64.sqrt() * 1e-7) - 1.0).abs() < 1e-3, "{frequency_hz} Hz: {got}");
            assert_eq!(Meter::new(&map, Held::Force, frequency_hz).amplitude(&codes), 0.0);
            // samples in SI units give the same but for rounding
            let si = (0..3).map(|place| ChannelSamples::F64(map.to_si(place, codes.channel(place))));
            let si = Samples::new(si.collect()).expect("equally long");
            let mut in_si = map.clone();
            in_si.channels.iter_mut().for_each(|channel| channel.units_per_volt = 1.0);
            let in_si = Meter::new(&in_si, Held::Displacement, frequency_hz).amplitude(&si);
            assert!((in_si / got - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn settled_is_steady_and_where_it_was_ordered() {
        let windows = |values: [f64; 6]| [&[0.2, 0.9, 1.3][..], &values[..]].concat();
        assert!(is_settled(&windows([1.01, 0.995, 1.0, 1.002, 0.99, 1.01]), Some(1.0)));
        assert!(
            !is_settled(&windows([0.981, 0.984, 0.988, 0.992, 0.998, 1.003]), Some(1.0)),
            "still drifting"
        );
        assert!(!is_settled(&windows([1.0, 1.0, 1.0, 1.0, 1.0, 1.03]), Some(1.0)));
        assert!(!is_settled(&windows([0.5; 6]), Some(1.0)) && is_settled(&windows([0.5; 6]), None));
        assert!(!is_settled(&[1.0; 5], Some(1.0)) && !is_settled(&[0.0; 6], None));
    }
}

#[cfg(test)]
mod options_tests {
    use super::*;
    use jointrig_protocol::channel::{Channel, Quantity};

    #[test]
    fn forces_are_limited_and_a_users_limit_counts_more() {
        let channel = |name: &str, role| Channel {
            name: name.parse().expect("short"),
            role,
            quantity: Quantity::Velocity,
            units_per_volt: -1e-3,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let channels = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel("hammer", Role::HammerForce),
                channel("LDV_A", Role::SpecimenA),
                channel("LC1", Role::LoadCell),
            ],
        };
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-8);
        assert!(near(&ChannelLimits::default().of(&channels), &[0.0, 0.0, 9.5e-3]));
        let own = ChannelLimits(vec![("LDV_A".into(), 2e-3), ("hammer".into(), 1.0)]);
        assert!(near(&own.of(&channels), &[1.0, 2e-3, 9.5e-3]));
    }
}

//! The shaker's levels: the device controls each to its amplitude; it is recorded in steady state
//! and stored, and the shaker then ramps down to rest.
//!
//! The shaker moves only as long as a host requests it: an order is valid for ten seconds of the
//! device's clock and is renewed every three (`order`); an interrupt, an error and the end of the
//! session bring the shaker to rest. Levels that are already in the file are skipped, so an
//! interrupted run is resumed by running it again.

mod error;
mod meter;
mod options;
mod order;
mod signals;
mod sweep;

pub use error::{ShakeError, Shortfall};
pub use meter::CRITERION;
pub(in crate::campaign) use meter::Meter;
pub use options::{Limits, Onlookers, Options};
pub use signals::{Unusable, record};

use std::sync::atomic::Ordering;

use jointrig_protocol::answer::Info;
use jointrig_protocol::channel::Role;
use jointrig_protocol::request::{Configuration, Stage as StageRequest};

use super::fit::with_sensors;
use super::structure::same_or_accepted;
use crate::campaign::plan::Plan;
use crate::campaign::plan::level::Level;
use crate::campaign::store::Store;
use crate::campaign::store::level_table::{LevelRow, NewLevel, Settled};
use crate::campaign::store::session_table::SessionInfo;
use crate::campaign::store::simulated::is_simulated_board;
use crate::campaign::store::stored::Hex;
use crate::campaign::watch::{Seen, Shaking};
use crate::device::channels::ChannelMap;
use crate::device::recording::by_channel;
use crate::device::session::Session;
use meter::{SETTLED_WINDOWS, WITHIN, is_settled};
use order::Orders;

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
    options: &Options,
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
    options: &Options,
    onlookers: &Onlookers,
    tell: &mut dyn FnMut(&Store, &Level, Option<&Outcome>),
) -> Result<Summary, ShakeError> {
    let plan = store.plan()?;
    let info = session.info()?;
    let device = session.channels(&info)?;
    let address = session.address().to_owned();
    let unfit = |what| ShakeError::Unfit { address: address.clone(), what };
    let (planned, remarks) = with_sensors(&plan, &device).map_err(unfit)?;
    let channels = store.calibrated(store.next_session()?, planned.clone())?;
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
    let known = store.levels()?;
    let id = store.begin_session(&noted, &planned)?;
    sync.iter().try_for_each(|sync| store.note_clock(id, sync))?;
    changed.iter().try_for_each(|what| store.note_another_structure(what))?;
    remarks.iter().try_for_each(|remark| store.log(remark))?;
    if let Some(simulated) = session.simulated() {
        store.note_simulated(simulated)?;
    }
    let (epoch, _) = session.start(channels.len())?;
    let simulated = is_simulated_board(&info.board);
    onlookers.watch.saw(&Seen::Stream { channels: &channels, simulated });
    if info.stage {
        assemble(session, &plan)?;
    }
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

/// The first channel at the contact with a code at the end of its range.
fn clipped(channels: &ChannelMap, codes: &[i16]) -> Option<String> {
    let at_contact = |place: &usize| {
        matches!(channels.channels[*place].role, Role::SpecimenA | Role::SpecimenB | Role::LoadCell)
    };
    let full = |code: &i16| matches!(*code, i16::MIN | i16::MAX);
    (0..channels.len())
        .filter(at_contact)
        .find(|place| codes.iter().skip(*place).step_by(channels.len()).any(full))
        .map(|place| channels.channels[place].name.to_string())
}

/// Selects the assembly on a virtual rig.
fn assemble(session: &mut Session, plan: &Plan) -> Result<(), ShakeError> {
    let cells = plan.cells();
    let Some(cell) = cells.iter().find(|cell| cell.configuration == Configuration::Ajb) else {
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
    options: &'a Options,
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
        let (codes, gaps) = self.session.cut(first_scan..end)?;
        let channels = self.channels.len();
        let new = NewLevel {
            session: self.session_id,
            moment: self.options.moment,
            level: *level,
            settled: taken.settled,
            epoch: self.epoch,
            first_scan,
            channels,
            codes: by_channel(&codes, channels),
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
            let (codes, gaps) = self.session.cut(at..at + window)?;
            at += window;
            if gaps.is_empty() {
                let amplitude = meter.amplitude(&codes, self.channels.len());
                amplitudes.push(amplitude);
                onlookers.watch.saw(&Seen::Shaking(Shaking {
                    at_s: (at - begun) as f64 / self.rate_hz(),
                    amplitude,
                    drive_v: f64::from(self.session.status()?.drive_v),
                    settled: is_settled(&amplitudes, target),
                    codes: &codes,
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
            sweep::go(self.session, &mut orders, [level.frequency_hz, end_hz], options.sweep_hz_per_s)?;
            return Ok(Taken { first_scan: before, scans: 0, settled });
        }
        let cycles = (options.seconds * level.frequency_hz).ceil().max(FEWEST_CYCLES);
        // one scan more than the cycles take, so that whole cycles can be cut
        let scans = (cycles * self.rate_hz() / level.frequency_hz).ceil() as u64 + 1;
        orders.go_on(self.session, at + scans)?;
        orders.still_runs(self.session)?;
        let (codes, _) = self.session.cut(at..at + scans)?;
        if let Some(channel) = clipped(self.channels, &codes) {
            return Err(ShakeError::Short(Shortfall::Clipped { channel }));
        }
        let moved = meter.amplitude(&codes, self.channels.len());
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

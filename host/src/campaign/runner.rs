//! The runner: brings every cell to its wanted number of good hits, keeps each record, resumes where it stopped.
//!
//! A cell begins with the structure at rest, and each later hit finds what the ones before left behind (within the plan's limit).
//! So a cell that was broken off is resumed, on a device that moves hammer and laser by itself (a virtual rig), by striking its
//! attempts once more at the same scans with the same pulses: nothing of that is stored, each is held against its stored record, and
//! the next hit is the one that an undisturbed run would have made, to the last bit. A real structure is not struck in vain: it
//! settles, and goes on.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::clock::ScanClock;
use super::codec;
use super::earlier::Earlier;
use super::judge::{Judge, Judgement, Kind};
use super::keeper::Keeper;
use super::others::Others;
use super::plan::{Cell, Plan};
use super::progress::{Left, Progress};
use super::pulse::{Hit, PulseLoop};
use super::quiet;
use super::rows::{CellRow, Counters, NewRecord, Samples, SessionInfo};
use super::shot::{Outcome, QuietLimits, Shooter};
use super::stage::{Moved, Stage, StageError};
use super::store::Store;
use super::store_error::StoreError;
use super::tally::Tally;
use crate::device::channels::ChannelMap;
use crate::device::error::DeviceError;
use crate::device::recording::Recording;
use crate::device::session::Session;
use crate::device::stream::Accounts;
use jointrig_protocol::channel::Role;

/// Shots of one cell that may be cancelled or find no quiet, before the cell is given up.
const SETBACKS: u32 = 4;

/// How a campaign is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Who moves hammer and laser.
    pub stage: Stage,
    /// Answer every prompt with yes.
    pub yes: bool,
    /// Show a progress bar on stderr.
    pub progress: bool,
    /// Set to end the run after the shot in hand.
    pub stop: Arc<AtomicBool>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Whether the user ended it early.
    pub interrupted: bool,
    /// Good records in the file.
    pub kept: u64,
    /// Good records wanted in all.
    pub wanted: u64,
    /// Cells given up in all.
    pub given_up: u64,
    /// Hits of this run.
    pub hits: u64,
    /// Where every scan of the stream went.
    pub accounts: Accounts,
}

/// Why a run ended with an error.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Hammer and laser.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The device does not fit the plan.
    #[error("{address} does not fit the plan: {what}")]
    Unfit {
        /// The device.
        address: String,
        /// What does not fit, and what to do.
        what: String,
    },
    /// The thread that stores records ended without saying why.
    #[error("records can no longer be stored; run the same command again")]
    KeeperGone,
    /// The rig is not safe to strike.
    #[error("{0}; nothing accepted is lost: run the same command again")]
    Unsafe(&'static str),
}

/// Runs the campaign in `store` on the device behind `session` until it is complete, given up or stopped.
///
/// # Errors
/// File, device or stage failed; everything accepted so far is in the file, and a later run goes on from there.
pub fn run(
    mut store: Store,
    session: &mut Session,
    judge: &mut dyn Judge,
    options: &Options,
) -> Result<Summary, RunError> {
    let plan = store.plan()?;
    let info = session.info()?;
    let channels = session.channels(&info)?;
    check_fit(session.address(), &plan, &channels)?;
    let noted = SessionInfo {
        address: session.address().into(),
        board: info.board.as_str().into(),
        serial: info.serial.as_str().into(),
        firmware_version: info.version.as_str().into(),
        target: info.target.as_str().into(),
        build: info.build,
        schema_hash: session.hello().schema,
    };
    let id = store.begin_session(&noted, &channels)?;
    let (cells, records) = (store.cells()?, store.records()?);
    let tally = Tally::new(&cells, &records);
    let mut pulse = PulseLoop::new(plan.force.get_ref(), info.coil_cap_us);
    for record in records.iter().filter(|record| record.damage.is_none()) {
        pulse.learn(Hit { pulse_us: record.shot.pulse_us, peak_n: record.peak_n });
    }
    session.set_load_cells([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])?;
    let (epoch, _) = session.start(channels.len())?;
    let shooter = Shooter::new(session, &plan, epoch, channels.len())?;
    let progress = Progress::new(tally.wanted(), tally.kept(), options.progress);
    let block = jointrig_protocol::limits::scans_per_block(channels.len()).unwrap_or(1);
    let mut runner = Runner {
        plan: &plan,
        channels: &channels,
        cells: &cells,
        earlier: Earlier::new(store.path(), records),
        stage: options.stage.clone().decided(info.stage),
        options,
        session,
        judge,
        shooter,
        pulse,
        clock: ScanClock::new(f64::from(channels.rate_hz), block),
        keeper: Keeper::start(store),
        session_id: id,
        tally,
        progress,
        hits: 0,
    };
    let walked = runner.walk();
    runner.end(walked)
}

fn check_fit(address: &str, plan: &Plan, channels: &ChannelMap) -> Result<(), RunError> {
    let unfit = |what: String| Err(RunError::Unfit { address: address.into(), what });
    let wanted = plan.record.get_ref().rate_hz;
    if channels.rate_hz != wanted {
        return unfit(format!(
            "it measures at {} Hz, the plan says {wanted} Hz (record.rate_hz)",
            channels.rate_hz
        ));
    }
    if channels.place(Role::HammerForce).is_none() || channels.responses().is_none() {
        return unfit("it needs a hammer force and the vibrometer's three axes among its channels".into());
    }
    for sensor in plan.channel.iter().map(toml::Spanned::get_ref) {
        let name = &sensor.name;
        let Some(channel) = channels.channels.iter().find(|channel| channel.name == name.as_str()) else {
            return unfit(format!("it has no channel `{name}` (channel.name)"));
        };
        let scale = f64::from(channel.units_per_volt);
        let differ =
            |given: Option<f64>, found: f64| given.is_some_and(|given| (found / given - 1.0).abs() > 0.01);
        let range = f64::from(channel.range_v) * scale.abs();
        if differ(sensor.sensitivity_v, 1.0 / scale.abs()) {
            return unfit(format!(
                "its channel `{name}` has {:.6} V per {unit} (channel.sensitivity_v)",
                1.0 / scale.abs(),
                unit = channel.quantity.unit()
            ));
        }
        if sensor.polarity.is_some_and(|sign| f64::from(sign) * scale < 0.0) {
            return unfit(format!("its channel `{name}` has the other sign (channel.polarity)"));
        }
        if differ(sensor.range, range) {
            let unit = channel.quantity.unit();
            return unfit(format!("its channel `{name}` ends at {range:.6} {unit} (channel.range)"));
        }
    }
    Ok(())
}

struct Runner<'a> {
    plan: &'a Plan,
    channels: &'a ChannelMap,
    cells: &'a [CellRow],
    earlier: Earlier,
    stage: Stage,
    options: &'a Options,
    session: &'a mut Session,
    judge: &'a mut dyn Judge,
    shooter: Shooter,
    pulse: PulseLoop,
    clock: ScanClock,
    keeper: Keeper,
    session_id: i64,
    tally: Tally,
    progress: Progress,
    hits: u64,
}

/// Where to go after a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    On,
    Back,
}

impl Runner<'_> {
    fn stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    fn walk(&mut self) -> Result<(), RunError> {
        let cells = self.cells;
        let (mut at, mut back) = (0, false);
        while let Some(row) = cells.get(at)
            && !self.stopped()
        {
            // a cell that somebody went back to is shown whatever its state
            if !self.tally.open(row.id) && !back {
                at += 1;
                continue;
            }
            back = match self.cell(row)? {
                Next::On => {
                    at += 1;
                    false
                }
                Next::Back => {
                    at = at.saturating_sub(1);
                    true
                }
            };
        }
        Ok(())
    }

    /// Brings one cell to its end: enough good hits, or a reason why not.
    fn cell(&mut self, row: &CellRow) -> Result<Next, RunError> {
        let (mut others, mut again) = self.earlier.of(row.id, self.plan, self.channels)?;
        if self.stage != Stage::Device {
            again.clear();
        }
        let attempt = if again.is_empty() { self.tally.attempts(row.id) } else { 0 };
        match self.go(row, attempt)? {
            Moved::InPlace(_) => {}
            Moved::Skip => return Ok(Next::On),
            Moved::Back => return Ok(Next::Back),
            Moved::Redo => {
                self.tally.redo(row.id);
                self.earlier.forget(row.id);
                still(self.keeper.redo(row.id, "struck anew, as a person asked at the prompt"))?;
                return self.cell(row);
            }
        }
        let mut quiet = quiet::unknown(self.channels);
        let mut setbacks = 0;
        while (self.tally.open(row.id) || !again.is_empty()) && !self.stopped() {
            if again.is_empty() && self.ended(row, &others)? {
                break;
            }
            let known = again.front().cloned();
            let pulse_us = known.as_ref().map_or(self.pulse.pulse_us(), |known| known.shot.pulse_us);
            self.mark()?;
            let outcome = self.shooter.shoot(self.session, pulse_us, &quiet, &self.options.stop)?;
            if let (Some(known), Some(crc)) = (&known, crc_of(&outcome)) {
                again.pop_front();
                if crc == known.crc {
                    setbacks = 0;
                    if let Outcome::Recorded(recording) = &outcome {
                        quiet = quiet::after(recording, self.channels, self.plan.settle.get_ref(), 1.0);
                    }
                } else {
                    self.differs(row, known.id)?;
                    again.clear();
                    quiet = quiet::unknown(self.channels);
                    let attempt = self.tally.attempts(row.id);
                    self.go(row, attempt)?;
                }
                continue;
            }
            match outcome {
                Outcome::Recorded(recording) => {
                    setbacks = 0;
                    quiet = quiet::after(&recording, self.channels, self.plan.settle.get_ref(), 1.0);
                    let judgement =
                        self.judge.judge(&row.cell, self.plan, self.channels, &recording, &others);
                    if judgement.kind == Kind::Good {
                        others.learn(self.plan, self.channels, &Samples::of(&recording));
                    }
                    self.keep(row, *recording, judgement)?;
                }
                Outcome::Missed(shot) => {
                    let limit = self.plan.limits.get_ref().weak_n;
                    let sentence = format!("the bolt did not arrive with a pulse of {pulse_us} us");
                    let judgement =
                        Judgement { kind: Kind::Weak, measure: 0.0, limit, sentence, peak_n: 0.0 };
                    let recording = Recording {
                        epoch: 0,
                        first_scan: shot.fired_at,
                        trigger_index: 0,
                        channels: self.channels.len(),
                        codes: Vec::new(),
                        gaps: Vec::new(),
                        shot: jointrig_protocol::shot::Shot { peak_n: 0.0, ..shot },
                    };
                    self.keep(row, recording, judgement)?;
                }
                Outcome::NotQuiet(shot) => {
                    setbacks += 1;
                    let reason = format!("not quiet within {} s", self.plan.settle.get_ref().bound_s);
                    if !self.set_back(row, setbacks, &format!("{reason} (ratio {:.1})", shot.quiet_ratio))? {
                        self.give_up(row, &reason)?;
                        break;
                    }
                    loosen(&mut quiet);
                }
                Outcome::Cancelled(_) => {
                    setbacks += 1;
                    let why = "the device took the shot back";
                    self.check_safe()?;
                    if !self.set_back(row, setbacks, why)? {
                        self.give_up(row, why)?;
                        break;
                    }
                }
                Outcome::Interrupted => {}
            }
        }
        Ok(Next::On)
    }

    /// Ends a cell whose attempts run out, or whose FRFs are good enough; returns whether it did.
    fn ended(&mut self, row: &CellRow, others: &Others) -> Result<bool, RunError> {
        let hits = self.plan.hits.get_ref();
        let (kept, attempts) = (self.tally.kept_in(row.id), self.tally.attempts(row.id));
        let enough = self.plan.enough.as_ref().map(toml::Spanned::get_ref).filter(|_| kept >= hits.minimum);
        let reason = if attempts >= hits.most {
            format!("{kept} of {} good after {attempts} hits", row.cell.wanted)
        } else if let Some(enough) = enough
            && let Some(error) = others.random_error(enough).filter(|error| *error <= enough.random_error)
        {
            format!(
                "{kept} good hits give the FRFs to {:.2} % (enough: {:.2} %)",
                100.0 * error,
                100.0 * enough.random_error
            )
        } else {
            return Ok(false);
        };
        if kept >= hits.minimum && kept > 0 {
            self.tally.settle(row.id);
            self.progress.say(&format!("{}: settled: {reason}", name(&row.cell)));
            still(self.keeper.settle(row.id, &reason))?;
        } else {
            self.give_up(row, &format!("{reason}, at least {} needed", hits.minimum))?;
        }
        Ok(true)
    }

    /// Brings hammer and laser to a cell. The acknowledgement is held meanwhile, so that the first shot is at a
    /// fixed distance from the scan at which they are in place.
    fn go(&mut self, row: &CellRow, attempt: u32) -> Result<Moved, RunError> {
        self.progress.cell(&row.cell, self.left(row));
        let what = self.directions(row);
        let (stage, session, yes) = (&self.stage, &mut *self.session, self.options.yes);
        let moved = self.progress.aside(|| stage.go(session, &row.cell, attempt, &what, yes))?;
        if let Moved::InPlace(at_scan) = moved {
            self.shooter.staged(at_scan);
        }
        Ok(moved)
    }

    /// What a person is told before a cell: what belongs where, and how far the cell is.
    fn directions(&self, row: &CellRow) -> String {
        let millimetres =
            |at: [f64; 3]| format!("x {:.1}, y {:.1}, z {:.1} mm", 1e3 * at[0], 1e3 * at[1], 1e3 * at[2]);
        let (cell, geometry) = (&row.cell, &self.plan.geometry);
        let impact =
            geometry.impact.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.impact);
        let response =
            geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.response);
        let hammer = impact.map_or(String::new(), |point| {
            let [x, y, z] = point.direction;
            format!(" ({}; pushing along {x} {y} {z})", millimetres(point.position_m))
        });
        let laser = response.map_or(String::new(), |point| format!(" ({})", millimetres(point.position_m)));
        let place = 1 + self.cells.iter().position(|other| other.id == row.id).unwrap_or(0);
        format!(
            "cell {place} of {}, structure {}: {} of {} good\n  hammer to {}{hammer}\n  laser to {}{laser}",
            self.cells.len(),
            super::plan::configuration_name(cell.configuration),
            self.tally.kept_in(row.id),
            cell.wanted,
            cell.impact,
            cell.response,
        )
    }

    /// Good hits that are still wanted here, in this structure, and in all.
    fn left(&self, row: &CellRow) -> Left {
        let mut left = Left::default();
        for other in self.cells.iter().filter(|other| self.tally.open(other.id)) {
            let missing = u64::from(other.cell.wanted.saturating_sub(self.tally.kept_in(other.id)));
            left.campaign += missing;
            left.configuration +=
                if other.cell.configuration == row.cell.configuration { missing } else { 0 };
            left.cell += if other.id == row.id { missing } else { 0 };
        }
        left
    }

    /// Notes where the scan clock is.
    fn mark(&mut self) -> Result<(), RunError> {
        let asked = Instant::now();
        let next_scan = self.session.status()?.next_scan;
        self.clock.mark(next_scan, asked, Instant::now());
        Ok(())
    }

    fn keep(&mut self, row: &CellRow, recording: Recording, judgement: Judgement) -> Result<(), RunError> {
        self.mark()?;
        self.hits += 1;
        let shot = recording.shot;
        self.pulse.learn(Hit { pulse_us: shot.pulse_us, peak_n: judgement.peak_n });
        let attempt = self.tally.add(row.id, judgement.kind == Kind::Good);
        self.progress.judged(&row.cell, &judgement, self.tally.kept(), self.left(row));
        log::debug!("{:?} attempt {attempt}: {} ({})", row.cell, judgement.kind, judgement.sentence);
        self.keep_log()?;
        let (utc, utc_error_s) = self.clock.utc(recording.first_scan + recording.trigger_index as u64);
        let record = NewRecord {
            cell: row.id,
            attempt,
            session: self.session_id,
            utc: utc.to_string(),
            utc_error_s,
            recording,
            judgement,
        };
        still(self.keeper.record(record, counters(self.session)))
    }

    /// The device did not repeat a stored record: it is another rig, or another seed.
    fn differs(&mut self, row: &CellRow, record: i64) -> Result<(), RunError> {
        let text = format!(
            "{}: struck once more, record {record} came out otherwise: another rig, or another seed, than it was measured with; \
             going on with this one",
            name(&row.cell)
        );
        self.progress.say(&text);
        still(self.keeper.log(text))
    }

    /// Keeps what the controller has logged.
    fn keep_log(&mut self) -> Result<(), RunError> {
        let lines = self.session.log_lines();
        lines.into_iter().try_for_each(|line| still(self.keeper.log(format!("controller: {line}"))))
    }

    fn give_up(&mut self, row: &CellRow, reason: &str) -> Result<(), RunError> {
        self.tally.give_up(row.id);
        self.progress.say(&format!("{}: given up: {reason}", name(&row.cell)));
        still(self.keeper.give_up(row.id, reason))
    }

    /// Notes a setback; returns whether it is worth trying again.
    fn set_back(&self, row: &CellRow, setbacks: u32, why: &str) -> Result<bool, RunError> {
        self.progress.say(&format!("{}: {why}", name(&row.cell)));
        still(self.keeper.log(format!("{}: {why}", name(&row.cell))))?;
        Ok(setbacks < SETBACKS)
    }

    /// Ends the run where the rig must not be struck: giving cells up one by one would help nobody.
    fn check_safe(&mut self) -> Result<(), RunError> {
        let status = self.session.status()?;
        if status.emergency_stop {
            Err(RunError::Unsafe("the emergency stop is latched: release and reset it at the rig"))
        } else if !status.interlock_closed {
            Err(RunError::Unsafe("the interlock is open: close the guard"))
        } else {
            Ok(())
        }
    }

    /// Ends stream and file; of two errors the first one counts.
    fn end(mut self, walked: Result<(), RunError>) -> Result<Summary, RunError> {
        self.progress.finish();
        let accounts = if walked.is_ok() {
            self.session.disarm().and_then(|()| self.session.finish())
        } else {
            // the device may be gone; its arming expires by itself
            drop(self.session.disarm());
            Ok(self.session.accounts())
        };
        if let Ok(accounts) = &accounts
            && walked.is_ok()
        {
            let text = format!("{accounts:?}, {} unexplained", accounts.unexplained());
            log::info!("{text}");
            if accounts.unexplained() > 0 {
                log::error!("scans are missing without a reason: {text}");
            }
            // a keeper that is gone says so below
            let _ = self.keeper.log(text);
            let _ = self.keeper.link(self.session_id, counters(self.session));
        }
        // here too a keeper that is gone says so below
        let _ = self.keep_log();
        let closed = self.keeper.finish();
        match &walked {
            Err(RunError::KeeperGone) | Ok(()) => closed?,
            Err(_) => {}
        }
        walked?;
        Ok(Summary {
            interrupted: self.options.stop.load(Ordering::Relaxed),
            kept: self.tally.kept(),
            wanted: self.tally.wanted(),
            given_up: self.tally.given_up(),
            hits: self.hits,
            accounts: accounts?,
        })
    }
}

/// The checksum of what a shot left behind, if it was fired: a missed one has no samples.
fn crc_of(outcome: &Outcome) -> Option<u32> {
    match outcome {
        Outcome::Recorded(recording) => Some(codec::checksum(&recording.codes)),
        Outcome::Missed(_) => Some(codec::checksum(&[])),
        _ => None,
    }
}

/// The link's counters of this session so far.
fn counters(session: &Session) -> Counters {
    let (accounts, (good, damaged)) = (session.accounts(), session.frames());
    [
        ("frames_received", good),
        ("frames_damaged", damaged),
        ("scans_received", accounts.received),
        ("scans_recovered", accounts.recovered),
        ("scans_lost", accounts.lost),
        ("scans_duplicate", accounts.duplicates),
    ]
    .map(|(name, count)| (name.to_owned(), count))
    .into()
}

/// Whether the keeper still works; why it does not is told when it is joined.
fn still(works: bool) -> Result<(), RunError> {
    if works { Ok(()) } else { Err(RunError::KeeperGone) }
}

fn name(cell: &Cell) -> String {
    format!("{} {}, {}", super::plan::configuration_name(cell.configuration), cell.impact, cell.response)
}

fn loosen(quiet: &mut QuietLimits) {
    for limit in quiet {
        *limit *= 2.0;
    }
}

#[cfg(test)]
#[path = "runner_tests.rs"]
mod tests;

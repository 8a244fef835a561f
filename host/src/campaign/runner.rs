//! The runner: brings every cell to its wanted number of good hits, keeps each record, resumes where it stopped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::judge::{Judge, Judgement, Kind};
use super::keeper::Keeper;
use super::plan::{Cell, Plan};
use super::progress::Progress;
use super::pulse::{Hit, PulseLoop};
use super::quiet;
use super::rows::{CellRow, NewRecord, SessionInfo};
use super::shot::{Outcome, QuietLimits, Shooter};
use super::stage::{Stage, StageError};
use super::store::{Store, utc_now};
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
    for record in &records {
        pulse.learn(Hit { pulse_us: record.shot.pulse_us, peak_n: f64::from(record.shot.peak_n) });
    }
    session.set_load_cells([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])?;
    let (epoch, _) = session.start(channels.len())?;
    let shooter = Shooter::new(session, &plan, epoch, channels.len())?;
    let progress = Progress::new(tally.wanted(), tally.kept(), options.progress);
    let mut runner = Runner {
        plan: &plan,
        channels: &channels,
        stage: options.stage.clone().decided(info.stage),
        options,
        session,
        judge,
        shooter,
        pulse,
        keeper: Keeper::start(store),
        session_id: id,
        tally,
        progress,
        hits: 0,
    };
    let walked = runner.walk(&cells);
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
    Ok(())
}

struct Runner<'a> {
    plan: &'a Plan,
    channels: &'a ChannelMap,
    stage: Stage,
    options: &'a Options,
    session: &'a mut Session,
    judge: &'a mut dyn Judge,
    shooter: Shooter,
    pulse: PulseLoop,
    keeper: Keeper,
    session_id: i64,
    tally: Tally,
    progress: Progress,
    hits: u64,
}

impl Runner<'_> {
    fn stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    fn walk(&mut self, cells: &[CellRow]) -> Result<(), RunError> {
        for row in cells {
            if self.stopped() {
                break;
            }
            if self.tally.open(row.id) {
                self.cell(row)?;
            }
        }
        Ok(())
    }

    /// Brings one cell to its end: enough good hits, or a reason why not.
    fn cell(&mut self, row: &CellRow) -> Result<(), RunError> {
        self.go(row)?;
        let most = self.plan.hits.get_ref().most;
        let mut quiet = quiet::unknown(self.channels);
        let mut setbacks = 0;
        while self.tally.open(row.id) && !self.stopped() {
            if self.tally.attempts(row.id) >= most {
                let reason =
                    format!("{} of {} good after {most} hits", self.tally.kept_in(row.id), row.cell.wanted);
                return self.give_up(row, &reason);
            }
            let pulse_us = self.pulse.pulse_us();
            match self.shooter.shoot(self.session, pulse_us, &quiet, &self.options.stop)? {
                Outcome::Recorded(recording) => {
                    setbacks = 0;
                    quiet = quiet::after(&recording, self.channels, self.plan.settle.get_ref(), 1.0);
                    let judgement = self.judge.judge(&row.cell, self.plan, self.channels, &recording);
                    self.keep(row, *recording, judgement)?;
                }
                Outcome::Missed(shot) => {
                    let limit = self.plan.limits.weak_n;
                    let sentence = format!("the bolt did not arrive with a pulse of {pulse_us} us");
                    let judgement = Judgement { kind: Kind::Weak, measure: 0.0, limit, sentence };
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
                        return self.give_up(row, &reason);
                    }
                    loosen(&mut quiet);
                }
                Outcome::Cancelled(_) => {
                    setbacks += 1;
                    let why = self.why_cancelled()?;
                    if !self.set_back(row, setbacks, &why)? {
                        return self.give_up(row, &why);
                    }
                }
                Outcome::Interrupted => {}
            }
        }
        Ok(())
    }

    /// Brings hammer and laser to a cell. The acknowledgement is held meanwhile, so that the first shot is at a
    /// fixed distance from the scan at which they are in place.
    fn go(&mut self, row: &CellRow) -> Result<(), RunError> {
        self.progress.cell(&row.cell);
        let attempt = self.tally.attempts(row.id);
        let (stage, session, yes) = (&self.stage, &mut *self.session, self.options.yes);
        let at_scan = self.progress.aside(|| stage.go(session, &row.cell, attempt, yes))?;
        self.shooter.staged(at_scan);
        Ok(())
    }

    fn keep(&mut self, row: &CellRow, recording: Recording, judgement: Judgement) -> Result<(), RunError> {
        self.hits += 1;
        let shot = recording.shot;
        self.pulse.learn(Hit { pulse_us: shot.pulse_us, peak_n: f64::from(shot.peak_n) });
        let attempt = self.tally.add(row.id, judgement.kind == Kind::Good);
        self.progress.judged(&row.cell, &judgement, self.tally.kept());
        log::debug!("{:?} attempt {attempt}: {} ({})", row.cell, judgement.kind, judgement.sentence);
        self.keep_log()?;
        let (cell, session, utc) = (row.id, self.session_id, utc_now());
        still(self.keeper.record(NewRecord { cell, attempt, session, utc, recording, judgement }))
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

    fn why_cancelled(&mut self) -> Result<String, RunError> {
        let status = self.session.status()?;
        Ok(if status.emergency_stop {
            "the emergency stop is latched: release and reset it at the rig".into()
        } else if !status.interlock_closed {
            "the interlock is open: close the guard".into()
        } else {
            "the device took the shot back".into()
        })
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

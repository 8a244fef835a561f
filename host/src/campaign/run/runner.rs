//! The runner: measures the wanted number of good hits in every cell, stores each record, and
//! resumes where it stopped, from the cell's records of earlier runs and the statistics of the good
//! ones.
//!
//! A cell starts with the structure at rest, and each later hit is affected by the residual motion
//! of the earlier ones (within the plan's limit). On a device that moves hammer and laser by itself
//! (a virtual rig), an interrupted cell is therefore resumed by repeating its attempts at the same
//! scans with the same pulses: these hits are not stored, each is compared with its stored record,
//! and the next hit is bit-identical to that of an uninterrupted run. A real structure is not
//! struck again: it comes to rest, and the cell continues.
//!
//! The target force of each hit is the plan's force, or a lower one for every second hit if the
//! plan requests it. Each force has a separate closed loop.

use super::answers::Answers;
use super::answers::{Edits, Recount};
use super::clock::ScanClock;
use super::error::RunError;
use super::further::{Choice, Further, FurtherCell};
use super::keeper::{Announced, Keeper};
use super::pulse::{FIRST_SLOPE, PulseHit, PulseLoop, fitted, strikes_in_time};
use super::shot::Shooter;
use super::stage::Stage;
use super::stage::{meanwhile, same_or_accepted};
use super::tally::Tally;
use crate::campaign::plan::{Force, Plan, structure};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::is_simulated_board;
use crate::campaign::store::record_table::{Damaged, NewRecord, RecordRow};
use crate::campaign::store::rows::Rows;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::judge::Judge;
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::campaign::watch::{Seen, Watchers};
use crate::device::channels::ChannelMap;
use crate::device::session::Session;
use crate::device::stream::Accounts;
use crate::device::stream::Recording;
use crate::structure::Structure;
use jointrig_protocol::channel::{Role, words_per_scan};
use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// How a campaign is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Who moves hammer and laser.
    pub stage: Stage,
    /// Answer every prompt with yes.
    pub yes: bool,
    /// Continue even if device or rig indicate another structure than that of the file's records.
    pub new_structure: bool,
    /// The observers.
    pub watch: Watchers,
    /// Changes to the file that persons request during the run.
    pub edits: Option<Edits>,
    /// Answers to the stage's questions from other places than the terminal.
    pub answers: Option<Answers>,
    /// Chooses further cells once every cell has the plan's fewest good hits; if absent, every cell
    /// gets the hits that the plan wants, and the run ends.
    pub further: Option<Further>,
    /// Set to end the run after the current shot.
    pub stop: Arc<AtomicBool>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Whether the user ended it early.
    pub interrupted: bool,
    /// Good records in the file.
    pub kept: u64,
    /// Good records wanted in total.
    pub wanted: u64,
    /// Total number of cells given up.
    pub given_up: u64,
    /// Hits of this run.
    pub hits: u64,
    /// Accounting of every scan of the stream.
    pub accounts: Accounts,
    /// Whether further cells reached what they were measured for, and why the run ended with them;
    /// `None` without them, or if the run was interrupted.
    pub further: Option<(bool, String)>,
}

/// Runs the campaign in `store` on the device behind `session` until every cell is complete or
/// given up, or the run is stopped.
///
/// # Errors
/// File, device or stage failed; every hit that was judged so far is in the file, and a later run
/// continues from there.
pub fn run(
    mut store: Store,
    session: &mut Session,
    judge: &mut dyn Judge,
    options: &Options,
) -> Result<Summary, RunError> {
    let plan = store.plan()?;
    let info = session.info()?;
    let device = session.channels(&info)?;
    let (planned, remarks) = fitted(session.address(), &plan, &device, info.coil_cap_us)?;
    if session.recorder().is_some() {
        strikes_in_time(session.address(), &plan)?;
    }
    let channels = store.calibrated(store.next_session()?, planned.clone())?;
    let changed = same_or_accepted(
        &store,
        &info,
        session.simulated(),
        options.new_structure,
        RunError::AnotherStructure,
    )?;
    session.calibrate(&device, &channels)?;
    let sync = plan.clock().map(|clock| session.take_clock(clock)).transpose()?;
    let noted = SessionInfo {
        address: session.address().into(),
        board: info.board.as_str().into(),
        serial: info.serial.as_str().into(),
        firmware_version: info.version.as_str().into(),
        target: info.target.as_str().into(),
        build: Hex(info.build),
        schema_hash: Hex(session.hello().schema),
    };
    let id = store.begin_session(&noted, &planned)?;
    sync.iter().try_for_each(|sync| store.note_clock(id, sync))?;
    changed.iter().try_for_each(|what| store.note_another_structure(what))?;
    let unknown = |name: &str| channels.channels.iter().all(|channel| channel.name != name);
    let calibrations = store.calibrations()?;
    let without = calibrations.iter().filter(|own| unknown(&own.channel));
    let without = without.map(|own| {
        format!("the device has no channel `{}`, which the file's calibration names", own.channel)
    });
    for remark in remarks.into_iter().chain(without) {
        store.log(&remark)?;
        options.watch.saw(&Seen::Remark(&remark));
    }
    if let Some(simulated) = session.simulated() {
        store.note_simulated(simulated)?;
    }
    let (mut cells, records) = (store.cells()?, store.records()?);
    if options.further.is_some() {
        // The chooser decides which cells get more. B alone cannot be struck again once the assembly
        // is put together, so its cells get all that the plan wants.
        let minimum = plan.hits.get_ref().minimum;
        for row in cells.iter_mut().filter(|row| structure(row.cell.configuration) != Structure::B) {
            row.cell.wanted = row.cell.wanted.min(minimum);
        }
    }
    let rows = Rows::new(&plan, &cells);
    let tally = Tally::new(&cells, rows.clone(), &records);
    // cells that are filled by the hits of another cell are not visited
    let mut filled: HashMap<i64, Vec<CellRow>> = HashMap::new();
    cells.retain(|row| match rows.lead(row.id) {
        Some(lead) => {
            filled.entry(lead).or_default().push(row.clone());
            false
        }
        None => true,
    });
    let mut forces = Forces::new(plan.force.get_ref(), info.coil_cap_us);
    // a hammer by hand has no coil, and the longest pulse of its device may be 0
    let swung_by_coil = records.iter().flatten().filter(|_| plan.by_hand().is_none());
    for record in swung_by_coil {
        forces
            .learn_judged(record.verdict, PulseHit { pulse_us: record.shot.pulse_us, peak_n: record.peak_n });
    }
    // a front end with fewer load cells has no matrix for three
    if channels.places(Role::LoadCell).len() == LOAD_CELLS {
        session.set_load_cells([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])?;
    }
    let (epoch, _) = session.start(&channels)?;
    let shooter = Shooter::new(session, &plan, epoch)?;
    let simulated = is_simulated_board(&info.board);
    options.watch.saw(&Seen::Stream { channels: &channels, simulated });
    options.watch.saw(&Seen::Begun { wanted: tally.wanted(), kept: tally.kept() });
    let block = jointrig_protocol::limits::scans_per_block(words_per_scan(&channels.channels)).unwrap_or(1);
    let mut runner = Runner {
        plan: &plan,
        channels: &channels,
        cells: &cells,
        filled,
        earlier: Earlier::new(store.path(), records),
        stage: options.stage.clone().decided(info.stage),
        options,
        session,
        judge,
        shooter,
        forces,
        clock: ScanClock::new(channels.fs_hz(), block),
        keeper: Keeper::start(store, options.edits.clone(), options.watch.clone()),
        session_id: id,
        tally,
        reopened: BTreeSet::new(),
        visit: None,
        excluded: BTreeSet::new(),
        hits: 0,
    };
    let walked = runner.walk().and_then(|()| runner.walk_further());
    runner.end(walked)
}

/// Number of load cells whose calibration matrix a device holds.
const LOAD_CELLS: usize = 3;

/// Hits between two readings of the temperature: some minutes, in which a laboratory's temperature
/// changes negligibly.
const HITS_PER_TEMPERATURE: u64 = 100;

/// A running campaign.
pub(super) struct Runner<'a> {
    pub(super) plan: &'a Plan,
    pub(super) channels: &'a ChannelMap,
    /// The cells that are struck.
    pub(super) cells: &'a [CellRow],
    /// The cells that are filled by the hits of a struck cell, by its id.
    pub(super) filled: HashMap<i64, Vec<CellRow>>,
    pub(super) earlier: Earlier,
    pub(super) stage: Stage,
    pub(super) options: &'a Options,
    pub(super) session: &'a mut Session,
    pub(super) judge: &'a mut dyn Judge,
    pub(super) shooter: Shooter,
    pub(super) forces: Forces,
    pub(super) clock: ScanClock,
    pub(super) keeper: Keeper,
    pub(super) session_id: i64,
    pub(super) tally: Tally,
    /// Cells that lost a good hit in this run because a person overruled it.
    reopened: BTreeSet<i64>,
    /// The number of attempts in the cell before the present visit, if it is one of the further
    /// cells.
    pub(super) visit: Option<u32>,
    /// Further cells that cannot be measured in this run.
    pub(super) excluded: BTreeSet<i64>,
    pub(super) hits: u64,
}

/// Which cell comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    On,
    Back,
}

impl Runner<'_> {
    pub(super) fn stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    pub(super) fn saw(&self, seen: &Seen<'_>) {
        self.options.watch.saw(seen);
    }

    fn walk(&mut self) -> Result<(), RunError> {
        let cells = self.cells;
        let (mut at, mut back) = (0, false);
        while !self.stopped() {
            self.recount(None);
            let Some(row) = cells.get(at) else {
                // an earlier cell that lost an overruled hit is measured again
                let tally = &self.tally;
                let lost = cells.iter().find(|row| self.reopened.contains(&row.id) && tally.open(row.id));
                let Some(row) = lost else { break };
                self.reopened.remove(&row.id);
                self.cell(row)?;
                continue;
            };
            // a cell that the user went back to is shown whatever its state
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

    /// Measures further cells until the chooser has enough; returns whether it has what it was to
    /// measure, and why it ended.
    fn walk_further(&mut self) -> Result<Option<(bool, String)>, RunError> {
        let Some(further) = &self.options.further else { return Ok(None) };
        while !self.stopped() {
            still(self.keeper.catch_up())?;
            let (path, cells, excluded) = (self.earlier.path.clone(), self.cells, self.excluded.clone());
            let choose = move || {
                let out =
                    |cell: &FurtherCell| cells.iter().any(|row| cell.is(row) && excluded.contains(&row.id));
                further.chooser().next(&path, &out).map_err(RunError::Further)
            };
            // the clock of a device that moves hammer and laser itself stands still meanwhile
            let choice =
                if self.stage == Stage::Device { choose()? } else { meanwhile(self.session, choose)? };
            let (Choice::Cells { why, .. } | Choice::Enough { why, .. }) = &choice;
            self.saw(&Seen::Remark(why));
            still(self.keeper.log(why.clone()))?;
            let chosen = match choice {
                Choice::Enough { reached, why } => return Ok(Some((reached, why))),
                Choice::Cells { cells, .. } => cells,
            };
            for cell in chosen {
                if self.stopped() {
                    break;
                }
                self.recount(None);
                let row = cells.iter().find(|row| cell.is(row));
                let row = row.ok_or_else(|| {
                    let FurtherCell { configuration, impact, response, .. } = &cell;
                    RunError::Further(format!("the plan has no cell {configuration} {impact}, {response}"))
                })?;
                self.visit(row, cell.more)?;
            }
        }
        Ok(None)
    }

    /// Adds good hits to a cell.
    fn visit(&mut self, row: &CellRow, more: u32) -> Result<(), RunError> {
        let mut row = row.clone();
        row.cell.wanted = self.tally.want(row.id, more);
        self.visit = Some(self.tally.attempts(row.id));
        let kept = self.tally.kept_in(row.id);
        self.cell(&row)?;
        self.visit = None;
        if self.tally.kept_in(row.id) <= kept && !self.stopped() {
            // skipped, or without a good hit: another cell is better
            self.excluded.insert(row.id);
        }
        Ok(())
    }

    /// Counts the verdicts overruled since the last call; returns whether one belongs to this cell.
    pub(super) fn recount(&mut self, concerned: Option<i64>) -> bool {
        let mut it_does = false;
        for Recount { cell, more } in self.keeper.recounts() {
            self.tally.recount(cell, more);
            if !more {
                self.reopened.insert(cell);
            }
            it_does |= concerned == Some(cell);
        }
        it_does
    }

    /// Marks the position of the scan clock.
    pub(super) fn mark(&mut self) -> Result<(), RunError> {
        let asked = Instant::now();
        let next_scan = self.session.status()?.next_scan;
        if let Some(recorder) = self.session.recorder() {
            self.clock.widen(recorder.longest_block as usize);
        }
        self.clock.mark(next_scan, asked, Instant::now());
        Ok(())
    }

    pub(super) fn keep(
        &mut self,
        row: &CellRow,
        recording: Recording,
        verdict: Judgement,
    ) -> Result<(), RunError> {
        self.mark()?;
        if self.hits.is_multiple_of(HITS_PER_TEMPERATURE) {
            self.keep_temperature()?;
        }
        self.hits += 1;
        let shot = recording.shot;
        if self.plan.by_hand().is_none() {
            self.forces
                .learn_judged(verdict.kind, PulseHit { pulse_us: shot.pulse_us, peak_n: verdict.peak_n });
        }
        let attempt = self.tally.add(row.id, verdict.kind == Verdict::Good);
        let standing = Announced { row: row.clone(), kept: self.tally.kept(), left: self.left(row) };
        self.saw(&Seen::Link(self.session.accounts()));
        log::debug!("{:?} attempt {attempt}: {} ({})", row.cell, verdict.kind, verdict.sentence);
        if self.plan.by_hand().is_some() && self.plan.sync.is_some() {
            // the device does not detect a manual hit, but another recorder needs a pulse for it
            self.session.pulse_output()?;
        }
        self.keep_edges()?;
        self.keep_log()?;
        let (utc, utc_error_s) = self.clock.utc(recording.first_scan + recording.trigger_index as u64);
        let record = NewRecord {
            cell: row.id,
            attempt,
            session: self.session_id,
            utc: utc.to_string(),
            utc_error_s,
            recording,
            verdict,
        };
        still(self.keeper.record(record, counters(self.session), standing))
    }

    /// Stores the specimen's temperature, if the device measures it.
    fn keep_temperature(&mut self) -> Result<(), RunError> {
        match self.session.temperature_c()? {
            Some(celsius) => still(self.keeper.temperature(self.session_id, celsius)),
            None => Ok(()),
        }
    }

    /// Stores edges of the sync input and output, if the plan requests them.
    fn keep_edges(&mut self) -> Result<(), RunError> {
        let edges = self.session.edges();
        if self.plan.sync.is_none() || edges.is_empty() {
            return Ok(());
        }
        still(self.keeper.edges(self.session_id, edges))
    }

    /// Stores the controller's log lines, and what a person should know about the recorder.
    pub(super) fn keep_log(&mut self) -> Result<(), RunError> {
        for remark in self.session.remarks() {
            self.saw(&Seen::Remark(&remark));
            still(self.keeper.log(remark))?;
        }
        let lines = self.session.log_lines();
        lines.into_iter().try_for_each(|line| still(self.keeper.log(format!("controller: {line}"))))
    }

    /// Ends stream and file; of two errors the first one is returned.
    fn end(mut self, walked: Result<Option<(bool, String)>, RunError>) -> Result<Summary, RunError> {
        self.saw(&Seen::Ended);
        let walked = walked.and_then(|further| {
            if self.hits > 0 {
                self.keep_temperature()?;
            }
            Ok(further)
        });
        let accounts = if walked.is_ok() {
            self.session.disarm().and_then(|()| self.session.finish())
        } else {
            // the device may be disconnected; its arming expires by itself
            drop(self.session.disarm());
            Ok(self.session.accounts())
        };
        if let Ok(accounts) = &accounts
            && walked.is_ok()
        {
            let text = format!(
                "{} scans sent: {} received, {} sent again, {} lost, {} came twice, {} unexplained",
                accounts.sent,
                accounts.received,
                accounts.recovered,
                accounts.lost,
                accounts.duplicates,
                accounts.unexplained()
            );
            log::info!("{text}");
            if accounts.unexplained() > 0 {
                log::error!("scans are missing without a reason: {text}");
            }
            // an error of the keeper is reported below
            let _ = self.keeper.log(text);
            let _ = self.keeper.link(self.session_id, counters(self.session));
        }
        // here too, an error of the keeper is reported below
        let _ = self.keep_edges();
        let _ = self.keep_log();
        let closed = self.keeper.finish();
        match &walked {
            Err(RunError::KeeperGone) | Ok(_) => closed?,
            Err(_) => {}
        }
        let further = walked?;
        Ok(Summary {
            interrupted: self.options.stop.load(Ordering::Relaxed),
            kept: self.tally.kept(),
            wanted: self.tally.wanted(),
            given_up: self.tally.given_up(),
            hits: self.hits,
            accounts: accounts?,
            further,
        })
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

/// Converts whether the keeper still works into a result; the cause is reported when it is joined.
pub(super) fn still(works: bool) -> Result<(), RunError> {
    if works { Ok(()) } else { Err(RunError::KeeperGone) }
}

/// The records of earlier runs, by cell.
pub(super) struct Earlier {
    path: PathBuf,
    records: HashMap<i64, Vec<Result<RecordRow, Damaged>>>,
}

impl Earlier {
    /// The records of the file at `path`.
    pub(super) fn new(path: &Path, rows: Vec<Result<RecordRow, Damaged>>) -> Self {
        let mut records: HashMap<i64, Vec<Result<RecordRow, Damaged>>> = HashMap::new();
        for row in rows {
            let cell = row.as_ref().map_or_else(|damaged| damaged.place.cell, |row| row.cell);
            records.entry(cell).or_default().push(row);
        }
        Self { path: path.into(), records }
    }

    /// Drops a cell's records.
    pub(super) fn forget(&mut self, cell: i64) {
        self.records.remove(&cell);
    }

    /// Statistics of the cell's good records, and its attempts from the first onwards so that they
    /// can be repeated; no attempts if one is missing or damaged.
    pub(super) fn of(
        &self,
        cell: i64,
        responses: &[usize],
        plan: &Plan,
        channels: &ChannelMap,
    ) -> Result<(Others, VecDeque<RecordRow>), StoreError> {
        let Some(records) = self.records.get(&cell) else {
            return Ok((Others::of(responses.into()), VecDeque::new()));
        };
        // the writer runs on another thread; a cell's earlier records were in the file before it
        // started
        let store = Store::open_read_only(&self.path)?;
        let others = learnt(&store, records, responses, plan, channels)?;
        let mut again: Vec<RecordRow> = records.iter().flatten().cloned().collect();
        again.sort_by_key(|record| record.attempt);
        // a cell that was left and visited again was at rest in between
        let one_visit = again.windows(2).all(|pair| pair[1].id == pair[0].id + 1);
        let whole = one_visit
            && again.len() == records.len()
            && again.iter().zip(0..).all(|(record, n)| record.attempt == n);
        Ok((others, if whole { again.into() } else { VecDeque::new() }))
    }

    /// Statistics of a cell's good records that are in the file at present.
    pub(super) fn others_now(
        &self,
        cell: i64,
        responses: &[usize],
        plan: &Plan,
        channels: &ChannelMap,
    ) -> Result<Others, StoreError> {
        let store = Store::open_read_only(&self.path)?;
        learnt(&store, &store.records_of(cell)?, responses, plan, channels)
    }
}

/// Statistics of the good ones among these records.
fn learnt(
    store: &Store,
    records: &[Result<RecordRow, Damaged>],
    responses: &[usize],
    plan: &Plan,
    channels: &ChannelMap,
) -> Result<Others, StoreError> {
    let mut others = Others::of(responses.into());
    let kept = |record: &&RecordRow| record.kept() && record.channels == channels.len();
    for record in records.iter().flatten().filter(kept) {
        match store.samples(record) {
            Ok(samples) => others.learn(plan, channels, &samples),
            Err(error @ StoreError::Damaged { .. }) => log::warn!("{error}"),
            Err(error) => return Err(error),
        }
    }
    Ok(others)
}

/// The closed loops of all forces.
#[derive(Clone, Debug)]
pub struct Forces(Vec<PulseLoop>);

impl Forces {
    /// Creates one loop, or two. `cap_us` is the device's longest pulse.
    pub fn new(force: &Force, cap_us: u32) -> Self {
        let mut loops = vec![PulseLoop::new(force, cap_us)];
        if let Some(softer) = force.softer {
            // a first guess that the loop corrects
            let pulse = f64::from(force.pulse_us) * softer.powf(FIRST_SLOPE.recip());
            let pulse_us = (pulse.round() as u32).max(force.pulse_bounds_us[0]);
            let soft = Force { target_n: softer * force.target_n, pulse_us, ..*force };
            loops.push(PulseLoop::new(&soft, cap_us));
        }
        Self(loops)
    }

    /// The pulse of the shot with this number, µs: every second one is softer.
    pub fn pulse_us(&self, number: u32) -> u32 {
        self.0[number as usize % self.0.len()].pulse_us()
    }

    /// Updates the loop after a hit was judged. A record with missing samples is ignored: its peak
    /// may be among the missing samples, and the loop would lengthen the pulse because of a fault
    /// of the link.
    pub fn learn_judged(&mut self, judged: Verdict, hit: PulseHit) {
        if judged != Verdict::Gap {
            self.learn(hit);
        }
    }

    /// Updates the loop whose pulse is nearest to the hit's, so that replaying a stored campaign
    /// reproduces the state of the running one.
    fn learn(&mut self, hit: PulseHit) {
        if let Some(own) = self.0.iter_mut().min_by_key(|own| own.pulse_us().abs_diff(hit.pulse_us)) {
            own.learn(hit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: Force = Force {
        target_n: 50.0,
        softer: Some(0.7),
        tolerance: 0.05,
        pulse_us: 3_000,
        pulse_bounds_us: [500, 8_000],
    };

    fn strike(forces: &mut Forces, kept: u32) -> f64 {
        let pulse_us = forces.pulse_us(kept);
        let peak_n = (f64::from(pulse_us) - 1_500.0).max(0.0) * 0.02;
        forces.learn(PulseHit { pulse_us, peak_n });
        peak_n
    }

    #[test]
    fn every_second_good_hit_is_softer() {
        let mut forces = Forces::new(&FORCE, 8_000);
        let peaks: Vec<f64> = (0..24).map(|kept| strike(&mut forces, kept)).collect();
        for pair in peaks[16..].chunks(2) {
            assert!((pair[0] / 50.0 - 1.0).abs() < 0.06 && (pair[1] / 35.0 - 1.0).abs() < 0.06, "{peaks:?}");
        }
    }

    #[test]
    fn a_stored_campaign_teaches_what_the_running_one_did() {
        let mut forces = Forces::new(&FORCE, 8_000);
        let mut stored = Vec::new();
        // a refused hit is repeated with the same force
        for kept in [0, 0, 1, 2, 3, 3, 4, 5] {
            let pulse_us = forces.pulse_us(kept);
            stored.push(PulseHit { pulse_us, peak_n: (f64::from(pulse_us) - 1_500.0) * 0.025 });
            forces.learn(stored[stored.len() - 1]);
        }
        let mut resumed = Forces::new(&FORCE, 8_000);
        for hit in stored {
            resumed.learn(hit);
        }
        assert_eq!([0, 1].map(|kept| resumed.pulse_us(kept)), [0, 1].map(|kept| forces.pulse_us(kept)));
    }

    #[test]
    fn without_a_softer_force_all_hits_are_alike() {
        let forces = Forces::new(&Force { softer: None, ..FORCE }, 8_000);
        assert_eq!(forces.pulse_us(0), forces.pulse_us(1));
    }
}

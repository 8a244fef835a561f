//! Detects changes of a campaign file, whichever process writes it.

use std::collections::BTreeMap;
use std::path::Path;

use super::message::{
    CellCount, Counted, Hit, Judged, Left, LevelDone, Message, Progress, Snapshot, VERSION,
};
use crate::campaign::plan::configuration_name;
use crate::campaign::run::tally::Tally;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::level_table::LevelRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};

/// Number of last hits from which the pace is computed.
const PACE: usize = 40;

/// Follows the changes of a campaign file.
pub struct Follower {
    store: Store,
    /// SQLite's `data_version` of the file: it changes with every commit of another connection.
    version: i64,
    /// Every record without its samples, as last read.
    records: Vec<Result<RecordRow, Damaged>>,
    /// Number of changed verdicts at that time.
    overruled: usize,
    seen: Snapshot,
}

impl Follower {
    /// Opens the file and reads everything except the samples.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(path: &Path) -> Result<Self, StoreError> {
        let store = Store::open_read_only(path)?;
        let version = store.data_version()?;
        let (records, overruled) = (store.records()?, store.overrules()?.len());
        let seen = Snapshot { hits: hits(&records), ..all_but_hits(&store, &records)? };
        Ok(Self { store, version, records, overruled, seen })
    }

    /// The complete state.
    pub fn whole(&self) -> Snapshot {
        self.seen.clone()
    }

    /// The changes since the last call, in order; empty if nothing was written.
    ///
    /// # Errors
    /// The file can no longer be read.
    pub fn look(&mut self) -> Result<Vec<Message>, StoreError> {
        let version = self.store.data_version()?;
        if version == self.version {
            return Ok(Vec::new());
        }
        let last = self.records.last().map_or(i64::MIN, |record| match record {
            Ok(record) => record.id,
            Err(damaged) => damaged.place.id,
        });
        let overruled = self.store.overrules()?.len();
        let (new, known) = self.store.records_after(last)?;
        let messages = if overruled == self.overruled && known == self.records.len() {
            // earlier hits are unchanged, so only the new ones are read
            let new_hits = hits(&new);
            self.records.extend(new);
            let now = all_but_hits(&self.store, &self.records)?;
            let messages = if same_campaign(&self.seen, &now) {
                Some(difference(&self.seen, &now, &new_hits, Vec::new()))
            } else {
                None
            };
            let mut all = std::mem::take(&mut self.seen.hits);
            all.extend(new_hits);
            self.seen = Snapshot { hits: all, ..now };
            messages
        } else {
            self.records = self.store.records()?;
            let now = Snapshot { hits: hits(&self.records), ..all_but_hits(&self.store, &self.records)? };
            let before = std::mem::replace(&mut self.seen, now);
            let now = &self.seen;
            // records that were removed cannot be expressed as single messages
            (same_campaign(&before, now) && now.hits.len() >= before.hits.len()).then(|| {
                let last = before.hits.last().map_or(i64::MIN, |hit| hit.record);
                let new_hits: Vec<Hit> = now.hits.iter().filter(|hit| hit.record > last).cloned().collect();
                let other = before.hits.iter().zip(&now.hits).filter(|(old, new)| old != new);
                difference(&before, now, &new_hits, other.map(|(_, new)| new.clone()).collect())
            })
        };
        (self.version, self.overruled) = (version, overruled);
        Ok(messages.unwrap_or_else(|| vec![Message::Snapshot(Box::new(self.seen.clone()))]))
    }
}

/// Whether the changes can be expressed as single messages: not if the plan was replaced, if a
/// first session began on a simulated rig, or if a level was added.
fn same_campaign(before: &Snapshot, now: &Snapshot) -> bool {
    before.cells.iter().map(|cell| cell.id).eq(now.cells.iter().map(|cell| cell.id))
        && (before.simulated, &before.plan, &before.levels) == (now.simulated, &now.plan, &now.levels)
}

/// The messages that lead from one state to the next; `new` are the hits that came, `overruled`
/// those whose verdict changed.
fn difference(before: &Snapshot, now: &Snapshot, new: &[Hit], overruled: Vec<Hit>) -> Vec<Message> {
    let mut messages = Vec::new();
    let mut told: Vec<i64> = Vec::new();
    for hit in new {
        let Some(cell) = now.cells.iter().find(|cell| cell.id == hit.cell) else { continue };
        told.push(cell.id);
        messages.push(Message::Judged(Box::new(Judged {
            hit: hit.clone(),
            cell: cell.clone(),
            progress: now.progress.clone(),
        })));
    }
    let changed =
        before.cells.iter().zip(&now.cells).filter(|(old, new)| old != new && !told.contains(&new.id));
    let cells: Vec<CellCount> = changed.map(|(_, new)| new.clone()).collect();
    if !cells.is_empty() || !overruled.is_empty() || (messages.is_empty() && before.progress != now.progress)
    {
        messages.push(Message::Cells(Counted { cells, hits: overruled, progress: now.progress.clone() }));
    }
    messages
}

fn hits(records: &[Result<RecordRow, Damaged>]) -> Vec<Hit> {
    records.iter().flatten().map(hit).collect()
}

fn all_but_hits(store: &Store, records: &[Result<RecordRow, Damaged>]) -> Result<Snapshot, StoreError> {
    let cells = store.cells()?;
    let tally = Tally::new(&cells, store.rows()?, records);
    let link = store.link_counters()?;
    Ok(Snapshot {
        version: VERSION,
        file: store.path().file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        plan: store.plan()?.name.into_inner(),
        simulated: store.is_simulated()?,
        progress: Progress {
            kept: tally.kept(),
            wanted: tally.wanted(),
            complete: tally.complete(),
            next: cells.iter().position(|row| tally.open(row.id)),
            left: left(&cells, &tally, records),
            lost_scans: link.get("scans_lost").copied().unwrap_or(0),
            recovered_scans: link.get("scans_recovered").copied().unwrap_or(0),
            wear_cycles: store.wear_total()?.cycles,
        },
        cells: cells.iter().map(|row| count(row, &tally)).collect(),
        levels: store.levels()?.iter().flatten().map(level).collect(),
        ..Snapshot::default()
    })
}

fn count(row: &CellRow, tally: &Tally) -> CellCount {
    let count = tally.cell(row.id);
    CellCount {
        id: row.id,
        configuration: configuration_name(row.cell.configuration),
        impact: row.cell.impact.clone(),
        response: row.cell.response.clone(),
        wanted: count.wanted,
        kept: count.kept,
        attempts: count.attempts,
        refused: count.refused.iter().map(|(kind, n)| (kind.name(), *n)).collect::<BTreeMap<_, _>>(),
        given_up: row.given_up.clone(),
        settled: row.settled.clone(),
    }
}

fn level(row: &LevelRow) -> LevelDone {
    LevelDone {
        id: row.id,
        title: row.level().to_string(),
        moment: row.moment.name(),
        held: row.held.name(),
        order: row.amplitude,
        reached: row.reached,
        overshoot: row.overshoot,
        after_s: row.after_s,
        drive_v: row.drive_v,
    }
}

fn hit(record: &RecordRow) -> Hit {
    let number = |value: f64| value.is_finite().then_some(value);
    Hit {
        record: record.id,
        cell: record.cell,
        attempt: record.attempt,
        utc: record.utc.clone(),
        verdict: record.standing().name(),
        judged: record.overruled.map(|_| record.verdict.name()),
        kept: record.kept(),
        measure: number(record.measure),
        limit: number(record.limit),
        sentence: record.sentence.clone(),
        peak_n: number(record.peak_n).unwrap_or(0.0),
        pulse_us: record.pulse_us,
    }
}

/// Time left at the pace of the last hits of one session; `None` before two good hits.
fn left(cells: &[CellRow], tally: &Tally, records: &[Result<RecordRow, Damaged>]) -> Option<Left> {
    let next = cells.iter().find(|row| tally.open(row.id))?;
    let session = records.iter().rev().find_map(|record| record.as_ref().ok())?.session;
    let own: Vec<&RecordRow> =
        records.iter().rev().flatten().take_while(|record| record.session == session).take(PACE).collect();
    let time = |record: &RecordRow| record.utc.parse::<jiff::Timestamp>().ok();
    let span = time(own.first()?)?.duration_since(time(own.last()?)?).as_secs_f64();
    let kept = own.iter().filter(|record| record.kept()).count();
    if kept < 2 || span <= 0.0 {
        return None;
    }
    let each = span / (own.len() - 1).max(1) as f64 * own.len() as f64 / kept as f64;
    let hits = |of: &dyn Fn(&CellRow) -> bool| -> f64 {
        let open = cells.iter().filter(|row| of(row) && tally.open(row.id)).map(|row| tally.cell(row.id));
        each * open.map(|count| f64::from(count.wanted.saturating_sub(count.kept))).sum::<f64>()
    };
    Some(Left {
        cell_s: hits(&|row| row.id == next.id),
        configuration_s: hits(&|row| row.cell.configuration == next.cell.configuration),
        campaign_s: hits(&|_| true),
    })
}

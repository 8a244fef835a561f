//! Compares what the raw samples yield with what the file states: verdicts with their measure,
//! limit and peak, and the amplitudes of the shaker's levels.
//!
//! Checksums show whether a row is as it was written. This shows whether it was right: each record
//! is judged again as it was at the time, with the plan, the scales and the earlier good records
//! that were valid then. The chain of rows gives that order. A file of an older version has no
//! chain, and the order may be different if two persons worked on the campaign concurrently; so a
//! verdict is also accepted if it follows from the current content of the file.

use std::collections::HashMap;

use super::plan::level::Held;
use super::plan::{Cell, Plan};
use super::run::by_hand::TOO_EARLY;
use super::run::shaking::Meter;
use super::store::Store;
use super::store::calibration_table::Calibration;
use super::store::error::StoreError;
use super::store::level_table::LevelRow;
use super::store::record_table::Overrule;
use super::store::record_table::RecordRow;
use super::store::session_table::SessionInfo;
use super::verdict::judge::{ByRecord, Judge};
use super::verdict::others::Others;
use super::verdict::{Judgement, Verdict};
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Recording;

/// Relative difference below which numbers are equal: another machine's sine may differ in the last
/// digit.
const ALIKE: f64 = 1e-9;

/// Result of the recheck.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rechecked {
    /// Records that were judged again; those without samples cannot be.
    pub records: usize,
    /// Levels whose amplitude was measured again: steps that control a displacement or a force.
    pub levels: usize,
    /// The differences, one sentence each.
    pub different: Vec<String>,
    /// Another version of jointrig that wrote a part of the file.
    pub other_version: Option<String>,
}

/// Recomputes everything; `at` is called with the number of records done and their total.
///
/// # Errors
/// The file cannot be read, or a record is damaged: [`Store::verify`] names it.
pub fn recheck(store: &Store, at: &dyn Fn(usize, usize)) -> Result<Rechecked, StoreError> {
    let past = Past::of(store)?;
    let mut found = Rechecked {
        other_version: store.software_versions()?.into_iter().find(|own| own != env!("CARGO_PKG_VERSION")),
        ..Rechecked::default()
    };
    let (cells, total) = (store.cells()?, store.places()?.len());
    let mut done = 0;
    for row in &cells {
        let mut before: Vec<(RecordRow, Samples)> = Vec::new();
        for record in store.records_of(row.id)? {
            at(done, total);
            done += 1;
            let record = record.map_err(|damaged| store.damaged(damaged.place.id, damaged.what))?;
            if record.scans == 0 {
                continue;
            }
            let samples = store.samples(&record)?;
            found.records += 1;
            found.different.extend(past.differs(&row.cell, &record, &samples, &before)?);
            before.push((record, samples));
        }
    }
    for level in store.levels()? {
        let level = level.map_err(|damaged| store.content(damaged.to_string()))?;
        if let Some(measured) = past.amplitudes(&level)? {
            found.levels += 1;
            let (id, was) = (level.id, level.held.show(level.reached));
            if !measured.iter().any(|amplitude| alike(*amplitude, level.reached)) {
                let now = measured.first().map_or_else(String::new, |amplitude| level.held.show(*amplitude));
                found.different.push(format!("level {id}: {was} in the file, but {now} from its samples"));
            }
        }
    }
    at(total, total);
    Ok(found)
}

fn alike(one: f64, other: f64) -> bool {
    one == other
        || (one - other).abs() <= ALIKE * one.abs().max(other.abs())
        || (one.is_nan() && other.is_nan())
}

/// Whether the stored verdict of a record matches the recomputed one.
fn agrees(record: &RecordRow, found: &Judgement) -> bool {
    let peak = alike(record.peak_n, found.peak_n);
    if record.verdict == Verdict::Noisy && record.sentence.starts_with(TOO_EARLY) {
        return peak;
    }
    peak && record.verdict == found.kind
        && alike(record.measure, found.measure)
        && alike(record.limit, found.limit)
}

/// The file's content as a function of time.
struct Past<'s> {
    store: &'s Store,
    /// Position of each row in the order of storing, by table and key.
    order: HashMap<(String, String), usize>,
    plans: Vec<(i64, Plan)>,
    overrules: Vec<Overrule>,
    calibrations: Vec<Calibration>,
    sessions: HashMap<i64, SessionInfo>,
}

impl<'s> Past<'s> {
    fn of(store: &'s Store) -> Result<Self, StoreError> {
        let mut plans = store.plans()?;
        for (_, plan) in &mut plans {
            // early stopping does not affect verdicts, and evaluating it is slow
            plan.enough = None;
        }
        Ok(Self {
            store,
            order: store.history()?.into_iter().enumerate().map(|(at, row)| (row, at)).collect(),
            plans,
            overrules: store.overrules()?,
            calibrations: store.calibrations()?,
            sessions: store.sessions()?.into_iter().collect(),
        })
    }

    /// Position of a row in the order of storing; 0 if there is no chain.
    fn at(&self, table: &str, id: i64) -> usize {
        self.order.get(&(table.to_owned(), id.to_string())).copied().unwrap_or(0)
    }

    /// The plan that was valid then, and the current one.
    fn plans(&self, then: usize) -> impl Iterator<Item = &Plan> {
        let known = self.plans.iter().rev().find(|(id, _)| self.at("plan", *id) <= then);
        known.into_iter().chain(self.plans.last()).map(|(_, plan)| plan)
    }

    /// The channels of a session with three calibrations: valid at its beginning, as measured,
    /// current.
    fn channels(&self, session: i64) -> Result<Vec<ChannelMap>, StoreError> {
        let measured = self.store.channels_as_measured(session)?;
        let imported = self.sessions.get(&session).is_some_and(|info| info.board == SessionInfo::IMPORTED);
        let begun = self.at("sessions", session);
        let mut then = measured.clone();
        for (calibration, id) in self.calibrations.iter().zip(1..) {
            if imported || calibration.from_session > session || self.at("calibrations", id) > begun {
                continue;
            }
            for channel in then.channels.iter_mut().filter(|own| own.name == calibration.channel.as_str()) {
                calibration.apply(channel);
            }
        }
        let mut all = vec![then, measured, self.store.channels(session)?];
        all.dedup();
        Ok(all)
    }

    /// Whether a record counted as good when another one was judged.
    fn stood(&self, record: &RecordRow, then: usize) -> bool {
        let of_record =
            self.overrules.iter().zip(1i64..).filter(|(overrule, _)| overrule.record == record.id);
        let last = of_record.filter(|(_, id)| self.at("overrules", *id) < then).last();
        last.map_or(record.verdict == Verdict::Good, |(overrule, _)| overrule.verdict == Verdict::Good.name())
    }

    /// A sentence if none of the verdicts that were possible at the time matches the stored one.
    fn differs(
        &self,
        cell: &Cell,
        record: &RecordRow,
        samples: &Samples,
        before: &[(RecordRow, Samples)],
    ) -> Result<Option<String>, StoreError> {
        let then = self.at("records", record.id);
        let recording = Recording {
            epoch: record.epoch,
            first_scan: record.first_scan,
            trigger_index: record.trigger_index,
            samples: samples.clone(),
            gaps: record.gaps.clone(),
            shot: record.shot,
        };
        let mut first = None;
        for map in self.channels(record.session)? {
            for plan in self.plans(then) {
                for as_it_stood in [true, false] {
                    let mut others = Others::of(Vec::new());
                    for (other, samples) in before {
                        let good = if as_it_stood {
                            self.stood(other, then)
                        } else {
                            other.verdict == Verdict::Good
                        };
                        if good && other.channels == map.len() && self.one_import(other, record) {
                            others.learn(plan, &map, samples);
                        }
                    }
                    let found = ByRecord.judge(cell, plan, &map, &recording, &others);
                    if agrees(record, &found) {
                        return Ok(None);
                    }
                    first.get_or_insert(found);
                }
            }
        }
        Ok(first.map(|found| {
            format!(
                "record {}: `{}` ({}; peak {:.2} N) in the file, but `{}` ({}; peak {:.2} N) computed from its samples",
                record.id,
                record.verdict,
                record.sentence,
                record.peak_n,
                found.kind,
                found.sentence,
                found.peak_n
            )
        }))
    }

    /// Imported hits were judged only against those of the same file.
    fn one_import(&self, one: &RecordRow, other: &RecordRow) -> bool {
        let info = |record: &RecordRow| self.sessions.get(&record.session);
        match info(other).filter(|info| info.board == SessionInfo::IMPORTED) {
            Some(own) => info(one).is_some_and(|info| info.serial == own.serial),
            None => true,
        }
    }

    /// The amplitude of a level for each possible calibration of its session and each plan, which
    /// states where the vibrometers look; `None` if no amplitude was controlled.
    fn amplitudes(&self, level: &LevelRow) -> Result<Option<Vec<f64>>, StoreError> {
        if level.end_hz.is_some() || level.held == Held::Drive || !level.whole() {
            return Ok(None);
        }
        let samples = self.store.level_samples(level)?;
        let maps = self.channels(level.session)?;
        if maps.iter().any(|map| map.len() != samples.channels()) {
            let what = format!("level {} has more or fewer channels than its session", level.id);
            return Err(self.store.content(what));
        }
        let mut along: Vec<ChannelMap> = Vec::new();
        for map in maps {
            for (_, plan) in &self.plans {
                let map = plan.along_sliding(map.clone());
                if !along.contains(&map) {
                    along.push(map);
                }
            }
        }
        let measured = |map: &ChannelMap| Meter::new(map, level.held, level.frequency_hz).amplitude(&samples);
        Ok(Some(along.iter().map(measured).collect()))
    }
}

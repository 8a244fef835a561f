//! A campaign file from a folder that `jointrig export` wrote with its document.
//!
//! Everything is checked before the campaign file is made. Records get their exported verdicts, and
//! their samples in the types in which they were measured; the caller judges them again
//! ([`recheck`](crate::campaign::recheck::recheck)) and reports the differences. What is in the
//! file already is not stored again, so that an interrupted import is continued by the same
//! command.

use std::collections::{HashMap, HashSet};
use std::io;
use std::path::{Component, Path, PathBuf};

use jointrig_protocol::channel::Channel;
use serde::Deserialize;

use super::{CellCopy, DOCUMENT, Document, LAYOUT, Place};
use crate::campaign::import::digest_of_file;
use crate::campaign::plan::configuration_named;
use crate::campaign::store::Store;
use crate::campaign::store::calibration_table::{Calibration, apply_all};
use crate::campaign::store::codec;
use crate::campaign::store::copied::SessionCopy;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::level_table::LevelRow;
use crate::campaign::store::record_table::{Overrule, RecordRow};
use crate::campaign::store::session_table::{EdgeRow, TemperatureRow};
use crate::campaign::store::stored::SampleTypes;
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, SampleType, Samples};
use crate::exchange::exported::{Holding, SignalFileError, Signals, read_exported};
use crate::exchange::{NpzError, read_frf};
use crate::{advice, untrusted_input};

/// Largest document, bytes: some 200 000 records.
const MOST: u64 = 256 << 20;

/// Key of the note that says where the campaign came from.
pub const RESTORED: &str = "restored_from";

/// Why a folder does not become a campaign file.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A file of signals.
    #[error(transparent)]
    Signals(#[from] SignalFileError),
    /// FRFs that were imported.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The document, or a file that it names, cannot be read.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// The folder is not as it was exported.
    #[error("{}: {what}: export the campaign again", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// What is different.
        what: String,
    },
    /// The export has no samples.
    #[error("{}: it was exported with --without-records: export the campaign again without that option", folder.display())]
    NoRecords {
        /// The folder.
        folder: PathBuf,
    },
    /// Written by a newer program.
    #[error("{}: its layout is {found}, this program reads {LAYOUT}: use a newer jointrig", path.display())]
    Newer {
        /// The document.
        path: PathBuf,
        /// Its layout.
        found: u32,
    },
    /// The campaign file has another plan.
    #[error(
        "{} has another plan than the export in {}: name a file that does not exist, which is then made with the exported plan",
        into.display(), folder.display()
    )]
    OtherPlan {
        /// The campaign file.
        into: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
}

/// What was restored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Restored {
    /// Name of the campaign file that was exported.
    pub campaign: String,
    /// Version of jointrig that exported it.
    pub jointrig: String,
    /// Whether the campaign file was made.
    pub created: bool,
    /// Records of the export.
    pub records: usize,
    /// Those among them without samples, which the export left out because they do not count.
    pub without_samples: usize,
    /// Levels of the export with samples.
    pub levels: usize,
    /// Levels whose samples the export left out.
    pub levels_without_samples: usize,
    /// Records and levels that were in the file before.
    pub already: usize,
    /// Records and levels that were damaged in the exported campaign, and are missing.
    pub damaged: Vec<String>,
}

/// Whether a folder holds the document of an export.
pub fn is_archive(folder: &Path) -> bool {
    folder.join(DOCUMENT).is_file()
}

/// Restores the campaign of `folder` into the file `into`, which is made if it does not exist;
/// `at` is called with the number of records done and their total.
///
/// # Errors
/// The folder is not as it was exported, or was exported without records; the file has another
/// plan, or cannot be written. A file that was made is removed again.
pub fn restore(folder: &Path, into: &Path, at: &dyn Fn(usize, usize)) -> Result<Restored, RestoreError> {
    let document = read(folder)?;
    let archive = Archive { folder, document };
    archive.check()?;
    let created = !into.exists();
    let mut store = if created {
        Store::create_with(into, &archive.document.plans)?
    } else {
        let store = Store::open(into)?;
        let (text, _) = store.plan_text()?;
        if archive.document.plans.last().is_none_or(|plan| plan.text != text) {
            return Err(RestoreError::OtherPlan { into: into.into(), folder: folder.into() });
        }
        store
    };
    let done = archive.fill(&mut store, created, at);
    match done {
        Ok(restored) => {
            store.close()?;
            Ok(restored)
        }
        Err(error) => {
            drop(store);
            if created {
                // the error that is reported is the one that matters
                let _ = std::fs::remove_file(into);
            }
            Err(error)
        }
    }
}

fn read(folder: &Path) -> Result<Document, RestoreError> {
    #[derive(Deserialize)]
    struct Layout {
        layout: u32,
    }
    let path = folder.join(DOCUMENT);
    let bytes = untrusted_input::bytes(&path, MOST)
        .map_err(|source| RestoreError::Read { path: path.clone(), source })?;
    let wrong = |error: serde_json::Error| RestoreError::Changed {
        path: path.clone(),
        what: format!("it is not the document of an export ({error})"),
    };
    let Layout { layout } = serde_json::from_slice(&bytes).map_err(wrong)?;
    if layout != LAYOUT {
        return Err(RestoreError::Newer { path, found: layout });
    }
    serde_json::from_slice(&bytes).map_err(wrong)
}

/// The file of signals that was read last: the hits of one cell follow one another.
#[derive(Default)]
struct LastRead {
    name: String,
    signals: Signals,
}

impl LastRead {
    fn get(
        &mut self,
        folder: &Path,
        name: &str,
        holding: Holding,
        bytes: impl Fn() -> u64,
    ) -> Result<&Signals, RestoreError> {
        if self.name != name {
            self.signals = read_exported(&folder.join(name), holding, bytes())?;
            name.clone_into(&mut self.name);
        }
        Ok(&self.signals)
    }
}

struct Archive<'a> {
    folder: &'a Path,
    document: Document,
}

impl Archive<'_> {
    fn changed(&self, file: &str, what: impl Into<String>) -> RestoreError {
        RestoreError::Changed { path: self.folder.join(file), what: what.into() }
    }

    /// Checks every file, and that the document's parts fit each other.
    fn check(&self) -> Result<(), RestoreError> {
        let document = &self.document;
        let inside = |name: &str| {
            let mut parts = Path::new(name).components();
            parts.all(|part| matches!(part, Component::Normal(_)))
        };
        for (name, state) in &document.files {
            if !inside(name) {
                return Err(self.changed(DOCUMENT, format!("it names `{name}`, outside the folder")));
            }
            let path = self.folder.join(name);
            let size = match std::fs::metadata(&path) {
                Ok(there) => there.len(),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    return Err(self.changed(name, "the file is missing"));
                }
                Err(source) => return Err(RestoreError::Read { path, source }),
            };
            if size != state.bytes {
                let what = format!("it has {size} bytes, and was exported with {}", state.bytes);
                return Err(self.changed(name, what));
            }
            let digest =
                digest_of_file(&path).map_err(|source| RestoreError::Read { path: path.clone(), source })?;
            if digest != state.digest {
                return Err(self.changed(name, "its content was changed since the export"));
            }
        }
        if !document.with_records && !document.records.is_empty() {
            return Err(RestoreError::NoRecords { folder: self.folder.into() });
        }
        let sessions: HashMap<i64, &SessionCopy> =
            document.sessions.iter().map(|own| (own.id, own)).collect();
        let cells: HashSet<i64> = document.cells.iter().map(|own| own.id).collect();
        let listed = |name: &String| document.files.contains_key(name);
        for own in &document.records {
            let row = &own.row;
            let fits =
                sessions.get(&row.session).is_some_and(|session| session.channels.len() == row.channels)
                    && cells.contains(&row.cell);
            let there = own.samples.as_ref().is_none_or(|place| {
                listed(&place.file)
                    && place.others.as_ref().is_none_or(listed)
                    && place.channels.iter().all(|channel| *channel < row.channels)
            });
            if !(fits && there) {
                let what = format!("record {} does not fit its session, cell or file", row.id);
                return Err(self.changed(DOCUMENT, what));
            }
        }
        for own in &document.levels {
            let fits = sessions.get(&own.row.session).is_some_and(|s| s.channels.len() == own.row.channels);
            if !(fits && own.file.as_ref().is_none_or(listed)) {
                let what = format!("level {} does not fit its session or file", own.row.id);
                return Err(self.changed(DOCUMENT, what));
            }
        }
        Ok(())
    }

    /// The channels of a session with the scales that the export used.
    fn exported_channels(&self, session: &SessionCopy) -> ChannelMap {
        let mut map = session.map();
        apply_all(&self.document.calibrations, session.id, &mut map);
        map
    }

    fn fill(
        &self,
        store: &mut Store,
        created: bool,
        at: &dyn Fn(usize, usize),
    ) -> Result<Restored, RestoreError> {
        let document = &self.document;
        let mut restored = Restored {
            campaign: document.campaign.clone(),
            jointrig: document.jointrig.clone(),
            created,
            damaged: document.damaged.clone(),
            ..Restored::default()
        };
        let sessions = self.sessions(store)?;
        let records = self.records(store, &sessions, &mut restored, at)?;
        self.levels(store, &sessions, &mut restored)?;
        self.entered(store, &sessions, &records)?;
        self.surroundings(store, &sessions)?;
        if created {
            for own in &document.cells {
                let cell = own.cell().ok_or_else(|| self.strange_cell(own))?;
                store.copy_cell_state(&cell, own.given_up.as_deref(), own.settled.as_deref())?;
            }
        }
        let from = format!(
            "{} (exported by jointrig {}, {} records, {} levels)",
            document.campaign,
            document.jointrig,
            document.records.len(),
            document.levels.len()
        );
        if restored.already < document.records.len() + document.levels.len() || created {
            store.set_meta(RESTORED, &from)?;
            store.log(&format!("restored from {}: {from}", self.folder.display()))?;
        }
        Ok(restored)
    }

    fn strange_cell(&self, own: &CellCopy) -> RestoreError {
        let CellCopy { configuration, impact, response, .. } = own;
        let what = format!("the plan has no cell {configuration}/{impact}/{response}");
        self.changed(DOCUMENT, what)
    }

    /// The id here of each session, which is stored if the file does not have it.
    fn sessions(&self, store: &Store) -> Result<HashMap<i64, i64>, RestoreError> {
        let there = store.session_copies()?;
        let mut ids = HashMap::new();
        for own in &self.document.sessions {
            let same =
                |one: &&SessionCopy| (&one.begun, &one.info, one.map()) == (&own.begun, &own.info, own.map());
            let id = match there.iter().find(same) {
                Some(one) => one.id,
                None => store.copy_session(own)?,
            };
            ids.insert(own.id, id);
        }
        Ok(ids)
    }

    /// Stores the records; returns the id here of each.
    fn records(
        &self,
        store: &Store,
        sessions: &HashMap<i64, i64>,
        restored: &mut Restored,
        at: &dyn Fn(usize, usize),
    ) -> Result<HashMap<i64, i64>, RestoreError> {
        let document = &self.document;
        let mut cells = HashMap::new();
        let here = store.cells()?;
        for own in &document.cells {
            let cell = own.cell().ok_or_else(|| self.strange_cell(own))?;
            let same = here.iter().find(|row| {
                (row.cell.configuration, &row.cell.impact, &row.cell.response)
                    == (cell.configuration, &cell.impact, &cell.response)
            });
            cells.insert(own.id, same.ok_or_else(|| self.strange_cell(own))?.id);
        }
        let key = |row: &RecordRow, cell: i64, session: i64| {
            (cell, session, row.utc.clone(), row.epoch, row.first_scan, row.shot.number)
        };
        let mut there = HashMap::new();
        let mut attempts: HashSet<(i64, u32)> = HashSet::new();
        for row in store.records()?.into_iter().flatten() {
            there.insert(key(&row, row.cell, row.session), row.id);
        }
        attempts.extend(store.places()?.iter().map(|place| (place.cell, place.attempt)));
        let (mut hits, mut others) = (LastRead::default(), LastRead::default());
        let mut ids = HashMap::new();
        for (done, own) in document.records.iter().enumerate() {
            at(done, document.records.len());
            let (cell, session) = (cells[&own.row.cell], sessions[&own.row.session]);
            restored.records += 1;
            if let Some(id) = there.get(&key(&own.row, cell, session)) {
                restored.already += 1;
                ids.insert(own.row.id, *id);
                continue;
            }
            let from = self.session(own.row.session)?;
            let samples = if let Some(place) = &own.samples {
                self.samples(&own.row, from, place, &mut hits, &mut others)?
            } else {
                restored.without_samples += usize::from(own.row.scans > 0);
                self.without_samples(&own.row)?
            };
            let mut attempt = own.row.attempt;
            while !attempts.insert((cell, attempt)) {
                attempt += 1;
            }
            let row = RecordRow { cell, attempt, session, ..own.row.clone() };
            ids.insert(own.row.id, store.copy_record(&row, samples, &from.link.clone().unwrap_or_default())?);
        }
        at(document.records.len(), document.records.len());
        Ok(ids)
    }

    fn session(&self, id: i64) -> Result<&SessionCopy, RestoreError> {
        let found = self.document.sessions.iter().find(|own| own.id == id);
        found.ok_or_else(|| self.changed(DOCUMENT, format!("session {id} is missing")))
    }

    /// The channels of a record whose samples the export left out.
    fn without_samples(&self, row: &RecordRow) -> Result<Samples, RestoreError> {
        if row.kept() {
            let what = format!("record {} counts, but its samples are missing", row.id);
            return Err(self.changed(DOCUMENT, what));
        }
        let types = self.types(&row.sample_types, row.channels)?;
        Samples::new(types.into_iter().map(ChannelSamples::empty).collect())
            .ok_or_else(|| self.changed(DOCUMENT, format!("record {} has no channels", row.id)))
    }

    fn types(&self, types: &SampleTypes, channels: usize) -> Result<Vec<SampleType>, RestoreError> {
        types.each(channels).map_err(|error| self.changed(DOCUMENT, error.to_string()))
    }

    /// The samples of a record as they were measured.
    fn samples(
        &self,
        row: &RecordRow,
        session: &SessionCopy,
        place: &Place,
        hits: &mut LastRead,
        others: &mut LastRead,
    ) -> Result<Samples, RestoreError> {
        let bytes = || self.bytes_of(&place.file);
        let mut signals: Vec<Option<&Vec<f64>>> = vec![None; row.channels];
        let found = hits.get(self.folder, &place.file, Holding::Hits, bytes)?;
        let hit = found.values.get(place.hit).filter(|hit| hit.len() == place.channels.len());
        let hit = hit.ok_or_else(|| {
            self.changed(&place.file, format!("it does not hold hit {} with its channels", place.hit))
        })?;
        for (channel, signal) in place.channels.iter().zip(hit) {
            signals[*channel] = Some(signal);
        }
        if let Some(file) = &place.others {
            let found = others.get(self.folder, file, Holding::Channels, bytes)?;
            let hit = found.records.iter().position(|record| *record == row.id);
            let hit = hit
                .and_then(|at| found.values.get(at))
                .ok_or_else(|| self.changed(file, format!("it does not hold record {}", row.id)))?;
            fill_by_name(&mut signals, session, &found.names, hit)
                .map_err(|what| self.changed(file, what))?;
        }
        let types = self.types(&row.sample_types, row.channels)?;
        let samples = self.as_measured(session, &types, &signals, row.scans);
        let samples =
            samples.map_err(|what| self.changed(&place.file, format!("record {}: {what}", row.id)))?;
        self.same_sum(session, &types, &samples, row.crc)
            .map_err(|what| self.changed(&place.file, format!("record {}: {what}", row.id)))?;
        Ok(samples)
    }

    /// Memory that the signals of a file of hits take, or those of the other channels of the same
    /// hits.
    fn bytes_of(&self, file: &str) -> u64 {
        let own = self.document.records.iter().filter_map(|own| Some((&own.row, own.samples.as_ref()?)));
        let own = own.filter(|(_, place)| place.file == file);
        // a row of cells: the file also holds the hits of the first cell of the row
        let values = |row: &RecordRow| (row.scans as u64).saturating_mul(8 * row.channels as u64);
        own.map(|(row, _)| values(row)).fold(0, u64::saturating_add)
    }

    /// The samples of a session's channels from values in SI units.
    fn as_measured(
        &self,
        session: &SessionCopy,
        types: &[SampleType],
        signals: &[Option<&Vec<f64>>],
        scans: usize,
    ) -> Result<Samples, String> {
        let map = self.exported_channels(session);
        let one = |((signal, of), channel): ((Option<&Vec<f64>>, &SampleType), &Channel)| {
            let name = &channel.name;
            let si = signal.ok_or_else(|| format!("channel {name} is missing"))?;
            if si.len() != scans {
                return Err(format!("channel {name} has {} samples, and {scans} were exported", si.len()));
            }
            ChannelSamples::from_si(*of, of.units(channel), si).map_err(|sample| {
                format!("channel {name}, sample {sample} is no value of its type ({})", of.name())
            })
        };
        let all =
            signals.iter().copied().zip(types).zip(&map.channels).map(one).collect::<Result<Vec<_>, _>>()?;
        Samples::new(all).ok_or_else(|| "its channels differ in length".into())
    }

    /// Compares the checksum of samples. Different samples in double precision may have the same
    /// value in SI units, which alone was exported.
    fn same_sum(
        &self,
        session: &SessionCopy,
        types: &[SampleType],
        samples: &Samples,
        crc: u32,
    ) -> Result<(), String> {
        let map = self.exported_channels(session);
        let ambiguous =
            |(of, channel): (&SampleType, &Channel)| *of == SampleType::F64 && of.units(channel) != 1.0;
        if types.iter().zip(&map.channels).any(ambiguous) || codec::checksum(samples) == crc {
            Ok(())
        } else {
            Err("its samples are not those that were measured".into())
        }
    }

    fn levels(
        &self,
        store: &Store,
        sessions: &HashMap<i64, i64>,
        restored: &mut Restored,
    ) -> Result<(), RestoreError> {
        let there: Vec<LevelRow> = store.levels()?.into_iter().flatten().collect();
        for own in &self.document.levels {
            let (row, session) = (&own.row, sessions[&own.row.session]);
            let same = |one: &LevelRow| {
                (one.session, &one.utc, one.first_scan, one.crc)
                    == (session, &row.utc, row.first_scan, row.crc)
            };
            if there.iter().any(same) {
                restored.levels += 1;
                restored.already += 1;
                continue;
            }
            let Some(file) = &own.file else {
                restored.levels_without_samples += 1;
                continue;
            };
            let from = self.session(row.session)?;
            let bytes = (row.scans as u64).saturating_mul(8 * row.channels as u64);
            let found = read_exported(&self.folder.join(file), Holding::Channels, bytes)?;
            let mut signals = vec![None; row.channels];
            let hit = found.values.first().ok_or_else(|| self.changed(file, "it is empty"))?;
            let types = self.types(&row.sample_types, row.channels)?;
            let samples = fill_by_name(&mut signals, from, &found.names, hit)
                .and_then(|()| self.as_measured(from, &types, &signals, row.scans))
                .and_then(|samples| self.same_sum(from, &types, &samples, row.crc).map(|()| samples))
                .map_err(|what| self.changed(file, what))?;
            store.copy_level(&LevelRow { session, ..row.clone() }, samples)?;
            restored.levels += 1;
        }
        Ok(())
    }

    /// What persons entered: calibrations and overruled verdicts.
    fn entered(
        &self,
        store: &Store,
        sessions: &HashMap<i64, i64>,
        records: &HashMap<i64, i64>,
    ) -> Result<(), RestoreError> {
        let there = store.calibrations()?;
        for own in &self.document.calibrations {
            // it may apply from a session which never took place
            let next = store.next_session()?;
            let from_session = sessions.get(&own.from_session).copied().unwrap_or(next);
            let row = Calibration { from_session, ..own.clone() };
            if !there.contains(&row) {
                store.copy_calibration(row)?;
            }
        }
        let there = store.overrules()?;
        for own in &self.document.overrules {
            let Some(record) = records.get(&own.record).copied() else { continue };
            let row = Overrule { record, ..own.clone() };
            if !there.contains(&row) {
                store.copy_overrule(row)?;
            }
        }
        Ok(())
    }

    /// Imported FRFs, temperatures, edges, notes and log.
    fn surroundings(&self, store: &Store, sessions: &HashMap<i64, i64>) -> Result<(), RestoreError> {
        let document = &self.document;
        for own in &document.frfs {
            let configuration = configuration_named(&own.configuration).ok_or_else(|| {
                self.changed(DOCUMENT, format!("there is no configuration {}", own.configuration))
            })?;
            if store.frf(&own.configuration)?.is_none() {
                let frf = read_frf(&self.folder.join(&own.file))?;
                store.insert_frf(configuration, &own.source, &frf)?;
            }
        }
        let here = |session: i64| sessions.get(&session).copied();
        let (temperatures, edges) = (store.temperatures()?, store.edges()?);
        for own in &document.temperatures {
            let Some(session) = here(own.session) else { continue };
            let row = TemperatureRow { session, ..own.clone() };
            if !temperatures.contains(&row) {
                store.copy_temperature(row)?;
            }
        }
        for own in &document.edges {
            let Some(session) = here(own.session) else { continue };
            let row = EdgeRow { session, ..own.clone() };
            if !edges.contains(&row) {
                store.copy_edge(row)?;
            }
        }
        for (key, value) in &document.notes {
            if store.meta(key)?.is_none() {
                store.set_meta(key, value)?;
            }
        }
        let lines = store.log_lines(0)?;
        let lines: HashSet<_> = lines.iter().map(|(_, utc, text)| (utc, text)).collect();
        for own in &document.log {
            if !lines.contains(&(&own.utc, &own.text)) {
                store.copy_log(own.clone())?;
            }
        }
        Ok(())
    }
}

/// Puts the signals of channels into their places, by name.
fn fill_by_name<'s>(
    signals: &mut [Option<&'s Vec<f64>>],
    session: &SessionCopy,
    names: &[String],
    hit: &'s [Vec<f64>],
) -> Result<(), String> {
    if names.len() != hit.len() {
        return Err(format!("it names {} channels and holds {}", names.len(), hit.len()));
    }
    for (name, signal) in names.iter().zip(hit) {
        let place = session.channels.iter().position(|channel| channel.name.as_str() == name);
        let slot = place.and_then(|place| signals.get_mut(place));
        *slot.ok_or_else(|| format!("its channel {name} is not one of the session's"))? = Some(signal);
    }
    Ok(())
}

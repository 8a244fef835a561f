//! The document of an export, `archive.json`: everything that a campaign file holds beside its
//! samples, and where the samples are among the exported files.
//!
//! With it a folder that `jointrig export` wrote becomes the same campaign again ([`restore`]):
//! plans, sessions with scales, delays and sensors, records with their verdicts, what persons
//! overruled, calibrations, levels, temperatures, notes. The samples are in the files that other
//! programs read, in SI units; the sample types and scales of the document give the codes back.
//! The document is written last, and states the size and SHA-256 of every file that it needs: a
//! file that is missing, cut short or changed is noticed before anything is stored.

pub mod restore;

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};

use super::import::digest_of_file;
use super::plan::{Cell, configuration_name, configuration_named};
use super::store::Store;
use super::store::calibration_table::Calibration;
use super::store::cell_table::CellRow;
use super::store::copied::{LogCopy, PlanSource, SessionCopy};
use super::store::error::StoreError;
use super::store::level_table::LevelRow;
use super::store::record_table::{Overrule, RecordRow};
use super::store::session_table::{EdgeRow, TemperatureRow};
use crate::advice;
use crate::exchange::{NpzError, write_frf};

/// Name of the document in the folder.
pub const DOCUMENT: &str = "archive.json";

/// Name of the file with the plan in effect.
pub const PLAN: &str = "plan.toml";

/// Version of the document.
const LAYOUT: u32 = 1;

/// Why the document cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// FRFs that were imported.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A file of the folder.
    #[error("{}: {doing}: {source}; {}", path.display(), advice::writing(source))]
    File {
        /// The file.
        path: PathBuf,
        /// The operation that failed.
        doing: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
}

/// A file of the export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct FileState {
    bytes: u64,
    /// As [`digest_of_file`].
    digest: String,
}

/// A cell, by name, and its state.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct CellCopy {
    id: i64,
    configuration: String,
    impact: String,
    response: String,
    wanted: u32,
    given_up: Option<String>,
    settled: Option<String>,
}

impl CellCopy {
    fn of(row: CellRow) -> Self {
        let CellRow { id, cell, given_up, settled } = row;
        let Cell { configuration, impact, response, wanted } = cell;
        let configuration = configuration_name(configuration).into();
        Self { id, configuration, impact, response, wanted, given_up, settled }
    }

    /// The cell; `None` if its configuration has no such name.
    fn cell(&self) -> Option<Cell> {
        let Self { impact, response, wanted, .. } = self.clone();
        Some(Cell { configuration: configuration_named(&self.configuration)?, impact, response, wanted })
    }
}

/// Where a record's samples are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// The file with force and response, relative to the folder.
    pub file: String,
    /// Index of the hit in it, from 0.
    pub hit: usize,
    /// Indices of the session's channels in that file: the force first.
    pub channels: Vec<usize>,
    /// The file with the other channels, if there are any.
    pub others: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct RecordCopy {
    row: RecordRow,
    /// `None` where the export holds no samples of it.
    samples: Option<Place>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct LevelCopy {
    row: LevelRow,
    /// The file with all its channels, relative to the folder.
    file: Option<String>,
}

/// FRFs of a configuration that were imported.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct FrfCopy {
    configuration: String,
    source: String,
    utc: String,
    file: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Document {
    layout: u32,
    /// Version of jointrig that exported.
    jointrig: String,
    /// Name of the campaign file.
    campaign: String,
    /// Whether the records' samples were to be exported.
    with_records: bool,
    /// The last one is in effect.
    plans: Vec<PlanSource>,
    sessions: Vec<SessionCopy>,
    cells: Vec<CellCopy>,
    records: Vec<RecordCopy>,
    /// Records and levels that are damaged in the campaign file, and were left out.
    damaged: Vec<String>,
    overrules: Vec<Overrule>,
    calibrations: Vec<Calibration>,
    levels: Vec<LevelCopy>,
    frfs: Vec<FrfCopy>,
    temperatures: Vec<TemperatureRow>,
    edges: Vec<EdgeRow>,
    log: Vec<LogCopy>,
    notes: Vec<(String, String)>,
    files: BTreeMap<String, FileState>,
}

/// What an export wrote into its folder.
#[derive(Debug, Default)]
pub struct Exported {
    /// Whether the records' samples were to be exported.
    pub with_records: bool,
    /// Where each record's samples are.
    pub records: HashMap<i64, Place>,
    /// The file with all channels of each level.
    pub levels: HashMap<i64, String>,
    /// Further files that must not change: tables.
    pub tables: Vec<String>,
}

/// Writes the plan, imported FRFs and the document into the folder of an export.
///
/// # Errors
/// The campaign file cannot be read, or the folder not written.
pub fn write(store: &Store, folder: &Path, exported: &Exported) -> Result<(), ArchiveError> {
    let plans = store.plan_sources()?;
    let failed = |path: PathBuf, doing| move |source| ArchiveError::File { path, doing, source };
    let put = |name: &str, content: &[u8], doing| {
        let path = folder.join(name);
        std::fs::write(&path, content).map_err(failed(path, doing))
    };
    let text = plans.last().map_or("", |plan| plan.text.as_str());
    put(PLAN, text.as_bytes(), "writing the plan")?;
    let frfs = write_frfs(store, folder)?;
    let mut damaged = Vec::new();
    let mut records = Vec::new();
    for record in store.records()? {
        match record {
            Ok(row) => {
                let samples = exported.records.get(&row.id).cloned();
                records.push(RecordCopy { row, samples });
            }
            Err(own) => damaged.push(format!("record {}: {}", own.place.id, own.what)),
        }
    }
    let mut levels = Vec::new();
    for level in store.levels()? {
        match level {
            Ok(row) => {
                let file = exported.levels.get(&row.id).cloned();
                levels.push(LevelCopy { row, file });
            }
            Err(own) => damaged.push(own.to_string()),
        }
    }
    let named = (records.iter().filter_map(|own| own.samples.as_ref()))
        .flat_map(|place| std::iter::once(&place.file).chain(&place.others))
        .chain(levels.iter().filter_map(|own| own.file.as_ref()))
        .chain(frfs.iter().map(|own| &own.file))
        .chain(&exported.tables);
    let mut names: Vec<String> = named.cloned().chain([PLAN.to_owned()]).collect();
    names.sort();
    names.dedup();
    let mut files = BTreeMap::new();
    for name in names {
        let path = folder.join(&name);
        let state = std::fs::metadata(&path)
            .and_then(|there| Ok(FileState { bytes: there.len(), digest: digest_of_file(&path)? }))
            .map_err(failed(path, "reading what was exported"))?;
        files.insert(name, state);
    }
    let log = store.log_lines(0)?.into_iter().map(|(_, utc, text)| LogCopy { utc, text }).collect();
    let document = Document {
        layout: LAYOUT,
        jointrig: env!("CARGO_PKG_VERSION").into(),
        campaign: store.path().file_name().unwrap_or_default().to_string_lossy().into_owned(),
        with_records: exported.with_records,
        plans,
        sessions: store.session_copies()?,
        cells: store.cells()?.into_iter().map(CellCopy::of).collect(),
        records,
        damaged,
        overrules: store.overrules()?,
        calibrations: store.calibrations()?,
        levels,
        frfs,
        temperatures: store.temperatures()?,
        edges: store.edges()?,
        log,
        notes: store.notes()?,
        files,
    };
    let json = serde_json::to_string_pretty(&document)
        .map_err(|error| failed(folder.join(DOCUMENT), "writing the archive's document")(error.into()))?;
    put(DOCUMENT, (json + "\n").as_bytes(), "writing the archive's document")
}

/// Writes the FRFs that were imported, as they were.
fn write_frfs(store: &Store, folder: &Path) -> Result<Vec<FrfCopy>, ArchiveError> {
    let mut all = Vec::new();
    for configuration in crate::structure::Structure::ALL.map(crate::structure::Structure::name) {
        let Some(found) = store.frf(configuration)? else { continue };
        let place = folder.join("imported_frf");
        std::fs::create_dir_all(&place).map_err(|source| ArchiveError::File {
            path: place.clone(),
            doing: "making the folder",
            source,
        })?;
        let file = format!("imported_frf/{configuration}.npz");
        write_frf(&folder.join(&file), &found.frf, &[])?;
        let (source, utc) = (found.source, found.utc);
        all.push(FrfCopy { configuration: configuration.into(), source, utc, file });
    }
    Ok(all)
}

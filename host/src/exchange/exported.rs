//! Reads back the signals that an export wrote: the force and responses of a cell's hits, and other
//! channels, in npz, universal files or comma-separated text.
//!
//! Nothing is interpreted: units are SI and the order is that of the export. Every value comes back
//! bit for bit in all three forms.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::NpzError;
use super::frf_uff::{FrfUffError, contents};
use super::npz::{Array, NpzFile};
use super::uff::{Function, Values, kind};
use crate::{advice, untrusted_input};

/// Why a file of signals cannot be read: one that an export wrote, or one of another recorder.
#[derive(Debug, thiserror::Error)]
pub enum SignalFileError {
    /// An npz file.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A universal file.
    #[error(transparent)]
    Uff(#[from] FrfUffError),
    /// It cannot be opened.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// Its content is not as expected.
    #[error("{}: {what}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        what: String,
    },
}

/// The signals of one or more records, SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals {
    /// The channels' names; empty for force and responses, which have none.
    pub names: Vec<String>,
    /// The record of each hit; empty for force and responses, which are in the order of hits.
    pub records: Vec<i64>,
    /// The values: (hit, channel, sample).
    pub values: Vec<Vec<Vec<f64>>>,
}

/// Which of both kinds a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// The force and the responses of a cell's hits.
    Hits,
    /// Other channels, with the record of each hit.
    Channels,
}

/// Reads a file that an export wrote; `bytes` is the memory that its signals take according to the
/// export.
///
/// # Errors
/// The file cannot be read, or does not have the form of an exported one.
pub fn read_exported(path: &Path, holding: Holding, bytes: u64) -> Result<Signals, SignalFileError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("npz") => of_npz(path, holding, bytes),
        Some("uff") => of_uff(path, holding),
        Some("csv") => of_csv(path, holding),
        _ => Err(wrong(path, "it is neither .npz nor .uff nor .csv")),
    }
}

fn wrong(path: &Path, what: impl Into<String>) -> SignalFileError {
    let what = format!("{}: export it again", what.into());
    SignalFileError::Content { path: path.into(), what }
}

/// The rows of an array along its first axes.
fn rows(array: &Array<f64>, length: usize) -> impl Iterator<Item = Vec<f64>> + '_ {
    array.values.chunks(length.max(1)).map(<[f64]>::to_vec)
}

fn of_npz(path: &Path, holding: Holding, bytes: u64) -> Result<Signals, SignalFileError> {
    let mut file = NpzFile::open(path)?.allowing(bytes.saturating_add(1 << 20));
    if holding == Holding::Hits {
        let force = file.real("force", "(hit, sample), N")?;
        let response = file.real("response", "(hit, channel, sample), SI")?;
        let (&[hits, scans], &[as_many, channels, as_long]) = (&force.shape[..], &response.shape[..]) else {
            return Err(wrong(path, "`force` and `response` do not have two and three axes"));
        };
        if hits != as_many || scans != as_long {
            return Err(wrong(path, "`force` and `response` differ in hits or samples"));
        }
        let mut responses = rows(&response, scans);
        let values = rows(&force, scans)
            .map(|force| std::iter::once(force).chain(responses.by_ref().take(channels)).collect())
            .collect();
        return Ok(Signals { values, ..Signals::default() });
    }
    let names = file.text("names", "(channel)")?.values;
    let records = file.real("record", "(hit)")?.values.iter().map(|id| *id as i64).collect::<Vec<_>>();
    let signals = file.real("signals", "(hit, channel, sample), SI")?;
    let &[hits, channels, scans] = &signals.shape[..] else {
        return Err(wrong(path, "`signals` does not have three axes"));
    };
    if hits != records.len() || channels != names.len() {
        return Err(wrong(path, "`signals` does not have one row for each record and name"));
    }
    let mut all = rows(&signals, scans);
    let values = (0..hits).map(|_| all.by_ref().take(channels).collect()).collect();
    Ok(Signals { names, records, values })
}

fn of_uff(path: &Path, holding: Holding) -> Result<Signals, SignalFileError> {
    let contents = contents(path)?;
    if let Some(fault) = contents.faults.first() {
        return Err(wrong(path, format!("{fault}")));
    }
    let mut found = Signals::default();
    let mut last = None;
    for function in contents.functions() {
        let Values::Real(values) = &function.values else {
            return Err(wrong(path, "a time response is complex"));
        };
        if function.kind != kind::TIME {
            return Err(wrong(path, "it holds other functions than time responses"));
        }
        if last != Some(function.version) {
            last = Some(function.version);
            found.values.push(Vec::new());
            if holding == Holding::Channels {
                found.records.push(function.version);
            }
        }
        if holding == Holding::Channels && found.values.len() == 1 {
            found.names.push(name_of(function).ok_or_else(|| wrong(path, "a channel has no name"))?);
        }
        if let Some(hit) = found.values.last_mut() {
            hit.push(values.clone());
        }
    }
    Ok(found)
}

/// The channel's name from the identification `record 7, NAME`.
fn name_of(function: &Function) -> Option<String> {
    function.id[0].split_once(", ").map(|(_, name)| name.to_owned())
}

fn of_csv(path: &Path, holding: Holding) -> Result<Signals, SignalFileError> {
    let opened = untrusted_input::open(path);
    let (file, _) = opened.map_err(|source| SignalFileError::Open { path: path.into(), source })?;
    let mut reader: csv::Reader<File> = csv::Reader::from_reader(file);
    let failed = |error: csv::Error| wrong(path, error.to_string());
    let heading = reader.headers().map_err(failed)?.clone();
    let mut found = Signals::default();
    let columns = heading.len().saturating_sub(2);
    if holding == Holding::Channels {
        let bare = |name: &str| name.rsplit_once(" (").map_or(name, |(name, _)| name).to_owned();
        found.names = heading.iter().skip(2).map(bare).collect();
    }
    let mut last: Option<String> = None;
    for row in reader.records() {
        let row = row.map_err(failed)?;
        let hit = &row[0];
        if last.as_deref() != Some(hit) {
            let number = hit.parse().map_err(|_| wrong(path, format!("`{hit}` is not a number of a hit")))?;
            last = Some(hit.to_owned());
            found.values.push(vec![Vec::new(); columns]);
            if holding == Holding::Channels {
                found.records.push(number);
            }
        }
        for (signal, text) in found.values.last_mut().into_iter().flatten().zip(row.iter().skip(2)) {
            signal.push(text.parse().map_err(|_| wrong(path, format!("`{text}` is not a number")))?);
        }
    }
    Ok(found)
}

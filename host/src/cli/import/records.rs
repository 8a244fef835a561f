//! Imports impact records into one cell of a campaign file.

use std::io::Read;
use std::path::Path;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use jointrig_protocol::shot::{Phase, Shot};
use sha2::{Digest, Sha256};
use toml::Spanned;

use super::as_recorded::as_recorded;
use super::bad;
use crate::analyse::AnalysedLength;
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::record_table::{NewRecord, RecordRow};
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::judge::{ByRecord, Judge};
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use crate::exchange::StatedUnits;
use crate::exchange::record_file::{PlannedPlace, RecordFile};
use crate::exchange::record_uff::read_record_file;
use crate::spectra::{Pulse, reversed_peak_n};
use crate::untrusted_input;
use crate::untrusted_text::tell_line;

/// The cell that the records belong to.
pub(super) struct CellName<'n> {
    pub(super) configuration: &'n str,
    pub(super) impact: &'n str,
    pub(super) response: &'n str,
}

/// Source of the records.
pub(super) struct RecordSource {
    /// Name of the file in the campaign file.
    name: String,
    /// Digest that identifies its content.
    digest: String,
}

impl RecordSource {
    pub(super) fn of(path: &Path, name: &str) -> Result<Self, CliError> {
        let failed = |source| CliError::Read { path: path.into(), doing: "reading a file to import", source };
        let (mut file, size) = untrusted_input::open(path).map_err(failed)?;
        let (mut digest, mut piece, mut read) = (Sha256::new(), vec![0; 1 << 16], 0u64);
        loop {
            let count = file.read(&mut piece).map_err(failed)?;
            read += count as u64;
            if count == 0 || read > size {
                break;
            }
            digest.update(&piece[..count]);
        }
        let digest = format!("sha256:{}", BASE64_STANDARD.encode(digest.finalize()));
        Ok(Self { name: name.into(), digest })
    }

    fn address(&self) -> String {
        format!("file:{}", self.name)
    }
}

/// Result of an import of records.
#[derive(Debug, Clone, Default)]
pub(super) struct Brought {
    pub(super) cells: usize,
    pub(super) hits: usize,
    pub(super) kept: usize,
    /// Hits that were already stored by an earlier import of the same file.
    pub(super) already: usize,
    /// Name and type of each channel as stored.
    types: Vec<String>,
    /// What was used of the last file, in one line.
    pub(super) taken: String,
}

impl Brought {
    pub(super) fn add(&mut self, other: &Brought) {
        self.cells += other.cells;
        self.hits += other.hits;
        self.kept += other.kept;
        self.already += other.already;
    }
}

/// Imports one file, and prints what was done.
pub(super) fn import(
    file: &Path,
    into: &Path,
    name: &CellName<'_>,
    replace: bool,
    units: &StatedUnits,
) -> Result<(), CliError> {
    let read = read_record_file(file, units).map_err(bad)?;
    for note in &read.notes {
        tell_line!("{}: {note}", file.display());
    }
    let mut store = Store::open(into)?;
    let called = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let origin = RecordSource::of(file, &called)?;
    let Brought { hits, kept, already, types, taken, .. } =
        bring(&mut store, &origin, name, read, replace, &mut |hit, verdict| {
            tell_line!("hit {hit}: {} ({})", verdict.kind, verdict.sentence);
        })?;
    store.log(&format!("imported {hits} hits from {}", file.display()))?;
    let length = length_notice(&store)?;
    store.close()?;
    if kept == 0 {
        return Err(bad(format!(
            "{}: none of the {hits} hits is good; they are stored with their verdicts, and no analysis uses them",
            file.display()
        )));
    }
    let mut lines = vec![
        format!("{}: {taken}", file.display()),
        format!("{}: {kept} of {hits} hits are good", into.display()),
    ];
    lines.extend(length);
    if already > 0 {
        lines.push(format!("{already} of them were there already, from an earlier import of the same file"));
    }
    if already < hits {
        lines.push(format!("stored with every digit: {}", types.join(", ")));
    }
    output::lines(lines)
}

/// Message about the length of the records that were imported into a campaign.
pub(super) fn length_notice(store: &Store) -> Result<Option<String>, CliError> {
    let notice = AnalysedLength::of(store, &store.plan()?)?.notice();
    Ok(notice.map(|notice| format!("{}: {notice}", store.path().display())))
}

/// Judges the hits like measured ones and stores those that are not yet present; reports each
/// verdict.
///
/// # Errors
/// There is no such cell, a hit has no pulse, the force has the wrong sign in all hits, or hits of
/// another file with this name exist and must not be replaced.
pub(super) fn bring(
    store: &mut Store,
    origin: &RecordSource,
    name: &CellName<'_>,
    read: RecordFile,
    replace: bool,
    tell: &mut dyn FnMut(u32, &Judgement),
) -> Result<Brought, CliError> {
    let plan = store.plan()?;
    let (id, cell, attempt) = find(store, name)?;
    let wrong = |reason: String| bad(format!("{}: {reason}", origin.name));
    let (read, axes) = along_plan(&plan, &cell, read).map_err(wrong)?;
    let RecordFile { records, delay_s, taken, .. } = read;
    let records = &records;
    let (mut map, samples) = as_recorded(records, axes).map_err(wrong)?;
    put_in_step(&mut map, &delay_s);
    let reversed: Vec<Option<f64>> = records.force_n.iter().map(|f| reversed_peak_n(f)).collect();
    if let (Some(peak_n), true) = (reversed.first().copied().flatten(), reversed.iter().all(Option::is_some))
    {
        return Err(wrong(format!(
            "the force's sign is the wrong way round: peak {peak_n:.1} N; a push is positive, so multiply the force by -1"
        )));
    }
    let types = samples.first().map(Samples::types).unwrap_or_default();
    let types = map.channels.iter().zip(types).map(|(c, of)| format!("{} {}", c.name, of.name())).collect();
    let mut recordings: Vec<Recording> = Vec::new();
    for (hit, own) in samples.into_iter().enumerate() {
        let pulse = Pulse::locate(&records.force_n[hit]);
        if pulse.is_none() && reversed[hit].is_none() {
            return Err(wrong(format!("hit {hit} has no force pulse: remove it")));
        }
        recordings.push(recording(hit, own, pulse.as_ref(), records.fs_hz));
    }
    let there = already_there(store, origin, id, replace)?;
    let mut own_session: Option<i64> = None;
    let mut brought = Brought {
        cells: 1,
        hits: recordings.len(),
        already: there.len(),
        taken,
        types,
        ..Brought::default()
    };
    let mut others = Others::of(map.responses().unwrap_or_default());
    for (hit, recording) in (0..).zip(recordings) {
        let verdict = ByRecord.judge(&cell, &plan, &map, &recording, &others);
        if verdict.kind == Verdict::Good {
            others.learn(&plan, &map, &recording.samples);
            brought.kept += 1;
        }
        tell(hit, &verdict);
        if !there.contains(&hit) {
            let session = match own_session {
                Some(session) => session,
                None => store.begin_session(&session(origin), &map)?,
            };
            own_session = Some(session);
            let record = NewRecord {
                cell: id,
                attempt: attempt + hit,
                session,
                utc: utc_now(),
                // the time of measurement is unknown
                utc_error_s: None,
                recording,
                verdict,
            };
            store.insert(&record, &Counters::default())?;
        }
    }
    Ok(brought)
}

/// The records along the directions that the plan defines for the cell, and the number of axes of
/// its location.
fn along_plan(plan: &Plan, cell: &Cell, read: RecordFile) -> Result<(RecordFile, usize), String> {
    let points = |name: &str| plan.geometry.response.iter().map(Spanned::get_ref).find(|p| p.name == name);
    let hammer = plan.geometry.impact.iter().map(Spanned::get_ref).find(|p| p.name == cell.impact);
    let (Some(sensor), Some(hammer)) = (points(&cell.response), hammer) else { return Ok((read, 3)) };
    let axes: Vec<[f64; 3]> = sensor.axes().into_iter().map(|(_, axis)| axis).collect();
    let place = PlannedPlace {
        impact: &cell.impact,
        push: hammer.direction,
        response: &cell.response,
        axes: &axes,
        own_axes: sensor.axes.is_some(),
    };
    Ok((read.along_plan(&place)?, axes.len()))
}

/// Stores the delay of each channel relative to the earliest, since delays of channels are not
/// negative.
fn put_in_step(map: &mut ChannelMap, delay_s: &[f64]) {
    let earliest = delay_s.iter().copied().fold(0.0, f64::min);
    let late = std::iter::once(0.0).chain(delay_s.iter().copied());
    for (channel, late) in map.channels.iter_mut().zip(late) {
        // less than a sample
        channel.delay_ns = (1e9 * (late - earliest)).round() as u32;
    }
}

/// The hits of exactly this file that the cell contains; those of another file with the same name
/// are dropped, or refused.
fn already_there(
    store: &Store,
    origin: &RecordSource,
    cell: i64,
    replace: bool,
) -> Result<Vec<u32>, CliError> {
    let sessions = store.sessions()?;
    let imported = |row: &RecordRow| {
        let own = sessions.iter().find(|(id, _)| *id == row.session).map(|(_, info)| info);
        own.filter(|info| info.board == SessionInfo::IMPORTED)
    };
    let rows: Vec<RecordRow> = store.records_of(cell)?.into_iter().flatten().collect();
    let (mut same, mut older) = (Vec::new(), Vec::new());
    for row in &rows {
        match imported(row) {
            Some(info) if info.serial == origin.digest => same.push(row.shot.number),
            Some(info) if info.address == origin.address() && row.kept() => older.push(row.id),
            _ => {}
        }
    }
    if !older.is_empty() && !replace {
        return Err(bad(format!(
            "{}: {} good hits of this cell came from another file `{}` before: --replace drops those and uses these instead",
            store.path().display(),
            older.len(),
            origin.name
        )));
    }
    for record in older {
        store.overrule(
            record,
            Verdict::Dropped,
            &format!("replaced by {} ({})", origin.name, origin.digest),
        )?;
    }
    Ok(same)
}

/// The cell's id, the cell, and its first free attempt number.
fn find(store: &Store, name: &CellName<'_>) -> Result<(i64, Cell, u32), CliError> {
    let configuration = store
        .plan()?
        .configuration(name.configuration)
        .map_or(name.configuration, |own| configuration_name(own));
    let wanted = [configuration, name.impact, name.response];
    let found = store.cells()?.into_iter().find(|row| {
        let Cell { configuration, impact, response, .. } = &row.cell;
        [configuration_name(*configuration), impact, response] == wanted
    });
    let Some(row) = found else {
        return Err(CliError::Usage(format!(
            "{} has no cell of configuration `{}`, impact `{}`, response `{}`: `jointrig campaign status --json` lists its cells",
            store.path().display(),
            wanted[0],
            wanted[1],
            wanted[2]
        )));
    };
    let attempts = store.places()?.iter().filter(|r| r.cell == row.id).map(|r| r.attempt + 1).max();
    Ok((row.id, row.cell, attempts.unwrap_or(0)))
}

fn session(origin: &RecordSource) -> SessionInfo {
    SessionInfo {
        address: origin.address(),
        board: SessionInfo::IMPORTED.into(),
        serial: origin.digest.clone(),
        firmware_version: String::new(),
        target: String::new(),
        build: Hex(0),
        schema_hash: Hex(0),
    }
}

fn recording(hit: usize, samples: Samples, pulse: Option<&Pulse>, fs_hz: f64) -> Recording {
    let start = pulse.map_or(0, |pulse| pulse.start);
    Recording {
        epoch: 0,
        first_scan: 0,
        trigger_index: start,
        samples,
        gaps: Vec::new(),
        shot: Shot {
            number: hit as u32,
            phase: Phase::Done,
            fired_at: 0,
            trigger: start as u64,
            pulse_us: 0,
            peak_n: pulse.map_or(0.0, |pulse| pulse.peak_n as f32),
            // the pulse's width determines how much of the record before its trigger is needed
            width_us: pulse.map_or(0.0, |pulse| (1e6 * pulse.width() as f64 / fs_hz) as f32),
            rebound_ratio: 0.0,
            rebound_after: 0,
            friction_peak_n: 0.0,
            quiet_ratio: 0.0,
        },
    }
}

//! Impact records from elsewhere into one cell of a campaign file.

use std::path::Path;

use jointrig_protocol::shot::{Phase, Shot};

use super::bad;
use super::quantised::quantised;
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::record_row::NewRecord;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::Kind;
use crate::campaign::verdict::judge::{ByRecord, Judge};
use crate::campaign::verdict::others::Others;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::device::recording::Recording;
use crate::exchange::record_uff::read_record_file;
use crate::spectra::Pulse;

/// The cell that the records belong to.
pub(super) struct CellName<'n> {
    pub(super) configuration: &'n str,
    pub(super) impact: &'n str,
    pub(super) response: &'n str,
}

pub(super) fn import(file: &Path, into: &Path, name: &CellName<'_>) -> Result<(), CliError> {
    let (records, warnings) = read_record_file(file).map_err(bad)?;
    for warning in &warnings {
        eprintln!("{}: {warning}", file.display());
    }
    let mut store = Store::open(into)?;
    let plan = store.plan()?;
    let (id, cell, attempt) = find(&store, name)?;
    let (map, codes) = quantised(&records).map_err(|reason| bad(format!("{}: {reason}", file.display())))?;
    let recordings: Vec<Recording> = codes
        .into_iter()
        .zip(&records.force_n)
        .enumerate()
        .map(|(hit, (codes, force_n))| {
            let no_pulse = || bad(format!("{}: hit {hit} has no force pulse: take it out", file.display()));
            Ok(recording(hit, codes, map.len(), &Pulse::locate(force_n).ok_or_else(no_pulse)?))
        })
        .collect::<Result<_, CliError>>()?;
    let session = store.begin_session(&session(file), &map)?;
    let (mut kept, mut others) = (0, Others::default());
    let hits = recordings.len();
    for (hit, recording) in recordings.into_iter().enumerate() {
        let verdict = ByRecord.judge(&cell, &plan, &map, &recording, &others);
        if verdict.kind == Kind::Good {
            others.learn(&plan, &map, recording.view());
            kept += 1;
        }
        eprintln!("hit {hit}: {} ({})", verdict.kind, verdict.sentence);
        let record = NewRecord {
            cell: id,
            attempt: attempt + hit as u32,
            session,
            utc: utc_now(),
            // when it was measured is not known here
            utc_error_s: None,
            recording,
            verdict,
        };
        store.insert(&record, &Counters::default())?;
    }
    let rounding: Vec<String> = map
        .channels
        .iter()
        .map(|c| format!("{} {:.1e} {}", c.name, 0.5 * c.units_per_code().abs(), c.quantity.unit()))
        .collect();
    store.log(&format!("imported {hits} hits from {}", file.display()))?;
    store.close()?;
    output::lines([
        format!("{}: {kept} of {hits} hits are good", into.display()),
        format!("stored in 16 bits, rounded by at most: {}", rounding.join(", ")),
    ])
}

/// The cell's id, the cell, and the first attempt that is free in it.
fn find(store: &Store, name: &CellName<'_>) -> Result<(i64, Cell, u32), CliError> {
    let wanted = [name.configuration, name.impact, name.response];
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

fn session(file: &Path) -> SessionInfo {
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    SessionInfo {
        address: format!("file:{name}"),
        board: SessionInfo::IMPORTED.into(),
        serial: String::new(),
        firmware_version: String::new(),
        target: String::new(),
        build: Hex(0),
        schema_hash: Hex(0),
    }
}

fn recording(hit: usize, codes: Vec<i16>, channels: usize, pulse: &Pulse) -> Recording {
    Recording {
        epoch: 0,
        first_scan: 0,
        trigger_index: pulse.start,
        channels,
        codes,
        gaps: Vec::new(),
        shot: Shot {
            number: hit as u32,
            phase: Phase::Done,
            fired_at: 0,
            trigger: pulse.start as u64,
            pulse_us: 0,
            peak_n: pulse.peak_n as f32,
            width_us: 0.0,
            rebound_ratio: 0.0,
            rebound_after: 0,
            friction_peak_n: 0.0,
            quiet_ratio: 0.0,
        },
    }
}

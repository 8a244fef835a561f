//! Every file of a folder into a campaign file, in one command that may be repeated: what is there already is not stored twice.

use std::path::Path;

use super::names::{Named, Source, from_folder, from_table};
use super::records::{Brought, CellName, Origin, bring, length_notice};
use super::{Frfs, bad, frfs};
use crate::campaign::store::Store;
use crate::campaign::verdict::{Kind, Verdict};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::waiting::Waiting;
use crate::exchange::frf_uff;
use crate::exchange::record_uff::{by_label, read_record_file};
use crate::outside::tell_line;

/// How files are named, and whether what came from a file of the same name before is dropped.
pub(super) struct Wishes<'w> {
    pub(super) configuration: Option<&'w str>,
    pub(super) names: Option<&'w Path>,
    pub(super) replace: bool,
}

/// Brings in all of `folder`.
///
/// # Errors
/// Before anything is stored: a file without a name. Later: a file that cannot be read or does not fit; what came before it is stored.
pub(super) fn import(folder: &Path, into: &Path, wishes: &Wishes<'_>) -> Result<(), CliError> {
    let mut store = Store::open(into)?;
    let plan = store.plan()?;
    let (sources, left_out) = match wishes.names {
        Some(table) => (from_table(folder, table)?, Vec::new()),
        None => from_folder(folder, &plan, wishes.configuration)?,
    };
    for path in &left_out {
        tell_line!("{}: left out, it is neither .npz nor a universal file", path.display());
    }
    let waiting = Waiting::of("importing files");
    let (mut all, mut matrices) = (Brought::default(), 0);
    for (done, source) in sources.iter().enumerate() {
        waiting.at(done, sources.len());
        let told = |error: CliError| match error {
            CliError::Bad(what) | CliError::Usage(what) => bad(format!(
                "{what}\n{done} of {} files are stored; the same command goes on with this one",
                sources.len()
            )),
            other => other,
        };
        match one(&mut store, source, wishes.replace).map_err(told)? {
            Some(brought) => all.add(&brought),
            None => matrices += 1,
        }
    }
    drop(waiting);
    store.log(&format!("imported {} files from {}", sources.len(), folder.display()))?;
    let length = length_notice(&store)?;
    store.close()?;
    let mut lines = Vec::new();
    if all.hits > 0 {
        let there =
            if all.already > 0 { format!(", {} were there already", all.already) } else { String::new() };
        lines.push(format!(
            "{}: {} hits in {} cells, {} of them good{there}",
            into.display(),
            all.hits,
            all.cells,
            all.kept
        ));
        lines.extend(length);
    }
    if matrices > 0 {
        lines.push(format!("{}: FRFs of {matrices} configurations", into.display()));
    }
    output::lines(lines)
}

fn say(path: &Path, warnings: &[String]) {
    for warning in warnings {
        tell_line!("{}: {warning}", path.display());
    }
}

/// Prints the verdict of a hit that is not good.
fn say_refused(of: &str, hit: u32, verdict: &Verdict) {
    if verdict.kind != Kind::Good {
        tell_line!("{of}: hit {hit}: {} ({})", verdict.kind, verdict.sentence);
    }
}

/// What came of a file of records; none of FRFs.
fn one(store: &mut Store, source: &Source, replace: bool) -> Result<Option<Brought>, CliError> {
    let Source { path, name, holds } = source;
    match holds {
        Named::Frfs(configuration) => {
            let told = frfs(store, &Frfs { file: path, name, configuration, replace })?;
            for line in told {
                tell_line!("{line}");
            }
            Ok(None)
        }
        Named::Cell { configuration, impact, response } => {
            let (records, warnings) = read_record_file(path).map_err(bad)?;
            say(path, &warnings);
            let origin = Origin::of(path, name)?;
            let cell = CellName { configuration, impact, response };
            Ok(Some(bring(store, &origin, &cell, &records, replace, &mut |hit, verdict| {
                say_refused(name, hit, verdict);
            })?))
        }
        Named::Labelled(configuration) => {
            let origin = Origin::of(path, name)?;
            let wrong = |what: String| bad(format!("{}: {what}", path.display()));
            let (rows, warnings) = by_label(&frf_uff::contents(path).map_err(bad)?).map_err(wrong)?;
            say(path, &warnings);
            let mut all = Brought::default();
            for row in rows {
                let cell = CellName { configuration, impact: &row.impact, response: &row.response };
                let of_cell = format!("{name}: {} to {}", row.impact, row.response);
                all.add(&bring(store, &origin, &cell, &row.records, replace, &mut |hit, verdict| {
                    say_refused(&of_cell, hit, verdict);
                })?);
            }
            Ok(Some(all))
        }
    }
}

//! Imports every file of a folder into a campaign file, with a command that may be repeated:
//! records already present are not stored again.

use std::path::Path;

use super::names::{Named, NamedFile, Pattern, Table, from_folder};
use super::records::{Brought, bring, bring_channels, has_all_channels, length_notice, origin_of};
use super::{Frfs, bad, frfs};
use crate::campaign::import::CellName;
use crate::campaign::import::assign::Calibrations;
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::output::Waiting;
use crate::exchange::StatedUnits;
use crate::exchange::record_uff::{LabelledRecords, by_label, read_record_file, record_contents};
use crate::untrusted_text::tell_line;

/// How files are named, and whether earlier records of a file with the same name are dropped.
pub(super) struct Wishes<'w> {
    pub(super) configuration: Option<&'w str>,
    pub(super) names: Option<&'w Path>,
    /// Form of the files' names.
    pub(super) pattern: Option<&'w Pattern>,
    pub(super) calibrate: &'w Calibrations,
    pub(super) replace: bool,
    pub(super) units: &'w StatedUnits,
}

/// Summaries of what was used of each file, printed once for all files with the same summary.
#[derive(Default)]
pub(super) struct Taken(Vec<(String, String, usize)>);

impl Taken {
    fn add(&mut self, file: &Path, taken: &str) {
        match self.0.iter_mut().find(|(known, ..)| known == taken) {
            Some((.., count)) => *count += 1,
            None => self.0.push((taken.into(), file.display().to_string(), 1)),
        }
    }

    fn tell(&self) {
        self.tell_from(0);
    }

    /// Number of different summaries.
    pub(super) fn different(&self) -> usize {
        self.0.len()
    }

    /// Prints those after the first `known`.
    pub(super) fn tell_from(&self, known: usize) {
        for (taken, first, count) in self.0.iter().skip(known) {
            match count - 1 {
                0 => tell_line!("{first}: {taken}"),
                more => tell_line!("{first} and {more} more: {taken}"),
            }
        }
    }
}

/// Why a file of a folder is left out.
pub(super) const LEFT_OUT: &str =
    "left out, it is no .npz and no universal file, nor .csv or .wav with the name of a cell";

/// Imports all files of `folder`.
///
/// # Errors
/// Before anything is stored: a file has no name. Later: a file cannot be read or does not fit; the
/// files before it are stored.
pub(super) fn import(folder: &Path, into: &Path, wishes: &Wishes<'_>) -> Result<(), CliError> {
    let mut store = Store::open(into)?;
    let plan = store.plan()?;
    let (sources, left_out) = match wishes.names {
        Some(table) => (Table::read(table)?.files(folder)?, Vec::new()),
        None => from_folder(folder, &plan, wishes.configuration, wishes.pattern)?,
    };
    for path in &left_out {
        tell_line!("{}: {LEFT_OUT}", path.display());
    }
    let waiting = Waiting::of("importing files");
    let (mut all, mut matrices, mut taken) = (Brought::default(), 0, Taken::default());
    for (done, source) in sources.iter().enumerate() {
        waiting.at(done, sources.len());
        let told = |error: CliError| match error {
            CliError::Bad(what) | CliError::Usage(what) => bad(format!(
                "{what}\n{done} of {} files are stored; run the same command again to continue with this one",
                sources.len()
            )),
            other => other,
        };
        match one(&mut store, &plan, source, wishes, &mut taken, &mut say_refused).map_err(told)? {
            Some(brought) => all.add(&brought),
            None => matrices += 1,
        }
    }
    drop(waiting);
    taken.tell();
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
            all.cells.len(),
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
fn say_refused(of: &str, hit: u32, verdict: &Judgement) {
    if verdict.kind != Verdict::Good {
        tell_line!("{of}: hit {hit}: {} ({})", verdict.kind, verdict.sentence);
    }
}

/// Imports one file; returns counts for records, `None` for FRFs. `tell` receives the file's name
/// (and cell), and each hit's number and verdict.
pub(super) fn one(
    store: &mut Store,
    plan: &Plan,
    source: &NamedFile,
    wishes: &Wishes<'_>,
    taken: &mut Taken,
    tell: &mut dyn FnMut(&str, u32, &Judgement),
) -> Result<Option<Brought>, CliError> {
    let NamedFile { path, name, holds } = source;
    let Wishes { replace, units, .. } = *wishes;
    match holds {
        Named::Frfs(configuration) => {
            let told = frfs(store, &Frfs { file: path, name, configuration, replace, units })?;
            for line in told {
                tell_line!("{line}");
            }
            Ok(None)
        }
        Named::Cell { configuration, impact, response } => {
            let origin = origin_of(path, name)?;
            let cell = CellName { configuration, impact, response };
            let mut tell = |hit: u32, verdict: &Judgement| tell(name, hit, verdict);
            let brought = if has_all_channels(path, plan, wishes.calibrate)? {
                bring_channels(store, &origin, &cell, path, (wishes.calibrate, replace), &mut tell)?
            } else {
                let read = read_record_file(path, units).map_err(bad)?;
                say(path, &read.notes);
                bring(store, &origin, &cell, read, replace, &mut tell)?
            };
            taken.add(path, &brought.taken);
            Ok(Some(brought))
        }
        Named::Labelled(configuration) => {
            let origin = origin_of(path, name)?;
            let wrong = |what: String| bad(format!("{}: {what}", path.display()));
            let geometry = &plan.geometry;
            let is_known = |name: &str| {
                geometry.impact.iter().any(|point| point.get_ref().name == name)
                    || geometry.response.iter().any(|point| point.get_ref().name == name)
            };
            let contents = record_contents(path).map_err(bad)?;
            let (rows, notes) = by_label(&contents, units, &is_known).map_err(wrong)?;
            drop(contents);
            say(path, &notes);
            check_labels(plan, configuration, &rows).map_err(wrong)?;
            let mut all = Brought::default();
            for LabelledRecords { impact, response, read } in rows {
                let cell = CellName { configuration, impact: &impact, response: &response };
                say(path, &read.notes);
                let of_cell = format!("{name}: {impact} to {response}");
                let brought = bring(store, &origin, &cell, read, replace, &mut |hit, verdict| {
                    tell(&of_cell, hit, verdict);
                })?;
                taken.add(path, &brought.taken);
                all.add(&brought);
            }
            Ok(Some(all))
        }
    }
}

/// Checks, before anything is stored, that the labels name cells of the plan; the error lists the
/// labels and the plan's names.
fn check_labels(plan: &Plan, configuration: &str, rows: &[LabelledRecords]) -> Result<(), String> {
    let own = plan.configuration(configuration).map_or(configuration, |own| configuration_name(own));
    let cells: Vec<Cell> =
        plan.cells().into_iter().filter(|cell| configuration_name(cell.configuration) == own).collect();
    let is_cell = |row: &LabelledRecords| {
        cells.iter().any(|c| (&c.impact, &c.response) == (&row.impact, &row.response))
    };
    if rows.iter().all(is_cell) {
        return Ok(());
    }
    let listed = |names: &mut dyn Iterator<Item = &String>| {
        let mut all: Vec<&str> = Vec::new();
        for name in names {
            if !all.contains(&name.as_str()) {
                all.push(name);
            }
        }
        let more = all.len().saturating_sub(MOST_LISTED);
        all.truncate(MOST_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", all.join(", "))
    };
    Err(format!(
        "its labels name the impacts {} and the responses {}, which are not all cells of {configuration} in the plan (impacts {}, responses \
         {}): rename them in one of the two, or give --names TABLE.csv with the columns file, configuration, impact, response",
        listed(&mut rows.iter().map(|row| &row.impact)),
        listed(&mut rows.iter().map(|row| &row.response)),
        listed(&mut cells.iter().map(|cell| &cell.impact)),
        listed(&mut cells.iter().map(|cell| &cell.response)),
    ))
}

/// Maximum number of names listed in a message.
const MOST_LISTED: usize = 12;

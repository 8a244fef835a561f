//! Imports a whole campaign that `jointrig export` wrote.

use std::path::Path;

use crate::campaign::archive::restore::{Restored, restore};
use crate::campaign::recheck::recheck;
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::output::Waiting;

/// Restores the campaign, judges every record again, and prints what was done.
pub(super) fn import(folder: &Path, into: &Path) -> Result<(), CliError> {
    let waiting = Waiting::of("importing records");
    let restored = restore(folder, into, &|done, total| waiting.at(done, total))?;
    drop(waiting);
    let store = Store::open_read_only(into)?;
    let waiting = Waiting::of("judging the records again");
    let judged = recheck(&store, &|done, total| waiting.at(done, total))?;
    drop(waiting);
    let mut lines = told(folder, into, &restored);
    if judged.different.is_empty() {
        lines.push(format!(
            "{} records and {} levels judged again: the verdicts and amplitudes are those of the export",
            judged.records, judged.levels
        ));
    } else {
        lines.push(format!(
            "{} verdicts or amplitudes differ from what the samples give now; the exported ones are kept:",
            judged.different.len()
        ));
        lines.extend(judged.different);
    }
    output::lines(lines)
}

fn told(folder: &Path, into: &Path, restored: &Restored) -> Vec<String> {
    let Restored { campaign, jointrig, created, records, levels, already, .. } = restored;
    let mut lines = vec![format!(
        "{}: {campaign}, exported by jointrig {jointrig}; {records} records and {levels} levels",
        folder.display()
    )];
    if *already > 0 {
        lines.push(format!("{already} of them were there already, from an earlier import"));
    }
    if restored.without_samples > 0 {
        lines.push(format!(
            "{} records that do not count have their verdicts but no samples: `jointrig export --all` exports those too",
            restored.without_samples
        ));
    }
    if restored.levels_without_samples > 0 {
        lines.push(format!(
            "{} levels were exported without samples and are missing",
            restored.levels_without_samples
        ));
    }
    lines.extend(restored.damaged.iter().map(|what| format!("missing, damaged before the export: {what}")));
    lines.push(format!("{}: {}", into.display(), if *created { "made" } else { "continued" }));
    lines
}

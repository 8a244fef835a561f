//! Identifies each file's content: by a table, by the file's name as `export` writes it, or by the
//! labels in a universal file.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::bad;
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::cli::error::CliError;
use crate::exchange::{delimiter, frf_file, record_uff};
use crate::untrusted_input;
use crate::untrusted_text::file_name;

/// Content of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Named {
    /// FRFs of a configuration.
    Frfs(String),
    /// Records of one cell.
    Cell { configuration: String, impact: String, response: String },
    /// Records of a configuration, whose labels name the cells.
    Labelled(String),
}

/// A file and its content.
pub(super) struct NamedFile {
    pub(super) path: PathBuf,
    /// Name in the campaign file: the path inside the folder.
    pub(super) name: String,
    pub(super) holds: Named,
}

/// A row of the table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NameRow {
    file: String,
    configuration: String,
    #[serde(default)]
    impact: String,
    #[serde(default)]
    response: String,
}

/// Extensions of readable files.
const ENDINGS: [&str; 4] = ["npz", "uff", "unv", "uf"];

/// Every file named in the table.
pub(super) fn from_table(folder: &Path, table: &Path) -> Result<Vec<NamedFile>, CliError> {
    let told = |error: csv::Error| {
        bad(format!(
            "{}: {error}; a table of names has the columns file, configuration, impact, response, the last two empty for FRFs and \
             for universal files whose labels name impact and response",
            table.display()
        ))
    };
    let text = untrusted_input::text(table, untrusted_input::TABLE).map_err(|source| CliError::Read {
        path: table.into(),
        doing: "reading the table of names",
        source,
    })?;
    let mut rows = csv::ReaderBuilder::new()
        .delimiter(delimiter(&text))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut sources = Vec::new();
    for row in rows.deserialize::<NameRow>() {
        let NameRow { file, configuration, impact, response } = row.map_err(told)?;
        let path = folder.join(&file);
        if !path.is_file() {
            return Err(bad(format!("{}: there is no file {}", table.display(), path.display())));
        }
        let holds = match (impact.is_empty(), response.is_empty()) {
            (false, false) => Named::Cell { configuration, impact, response },
            (true, true) => with_labels_or_frfs(&path, configuration)?,
            _ => {
                return Err(bad(format!(
                    "{}: {file} has only one of impact and response: give both or none",
                    table.display()
                )));
            }
        };
        sources.push(NamedFile { path, name: file, holds });
    }
    Ok(sources)
}

/// Every readable file of the folder and its subfolders; `configuration` applies if neither the
/// file's nor its folder's name gives one.
///
/// # Errors
/// A folder cannot be read, or files could not be identified: all of them are listed.
pub(super) fn from_folder(
    folder: &Path,
    plan: &Plan,
    configuration: Option<&str>,
) -> Result<(Vec<NamedFile>, Vec<PathBuf>), CliError> {
    let (mut sources, mut left_out, mut unnamed) = (Vec::new(), Vec::new(), Vec::new());
    for path in files(folder)? {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if !ending.is_some_and(|ending| ENDINGS.contains(&&*ending)) {
            left_out.push(path);
            continue;
        }
        let name = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned();
        match named(&path, folder, plan, configuration)? {
            Some(holds) => sources.push(NamedFile { path, name, holds }),
            None => unnamed.push(name),
        }
    }
    if !unnamed.is_empty() {
        return Err(bad(format!(
            "{}: it is not clear what these files hold: {}. Call them CONFIGURATION_IMPACT_RESPONSE (one cell each), CONFIGURATION (FRFs), \
             put universal files whose labels name impact and response into a folder named after the configuration, say --configuration, or \
             give --names TABLE.csv with the columns file, configuration, impact, response",
            folder.display(),
            unnamed.join(", ")
        )));
    }
    if sources.is_empty() {
        return Err(bad(format!("{}: it holds no .npz, .uff or .unv file", folder.display())));
    }
    Ok((sources, left_out))
}

fn named(
    path: &Path,
    folder: &Path,
    plan: &Plan,
    configuration: Option<&str>,
) -> Result<Option<Named>, CliError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    // names of points may contain an underscore
    let called = |cell: &Cell| {
        [configuration_name(cell.configuration), plan.called(cell.configuration)]
            .into_iter()
            .map(|name| format!("{name}_{}_{}", cell.impact, cell.response))
            // as it is, or as `export` writes names that are not valid file names
            .any(|name| name == *stem || file_name(&name) == *stem)
    };
    if let Some(Cell { configuration, impact, response, .. }) = plan.cells().into_iter().find(called) {
        return Ok(Some(Named::Cell {
            configuration: configuration_name(configuration).into(),
            impact,
            response,
        }));
    }
    let above = path.parent().filter(|above| *above != folder).and_then(Path::file_name);
    let above = above.map(|name| name.to_string_lossy().into_owned());
    let known = |name: &str| plan.configuration(name).map(|found| configuration_name(found).to_owned());
    let told = known(&stem)
        .or_else(|| above.as_deref().and_then(known))
        .or_else(|| configuration.map(str::to_owned));
    told.map(|configuration| with_labels_or_frfs(path, configuration)).transpose()
}

/// A universal file with forces over time contains records; everything else is treated as FRFs.
fn with_labels_or_frfs(path: &Path, configuration: String) -> Result<Named, CliError> {
    if frf_file::is_npz(path).map_err(bad)? {
        return Ok(Named::Frfs(configuration));
    }
    let records = record_uff::holds_records(&record_uff::record_contents(path).map_err(bad)?);
    Ok(if records { Named::Labelled(configuration) } else { Named::Frfs(configuration) })
}

/// The universal files of a folder and its subfolders.
pub(in crate::cli) fn universal_files(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let universal = |path: &PathBuf| {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        ending.is_some_and(|ending| ENDINGS[1..].contains(&&*ending))
    };
    let found: Vec<PathBuf> = files(folder)?.into_iter().filter(universal).collect();
    if found.is_empty() {
        return Err(bad(format!("{}: it holds no universal file (.uff, .unv)", folder.display())));
    }
    Ok(found)
}

/// All files, sorted by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let failed = |source| CliError::Read { path: folder.into(), doing: "reading the folder", source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            found.extend(files(&path)?);
        } else {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

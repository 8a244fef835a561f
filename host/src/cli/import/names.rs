//! Identifies each file's content: by a table, by the file's name as `export` writes it, or by the
//! labels in a universal file.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::Deserialize;

use super::bad;
use crate::campaign::import::channel_file::ending;
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

/// Extensions of readable files; those of universal files are the last three.
const ENDINGS: [&str; 4] = ["npz", "uff", "unv", "uf"];

/// Extensions of files that are read if their name is that of a cell: folders hold others, too.
const WITH_A_NAME: [&str; 2] = ["csv", "wav"];

/// The form of file names, such as `{configuration}_{impact}_{response}_{hit}`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Pattern(String);

impl FromStr for Pattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = ["{configuration}", "{impact}", "{response}", "{hit}"];
        let rest = known.iter().fold(text.to_owned(), |rest, name| rest.replacen(name, "", 1));
        if !text.contains("{impact}") || rest.contains(['{', '}']) {
            return Err(
                "write {configuration}, {impact}, {response} and {hit} where the names have them, each once; {impact} is needed"
                    .into(),
            );
        }
        Ok(Self(text.into()))
    }
}

impl Pattern {
    /// The cell that a name belongs to. Without `{response}` it is the first cell of a row whose
    /// sensors are fixed, and without `{configuration}` one of `configuration`.
    fn cell(&self, stem: &str, plan: &Plan, configuration: Option<&str>) -> Option<Cell> {
        let Self(pattern) = self;
        let stated = configuration.and_then(|name| plan.configuration(name));
        let fits = |cell: &Cell| {
            let of_row = pattern.contains("{response}") || plan.own_channels(&cell.response).is_some();
            let named = pattern.contains("{configuration}") || stated == Some(cell.configuration);
            of_row && named && self.writes(stem, plan, cell)
        };
        plan.cells().into_iter().find(fits)
    }

    /// Whether the cell's names in the pattern give this name.
    fn writes(&self, stem: &str, plan: &Plan, cell: &Cell) -> bool {
        let names = [configuration_name(cell.configuration), plan.called(cell.configuration)];
        names.into_iter().any(|name| {
            let filled = (self.0.replace("{configuration}", name))
                .replace("{impact}", &cell.impact)
                .replace("{response}", &cell.response);
            match filled.split_once("{hit}") {
                None => filled == stem,
                Some((before, after)) => {
                    let hit = stem.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
                    hit.is_some_and(|hit| !hit.is_empty() && hit.bytes().all(|c| c.is_ascii_digit()))
                }
            }
        })
    }
}

/// The table of names.
pub(super) struct Table {
    path: PathBuf,
    rows: Vec<NameRow>,
}

impl Table {
    /// Reads it.
    ///
    /// # Errors
    /// It cannot be read, or a row has only one of impact and response.
    pub(super) fn read(table: &Path) -> Result<Self, CliError> {
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
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter(&text))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let rows: Vec<NameRow> = reader.deserialize().collect::<Result<_, _>>().map_err(told)?;
        match rows.iter().find(|row| row.impact.is_empty() != row.response.is_empty()) {
            Some(NameRow { file, .. }) => Err(bad(format!(
                "{}: {file} has only one of impact and response: give both or none",
                table.display()
            ))),
            None => Ok(Self { path: table.into(), rows }),
        }
    }

    /// Every file that it names.
    ///
    /// # Errors
    /// A file does not exist, or its content cannot be recognised.
    pub(super) fn files(self, folder: &Path) -> Result<Vec<NamedFile>, CliError> {
        let named = |row: NameRow| {
            let path = folder.join(&row.file);
            if !path.is_file() {
                return Err(bad(format!("{}: there is no file {}", self.path.display(), path.display())));
            }
            row.names(path)
        };
        self.rows.into_iter().map(named).collect()
    }

    /// This file of the folder, if it is in the table.
    ///
    /// # Errors
    /// Its content cannot be recognised.
    pub(super) fn file(self, folder: &Path, path: &Path) -> Result<Option<NamedFile>, CliError> {
        let row = self.rows.into_iter().find(|row| folder.join(&row.file) == path);
        row.map(|row| row.names(path.into())).transpose()
    }
}

impl NameRow {
    /// The file that it names.
    fn names(self, path: PathBuf) -> Result<NamedFile, CliError> {
        let Self { file, configuration, impact, response } = self;
        let holds = if impact.is_empty() {
            with_labels_or_frfs(&path, configuration)?
        } else {
            Named::Cell { configuration, impact, response }
        };
        Ok(NamedFile { path, name: file, holds })
    }
}

/// What the name and the content of a file of a folder say about it.
pub(super) enum Identified {
    /// What it holds.
    Named(NamedFile),
    /// It has no readable format, or could be anything (csv, wav) and has no cell's name.
    LeftOut,
    /// It has a readable format, and neither a cell's name nor labels.
    Unnamed,
}

/// Whether a file has the ending of a format that is read.
pub(super) fn is_readable(path: &Path) -> bool {
    let ending = ending(path);
    ENDINGS.iter().chain(&WITH_A_NAME).any(|known| *known == ending)
}

/// Identifies a file of a folder; `configuration` applies if neither the file's nor its folder's
/// name gives one.
///
/// # Errors
/// Its content cannot be read.
pub(super) fn identified(
    path: PathBuf,
    folder: &Path,
    plan: &Plan,
    configuration: Option<&str>,
    pattern: Option<&Pattern>,
) -> Result<Identified, CliError> {
    if !is_readable(&path) {
        return Ok(Identified::LeftOut);
    }
    let by_name = WITH_A_NAME.contains(&&*ending(&path));
    let holds = match (by_cell(&path, plan, configuration, pattern), pattern) {
        (None, None) if !by_name => by_content(&path, folder, plan, configuration)?,
        (holds, _) => holds,
    };
    Ok(match holds {
        Some(holds) => {
            let name = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned();
            Identified::Named(NamedFile { path, name, holds })
        }
        None if by_name && pattern.is_none() => Identified::LeftOut,
        None => Identified::Unnamed,
    })
}

/// How files are named so that their content is known.
pub(super) const HOW_TO_NAME: &str = "say the form of their names with --pattern '{configuration}_{impact}_{response}_{hit}', or call them \
                                      CONFIGURATION_IMPACT_RESPONSE (one cell each), CONFIGURATION (FRFs), put universal files whose labels \
                                      name impact and response into a folder named after the configuration, say --configuration, or give \
                                      --names TABLE.csv with the columns file, configuration, impact, response";

/// Every readable file of the folder and its subfolders.
///
/// # Errors
/// A folder cannot be read, or files could not be identified: all of them are listed.
pub(super) fn from_folder(
    folder: &Path,
    plan: &Plan,
    configuration: Option<&str>,
    pattern: Option<&Pattern>,
) -> Result<(Vec<NamedFile>, Vec<PathBuf>), CliError> {
    let (mut sources, mut left_out, mut unnamed) = (Vec::new(), Vec::new(), Vec::new());
    for path in files(folder)? {
        match identified(path.clone(), folder, plan, configuration, pattern)? {
            Identified::Named(source) => sources.push(source),
            Identified::LeftOut => left_out.push(path),
            Identified::Unnamed => {
                unnamed.push(path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned());
            }
        }
    }
    if !unnamed.is_empty() {
        return Err(bad(format!(
            "{}: it is not clear what these files hold: {}: {HOW_TO_NAME}",
            folder.display(),
            unnamed.join(", ")
        )));
    }
    if sources.is_empty() {
        return Err(bad(format!(
            "{}: it holds no .npz, .uff or .unv file, and no .csv or .wav file with the name of a cell",
            folder.display()
        )));
    }
    Ok((sources, left_out))
}

/// The cell whose names the file's name has, in the form of the pattern or of an export.
fn by_cell(
    path: &Path,
    plan: &Plan,
    configuration: Option<&str>,
    pattern: Option<&Pattern>,
) -> Option<Named> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    // names of points may contain an underscore
    let called = |cell: &Cell| {
        [configuration_name(cell.configuration), plan.called(cell.configuration)]
            .into_iter()
            .map(|name| format!("{name}_{}_{}", cell.impact, cell.response))
            // as it is, or as `export` writes names that are not valid file names
            .any(|name| name == *stem || file_name(&name) == *stem)
    };
    let found = match pattern {
        Some(pattern) => pattern.cell(&stem, plan, configuration),
        None => plan.cells().into_iter().find(called),
    };
    found.map(|Cell { configuration, impact, response, .. }| Named::Cell {
        configuration: configuration_name(configuration).into(),
        impact,
        response,
    })
}

/// What a file without a cell's name holds, by its configuration and its content.
fn by_content(
    path: &Path,
    folder: &Path,
    plan: &Plan,
    configuration: Option<&str>,
) -> Result<Option<Named>, CliError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
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
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::CONTACT;

    #[test]
    fn a_pattern_finds_the_plans_names_in_a_files_name() {
        // with an impact whose name has the separator in it
        let with_mass = CONTACT.replace("\"AZ3\"]", "\"AZ3\", \"I_MZ\"]");
        let plan = Plan::parse(&with_mass, "contact.toml").expect("a plan");
        let found = |pattern: &str, stem: &str| {
            let pattern: Pattern = pattern.parse().expect("a pattern");
            let cell = pattern.cell(stem, &plan, Some("B"))?;
            Some(format!("{}/{}/{}", configuration_name(cell.configuration), cell.impact, cell.response))
        };
        let whole = "{configuration}_{impact}_{response}_{hit}";
        assert_eq!(found(whole, "AJB_I_MZ_C3_017").as_deref(), Some("AJB/I_MZ/C3"));
        assert_eq!(found(whole, "AJB_I_MZ_C3"), None);
        assert_eq!(found(whole, "AJB_I_MZ_S9_1"), None);
        assert_eq!(found("run 3 {impact}@{response}", "run 3 BZ2@B1").as_deref(), Some("B/BZ2/B1"));
        // the plan's vibrometer moves, so that the location must be named
        assert_eq!(found("{configuration}-{impact}-{hit}", "B-BZ2-1"), None);
        assert!("{response}".parse::<Pattern>().is_err() && "{impact}{place}".parse::<Pattern>().is_err());
    }
}

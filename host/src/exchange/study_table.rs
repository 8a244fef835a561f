//! The covariates of a study: a csv table with the column `file` and one column for each covariate.

use super::tables::delimiter;
use crate::{advice, untrusted_input};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most bytes of a table.
const MOST_BYTES: u64 = 8 << 20;

/// The column that names the campaign file.
const FILE: &str = "file";

/// Why a table of covariates cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StudyTableError {
    /// The file cannot be opened.
    #[error("{}: reading: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The path.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The column `file` is missing.
    #[error("{}: there is no column `file` in the first row: it names the campaign file of each row", path.display())]
    NoFiles {
        /// The path.
        path: PathBuf,
    },
    /// A row is wrong.
    #[error("{}, row {row}: {reason}", path.display())]
    Row {
        /// The path.
        path: PathBuf,
        /// Its number; the headings are row 1.
        row: usize,
        /// What is wrong and what is needed.
        reason: String,
    },
}

/// The rows of a table by file name.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyTable {
    path: PathBuf,
    headings: Vec<String>,
    /// Row number and cells.
    rows: BTreeMap<String, (usize, Vec<String>)>,
}

/// The row of one campaign.
#[derive(Debug, Clone, Copy)]
pub struct StudyRow<'a> {
    table: &'a StudyTable,
    number: usize,
    cells: &'a [String],
}

/// Reads a table of covariates.
///
/// # Errors
/// The file cannot be read, the column `file` is missing, or a file has two rows.
pub fn read_study(path: &Path) -> Result<StudyTable, StudyTableError> {
    let text = untrusted_input::text(path, MOST_BYTES)
        .map_err(|source| StudyTableError::Open { path: path.into(), source })?;
    let wrong = |row: usize, reason: String| StudyTableError::Row { path: path.into(), row, reason };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter(&text))
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let headings: Vec<String> =
        reader.headers().map_err(|error| wrong(1, error.to_string()))?.iter().map(Into::into).collect();
    let at = headings
        .iter()
        .position(|heading| heading == FILE)
        .ok_or_else(|| StudyTableError::NoFiles { path: path.into() })?;
    let mut rows = BTreeMap::new();
    for (number, row) in reader.records().enumerate() {
        let number = number + 2;
        let row = row.map_err(|error| wrong(number, error.to_string()))?;
        let cells: Vec<String> = row.iter().map(Into::into).collect();
        let name = cells.get(at).cloned().unwrap_or_default();
        if let Some((first, _)) = rows.insert(name.clone(), (number, cells)) {
            let reason = format!("`{name}` is in row {first} already: one row for each campaign");
            return Err(wrong(number, reason));
        }
    }
    Ok(StudyTable { path: path.into(), headings, rows })
}

impl StudyTable {
    /// The row of this campaign file.
    ///
    /// # Errors
    /// There is none; the text says what to do.
    pub fn row(&self, file: &str) -> Result<StudyRow<'_>, String> {
        let (number, cells) = self
            .rows
            .get(file)
            .ok_or_else(|| format!("{} has no row for it: add one with file {file}", self.path.display()))?;
        Ok(StudyRow { table: self, number: *number, cells })
    }
}

impl<'a> StudyRow<'a> {
    /// The cell in this column.
    ///
    /// # Errors
    /// There is no such column, or the cell is empty.
    pub fn text(&self, column: &str) -> Result<&'a str, String> {
        let StudyTable { path, headings, .. } = self.table;
        let path = path.display();
        let at = headings
            .iter()
            .position(|heading| heading == column)
            .ok_or_else(|| format!("{path} has no column `{column}`; it has {}", headings.join(", ")))?;
        match self.cells.get(at).map(String::as_str) {
            None | Some("") => Err(format!("{path}, row {}: `{column}` is empty", self.number)),
            Some(text) => Ok(text),
        }
    }

    /// The number in this column.
    ///
    /// # Errors
    /// As [`StudyRow::text`], or the cell is no number.
    pub fn number(&self, column: &str) -> Result<f64, String> {
        let text = self.text(column)?;
        text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
            format!(
                "{}, row {}: {column} is `{text}`: write a number",
                self.table.path.display(),
                self.number
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<StudyTable, StudyTableError> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("study.csv");
        std::fs::write(&path, text).expect("written");
        read_study(&path)
    }

    #[test]
    fn covariates_are_found_by_file_and_heading() {
        let table = read("load_n;file;set\n250;a.jrig;first\n;b.jrig;second\n").expect("a table");
        let row = table.row("a.jrig").expect("a row");
        assert_eq!((row.number("load_n"), row.text("set")), (Ok(250.0), Ok("first")));
        let said = |text: Result<f64, String>, part: &str| text.is_err_and(|text| text.contains(part));
        assert!(said(row.number("set"), "row 2: set is `first`"));
        assert!(said(row.number("weight"), "no column `weight`; it has load_n, file, set"));
        assert!(said(table.row("b.jrig").expect("a row").number("load_n"), "row 3: `load_n` is empty"));
        assert!(table.row("c.jrig").is_err_and(|text| text.contains("no row for it")));
    }

    #[test]
    fn a_table_without_files_or_with_one_twice_is_refused() {
        let missing = read("campaign,load\na.jrig,1\n").expect_err("no file").to_string();
        assert!(missing.contains("no column `file`"), "{missing}");
        let twice = read("file,load\na.jrig,1\na.jrig,2\n").expect_err("twice").to_string();
        assert!(twice.contains("row 3: `a.jrig` is in row 2 already"), "{twice}");
    }
}

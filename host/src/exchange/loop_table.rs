//! Loops as a table: one row for each point, columns `loop` (its name; may be missing if there is
//! only one), `displacement_m` and `force_n`. The rows of a loop are one cycle, at equal times.

use super::tables::delimiter;
use crate::{advice, untrusted_input};
use std::path::{Path, PathBuf};

/// Most bytes of a table: a million points.
const MOST_BYTES: u64 = 64 << 20;

/// The points of one loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopPoints {
    /// Its name.
    pub name: String,
    /// Displacement, m.
    pub displacement_m: Vec<f64>,
    /// Force, N.
    pub force_n: Vec<f64>,
}

/// Why a table of loops cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LoopTableError {
    /// The file cannot be opened.
    #[error("{}: reading: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The path.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A heading is missing.
    #[error(
        "{}: there is no column `{column}` in the first row: a table of loops has the columns loop, displacement_m and force_n",
        path.display()
    )]
    MissingColumn {
        /// The path.
        path: PathBuf,
        /// The column.
        column: &'static str,
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

/// Reads a table of loops, in the order in which they appear.
///
/// # Errors
/// The file cannot be read, a column is missing, or a value is not a number.
pub fn read_loops(path: &Path) -> Result<Vec<LoopPoints>, LoopTableError> {
    let text = untrusted_input::text(path, MOST_BYTES)
        .map_err(|source| LoopTableError::Open { path: path.into(), source })?;
    let wrong = |row: usize, reason: String| LoopTableError::Row { path: path.into(), row, reason };
    let mut rows = csv::ReaderBuilder::new()
        .delimiter(delimiter(&text))
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let headings = rows.headers().map_err(|error| wrong(1, error.to_string()))?.clone();
    let place = |column: &'static str| headings.iter().position(|heading| heading == column);
    let needed = |column: &'static str| {
        place(column).ok_or_else(|| LoopTableError::MissingColumn { path: path.into(), column })
    };
    let (name, x, f) = (place("loop"), needed("displacement_m")?, needed("force_n")?);
    let mut loops: Vec<LoopPoints> = Vec::new();
    for (number, row) in rows.records().enumerate() {
        let number = number + 2;
        let row = row.map_err(|error| wrong(number, error.to_string()))?;
        let value = |at: usize, column: &str| {
            let text = row.get(at).unwrap_or_default();
            let found = text.parse::<f64>().ok().filter(|value| value.is_finite());
            found.ok_or_else(|| wrong(number, format!("{column} is `{text}`: write a number")))
        };
        let (x, f) = (value(x, "displacement_m")?, value(f, "force_n")?);
        let own = name.and_then(|at| row.get(at)).unwrap_or("1");
        let known = loops.iter().position(|one| one.name == own);
        let at = known.unwrap_or_else(|| {
            loops.push(LoopPoints { name: own.into(), displacement_m: Vec::new(), force_n: Vec::new() });
            loops.len() - 1
        });
        loops[at].displacement_m.push(x);
        loops[at].force_n.push(f);
    }
    Ok(loops)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<LoopPoints>, LoopTableError> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("loops.csv");
        std::fs::write(&path, text).expect("written");
        read_loops(&path)
    }

    #[test]
    fn loops_are_read_by_their_names_and_headings() {
        let found = read("force_n;loop;displacement_m\n1;a;0.5\n2;b;0.25\n3;a;0.75\n").expect("a table");
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].name.as_str(), &found[0].force_n[..]), ("a", &[1.0, 3.0][..]));
        assert_eq!(found[0].displacement_m, [0.5, 0.75]);
        assert_eq!(read("displacement_m,force_n\n1e-6,2\n").expect("one loop").len(), 1);
    }

    #[test]
    fn errors_name_the_row_and_the_column() {
        let missing = read("displacement_m,force\n1,2\n").expect_err("no force_n").to_string();
        assert!(missing.contains("no column `force_n`"), "{missing}");
        let wrong = read("displacement_m,force_n\n1,2\n1,x\n").expect_err("no number").to_string();
        assert!(wrong.contains("row 3: force_n is `x`"), "{wrong}");
        assert!(read("displacement_m,force_n\n1,inf\n").is_err());
    }
}

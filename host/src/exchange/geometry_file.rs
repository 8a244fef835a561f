//! Reads a geometry in any of its file formats.

use super::positions::{PositionsError, read_positions};
use crate::substructuring::Geometry;
use crate::substructuring::geometry::FARTHEST_M;
use crate::{advice, foreign};
use std::io;
use std::path::{Path, PathBuf};

/// Why a geometry could not be read.
#[derive(Debug, thiserror::Error)]
pub enum GeometryFileError {
    /// The file cannot be read.
    #[error("{}: reading the geometry: {source}; {}", path.display(), advice::reading(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The TOML file is not a valid geometry.
    #[error(
        "{}, line {line}: {what}; a geometry has `a`, `b` and `ajb`, each with `channels` and `impacts`, and both virtual points \
         (docs/coming-from-pyfbs.md)", path.display()
    )]
    Toml {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// A position beyond the size of any rig.
    #[error(
        "{}: `{name}` stands at {coordinate} m, and no place may be further than {FARTHEST_M} m from the origin: positions are in m, not in mm",
        path.display()
    )]
    TooFar {
        /// The file.
        path: PathBuf,
        /// The point.
        name: String,
        /// The coordinate, m.
        coordinate: f64,
    },
    /// The workbook or its tables are invalid.
    #[error(transparent)]
    Positions(#[from] PositionsError),
}

/// Reads a geometry from a workbook (.xlsx), a folder of its tables as .csv, or a .toml file; also
/// returns warnings for the user.
///
/// # Errors
/// [`GeometryFileError`] naming the place in the file.
pub fn read_geometry(path: &Path) -> Result<(Geometry, Vec<String>), GeometryFileError> {
    let (geometry, warnings) = of_any_size(path)?;
    match geometry.too_far() {
        None => Ok((geometry, warnings)),
        Some((name, coordinate)) => {
            Err(GeometryFileError::TooFar { path: path.into(), name: name.into(), coordinate })
        }
    }
}

fn of_any_size(path: &Path) -> Result<(Geometry, Vec<String>), GeometryFileError> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let positions = read_positions(path)?;
        return Ok((positions.geometry, positions.warnings));
    }
    let text = foreign::text(path, foreign::SETTINGS)
        .map_err(|source| GeometryFileError::Read { path: path.into(), source })?;
    let geometry = toml::from_str(&text).map_err(|error| GeometryFileError::Toml {
        path: path.into(),
        line: error.span().map_or(1, |at| 1 + text[..at.start].matches('\n').count()),
        what: error.message().into(),
    })?;
    Ok((geometry, Vec::new()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test tables in a temporary folder, each text changed.
    fn changed(change: impl Fn(&str) -> String) -> tempfile::TempDir {
        let data = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions/csv");
        let dir = tempfile::tempdir().expect("a temporary folder");
        for entry in std::fs::read_dir(data).expect("test data") {
            let from = entry.expect("entry").path();
            let text = change(&std::fs::read_to_string(&from).expect("text"));
            std::fs::write(dir.path().join(from.file_name().expect("a name")), text).expect("written");
        }
        dir
    }

    #[test]
    fn positions_in_millimetres_are_refused_as_in_a_plan() {
        let millimetres = |text: &str| {
            let rows = text.lines().enumerate().map(|(row, line)| {
                let cells = line.split(',').enumerate().map(|(column, cell)| {
                    let position = row > 0 && (4..7).contains(&column);
                    if position {
                        format!("{}", 1e3 * cell.parse::<f64>().expect("a number"))
                    } else {
                        cell.into()
                    }
                });
                cells.collect::<Vec<_>>().join(",")
            });
            rows.collect::<Vec<_>>().join("\n")
        };
        assert!(read_geometry(changed(str::to_owned).path()).is_ok());
        let said = read_geometry(changed(millimetres).path()).expect_err("in mm").to_string();
        assert!(said.contains("in m, not in mm") && said.contains('`'), "{said}");
    }

    #[test]
    fn tables_with_semicolons_and_decimal_commas_are_the_same_geometry() {
        let (plain, _) = read_geometry(changed(str::to_owned).path()).expect("tables");
        for change in [
            |text: &str| text.replace(',', ";").replace('.', ","),
            |text: &str| text.replace(',', ";"),
            |text: &str| format!("\u{feff}sep=;\r\n{}", text.replace(',', ";").replace('.', ",")),
            |text: &str| text.replace(',', "\t").replace('.', ","),
        ] {
            let (read, warnings) = read_geometry(changed(change).path()).expect("tables");
            assert_eq!((read, warnings), (plain.clone(), vec![]));
        }
    }
}

//! A geometry in any of the forms in which it may lie on a disk.

use super::positions::{PositionsError, read_positions};
use crate::substructuring::Geometry;
use crate::{advice, foreign};
use std::io;
use std::path::{Path, PathBuf};

/// Why there is no geometry.
#[derive(Debug, thiserror::Error)]
pub enum GeometryFileError {
    /// The file cannot be read.
    #[error("{}: reading the geometry: {source}; {}", path.display(), advice::reading(source))]
    Read {
        /// Which.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// It is no such TOML.
    #[error(
        "{}, line {line}: {what}; a geometry has `a`, `b` and `ajb`, each with `channels` and `impacts`, and both virtual points \
         (docs/coming-from-pyfbs.md)", path.display()
    )]
    Toml {
        /// Which.
        path: PathBuf,
        /// Where in it, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// The workbook or its tables.
    #[error(transparent)]
    Positions(#[from] PositionsError),
}

/// The geometry of a workbook (.xlsx), a folder of its tables as .csv, or .toml, and what a reader must know about it.
///
/// # Errors
/// [`GeometryFileError`] naming the place.
pub fn read_geometry(path: &Path) -> Result<(Geometry, Vec<String>), GeometryFileError> {
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

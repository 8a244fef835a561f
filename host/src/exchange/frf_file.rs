//! An FRF file of either form: npz, or a universal file. What it is, its first bytes tell, not its name.

use super::frf_npz::read_frf;
use super::frf_uff::{FrfUffError, read_frf_uff};
use super::npz_error::NpzError;
use crate::frf::Frf;
use crate::{advice, foreign};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Why a file gives no FRFs.
#[derive(Debug, thiserror::Error)]
pub enum FrfFileError {
    /// It cannot be read at all.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is an npz file that holds no FRFs.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// It is not an npz file, and as a universal file it holds no FRFs.
    #[error(transparent)]
    Uff(#[from] FrfUffError),
}

/// Whether the file is an archive of arrays.
///
/// # Errors
/// It cannot be read.
pub fn is_npz(path: &Path) -> Result<bool, FrfFileError> {
    let mut first = Vec::new();
    foreign::open(path)
        .and_then(|(file, _)| file.take(4).read_to_end(&mut first))
        .map_err(|source| FrfFileError::Open { path: path.into(), source })?;
    // a zip archive begins with its first entry, an empty one with its end
    Ok(first.starts_with(b"PK\x03\x04") || first.starts_with(b"PK\x05\x06"))
}

/// Reads FRFs from an npz or a universal file. The second value says what was left out or is missing.
///
/// # Errors
/// [`FrfFileError`] with the file and what is wrong in it.
pub fn read_frf_file(path: &Path) -> Result<(Frf, Vec<String>), FrfFileError> {
    if is_npz(path)? { Ok((read_frf(path)?, Vec::new())) } else { Ok(read_frf_uff(path)?) }
}

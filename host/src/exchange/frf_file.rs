//! Reads an FRF file of either format, npz or universal file. Its first bytes determine the format,
//! not its name.

use super::frf_npz::read_labelled;
use super::frf_uff::{FrfUffError, read_frf_uff};
use super::labelled_frf::LabelledFrf;
use super::npz::NpzError;
use super::other_formats::{Contents, not_read_here};
use super::units::StatedUnits;
use crate::{advice, untrusted_input};
use std::io;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Why FRFs could not be read from a file.
#[derive(Debug, thiserror::Error)]
pub enum FrfFileError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The file has a known format that is not supported.
    #[error("{}: {said}", path.display())]
    OtherFormat {
        /// The file.
        path: PathBuf,
        /// The format, and how to convert the file to npz.
        said: String,
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
    untrusted_input::open(path)
        .and_then(|(file, _)| file.take(4).read_to_end(&mut first))
        .map_err(|source| FrfFileError::Open { path: path.into(), source })?;
    // a zip archive begins with its first entry, an empty one with its end
    Ok(first.starts_with(b"PK\x03\x04") || first.starts_with(b"PK\x05\x06"))
}

/// Refuses a file of another program's format, naming the format and how to convert it to npz.
///
/// # Errors
/// [`FrfFileError::OtherFormat`], [`FrfFileError::Open`].
pub(super) fn refuse_other_formats(path: &Path, wanted: Contents) -> Result<(), FrfFileError> {
    match not_read_here(path, wanted) {
        Ok(None) => Ok(()),
        Ok(Some(said)) => Err(FrfFileError::OtherFormat { path: path.into(), said }),
        Err(source) => Err(FrfFileError::Open { path: path.into(), source }),
    }
}

/// Reads FRFs from an npz or a universal file, in SI. `stated` units override the file's.
///
/// # Errors
/// [`FrfFileError`] with the file and what is wrong in it.
pub fn read_frf_file(path: &Path, stated: &StatedUnits) -> Result<LabelledFrf, FrfFileError> {
    if is_npz(path)? {
        return Ok(read_labelled(path, stated)?);
    }
    refuse_other_formats(path, Contents::Frfs)?;
    Ok(read_frf_uff(path, stated)?)
}

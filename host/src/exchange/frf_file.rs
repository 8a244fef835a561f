//! An FRF file of either form: npz, or a universal file. What it is, its first bytes tell, not its name.

use super::frf_npz::{read_frf, read_frf_noise};
use super::frf_uff::{FrfUffError, read_frf_uff};
use super::npz::NpzError;
use crate::advice;
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::noise::FrfNoise;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// What an FRF file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfFile {
    /// The FRFs.
    pub frf: FrfMatrix,
    /// Variance of the real part of each value, where the file tells it (npz, array `variance`).
    pub noise: Option<FrfNoise>,
    /// What was left out or is missing.
    pub warnings: Vec<String>,
}

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
    File::open(path)
        .and_then(|file| file.take(4).read_to_end(&mut first))
        .map_err(|source| FrfFileError::Open { path: path.into(), source })?;
    // a zip archive begins with its first entry, an empty one with its end
    Ok(first.starts_with(b"PK\x03\x04") || first.starts_with(b"PK\x05\x06"))
}

/// Reads FRFs from an npz or a universal file.
///
/// # Errors
/// [`FrfFileError`] with the file and what is wrong in it.
pub fn read_frf_file(path: &Path) -> Result<FrfFile, FrfFileError> {
    if is_npz(path)? {
        let frf = read_frf(path)?;
        let noise = read_frf_noise(path, &frf)?;
        return Ok(FrfFile { frf, noise, warnings: Vec::new() });
    }
    let (frf, warnings) = read_frf_uff(path)?;
    Ok(FrfFile { frf, noise: None, warnings })
}

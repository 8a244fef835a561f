//! Result of a command, and its exit code: 0 done, 1 the work could not be done, 2 the command line
//! was wrong.

use std::io;
use std::path::PathBuf;

use crate::advice;
use crate::analyse::AnalyseError;
use crate::campaign::archive::ArchiveError;
use crate::campaign::archive::restore::RestoreError;
use crate::campaign::import::ImportError;
use crate::campaign::plan::PlanError;
use crate::campaign::run::error::RunError;
use crate::campaign::run::shaking::ShakeError;
use crate::campaign::run::shaking::wear::WearError;
use crate::campaign::store::error::StoreError;
use crate::device::error::DeviceError;

/// Why a command could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The command line is invalid.
    #[error("{0}")]
    Usage(String),
    /// The plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The device.
    #[error(transparent)]
    Device(DeviceError),
    /// The run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The shaker's levels.
    #[error(transparent)]
    Shake(#[from] ShakeError),
    /// A wear run.
    #[error(transparent)]
    Wear(#[from] WearError),
    /// The analysis.
    #[error(transparent)]
    Analyse(#[from] AnalyseError),
    /// The live page.
    #[cfg(feature = "dashboard")]
    #[error(transparent)]
    Dashboard(#[from] crate::dashboard::DashboardError),
    /// A file that is read.
    #[error("{path}: {doing}: {source}; {}", advice::reading(source))]
    Read {
        /// The path.
        path: PathBuf,
        /// The operation that failed.
        doing: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
    /// A file or folder that is written.
    #[error("{path}: {doing}: {source}; {}", advice::writing(source))]
    File {
        /// The path.
        path: PathBuf,
        /// The operation that failed.
        doing: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
    /// The work was done and its result is negative.
    #[error("{0}")]
    Bad(String),
}

impl From<DeviceError> for CliError {
    /// An address that cannot be parsed is an error of the command line, not of the device.
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::Address { .. } | DeviceError::NotBuilt { .. } => Self::Usage(error.to_string()),
            other => Self::Device(other),
        }
    }
}

impl From<ImportError> for CliError {
    /// A cell that the plan does not have is an error of the command line.
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Store(error) => Self::Store(error),
            ImportError::NoCell { .. } => Self::Usage(error.to_string()),
            other => Self::Bad(other.to_string()),
        }
    }
}

impl From<ArchiveError> for CliError {
    fn from(error: ArchiveError) -> Self {
        match error {
            ArchiveError::Store(error) => Self::Store(error),
            other => Self::Bad(other.to_string()),
        }
    }
}

impl From<RestoreError> for CliError {
    fn from(error: RestoreError) -> Self {
        match error {
            RestoreError::Store(error) => Self::Store(error),
            other => Self::Bad(other.to_string()),
        }
    }
}

impl CliError {
    /// The exit code.
    pub fn code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            _ => 1,
        }
    }
}

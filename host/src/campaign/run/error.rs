//! Why a run ends with an error.

use super::stage::StageError;
use crate::campaign::store::error::StoreError;
use crate::device::error::DeviceError;

/// Why a run ended with an error.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Moving hammer or laser.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The device does not fit the plan.
    #[error("{address} does not fit the plan: {what}")]
    Unfit {
        /// The device.
        address: String,
        /// What does not fit, and what to do.
        what: String,
    },
    /// The file's records belong to another structure.
    #[error("{0}")]
    AnotherStructure(String),
    /// The thread that stores records ended without a reason.
    #[error("records can no longer be stored; run the same command again")]
    KeeperGone,
    /// The hammer is swung by a person, and no hit came in time.
    #[error("{cell}: no hit within {seconds} s (hammer.patience_s); run the same command again to continue")]
    NobodyStruck {
        /// The cell.
        cell: String,
        /// How long the run waited, s.
        seconds: f64,
    },
    /// Further cells could not be chosen.
    #[error("choosing further cells: {0}; nothing accepted is lost: run the same command again")]
    Further(String),
    /// The rig is not safe to strike.
    #[error("{0}; nothing accepted is lost: run the same command again")]
    Unsafe(&'static str),
}

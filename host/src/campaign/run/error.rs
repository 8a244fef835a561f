//! Why a run ends with an error.

use super::answers::Answers;
use super::answers::{Edits, Recount};
use super::clock::ScanClock;
use super::keeper::{Announced, Keeper};
use super::pulse::fitted;
use super::pulse::{FIRST_SLOPE, PulseHit, PulseLoop};
use super::runner::run;
use super::shot::Shooter;
use super::stage::same_or_accepted;
use super::stage::{Stage, StageError};
use super::tally::Tally;
use crate::campaign::plan::{Force, Plan};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::is_simulated_board;
use crate::campaign::store::record_table::{Damaged, NewRecord, RecordRow};
use crate::campaign::store::rows::Rows;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::judge::Judge;
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::campaign::watch::{Seen, Watchers};
use crate::device::channels::ChannelMap;
use crate::device::error::DeviceError;
use crate::device::session::Session;
use crate::device::stream::Accounts;
use crate::device::stream::Recording;
use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

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
    /// The hammer is swung by a person, and nobody struck.
    #[error(
        "{cell}: nobody struck within {seconds} s (hammer.patience_s); run the same command again to go on"
    )]
    NobodyStruck {
        /// The cell.
        cell: String,
        /// How long the run waited, s.
        seconds: f64,
    },
    /// The rig is not safe to strike.
    #[error("{0}; nothing accepted is lost: run the same command again")]
    Unsafe(&'static str),
}

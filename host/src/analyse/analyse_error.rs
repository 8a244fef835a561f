//! Errors of the analysis of a campaign file.

use super::campaign::analyse_measurements;
use super::cell::{CellName, ContactDelays, Hit, KnownContact, Measurements, ShakerLevel};
use super::data_quality::DataQuality;
use super::file_source::{calibrated, temperature_c};
use super::findings::Findings;
use super::plan_geometry::{geometry, places};
use super::wanted::{Progress, Wanted};
use crate::campaign::plan::{Plan, structure};
use crate::campaign::run::shaking;
use crate::campaign::run::tally::Tally;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::frf_table::ImportedFrf;
use crate::campaign::store::level_table::LevelRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::rows::{Rows, places as response_places};
use crate::campaign::store::session_table::SessionInfo;
use crate::contact::ContactPriors;
use crate::device::channels::ChannelMap;
use crate::hysteresis::HysteresisRecord;
use crate::results;
use crate::results::{Cells, Completeness, HitRow, Source, rounded};
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::geometry::Geometry;
use jointrig_protocol::channel::{Quantity, Role};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Why a campaign file cannot be analysed, or one of its cells cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum AnalyseError {
    /// The file cannot be read, or a record is damaged.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A channel that is required for analysing an impact is missing.
    #[error("record {record}: its session has no channel for {role}")]
    NoChannel {
        /// The record.
        record: i64,
        /// The missing channel.
        role: &'static str,
    },
    /// One cell has records of two sampling rates.
    #[error(
        "record {record} was sampled at {rate_hz} Hz, earlier ones at {others_hz} Hz, so their spectra have different lines: refuse one or the other and measure again"
    )]
    Rate {
        /// The record.
        record: i64,
        /// Its rate, Hz.
        rate_hz: f64,
        /// Rate of the earlier records, Hz.
        others_hz: f64,
    },
    /// The response channels of the file's sessions measure different quantities, or a quantity
    /// that is not motion.
    #[error(
        "the vibrometer's channels measure {0}: velocity, displacement or acceleration is needed, the same in all sessions"
    )]
    Quantity(String),
}

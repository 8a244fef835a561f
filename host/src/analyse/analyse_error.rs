//! Why a campaign file says nothing.

use crate::campaign::store::error::StoreError;

/// Why a campaign file cannot be analysed, or a cell of it not be read.
#[derive(Debug, thiserror::Error)]
pub enum AnalyseError {
    /// The file cannot be read, or a record is damaged.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A channel is not there without which an impact cannot be analysed.
    #[error("record {record}: its session has no channel for {role}")]
    NoChannel {
        /// The record.
        record: i64,
        /// What is missing.
        role: &'static str,
    },
    /// One cell has records of two sampling rates.
    #[error(
        "record {record} was sampled at {rate_hz} Hz, those before it at {others_hz} Hz: their spectra have other lines; refuse one or the other and measure again"
    )]
    Rate {
        /// The record.
        record: i64,
        /// Its rate, Hz.
        rate_hz: f64,
        /// That of the records before it, Hz.
        others_hz: f64,
    },
    /// The response channels of the file's sessions measure different quantities, or none that is motion.
    #[error(
        "the vibrometer's channels measure {0}: velocity, displacement or acceleration is needed, the same in all sessions"
    )]
    Quantity(String),
}

//! Errors of the analysis of a campaign file.

use crate::campaign::store::error::StoreError;

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

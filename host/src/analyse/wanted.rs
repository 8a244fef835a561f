//! What is asked of an analysis, and how far it is.

use super::cell::KnownContact;
use crate::results::MAIN_BAND;
use crate::substructuring::Band;

/// The bands that means are taken over, Hz; the first is the main one.
pub const BANDS: [Band; 3] =
    [MAIN_BAND, Band { low_hz: 100.0, high_hz: 800.0 }, Band { low_hz: 100.0, high_hz: 300.0 }];

/// What is wanted beyond the usual, and what is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Replicates of the bootstrap over hits; 0 for none.
    pub replicates: usize,
    /// Contact and static arm.
    pub known: KnownContact,
    /// Whether the FRFs of every pair are kept in the findings.
    pub frfs: bool,
}

/// How far the analysis is: cells done, and cells in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Cells done.
    pub done: usize,
    /// Cells in all.
    pub total: usize,
}

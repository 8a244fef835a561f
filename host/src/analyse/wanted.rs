//! Options of an analysis, and its progress.

use super::cell::KnownContact;
use crate::results::MAIN_BAND;
use crate::substructuring::Band;

/// The bands over which means are computed, Hz; the first is the main one.
pub const BANDS: [Band; 3] =
    [MAIN_BAND, Band { low_hz: 100.0, high_hz: 800.0 }, Band { low_hz: 100.0, high_hz: 300.0 }];

/// Additional results requested, and prior knowledge.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Replicates of the bootstrap over hits; 0 for none.
    pub replicates: usize,
    /// Prior knowledge of contact and static arm.
    pub known: KnownContact,
    /// Whether the FRFs of every pair are kept in the findings.
    pub frfs: bool,
}

/// Progress of the analysis: cells done, and total number of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Cells done.
    pub done: usize,
    /// Total number of cells.
    pub total: usize,
}

//! Progress of the plan: kept and refused hits per configuration.

use serde::Serialize;
use std::collections::BTreeMap;

/// Hits of one configuration.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Completeness {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// Cells of the plan.
    pub cells: usize,
    /// Cells with all planned hits.
    pub cells_complete: usize,
    /// Number of hits planned to be kept.
    pub wanted: usize,
    /// Hits kept.
    pub kept: usize,
    /// Hits refused, by verdict.
    pub refused: BTreeMap<String, usize>,
}

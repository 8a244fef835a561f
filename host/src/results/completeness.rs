//! What of the plan was measured: kept and refused hits per configuration.

use serde::Serialize;
use std::collections::BTreeMap;

/// Hits of one configuration.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Completeness {
    /// Configuration: `A`, `B` or `AJB`.
    pub configuration: String,
    /// Cells of the plan.
    pub cells: usize,
    /// Cells that have all the hits wanted.
    pub cells_complete: usize,
    /// Hits the plan wants kept.
    pub wanted: usize,
    /// Hits kept.
    pub kept: usize,
    /// Hits refused, by verdict.
    pub refused: BTreeMap<String, usize>,
}

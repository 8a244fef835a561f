//! Where the numbers of a mark are in `results.json`.

use serde::Serialize;

/// Where the numbers of a mark are in `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// Which of the mark's lists: `x`, `y`, `low`, `high`, `values`; `first` and `step` of regular
    /// positions; `at` of a level.
    pub of: &'static str,
    /// The path; `*` stands for any key or index.
    pub path: String,
    /// Factor by which the numbers there were multiplied for the unit shown.
    pub factor: f64,
    /// A second number that was combined with them before that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with: Option<Second>,
}

/// The second number of a sum or quotient, as in `mean ± σ`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Second {
    /// The operation.
    pub how: How,
    /// Its path, with as many `*` as the first one's.
    pub path: String,
}

/// Operation applied with a second number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum How {
    /// The second number was added.
    Plus,
    /// The second number was subtracted.
    Minus,
    /// The first was multiplied by it.
    Times,
    /// The first was divided by it.
    Per,
}

//! Where the numbers of a mark stand in `results.json`.

use serde::Serialize;

/// Where numbers of a mark stand in `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// Which of the mark's lists: `x`, `y`, `low`, `high`, `values`; `first` and `step` of regular places; `at` of a level.
    pub of: &'static str,
    /// The path; `*` stands for any key or index.
    pub path: String,
    /// What the numbers there were multiplied by for the unit shown.
    pub factor: f64,
    /// A second number that was brought in before that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with: Option<Second>,
}

/// The second number of a sum or quotient, as of `mean ± σ`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Second {
    /// What was done with it.
    pub how: How,
    /// Its path, with as many places as the first one's.
    pub path: String,
}

/// What was done with a second number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum How {
    /// It was added.
    Plus,
    /// It was taken away.
    Minus,
    /// The first was multiplied by it.
    Times,
    /// The first was divided by it.
    Per,
}

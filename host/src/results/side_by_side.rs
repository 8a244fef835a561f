//! FBS and loops side by side (the paper's Tables 2 and 3).

use serde::Serialize;

/// One type of stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideBySide {
    /// The method.
    pub found: String,
    /// Mean, N/m.
    pub mean_n_per_m: f64,
    /// Its scatter or standard deviation, N/m.
    pub std_n_per_m: f64,
    /// Its meaning, and what it may be used for.
    pub meaning: String,
}

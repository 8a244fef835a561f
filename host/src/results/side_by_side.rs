//! FBS and loops side by side (the paper's Tables 2 and 3).

use serde::Serialize;

/// One kind of stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideBySide {
    /// How it was found.
    pub found: String,
    /// Mean, N/m.
    pub mean_n_per_m: f64,
    /// Its scatter or standard deviation, N/m.
    pub std_n_per_m: f64,
    /// What it is, and what it may be used for.
    pub meaning: String,
}

//! What the report and the terminal say: findings and results in plain sentences, numbers with few digits.

pub(super) mod checks;
pub(super) mod missing;
mod names;
pub mod number;
pub mod side_by_side;
mod summary;
pub(super) mod warnings;

pub use names::{excitation, method, outcome, shape_name, slope, static_arm};
pub use summary::{bootstrapped, impact_loops, shaker_loops, substructuring, summary};

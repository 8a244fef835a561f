//! Text of the report and the terminal: findings and results in plain sentences, numbers with few
//! digits.

pub(super) mod answer_sentences;
pub mod brief;
pub(super) mod check_sentences;
pub(super) mod level_sentences;
pub mod mode_sentences;
mod names;
pub mod next_sentences;
pub mod number;
pub mod side_by_side;
mod summary;
pub mod trend_sentences;
pub(super) mod warning_sentences;

#[cfg(feature = "sim")]
pub use answer_sentences::expected;
pub use names::{TURNED_DEG, excitation, method, outcome, shape_name, slope, static_arm};
pub use summary::{bootstrapped, impact_loops, levels_at_the_contact, shaker_loops, substructuring, summary};

//! A campaign under way: cell after cell with the hammer ([`runner`]), level after level with the shaker ([`shaking`]).
//!
//! `runner.rs` walks the cells and keeps what comes, `cell.rs` brings one cell to its end, `shot.rs` fires once, `stage.rs` moves hammer and
//! laser, `by_hand.rs` waits for a person who strikes, `forces.rs` says how hard (by the closed loops of `pulse.rs`),
//! `edits.rs` takes notes and overruled verdicts from elsewhere, `answers.rs` the stage's answers,
//! `fit.rs` asks before all that whether the device fits the plan.

pub mod answers;
pub(in crate::campaign) mod by_hand;
mod cell;
mod clock;
mod directions;
mod earlier;
pub mod edits;
pub mod error;
mod fit;
mod forces;
mod keeper;
pub mod progress;
pub mod pulse;
pub mod quiet;
pub mod runner;
pub mod shaking;
pub mod shot;
pub mod stage;
pub mod status;
mod structure;
pub mod tally;

//! A running campaign: cell after cell with the hammer ([`runner`]), level after level with the
//! shaker ([`shaking`]).
//!
//! `runner.rs` walks the cells and stores the records, `cell.rs` measures one cell, `shot.rs` fires
//! one shot, `stage.rs` moves hammer and laser, `by_hand.rs` waits for a person to strike,
//! `forces.rs` determines the target force and its pulse (with the closed loops of `pulse.rs`),
//! `further.rs` chooses cells after those of the plan, `edits.rs` receives notes and overruled
//! verdicts, `answers.rs` receives answers to the stage's questions, `fit.rs` checks beforehand
//! that the device fits the plan.

pub mod answers;
pub(in crate::campaign) mod by_hand;
pub mod cell;
mod clock;
pub mod error;
pub mod further;
mod keeper;
pub mod progress;
pub mod pulse;
pub mod runner;
pub mod shaking;
pub mod shot;
pub mod stage;
pub mod tally;

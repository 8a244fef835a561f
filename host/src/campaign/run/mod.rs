//! A campaign under way: cell after cell with the hammer ([`runner`]), level after level with the shaker ([`shaking`]).
//!
//! `runner.rs` walks the cells and keeps what comes, `cell.rs` brings one cell to its end, `shot.rs` fires once, `stage.rs` moves hammer and
//! laser, `fit.rs` asks before all that whether the device fits the plan.

mod cell;
mod clock;
mod directions;
mod earlier;
pub mod error;
mod fit;
mod keeper;
mod progress;
pub mod pulse;
pub mod quiet;
pub mod runner;
pub mod shaking;
pub mod shot;
pub mod stage;
pub mod tally;

//! Campaigns: the plan, the file that keeps every record, and the runner that fills it.
//!
//! [`runner::run`] walks the cells of the plan: hammer and laser are brought there ([`stage`]), shots are fired at
//! repeatable scans ([`shot`]) with a pulse that finds the target force ([`pulse`]), each record is judged
//! ([`judge`]) and stored on a thread of its own (`keeper`, [`store`]).

mod backup;
pub mod check;
mod clock;
pub mod codec;
mod earlier;
pub mod frfs;
pub mod judge;
mod keeper;
pub mod level;
pub mod levels;
mod lock;
pub mod others;
pub mod plan;
mod plan_check;
mod progress;
pub mod pulse;
pub mod quiet;
mod records;
mod replan;
pub mod rows;
pub mod runner;
mod schema;
mod seal;
mod sessions;
pub mod shaking;
mod share;
pub mod shot;
pub mod stage;
pub mod store;
pub mod store_error;
pub mod tally;
mod upgrade;
pub mod verdict;

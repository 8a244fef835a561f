//! Campaigns: the plan, the file that keeps every record, and the runner that fills it.
//!
//! [`runner::run`] walks the cells of the plan: hammer and laser are brought there ([`stage`]), shots are fired at
//! repeatable scans ([`shot`]) with a pulse that finds the target force ([`pulse`]), each record is judged
//! ([`judge`]) and stored on a thread of its own (`keeper`, [`store`]).

mod backup;
mod cell_run;
pub mod cell_table;
pub mod check;
mod clock;
pub mod codec;
mod directions;
mod earlier;
mod fit;
pub mod frf_table;
pub mod judge;
mod keeper;
pub mod level;
pub mod level_table;
mod lock;
pub mod notes;
pub mod others;
pub mod overrules;
pub mod plan;
mod plan_check;
mod progress;
pub mod pulse;
pub mod quiet;
pub mod record_row;
mod record_table;
mod replan;
mod row_seal;
pub mod run_error;
pub mod runner;
mod schema;
pub mod session_table;
pub mod shaking;
mod share;
pub mod shot;
pub mod stage;
pub mod store;
pub mod store_error;
pub mod stored;
mod table;
pub mod tally;
pub mod verdict;
pub mod verify;

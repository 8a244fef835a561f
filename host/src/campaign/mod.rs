//! Campaigns: the plan, the campaign file that stores every record, the verdicts that accept or
//! refuse a record, and the runner that fills the file.
//!
//! | to add or change | where |
//! |---|---|
//! | a field of the plan | [`plan`], its rule in `plan/check.rs` |
//! | a column, a table | [`store`]: next to the row's type in its `*_table.rs` |
//! | a verdict, the double-hit threshold | [`verdict`] |
//! | what happens between two hits | [`run`]: `cell.rs` |
//! | a level of the shaker | [`run::shaking`] |
//! | what observers are notified of | [`watch`] |
//! | what an export holds beside signals, and its way back | [`archive`] |
//! | hits and levels from other systems | [`import`] |
//! | what `verify --deep` recomputes | [`recheck`] |
//!
//! [`run::runner::run`] walks the cells of the plan: hammer and laser are moved there
//! ([`run::stage`]), shots are fired at repeatable scans ([`run::shot`]) with a pulse length
//! controlled to the target force ([`run::pulse`]), each record is judged
//! ([`verdict::judge`](mod@verdict::judge)) and stored on a separate thread (`run/keeper.rs`).

pub mod archive;
pub mod cut;
pub mod import;
pub mod plan;
pub mod recheck;
pub mod run;
pub mod sensor_check;
pub mod store;
pub mod verdict;
pub mod watch;

//! Campaigns: the plan, the file that keeps every record, and the runner that fills it.

pub mod codec;
pub mod judge;
pub mod plan;
mod plan_check;
mod records;
pub mod rows;
mod schema;
mod sessions;
pub mod store;
pub mod store_error;
pub mod verdict;

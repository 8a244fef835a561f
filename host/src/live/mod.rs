//! Live view of a campaign while it is measured.
//!
//! What is stored is read from the campaign file, so that it is the same in the measuring process
//! and in another one; a reader of SQLite's write-ahead log does not block the writer. [`follow`]
//! detects changes of the file, [`figures`] draws single records and their spectra, and [`numbers`]
//! runs the analysis on the data so far and returns its results, with numbers for each cell.
//!
//! What happens between two records is reported by the measuring process: [`watching`] queues the
//! reports of its thread without ever blocking it, reads the stream through the tap, and makes
//! [`frames`] of it and the shaker's loop.
//!
//! [`bus`] numbers the messages of all these modules and distributes them; [`message`] and [`now`]
//! define their layout.

pub mod bus;
pub mod figures;
pub mod follow;
pub mod frames;
pub mod message;
pub mod now;
pub mod numbers;
pub mod watching;

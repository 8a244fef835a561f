//! Live view of a campaign while it is measured.
//!
//! What is stored is read from the campaign file, so that it is the same in the measuring process
//! and in another one; a reader of SQLite's write-ahead log does not block the writer. [`follow`]
//! detects changes of the file, [`forming`] runs the analysis on the data so far and returns its
//! results, [`figures`] draws single records, [`averaging`] computes their spectra, and [`numbers`]
//! gives a number for each cell.
//!
//! What happens between two records is reported by the measuring process: [`watcher`] queues the
//! reports of its thread without ever blocking it; [`watching`] receives them, reads the stream
//! through the tap, makes [`frames`] of it and the shaker's loop.
//!
//! [`bus`] numbers the messages of all these modules and distributes them; [`message`] and [`now`]
//! define their layout.

pub mod averaging;
pub mod bus;
pub mod figures;
pub mod follow;
pub mod forming;
pub mod frames;
pub mod message;
pub mod now;
pub mod numbers;
pub mod watcher;
pub mod watching;

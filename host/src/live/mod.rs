//! What can be said of a campaign while it is measured. All of it is read from the campaign file, so that it is the same in the measuring
//! process and beside it, and nothing here can slow the measuring: a reader of SQLite's write-ahead log blocks no writer.
//!
//! [`follow`] sees what is new in the file, [`forming`] runs the analysis on what is there, [`bus`] numbers what both have to say and keeps
//! it for whoever listens, [`message`] is its layout, [`figures`] draws single records.

pub mod bus;
pub mod figures;
pub mod follow;
pub mod forming;
pub mod message;

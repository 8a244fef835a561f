//! What can be said of a campaign while it is measured.
//!
//! What is stored is read from the campaign file, so that it is the same in the measuring process and beside it; a reader of SQLite's
//! write-ahead log blocks no writer. [`follow`] sees what is new in the file, [`forming`] has what is there analysed and gets what was [`found`], [`figures`] draws
//! single records, [`averaging`] and [`spectra_figures`] their spectra, [`numbers`] has a number for each cell.
//!
//! What happens between two records is told by the measuring process itself: [`eye`] takes down what its thread says without ever waiting,
//! [`watching`] hears that, looks at the stream through the tap, makes [`frames`] of it, and [`turning`] the shaker's loop.
//!
//! [`bus`] numbers what all of them have to say and keeps it for whoever listens; [`message`] and [`now`] are its layout.

pub mod averaging;
pub mod bus;
pub mod eye;
pub mod figures;
pub mod follow;
pub mod forming;
pub mod found;
pub mod frames;
pub mod message;
pub mod now;
pub mod numbers;
pub mod spectra_figures;
pub mod turning;
pub mod watching;

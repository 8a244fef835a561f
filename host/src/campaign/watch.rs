//! Notifies observers of the events of a running campaign: the progress bar in the terminal, the
//! live page.
//!
//! Notifications are one-way: an observer must return immediately, and cannot influence the
//! measurement.

use std::fmt;
use std::sync::Arc;

use super::plan::level::Level;
use super::store::cell_table::CellRow;
use super::verdict::Judgement;
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Accounts;

/// An observer.
pub trait Watch {
    /// Called for each event, by the measuring and the storing thread: must be short and must not
    /// block.
    fn saw(&self, seen: &Seen<'_>);
}

/// Number of good hits still wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Left {
    /// In the cell.
    pub cell: u64,
    /// In its configuration.
    pub configuration: u64,
    /// In the campaign.
    pub campaign: u64,
}

/// Progress of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Good hits so far.
    pub kept: u32,
    /// Hits so far, good or not: the number of its next attempt.
    pub attempts: u32,
}

/// An event.
#[derive(Clone, Copy, Debug)]
pub enum Seen<'a> {
    /// A stream of scans starts.
    Stream {
        /// Its channels.
        channels: &'a ChannelMap,
        /// Whether the rig is simulated.
        simulated: bool,
    },
    /// A campaign starts or is resumed.
    Begun {
        /// Good hits wanted in total.
        wanted: u64,
        /// Good hits already in the file.
        kept: u64,
    },
    /// Hammer and vibrometer are being moved to a cell.
    Moving {
        /// The cell.
        row: &'a CellRow,
        /// Its progress.
        standing: Standing,
        /// Whether a person or an external command moves them, not the device itself.
        by_hand: bool,
        /// Good hits still wanted.
        left: Left,
    },
    /// They are in place, or the move was skipped.
    Moved,
    /// A shot waits until the structure is at rest.
    Settling {
        /// The cell.
        row: &'a CellRow,
        /// Its progress.
        standing: Standing,
        /// Longest wait, s of the device's clock.
        most_s: f64,
        /// Whether a person strikes, and is waited for.
        by_hand: bool,
    },
    /// The hammer has struck, and the record is being received.
    Recording,
    /// The record is being judged.
    Judging,
    /// A hit was accepted or refused, and is in the file: it survives if the process is killed. The
    /// next cell or hit may already have started.
    Judged {
        /// The cell.
        row: &'a CellRow,
        /// The verdict.
        verdict: &'a Judgement,
        /// Good hits in total.
        kept: u64,
        /// Good hits still wanted.
        left: Left,
    },
    /// Accounting of the stream's scans so far.
    Link(Accounts),
    /// A message to be shown.
    Remark(&'a str),
    /// The shaker is ordered to drive a level.
    Level {
        /// The level.
        level: &'a Level,
        /// Limit of each channel above which the shaker stops, SI, in the order of the scan; 0 for
        /// none.
        limits: &'a [f64],
        /// The drive's largest amplitude, V.
        most_drive_v: f64,
        /// The load cells whose sum is T: index in the scan, and the factor of each.
        load_cells: &'a [(usize, f64)],
    },
    /// Some whole cycles of a level in progress.
    Shaking(Shaking<'a>),
    /// The level has ended: recorded, not reached, or the shaker has stopped.
    LevelOver {
        /// Whether it was recorded.
        recorded: bool,
        /// The result, as text.
        say: &'a str,
    },
    /// The measurement has ended.
    Ended,
}

/// A part of a level in progress.
#[derive(Clone, Copy, Debug)]
pub struct Shaking<'a> {
    /// Time since the order, s of the device's clock.
    pub at_s: f64,
    /// Amplitude of the controlled quantity, m or N; with an open-loop drive that of the relative
    /// displacement, m.
    pub amplitude: f64,
    /// The drive's amplitude, V.
    pub drive_v: f64,
    /// Whether it has settled.
    pub settled: bool,
    /// The samples of these cycles.
    pub samples: &'a Samples,
}

/// All observers.
#[derive(Clone, Default)]
pub struct Watchers(Vec<Arc<dyn Watch + Send + Sync>>);

impl Watchers {
    /// Adds an observer.
    #[must_use]
    pub fn and(mut self, watcher: Arc<dyn Watch + Send + Sync>) -> Self {
        self.0.push(watcher);
        self
    }

    /// Notifies each observer.
    pub fn saw(&self, seen: &Seen<'_>) {
        self.0.iter().for_each(|watcher| watcher.saw(seen));
    }
}

impl fmt::Debug for Watchers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} watchers", self.0.len())
    }
}

//! What happens while a campaign is measured, for whoever watches: the bar in the terminal, the live page.
//!
//! Measuring tells, and does not ask: a watcher must return at once, and nothing that it does comes back.

use std::fmt;
use std::sync::Arc;

use super::plan::level::Level;
use super::store::cell_table::CellRow;
use super::verdict::Verdict;
use crate::device::channels::ChannelMap;
use crate::device::stream::Accounts;

/// Somebody who watches.
pub trait Watch {
    /// Something happened. Called by the thread that measures, and by the one that stores: to be brief, without
    /// waiting for anything.
    fn saw(&self, seen: &Seen<'_>);
}

/// Good hits that are still wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Left {
    /// In the cell.
    pub cell: u64,
    /// In its configuration.
    pub configuration: u64,
    /// In the campaign.
    pub campaign: u64,
}

/// How far a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Good hits that it has.
    pub kept: u32,
    /// Hits that were tried: the number of its next attempt.
    pub attempts: u32,
}

/// What happened.
#[derive(Clone, Copy, Debug)]
pub enum Seen<'a> {
    /// A stream of scans begins.
    Stream {
        /// Of these channels.
        channels: &'a ChannelMap,
        /// Whether the rig is simulated.
        simulated: bool,
    },
    /// A campaign begins or goes on: good hits wanted, and those that are there.
    Begun {
        /// Good hits wanted in all.
        wanted: u64,
        /// Good hits that are there.
        kept: u64,
    },
    /// Hammer and vibrometer go to a cell.
    Moving {
        /// Which.
        row: &'a CellRow,
        /// How far it is.
        standing: Standing,
        /// Whether somebody or something outside moves them, and not the device itself.
        by_hand: bool,
        /// Good hits that are still wanted.
        left: Left,
    },
    /// They are there, or it was decided otherwise.
    Moved,
    /// A shot waits until the structure is at rest.
    Settling {
        /// In which cell.
        row: &'a CellRow,
        /// How far it is.
        standing: Standing,
        /// The longest that it waits, s of the device.
        most_s: f64,
        /// Whether a person strikes, who is waited for.
        by_hand: bool,
    },
    /// The hammer has struck, and its record comes in.
    Recording,
    /// The record is looked at.
    Judging,
    /// A hit was kept or refused, and is in the file: a process that is killed does not lose it any more. The
    /// next cell or hit may have begun meanwhile.
    Judged {
        /// In which cell.
        row: &'a CellRow,
        /// Why.
        verdict: &'a Verdict,
        /// Good hits in all.
        kept: u64,
        /// Good hits that are still wanted.
        left: Left,
    },
    /// Where the scans of the stream went so far.
    Link(Accounts),
    /// Something worth a line of its own.
    Remark(&'a str),
    /// The shaker is told to bring a level about.
    Level {
        /// Which.
        level: &'a Level,
        /// Magnitude of each channel that stops the shaker, SI, in the order of the scan; 0 where there is none.
        limits: &'a [f64],
        /// The drive's largest amplitude, V.
        most_drive_v: f64,
        /// The load cells whose sum is T: place in the scan, and by what each is multiplied.
        load_cells: &'a [(usize, f64)],
    },
    /// A piece of a level on its way: some whole cycles.
    Shaking(Shaking<'a>),
    /// The level is over: recorded, not reached, or the shaker has stopped. What is to be said of it.
    LevelOver {
        /// Whether it was recorded.
        recorded: bool,
        /// In words.
        say: &'a str,
    },
    /// Measuring is over.
    Ended,
}

/// A piece of a level on its way.
#[derive(Clone, Copy, Debug)]
pub struct Shaking<'a> {
    /// Since the order, s of the device.
    pub at_s: f64,
    /// Amplitude of what is held, m or N; for a held drive the relative displacement, m.
    pub amplitude: f64,
    /// The drive's amplitude, V.
    pub drive_v: f64,
    /// Whether it has settled by now.
    pub settled: bool,
    /// Codes of these cycles, scan after scan.
    pub codes: &'a [i16],
}

/// All who watch.
#[derive(Clone, Default)]
pub struct Watchers(Vec<Arc<dyn Watch + Send + Sync>>);

impl Watchers {
    /// One more.
    #[must_use]
    pub fn and(mut self, watcher: Arc<dyn Watch + Send + Sync>) -> Self {
        self.0.push(watcher);
        self
    }

    /// Tells each of them.
    pub fn saw(&self, seen: &Seen<'_>) {
        self.0.iter().for_each(|watcher| watcher.saw(seen));
    }
}

impl fmt::Debug for Watchers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} watchers", self.0.len())
    }
}

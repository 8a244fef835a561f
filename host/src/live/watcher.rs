//! Records for the live page what the measuring thread reports, without blocking that thread and
//! without unbounded memory.
//!
//! Reports go into a queue of fixed size; when it is full, the newest report is dropped, and the
//! state is correct again with the next one. The cycles of a level go into a single buffer, in
//! which new ones replace cycles that were not read.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use crate::campaign::plan::level::Level;
use crate::campaign::watch::{Seen, Watch};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelView, Samples};
use crate::device::stream::Accounts;

/// Length of the queue of reports.
const QUEUE: usize = 256;

/// Most codes kept of a level's cycles: at least a quarter of a second of sixteen channels.
const MOST_CODES: usize = 1 << 18;

/// One report.
#[derive(Clone, Debug)]
pub enum WatchReport {
    /// A stream with these channels began; the flag is true for a simulated rig.
    Stream(Arc<ChannelMap>, bool),
    /// Hammer and laser move to a cell.
    Moving {
        /// The cell.
        cell: i64,
        /// Good hits of the cell so far.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// Whether they are moved manually or by another program instead of by the device.
        by_hand: bool,
    },
    /// A shot waits for the structure to come to rest.
    Settling {
        /// The cell.
        cell: i64,
        /// Good hits of the cell so far.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// Longest wait, s of device time.
        most_s: f64,
        /// Whether a person strikes.
        by_hand: bool,
    },
    /// A record is being received.
    Recording,
    /// The record is being assessed.
    Judging,
    /// Scans received and lost.
    Link(Accounts),
    /// A level of the shaker begins.
    Level {
        /// The level.
        level: Level,
        /// Limit of each channel that stops the shaker, SI; 0 where there is none.
        limits: Vec<f64>,
        /// Largest amplitude of the drive, V.
        most_drive_v: f64,
        /// The load cells whose sum is T: index in the scan, and factor.
        load_cells: Vec<(usize, f64)>,
    },
    /// A window of the level: time (s), amplitude, drive (V), and whether the level has settled.
    Window([f64; 3], bool),
    /// The level is over: whether it was recorded, and a message.
    LevelOver(bool, String),
    /// Measuring has ended.
    Ended,
}

/// The newest cycles of a level.
#[derive(Debug, Default)]
pub struct Cycles {
    /// Codes, one channel after another.
    pub codes: Vec<i16>,
    /// Whether they have not been read yet.
    pub fresh: bool,
}

/// The sending end, used by the measuring thread.
pub struct Watcher {
    queue: SyncSender<WatchReport>,
    cycles: Arc<Mutex<Cycles>>,
}

/// The receiving end.
pub struct WatchQueue {
    /// The reports.
    pub queue: Receiver<WatchReport>,
    cycles: Arc<Mutex<Cycles>>,
}

/// Creates both ends.
pub fn watcher() -> (Watcher, WatchQueue) {
    let (to, from) = sync_channel(QUEUE);
    let cycles = Arc::new(Mutex::new(Cycles { codes: room(), fresh: false }));
    (Watcher { queue: to, cycles: cycles.clone() }, WatchQueue { queue: from, cycles })
}

/// A buffer for the cycles, allocated in advance so that the measuring thread never allocates.
pub fn room() -> Vec<i16> {
    Vec::with_capacity(MOST_CODES)
}

impl WatchQueue {
    /// Swaps the newest cycles with `own` if they have not been read yet; `own` should come from
    /// [`room`].
    pub fn cycles(&self, own: &mut Vec<i16>) -> bool {
        let mut cycles = self.cycles.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = std::mem::take(&mut cycles.fresh);
        if fresh {
            std::mem::swap(own, &mut cycles.codes);
        }
        fresh
    }
}

impl Watcher {
    fn tell(&self, told: WatchReport) {
        // if the queue is full, a later report updates the page
        let _ = self.queue.try_send(told);
    }

    fn keep(&self, samples: &Samples) {
        let mut cycles = match self.cycles.try_lock() {
            Ok(cycles) => cycles,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        cycles.codes.clear();
        // the buffer never grows: of a longer window the last scans are kept
        let kept = samples.scans().min(MOST_CODES / samples.channels().max(1));
        for place in 0..samples.channels() {
            if let ChannelView::I16(codes) = samples.channel(place) {
                cycles.codes.extend_from_slice(&codes[codes.len() - kept..]);
            }
        }
        cycles.fresh = true;
    }
}

impl Watch for Watcher {
    fn saw(&self, seen: &Seen<'_>) {
        match *seen {
            Seen::Stream { channels, simulated } => {
                self.tell(WatchReport::Stream(Arc::new(channels.clone()), simulated));
            }
            Seen::Moving { row, standing, by_hand, .. } => self.tell(WatchReport::Moving {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                by_hand,
            }),
            Seen::Settling { row, standing, most_s, by_hand } => self.tell(WatchReport::Settling {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                most_s,
                by_hand,
            }),
            Seen::Recording => self.tell(WatchReport::Recording),
            Seen::Judging => self.tell(WatchReport::Judging),
            Seen::Link(accounts) => self.tell(WatchReport::Link(accounts)),
            Seen::Level { level, limits, most_drive_v, load_cells } => {
                let (limits, load_cells) = (limits.to_vec(), load_cells.to_vec());
                self.tell(WatchReport::Level { level: *level, limits, most_drive_v, load_cells });
            }
            Seen::Shaking(shaking) => {
                self.keep(shaking.samples);
                self.tell(WatchReport::Window(
                    [shaking.at_s, shaking.amplitude, shaking.drive_v],
                    shaking.settled,
                ));
            }
            Seen::LevelOver { recorded, say } => self.tell(WatchReport::LevelOver(recorded, say.into())),
            Seen::Ended => self.tell(WatchReport::Ended),
            // the campaign file contains the rest
            Seen::Begun { .. } | Seen::Moved | Seen::Judged { .. } | Seen::Remark(_) => {}
        }
    }
}

//! The watcher of the live page: takes down what the measuring thread tells, without waiting for anything and without memory of its own.
//!
//! What is told goes into a queue of fixed size; when nobody empties it, the newest is left out, and the state is right again with the next
//! one. A level's cycles go into one buffer, where the newest replaces what nobody has looked at.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use crate::campaign::plan::level::Level;
use crate::campaign::watch::{Seen, Watch};
use crate::device::channels::ChannelMap;
use crate::device::stream::Accounts;

/// Things told that nobody has heard yet.
const QUEUE: usize = 256;

/// Codes of a level's cycles that are looked at: a quarter of a second of sixteen channels at least. More are left out.
const MOST_CODES: usize = 1 << 18;

/// One thing that was told.
#[derive(Clone, Debug)]
pub enum Told {
    /// A stream of these channels, and whether the rig is simulated.
    Stream(Arc<ChannelMap>, bool),
    /// Hammer and laser go to a cell.
    Moving {
        /// The cell.
        cell: i64,
        /// Good hits that it has.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// Whether somebody outside moves them.
        by_hand: bool,
    },
    /// A shot waits for rest.
    Settling {
        /// The cell.
        cell: i64,
        /// Good hits that it has.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// At most so long, s of the device.
        most_s: f64,
        /// Whether a person strikes.
        by_hand: bool,
    },
    /// A record comes in.
    Recording,
    /// It is looked at.
    Judging,
    /// Where the scans went.
    Link(Accounts),
    /// A level begins.
    Level {
        /// Which.
        level: Level,
        /// What stops the shaker, SI, channel by channel; 0 where nothing does.
        limits: Vec<f64>,
        /// The drive's largest amplitude, V.
        most_drive_v: f64,
        /// The load cells whose sum is T: place in the scan, and by what each is multiplied.
        load_cells: Vec<(usize, f64)>,
    },
    /// A piece of it: time (s), amplitude, drive (V), and whether it has settled.
    Window([f64; 3], bool),
    /// It is over.
    LevelOver(bool, String),
    /// Measuring is over.
    Ended,
}

/// The newest cycles of a level.
#[derive(Debug, Default)]
pub struct Cycles {
    /// Codes, scan after scan.
    pub codes: Vec<i16>,
    /// Whether nobody has looked at them.
    pub fresh: bool,
}

/// The end that is told.
pub struct Eye {
    queue: SyncSender<Told>,
    cycles: Arc<Mutex<Cycles>>,
}

/// The end that hears.
pub struct Ear {
    /// What was told.
    pub queue: Receiver<Told>,
    cycles: Arc<Mutex<Cycles>>,
}

/// Both ends.
pub fn eye() -> (Eye, Ear) {
    let (to, from) = sync_channel(QUEUE);
    let cycles = Arc::new(Mutex::new(Cycles { codes: room(), fresh: false }));
    (Eye { queue: to, cycles: cycles.clone() }, Ear { queue: from, cycles })
}

/// Room for the cycles, so that the measuring thread never asks for any.
pub fn room() -> Vec<i16> {
    Vec::with_capacity(MOST_CODES)
}

impl Ear {
    /// Exchanges the newest cycles for `own`, if nobody has looked at them; `own` is to come from [`room`].
    pub fn cycles(&self, own: &mut Vec<i16>) -> bool {
        let mut cycles = self.cycles.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = std::mem::take(&mut cycles.fresh);
        if fresh {
            std::mem::swap(own, &mut cycles.codes);
        }
        fresh
    }
}

impl Eye {
    fn tell(&self, told: Told) {
        // a page that is late hears the next one
        let _ = self.queue.try_send(told);
    }

    fn keep(&self, codes: &[i16]) {
        let mut cycles = match self.cycles.try_lock() {
            Ok(cycles) => cycles,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        cycles.codes.clear();
        cycles.codes.extend_from_slice(&codes[..codes.len().min(MOST_CODES)]);
        cycles.fresh = true;
    }
}

impl Watch for Eye {
    fn saw(&self, seen: &Seen<'_>) {
        match *seen {
            Seen::Stream { channels, simulated } => {
                self.tell(Told::Stream(Arc::new(channels.clone()), simulated));
            }
            Seen::Moving { row, standing, by_hand, .. } => self.tell(Told::Moving {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                by_hand,
            }),
            Seen::Settling { row, standing, most_s, by_hand } => self.tell(Told::Settling {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                most_s,
                by_hand,
            }),
            Seen::Recording => self.tell(Told::Recording),
            Seen::Judging => self.tell(Told::Judging),
            Seen::Link(accounts) => self.tell(Told::Link(accounts)),
            Seen::Level { level, limits, most_drive_v, load_cells } => {
                let (limits, load_cells) = (limits.to_vec(), load_cells.to_vec());
                self.tell(Told::Level { level: *level, limits, most_drive_v, load_cells });
            }
            Seen::Shaking(shaking) => {
                self.keep(shaking.codes);
                self.tell(Told::Window([shaking.at_s, shaking.amplitude, shaking.drive_v], shaking.settled));
            }
            Seen::LevelOver { recorded, say } => self.tell(Told::LevelOver(recorded, say.into())),
            Seen::Ended => self.tell(Told::Ended),
            // the file says the rest
            Seen::Begun { .. } | Seen::Moved | Seen::Judged { .. } | Seen::Remark(_) => {}
        }
    }
}

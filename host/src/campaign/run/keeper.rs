//! Stores records while the next hit is measured: compression, insertion and sync run on a separate
//! thread.
//!
//! The queue is short, so that a slow disk slows the campaign down instead of filling the memory.
//! The first error ends the campaign: nothing is measured that cannot be stored.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use jointrig_protocol::sync::Edge;

use super::answers::{Edits, Recount};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::NewRecord;
use crate::campaign::store::session_table::Counters;
use crate::campaign::watch::{Left, Seen, Watchers};

/// Records that may wait for the disk.
const QUEUE: usize = 2;

/// Interval at which requested edits are checked.
const EDITS: Duration = Duration::from_millis(50);

/// What observers are notified of when a record has been stored.
#[derive(Debug)]
pub struct Announced {
    /// Its cell.
    pub row: CellRow,
    /// Good hits in total, including this one.
    pub kept: u64,
    /// Good hits still wanted.
    pub left: Left,
}

/// An entry to be stored.
enum PendingEntry {
    Record(Box<(NewRecord, Announced)>, Counters),
    GivenUp {
        cell: i64,
        reason: String,
    },
    Settled {
        cell: i64,
        reason: String,
    },
    Redo {
        cell: i64,
        reason: String,
    },
    Link {
        session: i64,
        counters: Counters,
    },
    Log(String),
    Temperature {
        session: i64,
        celsius: f64,
    },
    Edges {
        session: i64,
        edges: Vec<Edge>,
    },
    /// Somebody waits until everything before this is stored.
    Waited(SyncSender<()>),
}

/// The thread that stores.
pub struct Keeper {
    queue: Option<SyncSender<PendingEntry>>,
    thread: Option<JoinHandle<(Store, Result<(), StoreError>)>>,
    recounts: Receiver<Recount>,
}

impl Keeper {
    /// Takes over the store until [`Keeper::finish`]; the watchers are notified of each record once
    /// it is stored.
    pub fn start(store: Store, edits: Option<Edits>, watch: Watchers) -> Self {
        let ((queue, entries), (to, recounts)) = (sync_channel(QUEUE), channel());
        let thread = std::thread::spawn(move || {
            let kept = match edits {
                Some(edits) => keep_and_edit(&store, &entries, &edits, &to, &watch),
                None => entries.iter().try_for_each(|entry| keep(&store, entry, &watch)),
            };
            (store, kept)
        });
        Self { queue: Some(queue), thread: Some(thread), recounts }
    }

    /// Cells whose count changed through edits since the last call.
    pub fn recounts(&self) -> Vec<Recount> {
        self.recounts.try_iter().collect()
    }

    /// Stores a record, with the link's counters so far, and then announces it; blocks only if the
    /// disk is two records behind. Returns whether the keeper still works: if not,
    /// [`Keeper::finish`] returns the error.
    #[must_use]
    pub fn record(&self, record: NewRecord, counters: Counters, announced: Announced) -> bool {
        self.send(PendingEntry::Record(Box::new((record, announced)), counters))
    }

    /// Marks a cell as done with the hits that it has. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn settle(&self, cell: i64, reason: &str) -> bool {
        self.send(PendingEntry::Settled { cell, reason: reason.into() })
    }

    /// Overrules a cell's good records because a person wants the cell struck again. Returns as
    /// [`Keeper::record`] does.
    #[must_use]
    pub fn redo(&self, cell: i64, reason: &str) -> bool {
        self.send(PendingEntry::Redo { cell, reason: reason.into() })
    }

    /// Stores the link's counters at the end of a session. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn link(&self, session: i64, counters: Counters) -> bool {
        self.send(PendingEntry::Link { session, counters })
    }

    /// Gives a cell up. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn give_up(&self, cell: i64, reason: &str) -> bool {
        self.send(PendingEntry::GivenUp { cell, reason: reason.into() })
    }

    /// Adds a line to the campaign's log. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn log(&self, text: String) -> bool {
        self.send(PendingEntry::Log(text))
    }

    /// Stores the specimen's temperature, °C. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn temperature(&self, session: i64, celsius: f64) -> bool {
        self.send(PendingEntry::Temperature { session, celsius })
    }

    /// Stores edges of the sync input and output. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn edges(&self, session: i64, edges: Vec<Edge>) -> bool {
        self.send(PendingEntry::Edges { session, edges })
    }

    /// Waits until everything handed over is in the file. Returns as [`Keeper::record`] does.
    #[must_use]
    pub fn catch_up(&self) -> bool {
        let (to, done) = sync_channel(1);
        self.send(PendingEntry::Waited(to)) && done.recv().is_ok()
    }

    fn send(&self, entry: PendingEntry) -> bool {
        self.queue.as_ref().is_some_and(|queue| queue.send(entry).is_ok())
    }

    /// Stores what is left, closes the file, and returns the first error.
    pub fn finish(mut self) -> Result<(), StoreError> {
        self.end().unwrap_or(Ok(()))
    }

    fn end(&mut self) -> Option<Result<(), StoreError>> {
        self.queue = None;
        let (store, kept) = match self.thread.take()?.join() {
            Ok(ended) => ended,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        Some(kept.and(store.close()))
    }
}

impl Drop for Keeper {
    /// Entries handed over are stored even if the runner ends early.
    fn drop(&mut self) {
        if self.thread.is_some()
            && !std::thread::panicking()
            && let Some(Err(error)) = self.end()
        {
            log::error!("{error}");
        }
    }
}

fn keep(store: &Store, entry: PendingEntry, watch: &Watchers) -> Result<(), StoreError> {
    match entry {
        PendingEntry::Record(record, counters) => {
            let (record, Announced { row, kept, left }) = &*record;
            store.insert(record, &counters)?;
            watch.saw(&Seen::Judged { row, verdict: &record.verdict, kept: *kept, left: *left });
            Ok(())
        }
        PendingEntry::Settled { cell, reason } => store.settle(cell, &reason),
        PendingEntry::Redo { cell, reason } => store.redo(cell, &reason).map(drop),
        PendingEntry::Link { session, counters } => store.note_link(session, &counters),
        PendingEntry::GivenUp { cell, reason } => store.give_up(cell, &reason),
        PendingEntry::Log(text) => store.log(&text),
        PendingEntry::Temperature { session, celsius } => store.note_temperature(session, celsius),
        PendingEntry::Edges { session, edges } => store.note_edges(session, &edges),
        PendingEntry::Waited(by) => {
            // the waiting thread may have ended
            let _ = by.send(());
            Ok(())
        }
    }
}

/// Stores incoming entries, and carries out requested edits in between.
fn keep_and_edit(
    store: &Store,
    entries: &Receiver<PendingEntry>,
    edits: &Edits,
    recounts: &Sender<Recount>,
    watch: &Watchers,
) -> Result<(), StoreError> {
    loop {
        let next = entries.recv_timeout(EDITS);
        let over = matches!(next, Err(RecvTimeoutError::Disconnected));
        if let Ok(entry) = next {
            keep(store, entry, watch)?;
        }
        for recount in edits.work_off(store)? {
            // a runner that has ended needs no counts
            let _ = recounts.send(recount);
        }
        if over {
            return Ok(());
        }
    }
}

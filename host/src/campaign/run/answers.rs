//! Answers to the stage's questions that come from other places than the terminal. An answer names
//! the cell and the attempt that it refers to: an answer to another question has no effect.
//!
//! Changes that a person requests while a campaign is measured: notes, and overruled verdicts. The
//! campaign file has one writer, so requests are queued and carried out between two records; the
//! runner is notified of the affected cells.

use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::verdict::Verdict;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The possible answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Hammer and laser are in place.
    Accept,
    /// Strike the cell's good hits again.
    Redo,
    /// Leave the cell for a later run.
    Skip,
    /// Go back to the cell before.
    Back,
}

/// Identifies a question: a cell's id, and the number of its next attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question {
    /// The cell.
    pub cell: i64,
    /// The attempt.
    pub attempt: u32,
}

/// The end where answers are given.
#[derive(Clone)]
pub struct Answerer(SyncSender<(Question, Key)>);

/// The end where answers are received.
#[derive(Clone)]
pub struct Answers {
    queue: Arc<Mutex<Receiver<(Question, Key)>>>,
    stop: Arc<AtomicBool>,
}

/// Creates both ends; `stop` ends the waiting.
pub fn answers(stop: Arc<AtomicBool>) -> (Answerer, Answers) {
    let (to, from) = sync_channel(1);
    (Answerer(to), Answers { queue: Arc::new(Mutex::new(from)), stop })
}

impl Answerer {
    /// Gives an answer; returns whether it was accepted.
    pub fn give(&self, question: Question, key: Key) -> bool {
        self.0.try_send((question, key)).is_ok()
    }
}

impl Answers {
    fn queue(&self) -> MutexGuard<'_, Receiver<(Question, Key)>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Discards answers that were given before the question.
    pub(super) fn forget(&self) {
        self.queue().try_iter().for_each(drop);
    }

    /// The answer to this question, if it has been given.
    pub(super) fn answer_to(&self, question: Question) -> Option<Key> {
        self.queue().try_iter().find(|(about, _)| *about == question).map(|(_, key)| key)
    }

    /// Whether the run is being stopped, so that no answer is needed any more.
    pub(super) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl fmt::Debug for Answers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("answers")
    }
}

/// Maximum number of queued edits.
const QUEUE: usize = 16;

/// A requested change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Edit {
    /// A line in the campaign's log.
    Note(String),
    /// A different verdict for a record: [`Verdict::Good`] keeps it, [`Verdict::Dropped`] leaves it
    /// out.
    Overrule {
        /// The record.
        record: i64,
        /// The new verdict.
        verdict: Verdict,
        /// The reason.
        reason: String,
    },
    /// Restores the verdict that a record had before it was last overruled.
    Undo {
        /// The record.
        record: i64,
    },
}

/// The result reported to the requester: a sentence, or the reason for failure.
pub type EditResult = Result<String, String>;

/// A requested change, and the callback for its result.
pub struct Request {
    edit: Edit,
    tell: Box<dyn FnOnce(EditResult) + Send>,
}

/// Why an edit is not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotTaken {
    /// The queue is full.
    Busy,
    /// The measurement has ended.
    Over,
}

/// The end where edits are submitted.
#[derive(Clone)]
pub struct EditQueue(SyncSender<Request>);

/// The end where edits are received, held by the writer of the campaign file.
#[derive(Clone)]
pub struct Edits(Arc<Mutex<Receiver<Request>>>);

/// Creates both ends.
pub fn edits() -> (EditQueue, Edits) {
    let (to, from) = sync_channel(QUEUE);
    (EditQueue(to), Edits(Arc::new(Mutex::new(from))))
}

impl EditQueue {
    /// Submits an edit; `tell` is called with its result on the writer's thread.
    ///
    /// # Errors
    /// The edit cannot be accepted.
    pub fn hand_in(
        &self,
        edit: Edit,
        tell: impl FnOnce(EditResult) + Send + 'static,
    ) -> Result<(), NotTaken> {
        self.0.try_send(Request { edit, tell: Box::new(tell) }).map_err(|error| match error {
            TrySendError::Full(_) => NotTaken::Busy,
            TrySendError::Disconnected(_) => NotTaken::Over,
        })
    }
}

impl fmt::Debug for Edits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("edits")
    }
}

/// A cell whose number of good hits changed by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recount {
    /// The cell's id.
    pub cell: i64,
    /// Whether it has one good hit more; otherwise one less.
    pub more: bool,
}

impl Edits {
    /// Carries out the queued edits, and returns the affected cells.
    ///
    /// # Errors
    /// The file cannot be written; an invalid edit is reported to its requester only.
    pub fn work_off(&self, store: &Store) -> Result<Vec<Recount>, StoreError> {
        let queue = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut changed = Vec::new();
        while let Ok(Request { edit, tell }) = queue.try_recv() {
            let (told, recount) = done(store, edit)?;
            changed.extend(recount);
            tell(told);
        }
        Ok(changed)
    }
}

/// Carries out one edit. A record that is missing or has no samples makes the edit invalid; a file
/// that cannot be written is an error of the run.
fn done(store: &Store, edit: Edit) -> Result<(EditResult, Option<Recount>), StoreError> {
    let (record, wanted, reason) = match edit {
        Edit::Note(text) => {
            store.log(&format!("note: {text}"))?;
            return Ok((Ok("noted".into()), None));
        }
        Edit::Overrule { record, verdict, reason } => (record, Some(verdict), reason),
        Edit::Undo { record } => (record, None, "taken back".into()),
    };
    let row = match store.record(record) {
        Ok(row) => row,
        Err(error) => return Ok((Err(error.to_string()), None)),
    };
    let verdict = match wanted {
        Some(verdict) => verdict,
        None => match before_last(store, record, row.verdict)? {
            Some(before) => before,
            None => return Ok((Err(format!("record {record}: its verdict was never overruled")), None)),
        },
    };
    if verdict == Verdict::Good && row.scans == 0 {
        return Ok((Err(format!("record {record} has no samples: the bolt did not arrive")), None));
    }
    if verdict == row.standing() {
        return Ok((Ok(format!("record {record}: {verdict} already")), None));
    }
    store.overrule(record, verdict, &reason)?;
    let (was, is) = (row.kept(), verdict == Verdict::Good);
    let recount = (was != is).then_some(Recount { cell: row.cell, more: is });
    Ok((Ok(format!("record {record}: {}, now {verdict}: {reason}", row.standing())), recount))
}

/// The verdict that was valid before a record was last overruled; `None` if `judged` was never
/// overruled.
fn before_last(store: &Store, record: i64, judged: Verdict) -> Result<Option<Verdict>, StoreError> {
    let all = store.overrules()?;
    let mut own = all.iter().rev().filter(|overrule| overrule.record == record);
    if own.next().is_none() {
        return Ok(None);
    }
    Ok(Some(own.next().and_then(|before| Verdict::named(&before.verdict)).unwrap_or(judged)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_counts_for_its_own_question_alone() {
        let (answerer, answers) = answers(Arc::default());
        let (asked, before) = (Question { cell: 4, attempt: 2 }, Question { cell: 4, attempt: 1 });
        assert!(answerer.give(before, Key::Accept));
        assert!(!answerer.give(asked, Key::Accept), "one at a time");
        assert_eq!(answers.answer_to(asked), None, "it was about another attempt");
        assert!(answerer.give(asked, Key::Skip));
        assert_eq!(answers.answer_to(asked), Some(Key::Skip));
        assert!(answerer.give(asked, Key::Redo));
        answers.forget();
        assert_eq!(answers.answer_to(asked), None);
        drop(answers);
        assert!(!answerer.give(asked, Key::Accept));
    }
}

#[cfg(test)]
mod edits_tests {
    use super::*;
    use crate::campaign::plan::SMALL;

    #[test]
    fn edits_wait_for_the_writer_and_no_more_than_a_few() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::create(&folder.path().join("a.jrig"), SMALL, "small.toml").expect("created");
        let (edit_queue, edits) = edits();
        let told = Arc::new(Mutex::new(Vec::new()));
        let hand_in = |edit: Edit| {
            let told = told.clone();
            edit_queue.hand_in(edit, move |what| told.lock().expect("whole").push(what))
        };
        for n in 0..QUEUE {
            assert_eq!(hand_in(Edit::Note(format!("note {n}"))), Ok(()));
        }
        assert_eq!(hand_in(Edit::Note("one too many".into())), Err(NotTaken::Busy));
        assert_eq!(edits.work_off(&store).expect("written"), []);
        assert_eq!(told.lock().expect("whole").len(), QUEUE);
        // an edit that fails is reported, and does not end the run
        for edit in [
            Edit::Undo { record: 1 },
            Edit::Overrule { record: 1, verdict: Verdict::Good, reason: "x".into() },
        ] {
            assert_eq!(hand_in(edit), Ok(()));
        }
        assert_eq!(edits.work_off(&store).expect("written"), []);
        assert!(told.lock().expect("whole")[QUEUE..].iter().all(Result::is_err));
        let lines = store.log_lines(0).expect("read");
        assert_eq!(lines.iter().filter(|(_, _, text)| text.starts_with("note: note")).count(), QUEUE);
        drop(edits);
        assert_eq!(hand_in(Edit::Note("late".into())), Err(NotTaken::Over));
    }
}

//! Answers to the stage's questions that come from other places than the terminal. An answer names
//! the cell and the attempt that it refers to: an answer to another question has no effect.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
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
    pub(super) fn heard(&self, question: Question) -> Option<Key> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_counts_for_its_own_question_alone() {
        let (answerer, answers) = answers(Arc::default());
        let (asked, before) = (Question { cell: 4, attempt: 2 }, Question { cell: 4, attempt: 1 });
        assert!(answerer.give(before, Key::Accept));
        assert!(!answerer.give(asked, Key::Accept), "one at a time");
        assert_eq!(answers.heard(asked), None, "it was about another attempt");
        assert!(answerer.give(asked, Key::Skip));
        assert_eq!(answers.heard(asked), Some(Key::Skip));
        assert!(answerer.give(asked, Key::Redo));
        answers.forget();
        assert_eq!(answers.heard(asked), None);
        drop(answers);
        assert!(!answerer.give(asked, Key::Accept));
    }
}

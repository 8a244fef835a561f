//! Storage of replies that makes requests idempotent.
//!
//! A host repeats a request with the same number until it receives a reply. A request that was
//! already carried out is answered from here without acting again; a number too old to be
//! recognised as a repeat is refused.

use heapless::Deque;
use jointrig_protocol::answer::Numbered;

/// Number of stored replies. A host has one outstanding request at a time; eight cover any
/// reordering of repeats.
pub const REMEMBERED: usize = 8;

/// How to treat a request with a given number.
#[derive(Debug, PartialEq)]
pub enum Seen {
    /// Not carried out yet: do it.
    New,
    /// Already carried out: send this reply again.
    Before(Numbered),
    /// Too old to decide.
    Stale,
}

/// The last replies of one session.
#[derive(Default)]
pub struct Memory {
    answers: Deque<Numbered, REMEMBERED>,
}

impl Memory {
    /// Empty: a new session.
    pub const fn new() -> Self {
        Self { answers: Deque::new() }
    }

    /// Looks up a number.
    pub fn look_up(&self, number: u32) -> Seen {
        if let Some(answer) = self.answers.iter().find(|answer| answer.number == number) {
            return Seen::Before(answer.clone());
        }
        // when full, a number lower than all stored ones may have been carried out and removed
        let forgotten = self.answers.is_full() && self.answers.iter().all(|answer| number < answer.number);
        if forgotten { Seen::Stale } else { Seen::New }
    }

    /// Stores a reply; removes the oldest when full.
    pub fn keep(&mut self, answer: &Numbered) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // there is space: the oldest was removed if necessary
        let _ = self.answers.push_back(answer.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::answer::{Answer, Refusal};

    fn answer(number: u32) -> Numbered {
        Numbered {
            number,
            outcome: if number.is_multiple_of(2) { Ok(Answer::Done) } else { Err(Refusal::Busy) },
        }
    }

    #[test]
    fn a_repeat_is_answered_from_memory_and_an_old_number_is_stale() {
        let mut memory = Memory::new();
        assert_eq!(memory.look_up(1), Seen::New);
        for number in 1..=20 {
            assert_eq!(memory.look_up(number), Seen::New);
            memory.keep(&answer(number));
            assert_eq!(memory.look_up(number), Seen::Before(answer(number)));
        }
        assert_eq!(memory.look_up(13), Seen::Before(answer(13)));
        assert_eq!(memory.look_up(12), Seen::Stale);
        assert_eq!(memory.look_up(1), Seen::Stale);
    }

    #[test]
    fn a_late_request_that_was_never_carried_out_is_new() {
        let mut memory = Memory::new();
        for number in [1, 2, 4, 5] {
            memory.keep(&answer(number));
        }
        assert_eq!(memory.look_up(3), Seen::New);
    }
}

//! The memory of answers that makes requests idempotent.
//!
//! A host repeats a request, with its number, until it hears an answer. A number that was carried
//! out is answered from here and does nothing twice; a number too old to be told from a repeat is
//! refused.

use heapless::Deque;
use jointrig_protocol::answer::Numbered;

/// Answers remembered. A host has one request in the air at a time; eight cover any reordering of
/// repeats.
pub const REMEMBERED: usize = 8;

/// What to do with a request of some number.
#[derive(Debug, PartialEq)]
pub enum Seen {
    /// Never carried out: do it.
    New,
    /// Carried out: say this again.
    Before(Numbered),
    /// Too old to know.
    Stale,
}

/// The last answers of one session.
#[derive(Default)]
pub struct Memory {
    answers: Deque<Numbered, REMEMBERED>,
}

impl Memory {
    /// Empty: a new session.
    pub const fn new() -> Self {
        Self { answers: Deque::new() }
    }

    /// What is known of this number.
    pub fn look_up(&self, number: u32) -> Seen {
        if let Some(answer) = self.answers.iter().find(|answer| answer.number == number) {
            return Seen::Before(answer.clone());
        }
        // with the memory full, a number before all that it holds may have been carried out and
        // forgotten
        let forgotten = self.answers.is_full() && self.answers.iter().all(|answer| number < answer.number);
        if forgotten { Seen::Stale } else { Seen::New }
    }

    /// Remembers an answer; the oldest is forgotten.
    pub fn keep(&mut self, answer: &Numbered) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // there is room: one was just forgotten if there was none
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

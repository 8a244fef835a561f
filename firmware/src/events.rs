//! Queue of events waiting for the link, and the rule for which events are dropped when it is full.
//!
//! The queue has a fixed length, and events may occur faster than the link can send them. When the
//! queue is full, the oldest event of the lowest rank is dropped, so that counters never displace
//! the state of guard or emergency stop. Lost scans do not wait here but in the ring
//! ([`crate::ring::Ring::take_loss`]), and are numbered when they are sent.

use heapless::Vec;
use jointrig_protocol::event::{Event, Numbered};

/// Capacity of the event queue.
pub const EVENTS: usize = 16;

/// Importance of an event; the lowest rank is dropped first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    /// Sent again within a second, or its loss is visible from its own numbers.
    Repeated,
    /// The result of a request, which the status also contains.
    Ordered,
    /// A fault of the board, reported once.
    Fault,
    /// The state of guard or emergency stop.
    Safety,
}

fn rank(event: &Event) -> Rank {
    match event {
        Event::Counters(_) | Event::Edge(_) => Rank::Repeated,
        Event::Armed
        | Event::Disarmed(_)
        | Event::Shot(_)
        | Event::ShakerRuns
        | Event::ShakerStops(_)
        | Event::ShakerRests => Rank::Ordered,
        Event::Fault(_) | Event::Panic(_) | Event::Clock(_) => Rank::Fault,
        Event::Interlock(_) | Event::EmergencyStop(_) | Event::Lost { .. } => Rank::Safety,
    }
}

/// Whether two events are of the same kind.
fn same_kind(one: &Event, other: &Event) -> bool {
    core::mem::discriminant(one) == core::mem::discriminant(other)
}

/// A queued event, and the scan at which it happened.
struct Waiting {
    at_scan: u64,
    event: Event,
}

/// The queue, the oldest event first.
pub struct Events {
    waiting: Vec<Waiting, EVENTS>,
    /// Number of the next event to be sent. A dropped event consumes a number, so that the host
    /// detects a jump.
    next: u32,
}

impl Events {
    /// An empty queue.
    pub const fn new() -> Self {
        Self { waiting: Vec::new(), next: 0 }
    }

    /// Whether the queue is empty.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Queues an event. Returns the number of events dropped for lack of space: 0 or 1, this one or
    /// an older one.
    pub fn push(&mut self, at_scan: u64, event: Event) -> u32 {
        if matches!(event, Event::Counters(_)) {
            // only the newest counters matter; replacing older ones loses nothing
            self.discard(|waiting| same_kind(waiting, &event));
        }
        let mut dropped = 0;
        if self.waiting.is_full() {
            dropped = 1;
            self.next = self.next.wrapping_add(1);
            match self.dispensable(&event) {
                Some(place) => self.drop_at(place),
                None => return dropped,
            }
        }
        // there is space: a full queue has dropped an event above
        drop(self.waiting.push(Waiting { at_scan, event }));
        dropped
    }

    /// Moves the event at `place` to the end of the queue; the newer ones move up. With a `pop`,
    /// this does what `Vec::remove` does, but exchanges events: `Vec::remove` needs `memmove`,
    /// 1.5 kB of flash that nothing else on a board uses.
    #[inline(never)]
    fn move_to_end(&mut self, place: usize) {
        let mut events = self.waiting.iter_mut().skip(place);
        let Some(mut moved) = events.next() else { return };
        for newer in events {
            core::mem::swap(moved, newer);
            moved = newer;
        }
    }

    /// Drops the event at `place`.
    fn drop_at(&mut self, place: usize) {
        self.move_to_end(place);
        drop(self.waiting.pop());
    }

    /// Drops the events that `which` selects; the others keep their order.
    fn discard(&mut self, which: impl Fn(&Event) -> bool) {
        // from the newest on, so that no event moves into a place that was already passed
        for place in (0..self.waiting.len()).rev() {
            if self.waiting.get(place).is_some_and(|waiting| which(&waiting.event)) {
                self.drop_at(place);
            }
        }
    }

    /// Index of the event to drop in favour of `event` in a full queue; `None` when `event` itself
    /// is to be dropped.
    fn dispensable(&self, event: &Event) -> Option<usize> {
        let mut lowest = rank(event);
        let mut dispensable = None;
        for (place, waiting) in self.waiting.iter().enumerate() {
            let rank = rank(&waiting.event);
            // among equal ranks the first one, which is the oldest
            if rank < lowest {
                (lowest, dispensable) = (rank, Some(place));
            }
        }
        if dispensable.is_some() {
            return dispensable;
        }
        if rank(event) < Rank::Safety {
            return None;
        }
        // only states of guard and stop remain: drop the oldest one that is superseded by a newer
        // one of its kind
        let after = |place: usize| self.waiting.iter().skip(place + 1).map(|waiting| &waiting.event);
        self.waiting.iter().enumerate().position(|(place, own)| {
            same_kind(&own.event, event) || after(place).any(|newer| same_kind(&own.event, newer))
        })
    }

    /// Takes the oldest event and numbers it.
    pub fn pop(&mut self) -> Option<Numbered> {
        self.move_to_end(0);
        let Waiting { at_scan, event } = self.waiting.pop()?;
        Some(self.number(at_scan, event))
    }

    /// Numbers an event that is sent without being queued here.
    pub fn number(&mut self, at_scan: u64, event: Event) -> Numbered {
        let number = self.next;
        self.next = self.next.wrapping_add(1);
        Numbered { number, at_scan, event }
    }

    /// Starts a new session: events that concern the previous session are dropped, because the new
    /// host would take them for results of its own requests. Faults and the states of guard and
    /// stop are kept for the new host.
    pub fn begin_session(&mut self) {
        self.discard(|waiting| match rank(waiting) {
            Rank::Repeated | Rank::Ordered => true,
            Rank::Fault | Rank::Safety => matches!(waiting, Event::Clock(_)),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heapless::String;
    use jointrig_protocol::answer::Counters;
    use jointrig_protocol::event::Reason;

    extern crate std;

    fn sent(events: &mut Events) -> std::vec::Vec<(u32, Event)> {
        core::iter::from_fn(|| events.pop()).map(|event| (event.number, event.event)).collect()
    }

    #[test]
    fn only_the_newest_counters_wait() {
        let mut events = Events::new();
        for frames_in in 0..100 {
            let counters = Counters { frames_in, ..Counters::default() };
            assert_eq!(events.push(0, Event::Counters(counters)), 0);
        }
        let newest = Counters { frames_in: 99, ..Counters::default() };
        assert_eq!(sent(&mut events), [(0, Event::Counters(newest))]);
    }

    #[test]
    fn a_full_queue_drops_the_oldest_of_the_lowest_rank_and_the_numbers_show_it() {
        let mut events = Events::new();
        for scan in 0..EVENTS as u64 - 1 {
            assert_eq!(events.push(scan, Event::Fault(String::new())), 0);
        }
        assert_eq!(events.push(20, Event::Armed), 0);
        // the result of a request is displaced, and is itself dropped when nothing in the queue is
        // less important
        assert_eq!(events.push(21, Event::Interlock(false)), 1);
        assert_eq!(events.push(22, Event::Disarmed(Reason::Interlock)), 1);
        assert_eq!(events.push(23, Event::EmergencyStop(true)), 1);
        let sent = sent(&mut events);
        assert_eq!(sent.len(), EVENTS);
        assert_eq!((sent[0].0, sent[EVENTS - 2].1.clone()), (3, Event::Interlock(false)));
        assert_eq!(sent[EVENTS - 1].1, Event::EmergencyStop(true));
    }

    #[test]
    fn the_newest_states_of_guard_and_stop_are_kept_whatever_waits() {
        let mut events = Events::new();
        events.push(0, Event::EmergencyStop(true));
        for change in 0..100 {
            events.push(change, Event::Interlock(change % 2 == 0));
        }
        let sent = sent(&mut events);
        assert_eq!(sent[0].1, Event::EmergencyStop(true));
        assert_eq!(sent[EVENTS - 1].1, Event::Interlock(false));
        let states = sent[1..].iter().map(|(_, event)| event);
        assert!(
            states
                .zip([true, false].iter().cycle().skip(1))
                .all(|(event, closed)| *event == Event::Interlock(*closed))
        );
    }
}

//! What is said, numbered, for whoever listens: the last few messages, and the whole for a listener who missed some.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use tokio::sync::watch;

use super::message::{Can, Message, Snapshot};
use super::now::{Now, Shaker, State as Doing};
use crate::outside::shown_json;

/// Messages that are kept for a listener who is late; who is later still gets the whole.
const KEPT: usize = 4096;

/// A message as it is sent, with its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbered {
    /// Its number; each message has one more than the one before.
    pub seq: u64,
    /// The message as JSON, with the number in it.
    pub text: Arc<str>,
}

#[derive(Debug, Default)]
struct State {
    seq: u64,
    recent: VecDeque<Numbered>,
    whole: Snapshot,
}

/// The one place that everything goes through.
#[derive(Debug)]
pub struct Bus {
    state: Mutex<State>,
    newest: watch::Sender<u64>,
}

impl Default for Bus {
    fn default() -> Self {
        Self { state: Mutex::default(), newest: watch::Sender::new(0) }
    }
}

impl Bus {
    /// Of a server that can do this besides looking.
    pub fn new(can: Can) -> Self {
        let bus = Self::default();
        bus.inner().whole.can = can;
        bus
    }

    fn inner(&self) -> MutexGuard<'_, State> {
        // what a thread that panicked left is a whole number of messages
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says something, and keeps the whole up to date.
    pub fn say(&self, message: Message) {
        let seq = {
            let mut state = self.inner();
            state.seq += 1;
            let numbered = match message {
                // what the file does not know is kept, and told with it
                Message::Snapshot(_) => {
                    state.whole.take_in(message);
                    numbered(state.seq, &Message::Snapshot(Box::new(state.whole.clone())))
                }
                message => {
                    let numbered = numbered(state.seq, &message);
                    state.whole.take_in(message);
                    numbered
                }
            };
            if state.recent.len() == KEPT {
                state.recent.pop_front();
            }
            state.recent.push_back(numbered);
            state.seq
        };
        self.newest.send_replace(seq);
    }

    /// What follows the message `after`: single messages, or the whole where some of them are gone, or `after` is none.
    pub fn since(&self, after: Option<u64>) -> Vec<Numbered> {
        let state = self.inner();
        let first = state.recent.front().map_or(state.seq + 1, |oldest| oldest.seq);
        match after {
            Some(after) if after + 1 >= first && after <= state.seq => {
                state.recent.iter().filter(|message| message.seq > after).cloned().collect()
            }
            _ => vec![numbered(state.seq, &Message::Snapshot(Box::new(state.whole.clone())))],
        }
    }

    /// What is going on, as it was told last.
    pub fn state(&self) -> Option<Doing> {
        self.inner().whole.now.state.clone()
    }

    /// The shaker's level, as it was told last.
    pub fn shaker(&self) -> Option<Shaker> {
        self.inner().whole.now.shaker.clone()
    }

    /// Whether the rig is simulated, as far as the file says.
    pub fn simulated(&self) -> bool {
        self.inner().whole.simulated
    }

    /// Whether anybody listens.
    pub fn is_heard(&self) -> bool {
        self.newest.receiver_count() > 0
    }

    /// Tells when there is something new: the number of the newest message.
    pub fn newest(&self) -> watch::Receiver<u64> {
        self.newest.subscribe()
    }
}

/// A message with its number, as it is written.
#[derive(Serialize)]
struct Written<'a> {
    seq: u64,
    #[serde(flatten)]
    message: &'a Message,
}

fn numbered(seq: u64, message: &Message) -> Numbered {
    let text = serde_json::to_string(&Written { seq, message }).unwrap_or_default();
    // names of devices and of plans among them
    Numbered { seq, text: shown_json(&text).into() }
}

impl Snapshot {
    /// As it is after a message.
    fn take_in(&mut self, message: Message) {
        match message {
            Message::Snapshot(whole) => {
                let estimate = whole.estimate.clone().or(self.estimate.take());
                let (now, can) = (std::mem::take(&mut self.now), self.can);
                *self = Snapshot { estimate, now, can, ..*whole };
            }
            Message::Judged(judged) => {
                self.hits.push(judged.hit);
                self.count([judged.cell]);
                self.progress = judged.progress;
            }
            Message::Cells(counted) => {
                self.count(counted.cells);
                for hit in counted.hits {
                    if let Some(own) = self.hits.iter_mut().find(|own| own.record == hit.record) {
                        *own = hit;
                    }
                }
                self.progress = counted.progress;
            }
            Message::Estimate(estimate) => self.estimate = Some(*estimate),
            other => self.now.take_in(other),
        }
    }

    fn count(&mut self, cells: impl IntoIterator<Item = super::message::CellCount>) {
        for cell in cells {
            if let Some(own) = self.cells.iter_mut().find(|own| own.id == cell.id) {
                *own = cell;
            }
        }
    }
}

impl Now {
    /// As it is after a message.
    fn take_in(&mut self, message: Message) {
        match message {
            Message::State(state) => self.state = Some(state),
            Message::Link(link) => self.link = Some(link),
            Message::Stream(stream) => self.stream = Some(stream),
            Message::Signals(signals) => self.signals = Some(signals),
            Message::Shaker(shaker) => match &mut self.shaker {
                Some(own) => own.take_in(*shaker),
                none => *none = Some(*shaker),
            },
            Message::Disk(disk) => self.disk = Some(disk),
            Message::Control(control) => self.control = Some(control),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::message::{Counted, Progress, Trouble};

    fn progress(kept: u64) -> Message {
        Message::Cells(Counted {
            cells: Vec::new(),
            hits: Vec::new(),
            progress: Progress { kept, ..Progress::default() },
        })
    }

    #[test]
    fn who_missed_nothing_gets_what_is_new_and_others_the_whole() {
        let bus = Bus::default();
        (1..=3).for_each(|kept| bus.say(progress(kept)));
        let seqs = |after| bus.since(after).iter().map(|m| m.seq).collect::<Vec<_>>();
        assert_eq!(seqs(Some(1)), [2, 3]);
        assert_eq!(seqs(Some(3)), [0; 0]);
        // a page that has just come, and one of an earlier server
        for after in [None, Some(99)] {
            let whole = bus.since(after);
            assert!(whole.len() == 1 && whole[0].text.contains("\"kind\":\"snapshot\""));
            assert!(whole[0].text.contains("\"kept\":3") && whole[0].seq == 3);
        }
    }

    #[test]
    fn a_listener_too_late_gets_the_whole() {
        let bus = Bus::default();
        (0..KEPT as u64 + 10).for_each(|kept| bus.say(progress(kept)));
        assert_eq!(bus.since(Some(5)).len(), 1);
        assert_eq!(bus.since(Some(10)).len(), KEPT);
    }

    #[test]
    fn a_new_whole_from_the_file_leaves_what_only_measuring_knows() {
        let bus = Bus::new(Can { edit: true, ..Can::default() });
        let link = crate::live::now::Link { lost_scans: 7, ..Default::default() };
        bus.say(Message::Link(link));
        bus.say(Message::Snapshot(Box::new(Snapshot { file: "new".into(), ..Snapshot::default() })));
        // told to whoever was there, and to whoever comes later
        for after in [Some(1), None] {
            let text = bus.since(after)[0].text.to_string();
            for part in ["\"file\":\"new\"", "\"lost_scans\":7", "\"edit\":true"] {
                assert!(text.contains(part), "{text}");
            }
        }
    }

    #[test]
    fn news_wake_whoever_waits() {
        let bus = Bus::default();
        let newest = bus.newest();
        bus.say(Message::Trouble(Trouble { what: "gone".into() }));
        assert!(newest.has_changed().expect("the bus is there"));
    }
}

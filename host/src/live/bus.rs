//! Numbered messages for all listeners: the newest messages, and the complete state for a listener
//! that missed some.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use tokio::sync::watch;

use super::message::{Can, Message, Snapshot};
use super::now::{Now, Shaker, State as Doing};
use crate::untrusted_text::shown_json;

/// Messages that are kept for late listeners; a listener that is further behind gets the complete
/// state.
const KEPT: usize = 4096;

/// A message as it is sent, with its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbered {
    /// Its number; consecutive.
    pub seq: u64,
    /// The message as JSON, including the number.
    pub text: Arc<str>,
}

#[derive(Debug, Default)]
struct BusState {
    seq: u64,
    recent: VecDeque<Numbered>,
    whole: Snapshot,
}

/// Distributes all messages.
#[derive(Debug)]
pub struct Bus {
    state: Mutex<BusState>,
    newest: watch::Sender<u64>,
}

impl Default for Bus {
    fn default() -> Self {
        Self { state: Mutex::default(), newest: watch::Sender::new(0) }
    }
}

impl Bus {
    /// A bus for a server that supports `can`.
    pub fn new(can: Can) -> Self {
        let bus = Self::default();
        bus.inner().whole.can = can;
        bus
    }

    fn inner(&self) -> MutexGuard<'_, BusState> {
        // valid even after a poisoned lock: it holds complete messages only
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a message and updates the complete state.
    pub fn say(&self, message: Message) {
        let seq = {
            let mut state = self.inner();
            state.seq += 1;
            let numbered = match message {
                // a snapshot of the file lacks the state of the measurement, so that state is kept
                // and sent with it
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

    /// The messages after number `after`; the complete state instead if some of them were dropped
    /// or `after` is `None`.
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

    /// What the measuring process was last reported to be doing.
    pub fn state(&self) -> Option<Doing> {
        self.inner().whole.now.state.clone()
    }

    /// The shaker's level as last reported.
    pub fn shaker(&self) -> Option<Shaker> {
        self.inner().whole.now.shaker.clone()
    }

    /// Whether the rig is simulated, according to the file.
    pub fn simulated(&self) -> bool {
        self.inner().whole.simulated
    }

    /// Whether there is any listener.
    pub fn is_heard(&self) -> bool {
        self.newest.receiver_count() > 0
    }

    /// A receiver of the newest message's number, which also signals new messages.
    pub fn newest(&self) -> watch::Receiver<u64> {
        self.newest.subscribe()
    }
}

/// A message with its number, for serialisation.
#[derive(Serialize)]
struct NumberedMessage<'a> {
    seq: u64,
    #[serde(flatten)]
    message: &'a Message,
}

fn numbered(seq: u64, message: &Message) -> Numbered {
    let text = serde_json::to_string(&NumberedMessage { seq, message }).unwrap_or_default();
    // escaped, because it includes names from devices and plans
    Numbered { seq, text: shown_json(&text).into() }
}

impl Snapshot {
    /// Updates the state with a message.
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
    /// Updates the state with a message.
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
        // a page that has just connected, and one that was connected to an earlier server
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
        // for current listeners and for those that connect later
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

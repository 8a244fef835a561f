//! Reports of a board: faults of its parts, and how its last run ended.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::event::Event;

use crate::Core;
use crate::fmt::warning;
use crate::sentence::{Sentence, Tell};

impl<M: RawMutex> Core<'_, M> {
    /// Reports a fault of a part of the board. Without a host, the event waits for one.
    pub fn report_fault(&self, what: &(impl Tell + ?Sized)) {
        let text = Sentence::of(what);
        warning!("fault: {}", text.as_str());
        self.with(|state| state.say(Event::Fault(text.into_string())));
        self.to_send.signal(());
    }

    /// Reports that the previous run ended in a panic with this message.
    pub fn report_panic(&self, what: &(impl Tell + ?Sized)) {
        let text = Sentence::of(what);
        warning!("the last run ended in a panic: {}", text.as_str());
        self.with(|state| state.say(Event::Panic(text.into_string())));
        self.to_send.signal(());
    }
}

//! What a board has to report: faults of its parts, and how its last run ended.

use core::fmt::{self, Write};

use embassy_sync::blocking_mutex::raw::RawMutex;
use heapless::String;
use jointrig_protocol::event::Event;
use jointrig_protocol::limits::SENTENCE_BYTES;

use crate::Core;
use crate::fmt::warning;

/// Keeps what fits.
struct Cut<'a>(&'a mut String<SENTENCE_BYTES>);

impl Write for Cut<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for c in text.chars() {
            self.0.push(c).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

/// The sentence, cut to what an event carries.
fn sentence(what: impl fmt::Display) -> String<SENTENCE_BYTES> {
    let mut text = String::new();
    // the error says that the sentence was cut, which is what it is for
    let _ = write!(Cut(&mut text), "{what}");
    text
}

impl<M: RawMutex> Core<'_, M> {
    /// A part of the board reports a fault. The event waits for a host if there is none.
    pub fn report_fault(&self, what: impl fmt::Display) {
        let text = sentence(what);
        warning!("fault: {}", text.as_str());
        self.with(|state| state.say(Event::Fault(text)));
        self.to_send.signal(());
    }

    /// The run before this one ended in a panic, which said this.
    pub fn report_panic(&self, what: impl fmt::Display) {
        let text = sentence(what);
        warning!("the last run ended in a panic: {}", text.as_str());
        self.with(|state| state.say(Event::Panic(text)));
        self.to_send.signal(());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_is_cut_at_a_whole_character() {
        assert_eq!(sentence("BUSY still high").as_str(), "BUSY still high");
        let accents: String<200> = core::iter::repeat_n('é', 100).collect();
        let long = sentence(format_args!("a{accents}"));
        assert_eq!(long.len(), SENTENCE_BYTES - 1);
        assert!(long.ends_with('é'));
    }
}

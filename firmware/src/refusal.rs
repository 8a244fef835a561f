//! Refusals with a message.

use heapless::String;
use jointrig_protocol::answer::Refusal;

/// A refusal because the request is out of bounds or refers to something that does not exist.
pub(crate) fn out_of_bounds(sentence: &str) -> Refusal {
    let mut text = String::new();
    // text beyond 120 bytes is dropped
    let _ = text.push_str(sentence);
    Refusal::OutOfBounds(text)
}

//! Refusals with a sentence.

use heapless::String;
use jointrig_protocol::answer::Refusal;

/// What was asked for is outside what is allowed, or not there.
pub(crate) fn out_of_bounds(sentence: &str) -> Refusal {
    let mut text = String::new();
    // what does not fit 120 bytes is left out
    let _ = text.push_str(sentence);
    Refusal::OutOfBounds(text)
}

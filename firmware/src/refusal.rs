//! Refusals that say what was wrong with an order.

use heapless::String;
use jointrig_protocol::answer::Refusal;

/// A refusal with a sentence.
pub(crate) fn out_of_bounds(sentence: &str) -> Refusal {
    let mut text = String::new();
    // what does not fit 120 bytes is left out
    let _ = text.push_str(sentence);
    Refusal::OutOfBounds(text)
}

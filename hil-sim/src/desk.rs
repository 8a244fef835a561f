//! Words for whoever stands at the virtual rig: its normal load and its safety chain, line by line.
//!
//! ```text
//! load 150         normal load, N: the contact carries at most μN from the next block on (a linear contact has no limit)
//! guard open       the guard over the hammer; guard shut
//! emergency press  the emergency stop; emergency release, and then reset turns its key
//! ```
//!
//! The link to the host knows nothing of them: in a laboratory, too, they are not the computer's.

use std::io::{BufRead, Write};

use crate::board::Controls;

/// What may be said.
const WORDS: &str = "load NEWTONS, guard open|shut, emergency press|release, reset";

/// The longest line that is looked at, bytes.
const LONGEST: u64 = 256;

/// Does what a line says; what has been done, or why it was not.
///
/// # Errors
/// A line that is none of the words, or a load that is negative or no number.
pub fn obey(controls: &Controls, line: &str) -> Result<String, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["load", newtons] => {
            let load: f64 =
                newtons.parse().map_err(|_| format!("`{newtons}` is no number of newtons: load 150"))?;
            controls.set_normal_load(load).map_err(|error| error.to_string())?;
            return Ok(format!("normal load {load} N"));
        }
        ["guard", "open"] => controls.open_guard(true),
        ["guard", "shut"] => controls.open_guard(false),
        ["emergency", "press"] => controls.press_emergency_stop(true),
        ["emergency", "release"] => controls.press_emergency_stop(false),
        ["reset"] => controls.reset(),
        _ => return Err(format!("`{}` is not known here: {WORDS}", line.trim())),
    }
    Ok(words.join(" "))
}

/// Obeys every line of `input` until it ends, and answers each on `output`; empty ones are passed over.
///
/// # Errors
/// What reading or writing failed with.
pub fn listen(controls: &Controls, mut input: impl BufRead, mut output: impl Write) -> std::io::Result<()> {
    let mut line = String::new();
    loop {
        line.clear();
        // what is longer comes as several lines, none of which is a word
        if std::io::Read::take(&mut input, LONGEST).read_line(&mut line)? == 0 {
            return Ok(());
        }
        if line.trim().is_empty() {
            continue;
        }
        match obey(controls, &line) {
            Ok(done) => writeln!(output, "{done}")?,
            Err(why) => writeln!(output, "not done: {why}")?,
        }
    }
}

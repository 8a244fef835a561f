//! Commands for the operator of the virtual rig, one per line: normal load and safety chain.
//!
//! ```text
//! load 150         normal load, N: the contact carries at most μN from the next block on
//!                  (a linear contact has no limit)
//! guard open       the guard over the hammer; guard shut
//! emergency press  the emergency stop; emergency release, and then reset turns its key
//! ```
//!
//! They are not available over the link to the host: in a laboratory, too, the computer does not
//! control them.

use std::io::{BufRead, Write};

use crate::board::Controls;

/// The valid commands.
const WORDS: &str = "load NEWTONS, guard open|shut, emergency press|release, reset";

/// Maximum length of a line, bytes.
const LONGEST: u64 = 256;

/// Executes one command; returns what has been done, or why it was not.
///
/// # Errors
/// An unknown command, or a load that is negative or not a number.
pub fn obey(controls: &Controls, line: &str) -> Result<String, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["load", newtons] => {
            let load: f64 = newtons
                .parse()
                .map_err(|_| format!("`{newtons}` is not a number of newtons: write e.g. load 150"))?;
            controls.set_normal_load(load).map_err(|error| error.to_string())?;
            return Ok(format!("normal load {load} N"));
        }
        ["guard", "open"] => controls.open_guard(true),
        ["guard", "shut"] => controls.open_guard(false),
        ["emergency", "press"] => controls.press_emergency_stop(true),
        ["emergency", "release"] => controls.press_emergency_stop(false),
        ["reset"] => controls.reset(),
        _ => return Err(format!("`{}` is not a command: write {WORDS}", line.trim())),
    }
    Ok(words.join(" "))
}

/// Executes every line of `input` until it ends, and writes one response to `output` for each;
/// empty lines are skipped.
///
/// # Errors
/// The I/O error of reading or writing.
pub fn listen(controls: &Controls, mut input: impl BufRead, mut output: impl Write) -> std::io::Result<()> {
    let mut line = String::new();
    loop {
        line.clear();
        // a longer line is split, and none of its parts is a command
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

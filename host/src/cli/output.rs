//! What a command shows in the terminal, and how it is interrupted.
//!
//! - Results are printed on stdout as one JSON document, or as lines of text; a closed pipe is no
//!   error. Numbers are formatted for the command line.
//! - The progress of a long task is a bar on a terminal, otherwise a line every ten seconds, so
//!   that a log shows that work continues.
//! - The first Ctrl-C ends the work after the current shot (or file), the second one ends the
//!   program.

use super::error::CliError;
use crate::campaign::run::progress::Pace;
use crate::untrusted_text::{printed_json, tell_line, visible};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Prints one JSON document.
pub fn json<T: Serialize>(value: &T) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| CliError::Bad(format!("the answer could not be written as JSON: {error}")))?;
    print([printed_json(&text)])
}

/// Prints lines, with the names in them made printable.
pub fn lines(lines: impl IntoIterator<Item = String>) -> Result<(), CliError> {
    print(lines.into_iter().map(|line| visible(&line).into_owned()))
}

fn print(lines: impl IntoIterator<Item = impl Display>) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    for line in lines {
        match writeln!(out, "{line}") {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
            Err(source) => {
                return Err(CliError::File { path: PathBuf::from("stdout"), doing: "printing", source });
            }
            Ok(()) => {}
        }
    }
    Ok(())
}

/// A finite number over 0.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("write a number over 0".into()),
    }
}

/// A finite number of 0 or more.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("write a number that is not negative".into()),
    }
}

/// Progress of a task.
pub struct Waiting {
    what: &'static str,
    bar: ProgressBar,
    /// `None` on a terminal.
    pace: Option<Pace>,
}

impl Waiting {
    /// Starts the display for `what`, such as "analysing".
    pub fn of(what: &'static str) -> Self {
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr());
            Self { what, bar, pace: None }
        } else {
            Self { what, bar: ProgressBar::hidden(), pace: Some(Pace::default()) }
        }
    }

    /// Reports that `done` of `total` parts are done.
    pub fn at(&self, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        if self.pace.as_ref().is_some_and(Pace::is_due) {
            tell_line!("{}: {done} of {total}", self.what);
        }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Returns a flag that Ctrl-C (or a termination signal) sets.
pub fn flag() -> Arc<AtomicBool> {
    let stop = Arc::default();
    catch(&stop, "shot");
    stop
}

/// Makes Ctrl-C (or a termination signal) set this flag; the message says that the current `part`
/// of the work is still finished.
pub fn catch(stop: &Arc<AtomicBool>, part: &'static str) {
    let raised = stop.clone();
    let set = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            // everything accepted is already in the file
            std::process::exit(1);
        }
        tell_line!("\nstopping after the current {part}; press Ctrl-C again to end immediately");
    });
    if let Err(error) = set {
        log::warn!("Ctrl-C cannot be caught ({error}): it will end the program immediately");
    }
    #[cfg(windows)]
    if let Err(error) = catch_closing(stop) {
        log::warn!("closing the window cannot be caught ({error}): it will end the program immediately");
    }
}

/// Makes closing the console, logging off and shutting down set this flag. Windows ends the program
/// as soon as its handler returns, but waits five seconds for it. ctrlc's returns at once; tokio's
/// never does, and the one that was set last is asked first. Until then the program ends by itself
/// as after Ctrl-C: hammer and shaker come to rest when the session ends. A longer shot is cut
/// short, and the controller stops both because its host is gone.
#[cfg(windows)]
fn catch_closing(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    use tokio::signal::windows::{ctrl_close, ctrl_logoff, ctrl_shutdown};

    let (mut close, mut logoff, mut shutdown) = (ctrl_close()?, ctrl_logoff()?, ctrl_shutdown()?);
    let runtime = tokio::runtime::Builder::new_current_thread().build()?;
    let raised = Arc::clone(stop);
    std::thread::Builder::new().name("console".into()).spawn(move || {
        runtime.block_on(async {
            tokio::select! {
                _ = close.recv() => {}
                _ = logoff.recv() => {}
                _ = shutdown.recv() => {}
            }
        });
        raised.store(true, Ordering::Relaxed);
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_what_is_no_number_are_refused() {
        assert_eq!((positive("1e-7"), not_negative("0")), (Ok(1e-7), Ok(0.0)));
        for wrong in ["0", "-1", "nan", "inf", "x", ""] {
            assert!(positive(wrong).is_err(), "{wrong}");
            assert!(not_negative(wrong).is_err() || wrong == "0", "{wrong}");
        }
    }
}

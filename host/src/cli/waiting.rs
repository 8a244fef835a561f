//! Progress of a long task: a bar on a terminal, otherwise a line every ten seconds, so that a log
//! shows that work continues.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget};

use crate::campaign::run::progress::Pace;
use crate::outside::tell_line;

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

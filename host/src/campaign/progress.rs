//! What the person at the rig sees while a campaign runs; always on stderr.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::judge::Judgement;
use super::plan::{Cell, configuration_name};

/// A bar over the hits of the campaign, with the time that is left.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar over `wanted` hits, of which `kept` are there already; invisible unless `shown`.
    pub fn new(wanted: u64, kept: u64, shown: bool) -> Self {
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(wanted), target).with_position(kept);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} hits, {eta} left  {wide_msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        // hits of earlier runs took no time of this one
        bar.reset_eta();
        Self { bar }
    }

    /// Hammer and laser moved here.
    pub fn cell(&self, cell: &Cell) {
        self.bar.set_message(label(cell));
    }

    /// A record was judged; `kept` good ones are there in all.
    pub fn judged(&self, cell: &Cell, judgement: &Judgement, kept: u64) {
        self.bar.set_position(kept);
        self.bar.set_message(format!("{}  {}: {}", label(cell), judgement.kind, judgement.sentence));
    }

    /// Something worth a line of its own.
    pub fn say(&self, text: &str) {
        if self.bar.is_hidden() {
            log::warn!("{text}");
        } else {
            self.bar.println(text);
        }
    }

    /// Runs `work` with the bar out of the way (prompts).
    pub fn aside<T>(&self, work: impl FnOnce() -> T) -> T {
        self.bar.suspend(work)
    }

    /// The end.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn label(cell: &Cell) -> String {
    format!("{} {}\u{2192}{}", configuration_name(cell.configuration), cell.impact, cell.response)
}

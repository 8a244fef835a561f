//! What the person at the rig sees while a campaign runs; always on stderr.

use std::cell::Cell;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::campaign::plan::{Cell as PlanCell, configuration_name};
use crate::campaign::verdict::Verdict;

/// Good hits that are still wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Left {
    /// In the cell.
    pub cell: u64,
    /// In its configuration.
    pub configuration: u64,
    /// In the campaign.
    pub campaign: u64,
}

/// A bar over the hits of the campaign, with the time that is left of cell, configuration and campaign.
pub struct Progress {
    bar: ProgressBar,
    /// Good hits that were there at the beginning.
    before: u64,
    begun: Instant,
    /// Time that a person took to move things, s.
    aside: Cell<Duration>,
}

impl Progress {
    /// A bar over `wanted` hits, of which `kept` are there already; invisible unless `shown`.
    pub fn new(wanted: u64, kept: u64, shown: bool) -> Self {
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(wanted), target).with_position(kept);
        if let Ok(style) = ProgressStyle::with_template("{bar:24} {pos}/{len} hits  {wide_msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        Self { bar, before: kept, begun: Instant::now(), aside: Cell::default() }
    }

    /// Hammer and laser moved here.
    pub fn cell(&self, cell: &PlanCell, left: Left) {
        self.bar.set_message(format!("{}  {}", label(cell), self.time_left(cell, left)));
    }

    /// A record was judged; `kept` good ones are there in all.
    pub fn judged(&self, cell: &PlanCell, verdict: &Verdict, kept: u64, left: Left) {
        self.bar.set_position(kept);
        let (time, label) = (self.time_left(cell, left), label(cell));
        self.bar.set_message(format!("{label}  {time}  {}: {}", verdict.kind, verdict.sentence));
    }

    /// `left: cell 9 s, AJB 4 min, all 1 h 10 min`, from the time that a good hit took so far.
    fn time_left(&self, cell: &PlanCell, left: Left) -> String {
        let good = self.bar.position().saturating_sub(self.before);
        if good == 0 {
            return String::new();
        }
        let each = self.begun.elapsed().saturating_sub(self.aside.get()).as_secs_f64() / good as f64;
        let time = |hits: u64| duration(each * hits as f64);
        let name = configuration_name(cell.configuration);
        format!(
            "left: cell {}, {name} {}, all {}",
            time(left.cell),
            time(left.configuration),
            time(left.campaign)
        )
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
        let begun = Instant::now();
        let done = self.bar.suspend(work);
        self.aside.set(self.aside.get() + begun.elapsed());
        done
    }

    /// The end.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// A time as people say it.
fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..=99 => format!("{whole} s"),
        100..=5_999 => format!("{} min", (whole + 30) / 60),
        _ => format!("{} h {} min", whole / 3_600, whole % 3_600 / 60),
    }
}

fn label(cell: &PlanCell) -> String {
    format!("{} {}\u{2192}{}", configuration_name(cell.configuration), cell.impact, cell.response)
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn times_are_said_as_people_say_them() {
        assert_eq!(duration(0.4), "0 s");
        assert_eq!(duration(99.0), "99 s");
        assert_eq!(duration(150.0), "3 min");
        assert_eq!(duration(7_500.0), "2 h 5 min");
    }
}

//! Progress display for the person at the rig; always on stderr.
//!
//! Progress of a campaign, as shown by `campaign status --json`.

use super::tally::{Count, Tally};
use crate::campaign::plan::{Cell as PlanCell, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::session_table::ClockRow;
use crate::campaign::watch::{Left, Seen, Watch};
use crate::untrusted_text::{tell_line, visible};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Map, Value, json};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A bar over the hits of the campaign, with the remaining time of cell, configuration and
/// campaign; without a terminal, a line of text every ten seconds.
#[derive(Default)]
pub struct CampaignProgress {
    state: Mutex<Option<State>>,
}

/// Determines when the next line is due if there is no terminal.
pub struct Pace {
    last: Mutex<Instant>,
}

/// Interval between lines without a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Default for Pace {
    fn default() -> Self {
        Self { last: Mutex::new(Instant::now()) }
    }
}

impl Pace {
    /// Whether ten seconds have passed since the start, or since this last returned true.
    pub fn is_due(&self) -> bool {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let due = last.elapsed() >= LINE_EVERY;
        if due {
            *last = Instant::now();
        }
        due
    }
}

/// State of the display, once the campaign has started.
struct State {
    bar: ProgressBar,
    pace: Pace,
    wanted: u64,
    /// Good hits that existed at the start.
    before: u64,
    begun: Instant,
    /// Total time that a person spent moving things, and the start of the current move.
    aside: Duration,
    aside_since: Option<Instant>,
}

impl Watch for CampaignProgress {
    fn saw(&self, seen: &Seen<'_>) {
        let mut state = self.state();
        if let Seen::Begun { wanted, kept } = *seen {
            *state = Some(State::new(wanted, kept));
            return;
        }
        let Some(state) = state.as_mut() else {
            if let Seen::Remark(text) = seen {
                log::warn!("{text}");
            }
            return;
        };
        match *seen {
            Seen::Moving { row, by_hand, left, .. } => {
                let message = format!("{}  {}", label(&row.cell), state.time_left(&row.cell, left));
                state.bar.set_message(visible(&message).into_owned());
                if by_hand {
                    state.step_aside();
                }
            }
            Seen::Moved => state.come_back(),
            Seen::Settling { row, standing, by_hand: true, .. } => {
                let (kept, wanted) = (standing.kept, row.cell.wanted);
                state.bar.set_message(format!("{}  strike now: {kept} of {wanted} good", label(&row.cell)));
            }
            Seen::Judged { row, verdict, kept, left } => {
                state.bar.set_position(kept);
                let (time, label) = (state.time_left(&row.cell, left), label(&row.cell));
                if state.bar.is_hidden() && state.pace.is_due() {
                    tell_line!("{kept} of {} hits  {label}  {time}", state.wanted);
                }
                let message = format!("{label}  {time}  {}: {}", verdict.kind, verdict.sentence);
                state.bar.set_message(visible(&message).into_owned());
            }
            Seen::Remark(text) if state.bar.is_hidden() => log::warn!("{text}"),
            Seen::Remark(text) => state.bar.println(visible(text)),
            Seen::Ended => state.bar.finish_and_clear(),
            _ => {}
        }
    }
}

impl CampaignProgress {
    fn state(&self) -> MutexGuard<'_, Option<State>> {
        // a bar that a panic left half drawn is redrawn
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn new(wanted: u64, kept: u64) -> Self {
        Self {
            bar: bar(wanted, kept),
            pace: Pace::default(),
            wanted,
            before: kept,
            begun: Instant::now(),
            aside: Duration::ZERO,
            aside_since: None,
        }
    }

    /// Hides the bar while a prompt is shown.
    fn step_aside(&mut self) {
        self.aside_since = Some(Instant::now());
        self.bar.finish_and_clear();
    }

    fn come_back(&mut self) {
        if let Some(since) = self.aside_since.take() {
            self.aside += since.elapsed();
            let message = self.bar.message();
            self.bar = bar(self.wanted, self.bar.position()).with_message(message);
        }
    }

    /// `left: cell 9 s, AJB 4 min, all 1 h 10 min`, estimated from the mean time per good hit so
    /// far.
    fn time_left(&self, cell: &PlanCell, left: Left) -> String {
        let good = self.bar.position().saturating_sub(self.before);
        if good == 0 {
            return String::new();
        }
        let each = self.begun.elapsed().saturating_sub(self.aside).as_secs_f64() / good as f64;
        let time = |hits: u64| duration(each * hits as f64);
        let name = configuration_name(cell.configuration);
        format!(
            "left: cell {}, {name} {}, all {}",
            time(left.cell),
            time(left.configuration),
            time(left.campaign)
        )
    }
}

/// A bar over `wanted` hits, of which `kept` are done.
fn bar(wanted: u64, kept: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(wanted), ProgressDrawTarget::stderr()).with_position(kept);
    if let Ok(style) = ProgressStyle::with_template("{bar:24} {pos}/{len} hits  {wide_msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// A duration in a convenient unit.
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

/// For each cell the hits wanted, kept and refused, and why; and the imported FRFs.
///
/// # Errors
/// The file cannot be read.
pub fn document(store: &Store) -> Result<Value, StoreError> {
    let (cells, records) = (store.cells()?, store.records()?);
    let tally = Tally::new(&cells, store.rows()?, &records);
    let frf = |row: &crate::campaign::store::frf_table::FrfRow| json!({ "configuration": row.configuration, "file": row.source, "imported": row.utc });
    let frfs: Vec<Value> = store.frf_rows()?.iter().map(frf).collect();
    let clock = |row: &ClockRow| json!({ "session": row.session, "source": row.source, "rate_hz": row.rate_hz, "ppm": row.ppm });
    let clocks: Vec<Value> = store.clocks()?.iter().map(clock).collect();
    let all: Vec<Value> = cells.iter().map(|row| of_cell(row, &tally.cell(row.id))).collect();
    Ok(json!({
        "wanted": tally.wanted(),
        "kept": tally.kept(),
        "complete": tally.complete(),
        "records": records.len(),
        "imported_frf": frfs,
        "clocks": clocks,
        "edges": store.edges()?.len(),
        "cells": all,
    }))
}

/// Number of good hits that count, and of those wanted.
///
/// # Errors
/// The file cannot be read.
pub fn counts(store: &Store) -> Result<(u64, u64), StoreError> {
    let tally = Tally::new(&store.cells()?, store.rows()?, &store.records()?);
    Ok((tally.kept(), tally.wanted()))
}

/// Number of refused hits of a cell, by verdict.
pub fn refusals(count: &Count) -> impl Iterator<Item = (&'static str, u32)> + '_ {
    count.refused.iter().map(|(kind, number)| (kind.name(), *number))
}

fn of_cell(row: &CellRow, count: &Count) -> Value {
    let refused: Map<String, Value> =
        refusals(count).map(|(kind, number)| (kind.into(), number.into())).collect();
    json!({
        "configuration": configuration_name(row.cell.configuration),
        "impact": row.cell.impact,
        "response": row.cell.response,
        "wanted": count.wanted,
        "kept": count.kept,
        "refused": refused,
        "given_up": row.given_up,
        "settled": row.settled,
        "damaged": count.damaged,
    })
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

//! The raw records of one cell, overlaid: force, and the response along each axis, against time
//! after the trigger.

use jointrig_protocol::channel::{Quantity, Role as Measures};

use super::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Source};
use super::svg;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::RecordRow;

/// Time range of the close view, ms after the trigger: pulse, rebound, and the first response of
/// the structure.
const CLOSE_MS: [f64; 2] = [-1.0, 8.0];

/// A record for plotting.
#[derive(Debug, Clone)]
pub struct Shown {
    /// Its number.
    pub record: i64,
    /// Whether analysis uses it.
    pub kept: bool,
    /// Its verdict.
    pub verdict: &'static str,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Index of the trigger sample.
    pub trigger: usize,
    /// Force, N.
    pub force_n: Vec<f64>,
    /// Quantity of the response.
    pub quantity: Quantity,
    /// The response's channels, SI.
    pub response: Vec<Vec<f64>>,
}

impl Shown {
    /// Converts a stored record; `None` if it holds no samples, or if its session lacks the
    /// hammer's force or the response.
    ///
    /// # Errors
    /// The record is damaged, or the file cannot be read.
    pub fn of(store: &Store, cell: i64, record: &RecordRow) -> Result<Option<Self>, StoreError> {
        if record.scans == 0 {
            return Ok(None);
        }
        let channels = store.channels(record.session)?;
        let responses = store.response_places(cell, record, &channels)?;
        let (Some(force), Some(responses)) = (channels.place(Measures::HammerForce), responses) else {
            return Ok(None);
        };
        let samples = store.samples(record)?;
        let si = |place: usize| channels.to_si(place, samples.channel(place));
        Ok(Some(Self {
            record: record.id,
            kept: record.kept(),
            verdict: record.standing().name(),
            rate_hz: channels.fs_hz(),
            trigger: record.trigger_index,
            force_n: si(force),
            quantity: channels.channels[responses[0]].quantity,
            response: responses.into_iter().map(si).collect(),
        }))
    }

    /// (name, unit, conversion factor, samples) of each row of the figure.
    fn rows(&self) -> Vec<(&'static str, &'static str, f64, &[f64])> {
        let (unit, factor) = match self.quantity {
            Quantity::Velocity => ("mm/s", 1e3),
            Quantity::Displacement => ("µm", 1e6),
            Quantity::Acceleration => ("m/s²", 1.0),
            Quantity::Force => ("N", 1.0),
            Quantity::Voltage => ("V", 1.0),
        };
        let force = ("force", "N", 1.0, self.force_n.as_slice());
        let axes = ["x", "y", "z"].into_iter().zip(&self.response);
        let responses = axes.map(|(axis, signal)| (axis, unit, factor, signal.as_slice()));
        std::iter::once(force).chain(responses).collect()
    }

    fn milliseconds(&self, sample: usize) -> f64 {
        1e3 * (sample as f64 - self.trigger as f64) / self.rate_hz
    }
}

/// The figure as a separate SVG document: the pulse on the left, the whole record on the right;
/// `None` without records.
pub fn records(title: &str, shown: &[Shown]) -> Option<String> {
    let whole = [
        shown.iter().map(|record| record.milliseconds(0)).fold(f64::INFINITY, f64::min),
        shown.iter().map(|record| record.milliseconds(record.force_n.len())).fold(0.0, f64::max),
    ];
    Some(svg::file(&of_views(title, shown, &[CLOSE_MS, whole])?))
}

/// The pulse and the first response of the structure; `None` without records.
pub fn close(title: &str, shown: &[Shown]) -> Option<Figure> {
    of_views(title, shown, &[CLOSE_MS])
}

/// A column for each view (ms after the trigger), a row for each signal.
fn of_views(title: &str, shown: &[Shown], views: &[[f64; 2]]) -> Option<Figure> {
    let first = shown.first()?;
    let mut figure =
        Figure::new("records", "", title, "Force and response along each axis, every hit over the others.")
            .across(views.len());
    figure.from =
        Source { file: listed(shown), version: env!("CARGO_PKG_VERSION").into(), ..Source::default() };
    for row in 0..first.rows().len() {
        let (quantity, unit, factor, _) = first.rows()[row];
        for range_ms in views.iter().copied() {
            let y = Axis::linear(quantity, unit, span(shown, row, range_ms, factor));
            let mut panel =
                Panel::new(Axis::linear("time after the trigger", "ms", range_ms), y).high(Height::Low);
            // kept records are drawn last, on top, because they are the ones used
            for record in shown.iter().filter(|r| !r.kept).chain(shown.iter().filter(|r| r.kept)) {
                let (role, name) =
                    if record.kept { (Role::Group1, "kept") } else { (Role::Refused, "refused") };
                let step = 1e3 / record.rate_hz;
                let from = ((range_ms[0] - record.milliseconds(0)) / step).floor().max(0.0) as usize;
                let Some((.., samples)) = record.rows().get(row).copied() else { continue };
                let to = (((range_ms[1] - record.milliseconds(0)) / step).ceil().max(0.0) as usize + 1)
                    .min(samples.len());
                let from = from.min(to);
                let along = Along::Regular { first: record.milliseconds(from), step, count: to - from };
                let mark = Mark::line(role, along, samples[from..to].iter().map(|v| v * factor));
                panel.marks.push(if row == 0 { mark.named(name) } else { mark });
            }
            figure = figure.with(panel);
        }
    }
    Some(figure)
}

/// `kept: 7; refused: 8 (double hit)`.
fn listed(shown: &[Shown]) -> String {
    let list = |kept: bool| -> Vec<String> {
        let of = shown.iter().filter(|record| record.kept == kept);
        of.map(|r| if kept { r.record.to_string() } else { format!("{} ({})", r.record, r.verdict) })
            .collect()
    };
    let parts = [("kept", list(true)), ("refused", list(false))];
    let told =
        parts.iter().filter(|(_, of)| !of.is_empty()).map(|(name, of)| format!("{name}: {}", of.join(", ")));
    told.collect::<Vec<_>>().join("; ")
}

/// Lowest and highest value of a row within the time range shown, with a margin.
fn span(shown: &[Shown], row: usize, range_ms: [f64; 2], factor: f64) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for record in shown {
        let rows = record.rows();
        let Some((.., samples)) = rows.get(row) else { continue };
        for (i, value) in samples.iter().enumerate() {
            if (range_ms[0]..=range_ms[1]).contains(&record.milliseconds(i)) {
                range = [range[0].min(value * factor), range[1].max(value * factor)];
            }
        }
    }
    let margin = (0.06 * (range[1] - range[0])).max(1e-9);
    if range[0] <= range[1] { [range[0] - margin, range[1] + margin] } else { [-1.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_record_is_drawn_and_named() {
        let record = |record, kept, verdict| Shown {
            record,
            kept,
            verdict,
            rate_hz: 51_200.0,
            trigger: 256,
            force_n: (0..4_096).map(|i| if (256..276).contains(&i) { 50.0 } else { 0.0 }).collect(),
            quantity: Quantity::Velocity,
            response: vec![(0..4_096).map(|i| 1e-3 * f64::from(i).sin()).collect(); 3],
        };
        let text =
            records("AJB <1>", &[record(7, true, "good"), record(8, false, "double hit")]).expect("drawn");
        for part in ["kept: 7", "refused: 8 (double hit)", "AJB &lt;1&gt;", "xmlns=", "force, N"] {
            assert!(text.contains(part), "{part}");
        }
        assert_eq!(
            text.matches("class=\"s-refused\"").count(),
            8 + 2,
            "four rows, two views, and a legend over each of the two"
        );
        assert!(records("none", &[]).is_none());
    }
}

//! The raw records of one cell, one over the other: force, and the response along each axis, by time after the trigger.

use super::drawing::{Anchor, Area, Drawing, Stroke};
use super::panel::{BLUE, Panel, VERMILION, legend};
use super::scale::Scale;

const WIDTH: f64 = 1040.0;
const LEFT: f64 = 78.0;
const TOP: f64 = 58.0;
const GAP: f64 = 12.0;
const BESIDE: f64 = 96.0;
const HEIGHT: f64 = 118.0;

/// The close view, ms after the trigger: pulse, rebound, and what the structure makes of it at first.
const CLOSE_MS: [f64; 2] = [-1.0, 8.0];

const KEPT: Stroke = Stroke::new(BLUE, 1.0);
const REFUSED: Stroke = Stroke::new(VERMILION, 1.0);

/// A record to be drawn.
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
    /// Sample of the trigger.
    pub trigger: usize,
    /// Force, N.
    pub force_n: Vec<f64>,
    /// Response along x, y and z, m/s.
    pub response_m_per_s: [Vec<f64>; 3],
}

impl Shown {
    /// (name, factor to the shown unit, samples) of each row of the figure.
    fn rows(&self) -> [(&'static str, f64, &[f64]); 4] {
        let [x, y, z] = &self.response_m_per_s;
        [
            ("force in N", 1.0, &self.force_n),
            ("x in mm/s", 1e3, x),
            ("y in mm/s", 1e3, y),
            ("z in mm/s", 1e3, z),
        ]
    }

    fn milliseconds(&self, sample: usize) -> f64 {
        1e3 * (sample as f64 - self.trigger as f64) / self.rate_hz
    }
}

/// The figure as an SVG document of its own; none without records. Left the pulse, right the whole record.
pub fn records(title: &str, shown: &[Shown]) -> Option<String> {
    let first = shown.first()?;
    let whole = [
        shown.iter().map(|record| record.milliseconds(0)).fold(f64::INFINITY, f64::min),
        shown.iter().map(|record| record.milliseconds(record.force_n.len())).fold(0.0, f64::max),
    ];
    let column = (WIDTH - LEFT - BESIDE - 20.0) / 2.0;
    let rows = first.rows().len();
    let mut drawing = Drawing::new("records", WIDTH, TOP + rows as f64 * (HEIGHT + GAP) + 40.0);
    drawing.fill(Area { left: 0.0, top: 0.0, width: WIDTH, height: 5_000.0 }, "#fff", 1.0);
    drawing.text([LEFT, 20.0], Anchor::Start, "title", title);
    legend(&mut drawing, [LEFT, 42.0], &entries(shown));
    for row in 0..rows {
        let (label, factor, _) = first.rows()[row];
        for (side, range_ms) in [CLOSE_MS, whole].into_iter().enumerate() {
            let area = Area {
                left: LEFT + side as f64 * (column + BESIDE),
                top: TOP + row as f64 * (HEIGHT + GAP),
                width: column,
                height: HEIGHT,
            };
            let x = Scale::linear(range_ms, [area.left, area.right()]);
            let y = Scale::linear(span(shown, row, range_ms, factor), [area.bottom(), area.top]);
            let panel = Panel { area, x, y };
            let (x_ticks, y_ticks) = (x.ticks(6), y.ticks(3));
            panel.grid(&mut drawing, &x_ticks, &y_ticks);
            // kept ones on top: they are what counts
            for record in shown.iter().filter(|r| !r.kept).chain(shown.iter().filter(|r| r.kept)) {
                let samples = record.rows()[row].2;
                let points = samples
                    .iter()
                    .enumerate()
                    .map(|(i, value)| (record.milliseconds(i), value * factor))
                    .filter(|(t, _)| (range_ms[0]..=range_ms[1]).contains(t));
                panel.curve(&mut drawing, points, if record.kept { KEPT } else { REFUSED });
            }
            let x_label = (row + 1 == rows).then_some("time after the trigger in ms");
            panel.axes(&mut drawing, (&x_ticks, x_label), (&y_ticks, Some(label)));
        }
    }
    let text = drawing.finish(title);
    // on its own, a drawing needs the name space and the letters that the report's page gives it
    let style = "<style>text{fill:#333;font-family:system-ui,\"Segoe UI\",Roboto,\"Liberation Sans\",Arial,sans-serif}\
                 .tick{font-size:12px}.legend{font-size:12.5px}.label{font-size:13px}.title{font-size:14px;font-weight:600}</style>";
    let (head, body) = text.split_once('>')?;
    let head = if head.contains("xmlns") {
        head.to_owned()
    } else {
        head.replacen("<svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"", 1)
    };
    Some(format!("{head}>{style}{body}\n"))
}

fn entries(shown: &[Shown]) -> Vec<(Stroke, String)> {
    let list = |kept: bool| {
        let of: Vec<String> = shown
            .iter()
            .filter(|record| record.kept == kept)
            .map(|record| {
                if kept {
                    record.record.to_string()
                } else {
                    format!("{} ({})", record.record, record.verdict)
                }
            })
            .collect();
        (!of.is_empty()).then(|| of.join(", "))
    };
    let kept = list(true).map(|of| (KEPT, format!("kept: {of}")));
    let refused = list(false).map(|of| (REFUSED, format!("refused: {of}")));
    kept.into_iter().chain(refused).collect()
}

/// Lowest and highest value of a row within the time shown, with a margin.
fn span(shown: &[Shown], row: usize, range_ms: [f64; 2], factor: f64) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for record in shown {
        for (i, value) in record.rows()[row].2.iter().enumerate() {
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
            response_m_per_s: [(); 3].map(|()| (0..4_096).map(|i| 1e-3 * f64::from(i).sin()).collect()),
        };
        let text =
            records("AJB <1>", &[record(7, true, "good"), record(8, false, "double hit")]).expect("drawn");
        for part in ["kept: 7", "refused: 8 (double hit)", "AJB &lt;1&gt;", "xmlns=", "force in N"] {
            assert!(text.contains(part), "{part}");
        }
        assert_eq!(text.matches(VERMILION).count(), 8 + 1, "four rows, two views, and the legend");
        assert!(records("none", &[]).is_none());
    }
}

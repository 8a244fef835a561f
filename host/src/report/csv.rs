//! Exports a figure's numbers as a table: one line for each point, in the units of its axes.

use super::figure::{Axis, Figure, Mark, Packed, Panel, Shape, six_digits};
use ::csv::Writer;
use std::borrow::Cow;

/// The figure as csv (RFC 4180), with a header line.
pub fn csv(figure: &Figure) -> String {
    let mut table = CsvTable(Writer::from_writer(Vec::new()));
    table.line(["panel", "curve", "horizontal", "x", "upright", "y", "low", "high"]);
    for (i, panel) in figure.panels.iter().enumerate() {
        let title = if panel.title.is_empty() { (i + 1).to_string() } else { panel.title.clone() };
        for mark in &panel.marks {
            table.mark(&title, panel, mark);
        }
    }
    String::from_utf8(table.0.into_inner().expect("memory takes every byte")).expect("made of text alone")
}

/// Not a number: gives an empty cell.
const NONE: f64 = f64::NAN;

struct CsvTable(Writer<Vec<u8>>);

impl CsvTable {
    fn line(&mut self, cells: [&str; 8]) {
        self.0.write_record(cells).expect("memory takes every line, and all have eight cells");
    }

    /// Writes numbers that are contained in `results.json`; visual aids (fits, guides, words) are
    /// left out.
    fn mark(&mut self, title: &str, panel: &Panel, mark: &Mark) {
        let name = if mark.name.is_empty() { mark.role.name() } else { &mark.name };
        let (title, name) = (guarded(title), guarded(name));
        let labels = [panel.x.label(), panel.y.label()];
        let [x_label, y_label] = [guarded(&labels[0]), guarded(&labels[1])];
        let told = |of: &str, value: f64| if mark.tells(of) { six_digits(value) } else { String::new() };
        // x is written where its origin is known, for regular curves through their step; on axes of
        // names, the name is written
        let x_told = mark.tells("x") || mark.tells("step") || panel.x.link == "cycle";
        let across = |value: f64| match named(&panel.x, value) {
            None if x_told => six_digits(value),
            None => String::new(),
            Some(name) => guarded(name).into_owned(),
        };
        let upright = |value: f64| {
            named(&panel.y, value).map_or_else(|| told("y", value), |name| guarded(name).into_owned())
        };
        let mut put = |[x, y, low, high]: [&str; 4]| {
            self.line([&title, &name, &x_label, x, &y_label, y, low, high]);
        };
        let at = |values: &Packed, i: usize| values.0.get(i).copied().map_or(NONE, f64::from);
        match &mark.shape {
            Shape::Line { x, y } if mark.tells("y") => {
                (0..y.0.len()).for_each(|i| put([&across(x.at(i)), &upright(at(y, i)), "", ""]));
            }
            Shape::Ribbon { x, low, high } if mark.tells("low") => {
                for i in 0..low.0.len() {
                    put([&across(x.at(i)), "", &told("low", at(low, i)), &told("high", at(high, i))]);
                }
            }
            Shape::Loop { x, y } if mark.tells("y") => {
                (0..y.0.len()).for_each(|i| put([&across(at(x, i)), &upright(at(y, i)), "", ""]));
            }
            Shape::Points { x, y, bars, .. } if mark.tells("x") || mark.tells("y") => {
                for i in 0..y.0.len() {
                    let [low, high] = bars.as_ref().map_or([NONE; 2], |b| [at(&b.low, i), at(&b.high, i)]);
                    put([&across(at(x, i)), &upright(at(y, i)), &told("low", low), &told("high", high)]);
                }
            }
            Shape::Level { at, .. } if mark.tells("at") => put(["", &six_digits(*at), "", ""]),
            Shape::Cells { values, .. } => {
                let columns = panel.x.names.len().max(1);
                for i in (0..values.0.len()).filter(|i| at(values, *i).is_finite()) {
                    put([
                        &across((i % columns) as f64),
                        &upright((i / columns) as f64),
                        &told("values", at(values, i)),
                        "",
                    ]);
                }
            }
            Shape::Strips { x, values, says } => {
                for (row, says) in says.iter().enumerate() {
                    for i in 0..x.0.len() {
                        let [f, value] = [at(x, i), at(values, row * x.0.len() + i)].map(six_digits);
                        self.line([&title, &guarded(says), &x_label, &f, &name, &value, "", ""]);
                    }
                }
            }
            Shape::Scene(scene) => {
                for spot in &scene.spots {
                    let [x, y, z] = spot.at.map(six_digits);
                    let what = if spot.toward.is_some() { "impact" } else { "response" };
                    self.line([what, &guarded(&spot.name), "x y z in m", &x, "", &y, &z, ""]);
                }
            }
            _ => {}
        }
    }
}

/// The nearest name on an axis of names, because markers are drawn at an offset from their names.
fn named(axis: &Axis, at: f64) -> Option<&str> {
    axis.names.get(at.round().max(0.0) as usize).map(String::as_str)
}

/// Prefixes an apostrophe to text that a spreadsheet would interpret as a formula.
fn guarded(text: &str) -> Cow<'_, str> {
    if text.starts_with(['=', '+', '-', '@', '\t']) { format!("'{text}").into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::super::figure::{Along, Marker, Role};
    use super::*;

    #[test]
    fn every_point_has_a_line_with_its_units() {
        let mark = Mark::points(Role::Loops, Marker::default(), [[200.0, 148.5]])
            .barred("y", [[147.0, 150.0]])
            .named("k, \"slope\"")
            .from("x", "/hysteresis/*/frequency_hz", 1.0)
            .scatter("y", "/hysteresis/*/k_eq_n_per_m/mean", 1e-6);
        let panel = Panel::new(
            Axis::linear("frequency", "Hz", [0.0, 300.0]),
            Axis::linear("k", "N/µm", [0.0, 200.0]),
        );
        let help = Mark::line(Role::Fitted, Along::of(&[0.0, 300.0]), [0.0, 200.0]);
        let text = csv(&Figure::new("x", "", "t", "s").with(panel.with(mark).with(help)));
        assert_eq!(text.lines().count(), 2, "a fitted line is no data");
        assert_eq!(
            text.lines().nth(1),
            Some("1,\"k, \"\"slope\"\"\",\"frequency, Hz\",200,\"k, N/µm\",148.5,147,150")
        );
    }
}

//! The page that compares two campaigns: the verdict, the differences, and the figures of both side
//! by side with the same axes.

use super::{figure_html, shell};
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role, Source};
use crate::report::figures;
use crate::report::html::{Html, list};
use crate::report::tables;
use crate::report::words::brief;
use crate::report::words::number::{micro, short};
use crate::results::{Compared, Results};

/// Figures shown for both campaigns.
const SHOWN: [&str; 8] =
    ["levels", "backbone", "shaker-loops", "impacts", "specimens", "joint-spectrum", "decay-loops", "pulses"];

/// The whole page as HTML.
pub fn comparison_page(compared: &Compared, both: [&Results; 2]) -> String {
    let mut drawn: Vec<Figure> = differences(compared).into_iter().collect();
    drawn.extend(side_by_side(both));
    let banner = both.map(brief::on_what).join("   |   ");
    let simulated = both.iter().any(|r| r.source.simulated);
    let mut body = Html::default();
    body.raw("<nav aria-label=\"contents\"><ul><li><a href=\"#answer\">The verdict</a></li><li><a href=\"#both\">Both side by side</a></li><li><a href=\"#glossary\">Words</a></li></ul></nav><main>");
    body.raw(
        "<section id=\"answer\" class=\"first\"><div class=\"words\"><h1>Do the two contacts differ?</h1>",
    );
    body.raw(if compared.differ == Some(true) {
        "<div class=\"found warn\">"
    } else {
        "<div class=\"found\">"
    });
    body.element("p class=\"headline\"", &compared.verdict);
    body.raw("</div>");
    for line in &compared.missing {
        body.element("p", line);
    }
    body.raw("</div>");
    if let Some(figure) = drawn.iter().find(|f| f.name == "differences") {
        figure_html::figure(&mut body, figure, 2);
    }
    body.raw("</section>");
    body.raw(&tables::differences(compared));
    body.raw("<section id=\"both\"><h2>Both side by side, on the same axes</h2>");
    for figure in drawn.iter().filter(|f| f.name != "differences") {
        figure_html::figure(&mut body, figure, 3);
    }
    body.raw("</section><section id=\"glossary\"><h2>Words</h2>");
    list(&mut body);
    body.raw("</section></main>");
    shell("Two contacts compared", &banner, simulated, &body.finish(), drawn.iter())
}

/// Both values of every quantity on one axis.
fn differences(compared: &Compared) -> Option<Figure> {
    let shown: Vec<_> =
        compared.differences.iter().enumerate().filter(|(_, d)| d.unit == "N/m").take(12).collect();
    let high = shown.iter().flat_map(|(_, d)| [d.a.ci95[1], d.b.ci95[1]]).fold(0.0, f64::max);
    if shown.is_empty() {
        return None;
    }
    let names = shown
        .iter()
        .map(|(_, d)| {
            format!("{}: {} and {} N/µm", d.quantity, short(micro(d.a.mean)), short(micro(d.b.mean)))
        })
        .collect();
    let x = Axis::linear("stiffness", "N/µm", [0.0, 1.08 * micro(high)]);
    let mut panel = Panel::new(x, Axis::named("", names)).high(Height::Rows);
    for (row, (i, d)) in shown.iter().enumerate() {
        for (of, k, role, marker, name, lower) in [
            ("a", &d.a, Role::Group1, Marker::Dot, "first", 0.08),
            ("b", &d.b, Role::Group2, Marker::Frame, "second", 0.3),
        ] {
            panel.marks.push(
                Mark::points(role, marker, [[micro(k.mean), row as f64 + lower]])
                    .barred("x", [k.ci95.map(micro)])
                    .named(name)
                    .from("x", format!("/differences/{i}/{of}/mean"), 1e-6),
            );
        }
    }
    let mut figure = Figure::new(
        "differences",
        "",
        "Both on one axis",
        "Each quantity of both campaigns with its 95 % interval.",
    )
    .across(2)
    .with(panel);
    figure.from = Source {
        records: Vec::new(),
        file: format!("{} and {}", compared.sources[0].file, compared.sources[1].file),
        simulated: compared.sources.iter().any(|s| s.simulated),
        version: compared.sources[0].software.version.clone(),
    };
    Some(figure)
}

/// The figures that both have, with their panels side by side.
fn side_by_side(both: [&Results; 2]) -> Vec<Figure> {
    let [of_a, of_b] = both.map(figures::all);
    let mut merged = Vec::new();
    for name in SHOWN {
        let find = |all: &[Figure]| all.iter().find(|f| f.name == name).cloned();
        let (Some(a), Some(b)) = (find(&of_a), find(&of_b)) else { continue };
        let mut figure = Figure { columns: 2, panels: Vec::new(), ..a.clone() };
        figure.from.file = format!("{} and {}", a.from.file, b.from.file);
        figure.from.simulated = a.from.simulated || b.from.simulated;
        figure.from.records.clear();
        for (one, other) in a.panels.into_iter().zip(b.panels) {
            let (x, y) = (union(&one.x, &other.x), union(&one.y, &other.y));
            for (panel, which) in [(one, "first"), (other, "second")] {
                let title = if panel.title.is_empty() {
                    which.to_owned()
                } else {
                    format!("{which}: {}", panel.title)
                };
                let (x, y) = (ranged(&panel.x, x), ranged(&panel.y, y));
                figure.panels.push(Panel { title, x, y, ..panel });
            }
        }
        merged.push(figure);
    }
    merged
}

fn union(a: &Axis, b: &Axis) -> [f64; 2] {
    [a.range[0].min(b.range[0]), a.range[1].max(b.range[1])]
}

/// Sets the range of an axis; an axis of names is unchanged because its positions are fixed.
fn ranged(axis: &Axis, range: [f64; 2]) -> Axis {
    if axis.names.is_empty() { Axis { range, ..axis.clone() } } else { axis.clone() }
}

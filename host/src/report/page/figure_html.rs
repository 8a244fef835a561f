//! A figure in the page: its description, its panels as SVG, its source, and the data from which
//! the page's script makes it interactive.

use crate::report::figure::{Figure, Height, Panel, Shape, role};
use crate::report::html::{Html, escaped};
use crate::report::svg;
use crate::untrusted_text::shown_json;

/// Width of the page's text, px; a full-width panel is drawn for it.
const WIDE: f64 = 1040.0;
const GAP: f64 = 16.0;

/// The figure; `level` is the level of its heading.
pub fn figure(html: &mut Html, figure: &Figure, level: u8) {
    let (name, columns) = (figure.name, figure.columns.clamp(1, 4));
    html.raw(&format!("<figure id=\"fig-{name}\" data-figure=\"{name}\" class=\"columns-{columns}\" tabindex=\"0\" role=\"group\" aria-label=\""));
    html.text(&figure.title);
    html.raw("\">");
    html.element(&format!("h{level}"), &figure.heading());
    html.element("p class=\"say\"", &figure.say);
    html.raw("<div class=\"panels\">");
    let width = ((WIDE - GAP * (columns as f64 - 1.0)) / columns as f64).floor();
    for (i, panel) in figure.panels.iter().enumerate() {
        one_panel(html, figure, panel, i, width);
    }
    html.raw("</div><div class=\"readout\" aria-live=\"polite\"></div>");
    source(html, figure);
    html.raw("</figure>");
}

fn one_panel(html: &mut Html, figure: &Figure, panel: &Panel, index: usize, width: f64) {
    html.raw(&format!("<div class=\"panel\" data-panel=\"{index}\">"));
    if !panel.title.is_empty() {
        html.element("p class=\"panel-title\"", &panel.title);
    }
    let legend = panel.legend();
    if !legend.is_empty() {
        html.raw("<ul class=\"legend\">");
        for (name, role, drawn) in legend {
            html.raw(&format!(
                "<li data-role=\"{}\" data-name=\"{}\">{}",
                role.name(),
                escaped(name),
                svg::sample_picture(role, drawn)
            ));
            html.element("span", name);
            html.raw("</li>");
        }
        html.raw("</ul>");
    }
    let scene = panel.marks.iter().any(|m| matches!(m.shape, Shape::Scene(_)));
    let matrix = panel.marks.iter().any(|m| matches!(m.shape, Shape::Cells { .. }));
    let class = if scene {
        "plot scene"
    } else if matrix {
        "plot matrix"
    } else if panel.height == Height::Rows {
        "plot rows"
    } else {
        "plot"
    };
    let meaning = if panel.title.is_empty() {
        figure.title.clone()
    } else {
        format!("{}: {}", figure.title, panel.title)
    };
    html.raw(&format!("<div class=\"{class}\">"));
    html.raw(&svg::panel(panel, &format!("{}-{index}", figure.name), width, &meaning));
    html.raw("</div></div>");
}

fn source(html: &mut Html, figure: &Figure) {
    html.raw("<details class=\"from\"><summary>from</summary><p>");
    let from = &figure.from;
    let records: Vec<String> =
        from.records.iter().map(|[a, b]| if a == b { a.to_string() } else { format!("{a}–{b}") }).collect();
    let records = if records.is_empty() { "all accepted ones".into() } else { records.join(", ") };
    html.text(&format!("{}; records: {records}; jointrig {}", from.file, from.version));
    html.raw("</p></details>");
}

/// The appearance of every role except its colours, which are in the style sheet, as an object for
/// the page's script.
pub fn roles() -> String {
    let looks = role::ALL.iter().map(|role| {
        let (name, width, dash, opacity) = (role.name(), role.width(), role.dash(), role.opacity());
        format!("\"{name}\":{{\"width\":{width},\"dash\":\"{dash}\",\"opacity\":{opacity}}}")
    });
    format!("{{{}}}", looks.collect::<Vec<_>>().join(","))
}

/// All figures as JSON data; `<` is escaped so that it cannot end the element.
pub fn data<'a>(html: &mut Html, figures: impl Iterator<Item = &'a Figure>) {
    html.raw("<script type=\"application/json\" id=\"figures\">{\"figures\":[");
    for (i, figure) in figures.enumerate() {
        if i > 0 {
            html.raw(",");
        }
        // a figure is plain data, so serialising it cannot fail
        let data = serde_json::to_string(figure).unwrap_or_else(|_| "null".into());
        html.raw(&shown_json(&data).replace('<', "\\u003c"));
    }
    html.raw("]}</script>");
}

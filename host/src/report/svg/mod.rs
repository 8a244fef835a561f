//! Figures as SVG: panels for the page and for print, and standalone files.

pub mod drawing;
mod marks;
mod panel;

pub use panel::panel;

use super::figure::{Drawn, Figure, Role, role};
use drawing::{Anchor, Drawing, Stroke, escape};

/// Gap between panels, px.
const GAP: f64 = 16.0;
/// Height of the title and its sentence above the panels, px.
const HEAD: f64 = 52.0;
/// Width of a standalone figure, px.
pub const WIDTH: f64 = 1040.0;
/// Width of a letter in legends, px; a generous estimate.
const LETTER: f64 = 6.8;

const STYLE: &str = "text{fill:#333;stroke:none;font-family:system-ui,\"Segoe UI\",Roboto,\"Liberation Sans\",\"DejaVu Sans\",Arial,sans-serif}\
    .tick{font-size:12px}.legend{font-size:12.5px}.label{font-size:13px}.title{font-size:14px;font-weight:600}.heading{font-size:17px;font-weight:600}\
    .paper{fill:#fff}.frame{stroke:#888}.grid{stroke:#e4e4e4}.none{fill:none}.s-paper{stroke:#fff}";

/// Differences of the style on a dark background.
const DARK: &str =
    "text{fill:#ccc}.paper{fill:#16181b}.frame{stroke:#777}.grid{stroke:#33363b}.s-paper{stroke:#16181b}";

/// The figure as a standalone SVG file, on a light background.
pub fn file(figure: &Figure) -> String {
    with_style(figure, "", &format!("{STYLE}{}", role::plain_classes()))
}

/// The same for a notebook: on the reader's background, light or dark, with a style limited to the
/// drawing.
pub fn notebook(figure: &Figure) -> String {
    let id = format!("jointrig-{}", figure.name);
    let [light, dark] = [false, true].map(role::variables);
    let style = format!(
        "#{id}{{{light}{STYLE}{}}}@media(prefers-color-scheme:dark){{#{id}{{{dark}{DARK}}}}}",
        role::classes()
    );
    with_style(figure, &format!(" id=\"{id}\""), &style)
}

fn with_style(figure: &Figure, id: &str, style: &str) -> String {
    let columns = figure.columns.max(1);
    let width = (WIDTH - GAP * (columns as f64 - 1.0)) / columns as f64;
    let mut parts = String::new();
    let mut top = HEAD;
    for row in figure.panels.chunks(columns) {
        let mut below = top;
        for (i, one) in row.iter().enumerate() {
            let left = i as f64 * (width + GAP);
            let legend = legend(one.legend().as_slice(), width);
            let shift = legend.size()[1];
            parts.push_str(&legend.inside([left, top]));
            let drawn = panel::drawing(one, &format!("{}-{}", figure.name, parts.len()), width);
            let height = drawn.size()[1];
            parts.push_str(&drawn.inside([left, top + shift]));
            below = below.max(top + shift + height);
        }
        top = below + GAP;
    }
    let simulated = if figure.from.simulated { "SIMULATED rig. " } else { "" };
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\"{id} viewBox=\"0 0 {WIDTH} {top:.0}\" width=\"{WIDTH}\" height=\"{top:.0}\" role=\"img\" aria-label=\"{}\">\
         <style>{style}</style><rect width=\"100%\" height=\"100%\" class=\"paper\"/><text x=\"8\" y=\"22\" class=\"heading\">{}</text>\
         <text x=\"8\" y=\"42\" class=\"tick\">{simulated}{}, jointrig {}</text>{parts}</svg>\n",
        escape(&figure.say),
        escape(&figure.heading()),
        escape(&figure.from.file),
        escape(&figure.from.version),
    )
}

/// A legend in as many rows as it needs.
fn legend(entries: &[(&str, Role, Drawn)], width: f64) -> Drawing {
    let mut placed = Vec::new();
    let (mut x, mut y) = (8.0, 0.0);
    for (name, role, drawn) in entries {
        let needed = 28.0 + LETTER * name.chars().count() as f64 + 18.0;
        if x > 8.0 && x + needed > width {
            (x, y) = (8.0, y + 18.0);
        }
        placed.push((*name, *role, *drawn, [x, y + 14.0]));
        x += needed;
    }
    let mut drawing = Drawing::new("", width, if placed.is_empty() { 0.0 } else { y + 20.0 });
    for (name, role, drawn, [x, y]) in placed {
        sample(&mut drawing, role, drawn, [x, y - 4.0]);
        drawing.text([x + 28.0, y], Anchor::Start, "legend", name);
    }
    drawing
}

/// Sample of a mark, 22 px wide, for a legend.
pub fn sample(drawing: &mut Drawing, role: Role, drawn: Drawn, [x, y]: [f64; 2]) {
    let class = format!("s-{}", role.name());
    match drawn {
        Drawn::Line => {
            let stroke = Stroke { class: &class, width: role.width().max(1.6), dash: role.dash() };
            drawing.line([x, y], [x + 22.0, y], stroke);
        }
        Drawn::Points(marker) => marks::draw_marker(drawing, [x + 11.0, y], role, marker),
        Drawn::Area => {
            let area = drawing::Area { left: x, top: y - 5.0, width: 22.0, height: 10.0 };
            drawing.fill(area, &format!("f-{}", role.name()), 0.3);
        }
    }
}

/// The sample of a legend entry as a small picture, for the page.
pub fn sample_picture(role: Role, drawn: Drawn) -> String {
    let mut drawing = Drawing::new("", 24.0, 12.0);
    sample(&mut drawing, role, drawn, [1.0, 6.0]);
    drawing.decoration()
}

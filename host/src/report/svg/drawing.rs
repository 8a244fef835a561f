//! Vector drawings as SVG text that can be embedded in one HTML page.

use std::fmt::Write;

use crate::untrusted_text::visible;

/// Style of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke<'a> {
    /// Its class; the style sheet sets the colour.
    pub class: &'a str,
    /// Width, px.
    pub width: f64,
    /// Dash pattern, empty for a solid line.
    pub dash: &'static str,
}

impl<'a> Stroke<'a> {
    /// A solid line.
    pub const fn new(class: &'a str, width: f64) -> Self {
        Stroke { class, width, dash: "" }
    }
}

/// Horizontal alignment of a text at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The point is at its left end.
    Start,
    /// The point is in its middle.
    Middle,
    /// The point is at its right end.
    End,
}

/// A rectangle, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Area {
    /// Right edge.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Lower edge.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// A drawing under construction.
#[derive(Debug)]
pub struct Drawing {
    name: String,
    width: f64,
    height: f64,
    clips: usize,
    body: String,
}

impl Drawing {
    /// An empty drawing; `name` makes its ids differ from those of the page's other drawings.
    pub fn new(name: &str, width: f64, height: f64) -> Self {
        Drawing { name: name.to_owned(), width, height, clips: 0, body: String::new() }
    }

    /// A straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], stroke: Stroke<'_>) {
        let path = format!("M{} {}L{} {}", px(from[0]), px(from[1]), px(to[0]), px(to[1]));
        self.path(&path, stroke);
    }

    /// A curve through points in pixels, with a gap at `None`. If many points share a pixel column
    /// they are reduced to the lowest and the highest, which looks the same.
    pub fn curve(&mut self, points: &[Option<[f64; 2]>], stroke: Stroke<'_>) {
        let path = path_of(points);
        if !path.is_empty() {
            self.path(&path, stroke);
        }
    }

    fn path(&mut self, path: &str, stroke: Stroke<'_>) {
        let dash = if stroke.dash.is_empty() {
            String::new()
        } else {
            format!(" stroke-dasharray=\"{}\"", stroke.dash)
        };
        self.push(format_args!(
            "<path d=\"{path}\" fill=\"none\" class=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{dash}/>",
            stroke.class,
            px(stroke.width)
        ));
    }

    /// A filled closed curve through points.
    pub fn area(&mut self, points: &[[f64; 2]], class: &str, opacity: f64) {
        let path = path_of(&points.iter().copied().map(Some).collect::<Vec<_>>());
        if !path.is_empty() {
            self.push(format_args!("<path d=\"{path}Z\" class=\"{class}\" fill-opacity=\"{opacity:.2}\"/>"));
        }
    }

    /// A filled rectangle.
    pub fn fill(&mut self, area: Area, class: &str, opacity: f64) {
        if area.width <= 0.0 || area.height <= 0.0 {
            return;
        }
        self.push(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"{class}\" fill-opacity=\"{opacity:.2}\"/>",
            px(area.left),
            px(area.top),
            px(area.width),
            px(area.height)
        ));
    }

    /// Filled rectangles, as one shape.
    pub fn fills(&mut self, areas: &[Area], class: &str, opacity: f64) {
        if areas.is_empty() {
            return;
        }
        let mut path = String::new();
        for area in areas {
            let (left, top, width, height) = (px(area.left), px(area.top), px(area.width), px(area.height));
            let _ = write!(path, "M{left} {top}h{width}v{height}h-{width}z");
        }
        self.push(format_args!("<path d=\"{path}\" class=\"{class}\" fill-opacity=\"{opacity:.2}\"/>"));
    }

    /// Round or square points of this width, as one shape.
    pub fn ends(&mut self, points: &[[f64; 2]], class: &str, width: f64, round: bool) {
        let mut path = String::new();
        for p in points {
            let _ = write!(path, "M{} {}h0", px(p[0]), px(p[1]));
        }
        let cap = if round { "round" } else { "square" };
        let width = px(width);
        self.push(format_args!("<path d=\"{path}\" class=\"{class}\" stroke-width=\"{width}\" stroke-linecap=\"{cap}\" fill=\"none\"/>"));
    }

    /// Diagonal crosses, as one shape.
    pub fn crosses(&mut self, points: &[[f64; 2]], class: &str, half: f64) {
        let (whole, back) = (px(2.0 * half), px(-2.0 * half));
        let one = |p: &[f64; 2]| {
            format!("M{} {}l{whole} {whole}m{back} 0l{whole} {back}", px(p[0] - half), px(p[1] - half))
        };
        let path: String = points.iter().map(one).collect();
        self.push(format_args!("<path d=\"{path}\" class=\"{class}\" stroke-width=\"1.8\" fill=\"none\"/>"));
    }

    /// A dot or ring; `classes` define its fill and stroke.
    pub fn dot(&mut self, at: [f64; 2], radius: f64, classes: &str) {
        self.push(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" class=\"{classes}\" stroke-width=\"1.4\"/>",
            px(at[0]),
            px(at[1]),
            px(radius)
        ));
    }

    /// A square, filled or empty.
    pub fn square(&mut self, at: [f64; 2], half: f64, classes: &str) {
        self.push(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"{classes}\" stroke-width=\"1.4\"/>",
            px(at[0] - half),
            px(at[1] - half),
            px(2.0 * half),
            px(2.0 * half)
        ));
    }

    /// A text; `class` selects its size and colour in the page's style sheet.
    pub fn text(&mut self, at: [f64; 2], anchor: Anchor, class: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.push(format_args!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" class=\"{class}\">{}</text>",
            px(at[0]),
            px(at[1]),
            escape(text)
        ));
    }

    /// A text rotated to read upwards.
    pub fn text_upwards(&mut self, at: [f64; 2], class: &str, text: &str) {
        self.push(format_args!(
            "<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\" class=\"{class}\">{}</text>",
            px(at[0]),
            px(at[1]),
            escape(text)
        ));
    }

    /// Draws the output of `inside`, clipped at the edges of `area`.
    pub fn clipped(&mut self, area: Area, inside: impl FnOnce(&mut Drawing)) {
        self.clips += 1;
        let id = format!("{}-{}", self.name, self.clips);
        self.push(format_args!(
            "<clipPath id=\"{id}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath><g clip-path=\"url(#{id})\">",
            px(area.left),
            px(area.top),
            px(area.width),
            px(area.height)
        ));
        inside(self);
        self.body.push_str("</g>");
    }

    /// The finished drawing; `meaning` is read out by screen readers.
    pub fn finish(self, meaning: &str) -> String {
        let size = format!("0 0 {} {}", px(self.width), px(self.height));
        format!("<svg viewBox=\"{size}\" role=\"img\" aria-label=\"{}\">{}</svg>", escape(meaning), self.body)
    }

    /// The finished drawing as a decoration that screen readers skip.
    pub fn decoration(self) -> String {
        let (width, height) = (px(self.width), px(self.height));
        format!(
            "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" aria-hidden=\"true\">{}</svg>",
            self.body
        )
    }

    /// The finished drawing as part of a larger one, with its upper left corner at `at`.
    pub fn inside(self, at: [f64; 2]) -> String {
        let (x, y, width, height) = (px(at[0]), px(at[1]), px(self.width), px(self.height));
        format!("<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\">{}</svg>", self.body)
    }

    /// Its size, px.
    pub fn size(&self) -> [f64; 2] {
        [self.width, self.height]
    }

    fn push(&mut self, arguments: std::fmt::Arguments<'_>) {
        self.body.write_fmt(arguments).expect("writing into a String cannot fail");
    }
}

/// A path in tenths of a pixel, each point relative to the one before: half as long as with
/// absolute positions.
fn path_of(points: &[Option<[f64; 2]>]) -> String {
    let mut path = String::new();
    for run in points.split(Option::is_none) {
        let run: Vec<[f64; 2]> = run.iter().copied().flatten().collect();
        let mut before = [0i64; 2];
        let mut lined = false;
        for (i, p) in thinned(&run).into_iter().enumerate() {
            let at = p.map(|v| (10.0 * held(v)).round() as i64);
            if i == 0 {
                path.push('M');
            } else if at == before {
                continue;
            } else if !lined {
                path.push('l');
                lined = true;
            }
            for (n, (now, then)) in at.into_iter().zip(before).enumerate() {
                let step = if i == 0 { now } else { now - then };
                if step >= 0 && (n > 0 || !path.ends_with(['M', 'l'])) {
                    path.push(' ');
                }
                tenths(&mut path, step);
            }
            before = at;
        }
    }
    path
}

/// `-0.3` as `-.3`, `12.0` as `12`.
fn tenths(path: &mut String, value: i64) {
    if value < 0 {
        path.push('-');
    }
    let (whole, tenth) = (value.abs() / 10, value.abs() % 10);
    if whole > 0 || tenth == 0 {
        let _ = write!(path, "{whole}");
    }
    if tenth > 0 {
        let _ = write!(path, ".{tenth}");
    }
}

/// Clamps distant values to a range that every browser can draw.
fn held(value: f64) -> f64 {
    if value.is_finite() { value.clamp(-20_000.0, 20_000.0) } else { 0.0 }
}

/// Reduces each pixel column to its lowest and highest point, in their original order.
fn thinned(run: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for column in run.chunk_by(|a, b| a[0].floor() == b[0].floor()) {
        if column.len() <= 4 {
            kept.extend_from_slice(column);
            continue;
        }
        let by_height = |a: &usize, b: &usize| column[*a][1].total_cmp(&column[*b][1]);
        let mut indices = Vec::with_capacity(2);
        indices.extend((0..column.len()).min_by(by_height));
        indices.extend((0..column.len()).max_by(by_height));
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().map(|i| column[i]));
    }
    kept
}

/// Pixels, rounded to a tenth.
fn px(value: f64) -> String {
    let text = format!("{:.1}", held(value));
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Text escaped for HTML and SVG.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in visible(text).chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_of_points_in_a_column_become_four() {
        let run: Vec<[f64; 2]> =
            (0..4000).map(|i| [f64::from(i) / 1000.0, f64::from(i * 37 % 101)]).collect();
        let kept = thinned(&run);
        assert!(kept.len() <= 16, "{}", kept.len());
        assert!(kept.iter().any(|p| p[1] == 100.0) && kept.iter().any(|p| p[1] == 0.0));
    }

    #[test]
    fn gaps_break_the_curve_and_nothing_is_not_a_number() {
        let path = path_of(&[Some([0.0, 1.0]), None, Some([2.0, f64::INFINITY]), Some([3.0, f64::NAN])]);
        assert_eq!(path.matches('M').count(), 2);
        assert_eq!(path, "M0 1M2 0l1 0", "relative, in tenths, and nothing but numbers");
    }

    #[test]
    fn texts_cannot_break_the_page() {
        let mut drawing = Drawing::new("x", 10.0, 10.0);
        drawing.text([0.0, 0.0], Anchor::Start, "tick", "<script>\"&'");
        assert!(drawing.finish("a<b").contains("&lt;script&gt;&quot;&amp;&#39;"));
    }
}

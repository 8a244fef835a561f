//! The tables: HTML text from the results of a campaign, or from the differences of two. Every
//! number is marked with its path in `results.json`.

use super::words::number::{decimals, short};
use crate::report::html::escaped;
use crate::results::Compared;
use std::fmt::Write;

pub use checks::checks;
pub use checks::virtual_points;
pub use joint::recommended;
pub use joint::{joint, refusals};
pub use loops::{decay, hysteresis, side_by_side, static_arm};
pub use modes::modes;
pub use provenance::{calibrations, completeness, provenance};
pub use study::campaigns_of_study;
pub use wear::wear;

mod checks;
mod joint;
mod loops;
mod modes;
mod provenance;
mod study;
mod wear;

/// Text for an unknown value.
pub(super) const UNKNOWN: &str = "–";

/// One cell: words, or a number with its path in `results.json`; for several numbers, the paths in
/// order, separated by spaces.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TableCell {
    text: String,
    path: String,
}

/// A cell with words.
pub(super) fn words(text: impl Into<String>) -> TableCell {
    TableCell { text: text.into(), path: String::new() }
}

/// A number, or a dash if it is not known.
pub(super) fn number(text: Option<String>, path: impl Into<String>) -> TableCell {
    match text {
        Some(text) => TableCell { text, path: path.into() },
        None => words(UNKNOWN),
    }
}

/// A number with its scatter; both are in the object at `place`.
pub(super) fn scattered(text: Option<String>, place: &str) -> TableCell {
    number(text, format!("{place}/mean {place}/std"))
}

/// An interval at `place`.
pub(super) fn interval(text: Option<String>, place: &str) -> TableCell {
    number(text, format!("{place}/0 {place}/1"))
}

/// A key of any name, encoded as a part of a path (RFC 6901), in which spaces are not allowed.
pub(super) fn key(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1").replace('%', "%25").replace(' ', "%20")
}

/// Builds one table; cells are escaped, columns after the first `text_columns` are right-aligned.
pub(super) struct HtmlTable {
    html: String,
    text_columns: usize,
}

impl HtmlTable {
    pub(super) fn new(text_columns: usize, caption: &str, heads: &[&str]) -> Self {
        let mut html =
            format!("<div class=\"wide\"><table><caption>{}</caption><thead><tr>", escaped(caption));
        for (i, head) in heads.iter().enumerate() {
            let class = if i < text_columns { "" } else { " class=\"n\"" };
            let _ = write!(html, "<th scope=\"col\"{class}>{}</th>", escaped(head));
        }
        html.push_str("</tr></thead><tbody>");
        HtmlTable { html, text_columns }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = TableCell>) {
        self.html.push_str("<tr>");
        for (i, cell) in cells.into_iter().enumerate() {
            let class = if i < self.text_columns { "" } else { " class=\"n\"" };
            let (tag, scope) = if i == 0 { ("th", " scope=\"row\"") } else { ("td", "") };
            let path = if cell.path.is_empty() {
                String::new()
            } else {
                format!(" data-path=\"{}\"", escaped(&cell.path))
            };
            let _ = write!(self.html, "<{tag}{scope}{class}{path}>{}</{tag}>", escaped(&cell.text));
        }
        self.html.push_str("</tr>");
    }

    pub(super) fn finish(mut self) -> String {
        self.html.push_str("</tbody></table></div>");
        self.html
    }
}

/// Remarks grouped by kind, each with the number of rows that it applies to, and the first of them.
pub(super) fn remarks(all: &[(String, &str)]) -> String {
    let mut kinds: Vec<(String, &str, Vec<&str>)> = Vec::new();
    for (row, remark) in all {
        let kind = kind_of(remark);
        match kinds.iter_mut().find(|(k, ..)| *k == kind) {
            Some((_, _, rows)) => rows.push(row),
            None => kinds.push((kind, remark, vec![row])),
        }
    }
    if kinds.is_empty() {
        return String::new();
    }
    let mut html = String::from("<details class=\"remarks\"><summary>");
    let _ = write!(html, "{} kinds of remarks on these rows</summary><ul class=\"notes\">", kinds.len());
    for (_, remark, mut rows) in kinds {
        rows.dedup();
        let of = if rows.len() == 1 {
            rows[0].to_owned()
        } else {
            format!("{} rows, such as {}", rows.len(), rows[0])
        };
        let _ = write!(html, "<li><b>{}</b>: {}</li>", escaped(&of), escaped(remark));
    }
    html.push_str("</ul></details>");
    html
}

/// A remark without its numbers: two remarks that differ only in numbers are of one kind.
pub(super) fn kind_of(remark: &str) -> String {
    let mut kind = String::with_capacity(remark.len());
    for c in remark.chars() {
        let numeric = c.is_ascii_digit() || matches!(c, '.' | '−' | '-' | '…');
        if !numeric {
            kind.push(c);
        } else if !kind.ends_with('#') {
            kind.push('#');
        }
    }
    kind
}

/// Both values and their difference, quantity by quantity.
pub fn differences(compared: &Compared) -> String {
    let heads =
        ["quantity", "differ?", "first", "second", "second − first", "95 % interval", "of the first, %"];
    let mut table = HtmlTable::new(2, "Differences", &heads);
    for (i, d) in compared.differences.iter().enumerate() {
        let (scale, unit) = if d.unit == "N/m" { (1e-6, "N/µm") } else { (1.0, "N s/m") };
        let at = |field: &str| format!("/differences/{i}/{field}");
        let shown = |value: f64| short(scale * value);
        let [low, high] = d.b_minus_a.ci95;
        table.row([
            words(format!("{}, {unit}", d.quantity)),
            words(if d.differ { "✗ yes" } else { "✓ no" }),
            number(Some(shown(d.a.mean)), at("a/mean")),
            number(Some(shown(d.b.mean)), at("b/mean")),
            number(Some(shown(d.b_minus_a.mean)), at("b_minus_a/mean")),
            number(Some(format!("{}…{}", shown(low), shown(high))), at("b_minus_a/ci95/0")),
            words(decimals(100.0 * d.b_minus_a.mean / d.a.mean, 1)),
        ]);
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_that_differ_in_numbers_alone_are_one() {
        let rows = |n: usize| format!("row {n}");
        let remarks_of: Vec<(String, &str)> = vec![
            (rows(1), "scatters by 421 % of its mean"),
            (rows(2), "scatters by 12.5 % of its mean"),
            (rows(3), "another"),
        ];
        let html = remarks(&remarks_of);
        assert_eq!(html.matches("<li>").count(), 2);
        assert!(html.contains("2 rows, such as row 1"));
    }

    #[test]
    fn a_number_says_where_it_stands() {
        let mut table = HtmlTable::new(1, "c", &["a", "b"]);
        table.row([words("<x>"), number(Some("26.8".into()), "/joint/0/x")]);
        table.row([words("y"), number(None, "/joint/1/x")]);
        let html = table.finish();
        assert!(html.contains("data-path=\"/joint/0/x\">26.8<") && html.contains("&lt;x&gt;"));
        assert_eq!(html.matches("data-path").count(), 1);
    }
}

//! Builds HTML: all text from a file is escaped by [`escaped`], and no number is separated from its
//! unit by a line break.

use crate::report::svg::drawing::escape;
use std::fmt::Write;

/// HTML under construction.
#[derive(Debug, Default)]
pub struct Html(String);

impl Html {
    /// Appends trusted markup.
    pub fn raw(&mut self, markup: &str) {
        self.0.push_str(markup);
    }

    /// Appends untrusted text, escaped.
    pub fn text(&mut self, text: &str) {
        self.0.push_str(&escaped(text));
    }

    /// Appends an element with untrusted text, escaped; `open` is the trusted text between its
    /// angle brackets.
    pub fn element(&mut self, open: &str, text: &str) {
        let tag = open.split(' ').next().unwrap_or(open);
        let _ = write!(self.0, "<{open}>{}</{tag}>", escaped(text));
    }

    /// The HTML written so far.
    pub fn finish(self) -> String {
        self.0
    }
}

/// Text escaped for HTML, with no line break between numbers and units.
pub fn escaped(text: &str) -> String {
    unbroken(&escape(text))
}

/// Units that are not separated from the number before them.
const UNITS: [&str; 22] = [
    "N/µm", "N/m", "N s/m", "N m/rad", "µm/N", "m/N", "µm", "nm", "mm", "ms", "Hz", "%", "°", "N", "µJ",
    "kg", "s", "m", "dB", "MB", "IDMs", "hits",
];

/// Replaces spaces between a number and its unit, and around ±, by no-break spaces.
pub fn unbroken(text: &str) -> String {
    const HARD: char = '\u{a0}';
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    for (i, c) in text.char_indices() {
        if c != ' ' {
            out.push(c);
            // no line break within a unit such as N/µm
            let above = || text[..i].rsplit(|c: char| !c.is_alphanumeric() && c != '_').next();
            let below = text[i + c.len_utf8()..].starts_with(['µ', 'm', 'N', 'r']);
            let unit = c == '/' && below && matches!(above(), Some("N" | "m" | "µm"));
            if unit {
                out.push('\u{2060}');
            }
            // no line break within a range
            if c == '…' && before.is_ascii_digit() {
                out.push('\u{2060}');
            }
            before = c;
            continue;
        }
        let rest = &text[i + 1..];
        let unit = |unit: &str| {
            rest.strip_prefix(unit)
                .is_some_and(|after| !after.starts_with(|c: char| c.is_alphanumeric() || c == '/'))
        };
        let holds = (before.is_ascii_digit() && (rest.starts_with('±') || UNITS.iter().any(|u| unit(u))))
            || before == '±'
            || (before == '%' && rest.starts_with(|c: char| c.is_ascii_digit()))
            || (before == '=' && rest.starts_with(|c: char| c.is_ascii_digit() || c == '−'));
        out.push(if holds { HARD } else { ' ' });
        before = c;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_units() {
        assert_eq!(
            unbroken("26.8 ± 0.9 N/µm (95 % of it)"),
            "26.8\u{a0}±\u{a0}0.9\u{a0}N/\u{2060}µm (95\u{a0}% of it)"
        );
        assert_eq!(unbroken("25…28"), "25…\u{2060}28");
        assert_eq!(unbroken("2 Next 3 A/Nothing"), "2 Next 3 A/Nothing");
        assert_eq!(unbroken("/k_n_per_m/mean"), "/k_n_per_m/mean");
    }

    #[test]
    fn nothing_from_a_file_is_markup() {
        let mut html = Html::default();
        html.element("p class=\"x\"", "</p><script>");
        assert_eq!(html.finish(), "<p class=\"x\">&lt;/p&gt;&lt;script&gt;</p>");
    }
}

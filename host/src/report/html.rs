//! Builds the HTML text of page and tables: all text from a file is escaped by [`escaped`], and no
//! number is separated from its unit by a line break.
//!
//! Text between backticks is marked as code. The page contains the glossary, from the text of
//! `docs/glossary.md`, and the first use of each of its terms is a link to it.

use crate::report::svg::drawing::escape;
use std::cmp::Reverse;
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

/// The glossary: `**term** — meaning`, one paragraph each.
const GLOSSARY: &str = include_str!("../../../docs/glossary.md");

/// Terms with their meanings.
pub fn terms() -> impl Iterator<Item = (&'static str, &'static str)> {
    GLOSSARY.lines().filter_map(|line| line.strip_prefix("- **")?.split_once("**: "))
}

/// The whole list.
pub fn list(html: &mut Html) {
    html.raw("<dl class=\"glossary\">");
    for (term, meaning) in terms() {
        html.raw(&format!("<dt id=\"word-{}\">{}</dt>", anchor(term), escaped(term)));
        html.element("dd", meaning);
    }
    html.raw("</dl>");
}

/// A term as an HTML anchor.
pub fn anchor(term: &str) -> String {
    term.chars()
        .filter_map(|c| {
            if c.is_alphanumeric() { Some(c.to_ascii_lowercase()) } else { (c == ' ').then_some('-') }
        })
        .collect()
}

/// Elements in which no link is allowed: other links, headings, drawings and controls, and the
/// glossary itself.
const CLOSED: [&str; 12] = [
    "a",
    "nav",
    "h1",
    "h2",
    "h3",
    "svg",
    "ul class=\"legend\"",
    "summary",
    "dl",
    "caption",
    "span class=\"good\"",
    "span class=\"bad\"",
];

/// A term that has not been used so far.
struct Term {
    term: &'static str,
    link: String,
}

/// `body` with every term of the glossary linked at its first use.
pub fn linked(body: &str) -> String {
    let mut unused: Vec<Term> = terms()
        .map(|(term, meaning)| Term {
            term,
            link: format!(
                "<a class=\"word\" href=\"#word-{}\" title=\"{}\">",
                anchor(term),
                escaped(meaning)
            ),
        })
        .collect();
    // longer terms first: `slope between the spots` before `spots`
    unused.sort_by_key(|t| Reverse(t.term.len()));
    let mut out = String::with_capacity(body.len() + 16_000);
    let mut closed: Vec<&str> = Vec::new();
    let mut rest = body;
    while let Some(at) = rest.find('<') {
        text(&mut out, &rest[..at], &mut unused, closed.is_empty());
        let end = rest[at..].find('>').map_or(rest.len(), |end| at + end + 1);
        follow(&rest[at + 1..end.max(at + 2) - 1], &mut closed);
        out.push_str(&rest[at..end]);
        rest = &rest[end..];
    }
    text(&mut out, rest, &mut unused, closed.is_empty());
    out
}

/// Tracks the elements in which no link is allowed; `tag` is the text between its angle brackets.
fn follow<'a>(tag: &'a str, closed: &mut Vec<&'a str>) {
    let name = |tag: &'a str| tag.split([' ', '/']).next().unwrap_or(tag);
    if let Some(ended) = tag.strip_prefix('/') {
        if closed.last() == Some(&ended) {
            closed.pop();
        }
        return;
    }
    let begins =
        |of: &str| tag.strip_prefix(of).is_some_and(|after| after.is_empty() || after.starts_with(' '));
    let again = closed.last() == Some(&name(tag));
    if again || (closed.is_empty() && CLOSED.into_iter().any(begins)) {
        closed.push(name(tag));
    }
}

/// One run of text, with its links and code.
fn text(out: &mut String, run: &str, unused: &mut Vec<Term>, open: bool) {
    let parts: Vec<&str> = run.split('`').collect();
    // an unpaired backtick does not mark code
    if parts.len().is_multiple_of(2) {
        return words(out, run, unused, open);
    }
    for (i, part) in parts.into_iter().enumerate() {
        if i % 2 == 0 {
            words(out, part, unused, open);
        } else {
            out.push_str("<code>");
            out.push_str(part);
            out.push_str("</code>");
        }
    }
}

fn words(out: &mut String, run: &str, unused: &mut Vec<Term>, open: bool) {
    if !open || unused.is_empty() {
        out.push_str(run);
        return;
    }
    let (mut before, mut skip) = (' ', 0);
    for (i, c) in run.char_indices() {
        if i < skip {
            before = c;
            continue;
        }
        let found = (!is_word(before))
            .then(|| unused.iter().enumerate().find_map(|(n, t)| Some((n, length(&run[i..], t.term)?))))
            .flatten();
        if let Some((n, length)) = found {
            let term = unused.remove(n);
            out.push_str(&term.link);
            out.push_str(&run[i..i + length]);
            out.push_str("</a>");
            skip = i + length;
        } else {
            out.push(c);
        }
        before = c;
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Number of bytes at the start of `run` that match this term or its plural; `None` without a
/// match.
fn length(run: &str, term: &str) -> Option<usize> {
    let mut letters = run.char_indices();
    let mut end = 0;
    for (n, wanted) in term.chars().enumerate() {
        let (at, found) = letters.next()?;
        let found = if found == '\u{a0}' { ' ' } else { found };
        let capital = n == 0 && wanted.to_uppercase().eq([found]);
        if found != wanted && !capital {
            return None;
        }
        end = at + run[at..].chars().next()?.len_utf8();
    }
    let after = &run[end..];
    let ends = |rest: &str| !rest.starts_with(is_word);
    match after.strip_prefix('s') {
        _ if ends(after) => Some(end),
        Some(rest) if ends(rest) => Some(end + 1),
        _ => None,
    }
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

#[cfg(test)]
mod glossary_html_tests {
    use super::*;

    #[test]
    fn every_term_has_one_place() {
        let mut anchors: Vec<String> = terms().map(|(term, _)| anchor(term)).collect();
        let all = anchors.len();
        anchors.sort();
        anchors.dedup();
        assert!(all > 12 && anchors.len() == all);
    }
}

#[cfg(test)]
mod linked_words_tests {
    use super::*;

    #[test]
    fn a_term_is_linked_where_it_is_used_first_and_nowhere_else() {
        let html = linked(
            "<h2>Coherence</h2><p class=\"FRF\">FRFs, k_T, c_Tx. Coherence; coherence</p><svg><text>IDM</text></svg><b>2\u{a0}IDMs</b>",
        );
        let link = |word: &str| format!("href=\"#word-{word}\"");
        assert_eq!(html.matches(&link("coherence")).count(), 1);
        assert!(html.contains(">Coherence</a>; coherence") && html.starts_with("<h2>Coherence</h2>"));
        assert!(html.contains(">FRFs</a>, ") && html.contains(">k_T</a>, c_Tx."), "{html}");
        assert!(html.contains("<text>IDM</text>") && html.contains("2\u{a0}<a class=\"word\""), "{html}");
    }

    #[test]
    fn commands_are_code() {
        assert_eq!(linked("<p>try `jointrig shaker` or `not</p>"), "<p>try `jointrig shaker` or `not</p>");
        assert_eq!(linked("<p>try `jointrig shaker`</p>"), "<p>try <code>jointrig shaker</code></p>");
    }
}

//! Links the first use of each glossary term in the page, and marks text between backticks as code.

use super::glossary_html::{anchor, terms};
use super::text::escaped;
use std::cmp::Reverse;

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

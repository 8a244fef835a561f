//! The glossary in the page, from the text of `docs/glossary.md`.

use super::text::{Html, escaped};

/// The glossary: `**term** — meaning`, one paragraph each.
const GLOSSARY: &str = include_str!("../../../../docs/glossary.md");

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

#[cfg(test)]
mod tests {
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

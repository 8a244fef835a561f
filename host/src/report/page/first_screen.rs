//! The first screen: what was measured, the answer, why its parts differ, which checks failed; with
//! one figure.

use super::figure_html;
use super::text::{Html, escaped};
use crate::report::figure::Figure;
use crate::report::figures::{Chapter, Entry};
use crate::report::words::number::{AnswerLine, UNKNOWN};
use crate::report::words::{self, answer_sentences, brief};
use crate::results::Results;

/// The answer next to its figure.
pub fn answer(html: &mut Html, results: &Results, drawn: &[(&Entry, Option<Figure>)]) {
    html.raw("<section id=\"answer\" class=\"first\"><div class=\"words\"><h1>How stiff is the contact in its sliding direction?</h1>");
    let mut lines = brief::answer(results);
    if lines.is_empty() {
        lines.extend(
            [
                words::substructuring(results),
                words::impact_loops(results),
                words::shaker_loops(results),
                words::levels_at_the_contact(results),
            ]
            .into_iter()
            .flatten()
            .map(AnswerLine::words),
        );
    }
    if lines.is_empty() {
        html.raw("<div class=\"found warn\"><p>No stiffness could be found from this file.</p></div>");
    } else {
        let known = lines.iter().any(|line| !line.text.starts_with(UNKNOWN) && !line.is_truth());
        html.raw(if known { "<div class=\"found\">" } else { "<div class=\"found warn\">" });
        for (i, line) in lines.iter().enumerate() {
            // a value that is not known is shown in normal size, with its reason
            let large = i == 0 && !line.head.is_empty() && !line.text.starts_with(UNKNOWN);
            html.raw(if large { "<p class=\"headline\">" } else { "<p>" });
            if !line.head.is_empty() {
                html.raw(&format!("<strong>{}</strong> ", escaped(&line.head)));
            }
            told(html, line);
            html.raw("</p>");
        }
        html.raw("</div>");
    }
    if let Some(why) = answer_sentences::why_they_differ(results) {
        html.raw("<p class=\"differ\">");
        told(html, &why);
        html.raw("</p>");
    }
    failed(html, results);
    missing(html, results);
    html.raw("</div>");
    for (_, figure) in drawn.iter().filter(|(entry, _)| entry.chapter == Chapter::Answer) {
        if let Some(figure) = figure {
            figure_html::figure(html, figure, 2);
        }
    }
    html.raw("</section>");
}

/// Number of missing items that are named on the first screen.
const NAMED: usize = 3;

fn missing(html: &mut Html, results: &Results) {
    if results.missing.is_empty() {
        return;
    }
    html.raw("<div class=\"found warn\"><h2><a href=\"#missing\">Missing</a></h2><ul>");
    for line in results.missing.iter().take(NAMED) {
        html.element("li", line);
    }
    if results.missing.len() > NAMED {
        html.element("li", &format!("and {} more", results.missing.len() - NAMED));
    }
    html.raw("</ul></div>");
}

/// A line's text, in which each number is marked with its path in `results.json`.
fn told(html: &mut Html, line: &AnswerLine) {
    let mut rest = escaped(&line.text);
    for (shown, place) in &line.numbers {
        let shown = escaped(shown);
        let Some(at) = rest.find(&shown) else { continue };
        html.raw(&rest[..at]);
        html.raw(&format!("<span data-path=\"{}\">{shown}</span>", escaped(place)));
        rest = rest.split_off(at + shown.len());
    }
    html.raw(&rest);
}

fn failed(html: &mut Html, results: &Results) {
    let failed: Vec<_> = results.checks.iter().filter(|c| c.ok == Some(false)).collect();
    if failed.is_empty() {
        return;
    }
    html.raw("<div class=\"found warn\"><h2>Look here</h2><ul>");
    for check in failed {
        html.raw(&format!("<li><a href=\"#check-{}\">", escaped(&check.name)));
        html.text(&brief::failed(check));
        html.raw("</a></li>");
    }
    html.raw("</ul></div>");
}

//! The page, in one HTML text without external resources: the first screen (what was measured, the
//! answer, why its parts differ, which checks failed; with one figure), then the chapters in the
//! order of the paper: figures and tables, missing figures with the data they need, and provenance.
//!
//! Content security policy: the page may run its one script, use its one style sheet, and load
//! nothing else.

use super::figure::{Figure, role};
use super::figures;
use super::html::{Html, escaped, linked, list};
use super::words::{answer_sentences, brief};
use crate::report::figures::{Chapter, Entry};
use crate::report::words::number::{AnswerLine, UNKNOWN};
use crate::report::{tables, words};
use crate::results::Results;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha2::{Digest, Sha256};

pub use comparison_page::comparison_page;
pub use trend_page::{trend_figure, trend_page};
mod comparison_page;
mod figure_html;
mod trend_page;

const STYLE: &str = include_str!("page.css");
const CHARTS_STYLE: &str = include_str!("../../../vendor/uplot/uPlot.min.css");
const CHARTS: &str = include_str!("../../../vendor/uplot/uPlot.iife.min.js");
/// The scripts that make figures interactive, in order of dependency.
const FIGURE_SCRIPTS: [&str; 7] = [
    include_str!("ticks.js"),
    include_str!("marks.js"),
    include_str!("pens.js"),
    include_str!("panel.js"),
    include_str!("scene.js"),
    include_str!("arms.js"),
    include_str!("figure.js"),
];
/// The script of the report page.
const PAGE_SCRIPT: &str = include_str!("page.js");

/// The whole report as HTML.
pub fn page(results: &Results) -> String {
    let drawn: Vec<_> = figures::ALL.iter().map(|entry| (entry, entry.of(results))).collect();
    let mut body = Html::default();
    contents(&mut body, results, &drawn);
    body.raw("<main>");
    first_screen(&mut body, results, &drawn);
    chapters(&mut body, results, &drawn);
    body.raw("</main>");
    let title = format!("Contact stiffness: {}", results.source.file);
    let figures = drawn.iter().filter_map(|(_, figure)| figure.as_ref());
    shell(&title, &brief::on_what(results), results.source.simulated, &body.finish(), figures)
}

/// A page around `body`: its policy, style, banner, the figures' data, and the script that makes
/// them interactive.
fn shell<'a>(
    title: &str,
    banner: &str,
    simulated: bool,
    body: &str,
    figures: impl Iterator<Item = &'a Figure>,
) -> String {
    let (style, script) = (chart_style(), script(PAGE_SCRIPT));
    let mut html = Html::default();
    html.raw("<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">");
    html.raw(&meta(&style, &script));
    html.element("title", title);
    html.raw(&format!("<style>{style}</style></head><body>"));
    html.raw(if simulated { "<header class=\"banner simulated\">" } else { "<header class=\"banner\">" });
    html.element("p", banner);
    html.raw("<div class=\"tools\" id=\"page-tools\"></div></header><div class=\"frame\">");
    html.raw(&linked(body));
    html.raw("</div>");
    figure_html::data(&mut html, figures);
    html.raw(&format!("<script>{script}</script></body></html>\n"));
    html.finish()
}

/// The script of a page with interactive figures, followed by `own`.
pub fn script(own: &str) -> String {
    format!(
        "{CHARTS}\n(()=>{{\"use strict\";\n{}ROLES={};\n{own}}})();\n",
        FIGURE_SCRIPTS.concat(),
        figure_html::roles()
    )
}

/// A figure as HTML: its panels as SVG, which a page's script replaces by interactive charts.
pub fn figure_fragment(figure: &Figure) -> String {
    let mut html = Html::default();
    figure_html::figure(&mut html, figure, 3);
    html.finish()
}

/// The style sheet with the colours of the roles in light and dark.
pub fn chart_style() -> String {
    let (light, dark) = (role::variables(false), role::variables(true));
    format!(
        "{CHARTS_STYLE}\n:root{{{light}}}\n@media(prefers-color-scheme:dark){{:root:not([data-light=light]){{{dark}}}}}\n:root[data-light=dark]{{{dark}}}\n\
         @media print{{:root:root:root{{{light}}}}}\n{}{STYLE}",
        role::classes()
    )
}

/// The policy as a meta element; the hashes are those of these texts.
pub fn meta(style: &str, script: &str) -> String {
    let hash = |text: &str| BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()));
    format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; img-src data: blob:\">",
        hash(script),
        hash(style)
    )
}

/// The answer next to its figure.
fn first_screen(html: &mut Html, results: &Results, drawn: &[(&Entry, Option<Figure>)]) {
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
    missing_briefly(html, results);
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

fn missing_briefly(html: &mut Html, results: &Results) {
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

type Drawn<'a> = [(&'a Entry, Option<Figure>)];

const CHAPTERS: [(Chapter, &str, &str); 6] = [
    (Chapter::SideBySide, "side-by-side", "What each measurement sees"),
    (Chapter::Joint, "joint", "Joint by substructuring"),
    (Chapter::Loops, "loops", "Contact by loops"),
    (Chapter::Modes, "modes", "Modes"),
    (Chapter::Measured, "measured", "What was measured"),
    (Chapter::Frfs, "frfs", "Frequency response functions"),
];

/// The list of chapters in the sidebar.
fn contents(html: &mut Html, results: &Results, drawn: &Drawn<'_>) {
    html.raw("<nav aria-label=\"contents\"><ul><li><a href=\"#answer\">The answer</a></li>");
    for (chapter, id, title) in CHAPTERS {
        if chapter_is_empty(results, chapter, drawn) {
            continue;
        }
        html.raw(&format!("<li><a href=\"#{id}\">{title}</a><ul>"));
        for figure in drawn.iter().filter(|(e, _)| e.chapter == chapter).filter_map(|(_, f)| f.as_ref()) {
            html.raw(&format!("<li><a href=\"#fig-{}\">", figure.name));
            html.text(&figure.title);
            html.raw("</a></li>");
        }
        html.raw("</ul></li>");
    }
    html.raw("<li><a href=\"#source\">Where it comes from</a></li><li><a href=\"#glossary\">Words</a></li></ul></nav>");
}

/// All chapters after the first screen.
fn chapters(html: &mut Html, results: &Results, drawn: &Drawn<'_>) {
    for (chapter, id, title) in CHAPTERS {
        if chapter_is_empty(results, chapter, drawn) {
            continue;
        }
        html.raw(&format!("<section id=\"{id}\"><h2>{title}</h2>"));
        let own = drawn.iter().filter(|(entry, _)| entry.chapter == chapter);
        for figure in own.filter_map(|(_, figure)| figure.as_ref()) {
            figure_html::figure(html, figure, 3);
            for table in tables_beside(results, figure.name).into_iter().flatten() {
                html.raw(&table);
            }
        }
        for line in absent(chapter, drawn) {
            html.element("p class=\"absent\"", &line);
        }
        for table in tables_of(results, chapter).into_iter().flatten() {
            html.raw(&table);
        }
        html.raw("</section>");
    }
    html.raw("<section id=\"source\"><h2>Where it comes from</h2>");
    html.raw(&tables::provenance(results));
    if let Some(table) = tables::calibrations(results) {
        html.raw(&table);
    }
    html.raw("</section><section id=\"glossary\"><h2>Words</h2>");
    list(html);
    html.raw("</section>");
}

/// Figures that cannot be drawn in a chapter, grouped by the data they need.
fn absent(chapter: Chapter, drawn: &Drawn<'_>) -> Vec<String> {
    let mut needs: Vec<(&str, Vec<&str>)> = Vec::new();
    for (entry, _) in drawn.iter().filter(|(entry, figure)| entry.chapter == chapter && figure.is_none()) {
        match needs.iter_mut().find(|(need, _)| *need == entry.needs) {
            Some((_, titles)) => titles.push(entry.title),
            None => needs.push((entry.needs, vec![entry.title])),
        }
    }
    needs.iter().map(|(need, titles)| format!("Not drawn (needs {need}): {}.", titles.join("; "))).collect()
}

fn chapter_is_empty(results: &Results, chapter: Chapter, drawn: &Drawn<'_>) -> bool {
    drawn.iter().all(|(entry, figure)| entry.chapter != chapter || figure.is_none())
        && tables_of(results, chapter).iter().all(Option::is_none)
}

/// Tables that accompany one figure.
fn tables_beside(results: &Results, figure: &str) -> Vec<Option<String>> {
    match figure {
        "comparison" => vec![tables::side_by_side(results)],
        "decay-loops" => vec![tables::decay(results)],
        "interface-modes" => vec![tables::virtual_points(results)],
        _ => Vec::new(),
    }
}

/// Tables of a whole chapter.
fn tables_of(results: &Results, chapter: Chapter) -> Vec<Option<String>> {
    match chapter {
        Chapter::Answer | Chapter::Frfs => Vec::new(),
        Chapter::Modes => vec![tables::modes(results)],
        Chapter::Measured => vec![tables::completeness(results), missing(results)],
        Chapter::SideBySide => vec![tables::checks(results)],
        Chapter::Joint => {
            vec![tables::recommended(results), tables::joint(results), tables::refusals(results)]
        }
        Chapter::Loops => {
            vec![tables::hysteresis(results), tables::static_arm(results), tables::wear(results)]
        }
    }
}

fn missing(results: &Results) -> Option<String> {
    if results.missing.is_empty() {
        return None;
    }
    let mut html = Html::default();
    html.raw("<h3 id=\"missing\">Missing</h3><ul class=\"notes\">");
    for line in &results.missing {
        html.element("li", line);
    }
    html.raw("</ul>");
    Some(html.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use base64::prelude::BASE64_STANDARD;
    use sha2::{Digest, Sha256};

    #[test]
    fn the_charts_are_the_ones_that_were_published() {
        let hash = |text: &str| {
            use std::fmt::Write;
            Sha256::digest(text.as_bytes()).iter().fold(String::new(), |mut hash, byte| {
                write!(hash, "{byte:02x}").expect("a String takes everything");
                hash
            })
        };
        let about = include_str!("../../../vendor/uplot/README.md");
        for file in [CHARTS, CHARTS_STYLE] {
            assert!(about.contains(&hash(file)), "a vendored file is not the one that its README names");
        }
    }

    #[test]
    fn the_policy_names_the_only_script_and_the_only_style() {
        let html = page(&crate::results::example_tests::results());
        for tag in ["script", "style"] {
            let from = html.find(&format!("<{tag}>")).expect(tag) + tag.len() + 2;
            let inside = &html[from..from + html[from..].find(&format!("</{tag}>")).expect(tag)];
            let hash = BASE64_STANDARD.encode(Sha256::digest(inside.as_bytes()));
            assert!(html.contains(&format!("{tag}-src 'sha256-{hash}'")), "{tag}");
            assert_eq!(html.matches(&format!("<{tag}>")).count(), 1);
        }
        assert!(!html.contains(" style=") && !html.contains(" onclick"));
    }
}

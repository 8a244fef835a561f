//! The chapters, in the order of the paper: figures and tables, missing figures with the data they
//! need, and provenance.

use super::figure_html;
use super::text;
use super::text::Html;
use crate::report::figure::Figure;
use crate::report::figures::{Chapter, Entry};
use crate::report::tables;
use crate::results::Results;

type Drawn<'a> = [(&'a Entry, Option<Figure>)];

const CHAPTERS: [(Chapter, &str, &str); 5] = [
    (Chapter::SideBySide, "side-by-side", "What each measurement sees"),
    (Chapter::Joint, "joint", "Joint by substructuring"),
    (Chapter::Loops, "loops", "Contact by loops"),
    (Chapter::Measured, "measured", "What was measured"),
    (Chapter::Frfs, "frfs", "Frequency response functions"),
];

/// The list of chapters in the sidebar.
pub fn contents(html: &mut Html, results: &Results, drawn: &Drawn<'_>) {
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
pub fn all(html: &mut Html, results: &Results, drawn: &Drawn<'_>) {
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
    text::list(html);
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
        Chapter::Measured => vec![tables::completeness(results), missing(results)],
        Chapter::SideBySide => vec![tables::checks(results)],
        Chapter::Joint => {
            vec![tables::recommended(results), tables::joint(results), tables::refusals(results)]
        }
        Chapter::Loops => vec![tables::hysteresis(results), tables::static_arm(results)],
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

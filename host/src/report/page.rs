//! The page: headline, figures and tables in one html text without anything from outside.

use super::drawing::escape;
use super::{figures, interface_tables, tables};
use crate::report::words;
use crate::results::Results;
use std::fmt::Write;

const STYLE: &str = include_str!("style.css");

/// The whole report as html.
pub fn page(results: &Results) -> String {
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Contact stiffness: {file}</title><style>{STYLE}</style></head><body><main>\
         <h1>Contact stiffness of the joint</h1><p class=\"sub\">{file}, computed by {name} {version}</p>",
        file = escape(&results.source.file),
        name = escape(&results.source.software.name),
        version = escape(&results.source.software.version),
    );
    headline(&mut html, results);
    section(
        &mut html,
        "What each measurement sees",
        &[
            figure(
                figures::comparison(results),
                "FBS takes the motion of the arms and moves it to the contact, so everything between arm and contact counts as part of the \
                 joint. The loops take the relative motion at the specimens. FBS: main band 300–600 Hz, scatter over lines; loops: scatter over cycles.",
            ),
            tables::side_by_side(results),
            tables::checks(results),
        ],
    );
    section(
        &mut html,
        "Joint by substructuring",
        &[
            figure(
                figures::joint_spectrum(results),
                "Real part of the joint's dynamic stiffness along the sliding direction. The main band is shaded, with the mean of each set of interface \
                 deformation modes (IDMs); values beyond the frame are cut.",
            ),
            interface_tables::recommended(results),
            tables::joint(results),
            refusals(results),
            figure(
                figures::interface_modes(results),
                "Singular values of Y(AJB) − Y(A) − Y(B) (CMIF, Eq. B.1): as many motions couple as curves stand clear of the rest.",
            ),
            interface_tables::virtual_points(results),
        ],
    );
    section(
        &mut html,
        "Contact by loops",
        &[
            figure(
                figures::contact_loop(results),
                "One impact in the assembly: the specimens' displacements (integrated velocity) and the sum of the load cells T. The slope of the first cycle holds \
                 every mode that the hit excites.",
            ),
            figure(figures::impacts(results), "Every hit that counts: along z on A or on the moving mass."),
            tables::decay(results),
            figure(
                figures::levels(results),
                "The shaker's levels. Round marks are slopes of straight loops between the spots, square ones k_eq of ellipses or of slip; full before the hammer's cells, hollow after them.",
            ),
            figure(
                figures::backbone(results),
                "The contact against amplitude where it slips. Left the slope of the stick part and the loop's peak secant, right the force at the loops' tips; the curves are \
                 the law of parallel sliders that fits the tips best.",
            ),
            figure(
                figures::shaker_loops(results),
                "Loops of the shaker, averaged over the record's cycles, and both specimens over one cycle. Beside a resonance of one specimen Δx leaves the phase of T, and the \
                 line opens to an ellipse.",
            ),
            tables::hysteresis(results),
            tables::static_arm(results),
            figure(
                figures::specimens(results),
                "Specimens A and B and both arms in the assembly, from one impact. A peak or a phase step that only one specimen has is a resonance of its clamp; loops near it are ellipses.",
            ),
            figure(
                figures::rebuilt(results),
                "The decay of both specimens after one hit, and the same put together from decaying sinusoids: the mode that all share, and for A the hidden resonance beside it.",
            ),
        ],
    );
    section(
        &mut html,
        "Frequency response functions",
        &[figure(
            figures::receptances(results),
            "Receptance by H1, its phase and coherence, at a driving point and across. The main band is shaded yellow; grey, where the hammer's force is \
             more than 6 dB down.",
        )],
    );
    section(&mut html, "What was measured", &[tables::completeness(results), missing(results)]);
    section(&mut html, "Where it comes from", &[Some(tables::provenance(results))]);
    html.push_str("</main></body></html>\n");
    html
}

fn headline(html: &mut String, results: &Results) {
    let mut found = words::answer_sentences::lines(results);
    found.extend(
        [
            words::substructuring(results),
            words::impact_loops(results),
            words::shaker_loops(results),
            words::levels_at_the_contact(results),
        ]
        .into_iter()
        .flatten(),
    );
    if found.is_empty() {
        put(
            html,
            format_args!(
                "<div class=\"found warn\"><p>No stiffness could be found from this file.</p></div>"
            ),
        );
    } else {
        paragraphs(html, "found", found.iter().map(String::as_str));
    }
    let failed: Vec<&str> =
        results.checks.iter().filter(|c| c.ok == Some(false)).map(|c| c.meaning.as_str()).collect();
    if !failed.is_empty() {
        paragraphs(html, "found warn", failed);
    }
}

fn paragraphs<'a>(html: &mut String, class: &str, lines: impl IntoIterator<Item = &'a str>) {
    put(html, format_args!("<div class=\"{class}\">"));
    for line in lines {
        put(html, format_args!("<p>{}</p>", escape(line)));
    }
    html.push_str("</div>");
}

fn section(html: &mut String, title: &str, parts: &[Option<String>]) {
    if parts.iter().all(Option::is_none) {
        return;
    }
    put(html, format_args!("<h2>{}</h2>", escape(title)));
    for part in parts.iter().flatten() {
        html.push_str(part);
    }
}

fn figure(svg: Option<String>, caption: &str) -> Option<String> {
    svg.map(|svg| format!("<figure>{svg}<figcaption>{}</figcaption></figure>", escape(caption)))
}

fn refusals(results: &Results) -> Option<String> {
    if results.refused.is_empty() {
        return None;
    }
    let mut html = String::from("<p>Not applicable to this data:</p><ul class=\"notes\">");
    for r in &results.refused {
        put(
            &mut html,
            format_args!("<li><b>{}, {} IDMs</b>: {}</li>", escape(&r.method), r.idms, escape(&r.reason)),
        );
    }
    html.push_str("</ul>");
    Some(html)
}

fn missing(results: &Results) -> Option<String> {
    if results.missing.is_empty() {
        return None;
    }
    let mut html = String::from("<p>Missing:</p><ul class=\"notes\">");
    for line in &results.missing {
        put(&mut html, format_args!("<li>{}</li>", escape(line)));
    }
    html.push_str("</ul>");
    Some(html)
}

fn put(html: &mut String, arguments: std::fmt::Arguments<'_>) {
    html.write_fmt(arguments).expect("writing into a String cannot fail");
}

//! The page: the answer, then figures and tables by chapter, in one HTML text without external
//! resources.
//!
//! Content security policy: the page may run its one script, use its one style sheet, and load
//! nothing else.

use super::figure::{Figure, role};
use super::figures;
use super::words::brief;
use crate::results::Results;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha2::{Digest, Sha256};

pub use comparison_page::comparison_page;
pub(super) use text::{Html, escaped};

mod chapters;
mod comparison_page;
mod figure_html;
mod first_screen;
mod text;

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
    chapters::contents(&mut body, results, &drawn);
    body.raw("<main>");
    first_screen::answer(&mut body, results, &drawn);
    chapters::all(&mut body, results, &drawn);
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
    html.raw(&text::linked(body));
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

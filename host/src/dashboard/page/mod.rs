//! What the browser gets: one page, one style sheet, one script, all of them part of the program.

use std::sync::LazyLock;

use crate::report;

/// The page without any data.
pub const HTML: &str = include_str!("live.html");

/// In the order in which they build on one another.
const SCRIPTS: [&str; 8] = [
    include_str!("link.js"),
    include_str!("picture.js"),
    include_str!("edit.js"),
    include_str!("scope.js"),
    include_str!("shaker.js"),
    include_str!("matrix.js"),
    include_str!("screens.js"),
    include_str!("live.js"),
];

/// The report's style, and what the live page adds.
pub fn style() -> &'static str {
    static STYLE: LazyLock<String> =
        LazyLock::new(|| format!("{}\n{}", report::chart_style(), include_str!("live.css")));
    &STYLE
}

/// The report's charts, and what the live page does with them: in a block of its own, so that no name of one means the other.
pub fn script() -> &'static str {
    static SCRIPT: LazyLock<String> =
        LazyLock::new(|| report::script(&format!("{{\n{}}}\n", SCRIPTS.concat())));
    &SCRIPT
}

#[cfg(test)]
#[path = "colour_tests.rs"]
mod colour_tests;

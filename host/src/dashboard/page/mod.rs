//! Content for the browser: one page, one style sheet and one script, all compiled into the
//! program.

use std::sync::LazyLock;

use crate::report;

/// The page without any data.
pub const HTML: &str = include_str!("live.html");

/// Scripts in the order of their dependencies.
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

/// The report's style sheet followed by that of the live page.
pub fn style() -> &'static str {
    static STYLE: LazyLock<String> =
        LazyLock::new(|| format!("{}\n{}", report::chart_style(), include_str!("live.css")));
    &STYLE
}

/// The report's script followed by that of the live page, which is in a separate block so that
/// names do not collide.
pub fn script() -> &'static str {
    static SCRIPT: LazyLock<String> =
        LazyLock::new(|| report::script(&format!("{{\n{}}}\n", SCRIPTS.concat())));
    &SCRIPT
}

#[cfg(test)]
#[path = "colour_tests.rs"]
mod colour_tests;

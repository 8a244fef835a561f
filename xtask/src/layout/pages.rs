//! The folders and files named in the overview pages exist.

use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// The pages, relative to the repository's root.
const PAGES: [&str; 3] = ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md"];
/// The folders with which a path may begin. Other paths are abbreviations relative to one of these,
/// or belong to the user.
const TOP: [&str; 9] =
    ["protocol", "firmware", "hil-sim", "host", "tests", "xtask", "docs", ".cargo", ".github"];

/// Checks every path; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let (mut number, mut missing) = (0, Vec::new());
    for page in PAGES {
        let text = std::fs::read_to_string(project.root.join(page))
            .with_context(|| format!("could not read {page}"))?;
        for path in paths(&text) {
            number += 1;
            if !project.root.join(path).exists() {
                missing.push(format!("{page} names {path}"));
            }
        }
    }
    if missing.is_empty() {
        return Ok(format!("{number} paths are there"));
    }
    bail!("{}, which is not there", missing.join(", "))
}

/// Texts between backticks, or link targets, that begin with one of the folders.
fn paths(text: &str) -> Vec<&str> {
    text.split(['`', '(', ')'])
        .map(|part| part.split('#').next().unwrap_or(part))
        .filter(|part| part.contains('/') && !part.contains(char::is_whitespace))
        .filter(|part| {
            Path::new(part)
                .components()
                .next()
                .is_some_and(|first| TOP.iter().any(|top| first.as_os_str() == *top))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_found_in_words_and_links() {
        let text = "see `host/src/cli/` and [rigs](hil-sim/rigs#x); `cargo run host/src`, `word/s`, and/or `docs/a.md`";
        assert_eq!(paths(text), ["host/src/cli/", "hil-sim/rigs", "docs/a.md"]);
    }
}

//! The pages that say where things are name folders and files that are there.

use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// The pages, from the repository's root.
const PAGES: [&str; 3] = ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md"];
/// Where a path may begin. Others are short for what stands beside one of these, or are a user's.
const TOP: [&str; 9] =
    ["protocol", "firmware", "hil-sim", "host", "tests", "xtask", "docs", ".cargo", ".github"];

/// Follows every path; returns a remark.
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

/// What stands between backticks, or is linked to, and begins with one of the folders.
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

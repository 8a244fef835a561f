//! The messages quoted on the troubleshooting page are those of the program.
#![allow(clippy::unwrap_used)]

use std::path::Path;

const PAGE: &str = include_str!("../../../docs/troubleshooting.md");

/// All sources below a folder, with continued strings joined.
fn sources(folder: &Path) -> String {
    let mut all = String::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all += &sources(&path);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            let mut parts = text.split("\\\n");
            all += parts.next().unwrap();
            for part in parts {
                all += part.trim_start();
            }
        }
    }
    all
}

#[test]
fn every_quoted_sentence_is_in_the_program() {
    let host = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host");
    let said = sources(&host.join("src")) + &sources(&host.join("analysis/src"));
    let rows: Vec<&str> = PAGE.lines().filter(|line| line.starts_with("| `")).collect();
    assert!(rows.len() > 30, "{}", rows.len());
    for row in rows {
        let quoted = row.split('`').nth(1).unwrap();
        for part in quoted.split('…').map(str::trim).filter(|part| !part.is_empty()) {
            assert!(said.contains(part), "`{part}` of `{quoted}` is said nowhere");
        }
    }
}

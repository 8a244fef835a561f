//! The two lock files agree on every crate they share: firmware tested on a PC is the firmware on
//! the board.
//!
//! A crate may appear in several versions in one lock. The workspaces agree on a crate if, for
//! every compatible range (with the same first non-zero number) that both contain, the versions are
//! the same; `0.9.3` in one and only `1.0.0` in the other are different ranges, which are not
//! compared.

use anyhow::{Context, Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The versions of each crate, by name and compatible range.
type Versions = BTreeMap<(String, String), BTreeSet<String>>;

/// Compares two lock files, and fails with the names of the crates on which they differ.
pub fn compare(one: &Path, other: &Path) -> Result<()> {
    let differences = differences(&read(one)?, &read(other)?);
    if differences.is_empty() {
        return Ok(());
    }
    bail!(
        "{} and {} differ on: {}. Bring them together with `cargo update --package <crate> --precise <version>` in \
         one of the two folders",
        one.display(),
        other.display(),
        differences.join(", ")
    )
}

fn read(path: &Path) -> Result<Versions> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("could not read {}: run `cargo generate-lockfile` beside it", path.display())
    })?;
    parse(&text).with_context(|| format!("{} is not a lock file", path.display()))
}

fn parse(text: &str) -> Result<Versions> {
    let lock: toml::Table = text.parse()?;
    let mut versions = Versions::new();
    for package in lock.get("package").and_then(toml::Value::as_array).context("it has no packages")? {
        // Packages without a source are members of the workspaces.
        if package.get("source").is_none() {
            continue;
        }
        let text = |field: &str| {
            package
                .get(field)
                .and_then(toml::Value::as_str)
                .with_context(|| format!("a package has no {field}"))
        };
        let (name, version) = (text("name")?.to_owned(), text("version")?.to_owned());
        versions.entry((name, compatible_range(&version))).or_default().insert(version);
    }
    Ok(versions)
}

fn differences(one: &Versions, other: &Versions) -> Vec<String> {
    let list = |versions: &BTreeSet<String>| versions.iter().cloned().collect::<Vec<_>>().join(" and ");
    one.iter()
        .filter_map(|(key, here)| {
            let there = other.get(key)?;
            (here != there).then(|| format!("{} ({} and {})", key.0, list(here), list(there)))
        })
        .collect()
}

/// The part of a version that cargo treats as incompatible when it changes: `1.x`, `0.9.x`,
/// `0.0.3`.
fn compatible_range(version: &str) -> String {
    let mut range = Vec::new();
    for number in version.split(['.', '-', '+']).take(3) {
        range.push(number);
        if number != "0" {
            break;
        }
    }
    range.join(".")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lock(packages: &[(&str, &str)]) -> Versions {
        let mut text = "version = 4\n[[package]]\nname = \"own\"\nversion = \"0.1.0\"\n".to_owned();
        for (name, version) in packages {
            text.push_str(
                &["[[package]]\nname = \"", name, "\"\nversion = \"", version, "\"\nsource = \"r\"\n"]
                    .concat(),
            );
        }
        parse(&text).expect("a lock file")
    }

    #[test]
    fn equal_versions_agree_and_crates_of_one_side_do_not_matter() {
        let one = lock(&[("postcard", "1.1.3"), ("clap", "4.6.7")]);
        let other = lock(&[("postcard", "1.1.3"), ("cortex-m", "0.7.10")]);
        assert!(differences(&one, &other).is_empty());
    }

    #[test]
    fn a_shared_crate_with_two_versions_is_named() {
        let one = lock(&[("postcard", "1.1.3"), ("heapless", "0.9.3")]);
        let other = lock(&[("postcard", "1.1.2"), ("heapless", "0.9.3")]);
        assert_eq!(differences(&one, &other), ["postcard (1.1.3 and 1.1.2)"]);
    }

    #[test]
    fn incompatible_versions_are_different_crates() {
        let one = lock(&[("bitflags", "2.9.0")]);
        let other = lock(&[("bitflags", "1.3.2"), ("bitflags", "2.9.0")]);
        assert!(differences(&one, &other).is_empty());
    }

    #[test]
    fn ranges_follow_cargo() {
        assert_eq!(compatible_range("1.2.3"), "1");
        assert_eq!(compatible_range("0.9.3"), "0.9");
        assert_eq!(compatible_range("0.0.3"), "0.0.3");
    }

    #[test]
    fn a_missing_or_broken_lock_says_so() {
        assert!(parse("version = 4").is_err());
        let message = format!("{:#}", read(Path::new("/nowhere/Cargo.lock")).expect_err("no such file"));
        assert!(
            message.starts_with("could not read /nowhere/Cargo.lock: run `cargo generate-lockfile`"),
            "{message}"
        );
    }
}

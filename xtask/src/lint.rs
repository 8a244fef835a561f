//! Formatting and lints in both workspaces, and the comparison of their lock files, which agree on
//! every crate they share: firmware tested on a PC is the firmware on the board.
//!
//! A crate may appear in several versions in one lock. The workspaces agree on a crate if, for
//! every compatible range (with the same first non-zero number) that both contain, the versions are
//! the same; `0.9.3` in one and only `1.0.0` in the other are different ranges, which are not
//! compared.

use crate::packages::Consent;
use crate::project::{Project, TARGET};
use crate::{command, setup};
use anyhow::{Context, Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// `cargo xtask fmt-check`.
pub fn formatting(project: &Project) -> Result<()> {
    let boards = project.boards_root();
    for folder in [Some(project.root.clone()), boards].into_iter().flatten() {
        command::run(command::cargo(&folder).args(["fmt", "--all", "--check"]))
            .with_context(|| format!("not formatted: run `cargo fmt --all` in {}", folder.display()))?;
    }
    Ok(())
}

/// `cargo xtask lint`.
pub fn all(project: &Project) -> Result<()> {
    workspace(project)?;
    let Some(folder) = project.boards_root() else { return Ok(()) };
    compare_locks(&project.root.join("Cargo.lock"), &folder.join("Cargo.lock"))?;
    boards(project, &folder)
}

/// Clippy on the root workspace. It uses the release profile, like the tests: the required build
/// scripts (including SQLite's C code) then run once for both.
fn workspace(project: &Project) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["clippy", "--workspace", "--all-targets", "--release"]);
    // with the table of speed, which no other step builds
    cargo.args(["--features", "jointrig-benches/table", "--", "-Dwarnings"]);
    command::run(&mut cargo)
        .context("clippy found something: each finding above names its file and its remedy")?;
    // The published crates once more as external users build them: the workspace above enables
    // their features.
    let mut alone = command::cargo(&project.root);
    alone.args(["clippy", "--package", "jointrig-analysis", "--package", "jointrig-uff", "--all-targets"]);
    alone.args(["--release", "--", "-Dwarnings"]);
    command::run(&mut alone).context("clippy found something in a crate without its features")
}

/// Clippy on each board, with the compiler that builds it.
fn boards(project: &Project, folder: &Path) -> Result<()> {
    let toolchain = setup::target(project, Consent::new(false))?;
    for board in project.boards()? {
        let selection = ["--release", "--target", TARGET, "--package", &board.name];
        let mut clippy = toolchain.clippy(folder, project, &selection);
        command::run(&mut clippy)
            .with_context(|| format!("clippy found something in the board {}", board.name))?;
    }
    Ok(())
}

/// The versions of each crate, by name and compatible range.
type Versions = BTreeMap<(String, String), BTreeSet<String>>;

/// Compares two lock files, and fails with the names of the crates on which they differ.
fn compare_locks(one: &Path, other: &Path) -> Result<()> {
    let differences = differences(&read_lock(one)?, &read_lock(other)?);
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

fn read_lock(path: &Path) -> Result<Versions> {
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
        let message = format!("{:#}", read_lock(Path::new("/nowhere/Cargo.lock")).expect_err("no such file"));
        assert!(
            message.starts_with("could not read /nowhere/Cargo.lock: run `cargo generate-lockfile`"),
            "{message}"
        );
    }
}

//! Formatting and lints, in both workspaces.

use crate::consent::Consent;
use crate::project::{Project, TARGET};
use crate::{command, locks, setup};
use anyhow::{Context, Result};
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
    locks::compare(&project.root.join("Cargo.lock"), &folder.join("Cargo.lock"))?;
    boards(project, &folder)
}

/// Clippy on the root workspace. It uses the release profile, like the tests: the required build
/// scripts (including SQLite's C code) then run once for both.
fn workspace(project: &Project) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["clippy", "--workspace", "--all-targets", "--release", "--", "-Dwarnings"]);
    command::run(&mut cargo)
        .context("clippy found something: each finding above names its file and its remedy")?;
    // code that no other step builds, and that would otherwise not be checked
    let mut table = command::cargo(&project.root);
    table.args([
        "clippy",
        "--package",
        "jointrig-benches",
        "--features",
        "table",
        "--release",
        "--",
        "-Dwarnings",
    ]);
    command::run(&mut table).context("clippy found something in the table of speed")?;
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

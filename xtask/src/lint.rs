//! Formatting and lints, in both workspaces.

use crate::consent::Consent;
use crate::project::Project;
use crate::toolchain::{TARGET, Toolchain};
use crate::{command, locks, setup};
use anyhow::{Context, Result};

/// `cargo xtask fmt-check`.
pub fn formatting(project: &Project) -> Result<()> {
    let boards = project.boards_root();
    for folder in [Some(project.root.clone()), boards].into_iter().flatten() {
        command::run(command::cargo(&folder).args(["fmt", "--all", "--check"]))
            .with_context(|| format!("not formatted: run `cargo fmt --all` in {}", folder.display()))?;
    }
    Ok(())
}

/// `cargo xtask lint`: returns what was left out, if anything.
pub fn all(project: &Project) -> Result<Option<String>> {
    workspace(project)?;
    let Some(folder) = project.boards_root() else { return Ok(None) };
    locks::compare(&project.root.join("Cargo.lock"), &folder.join("Cargo.lock"))?;
    let toolchain = setup::target(project, Consent::new(false))?;
    boards(project, &toolchain)
}

/// Clippy on the root workspace. It runs in the release profile, like the tests: the build scripts it needs (SQLite's
/// C code among them) then run once for both.
fn workspace(project: &Project) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["clippy", "--workspace", "--all-targets", "--release", "--", "-Dwarnings"]);
    command::run(&mut cargo)
        .context("clippy found something: each finding above names its file and its remedy")
}

fn boards(project: &Project, toolchain: &Toolchain) -> Result<Option<String>> {
    if !toolchain.has_clippy() {
        let note =
            "no clippy for the boards: the distribution's compiler has none (their build denies warnings)";
        println!("  {note}");
        return Ok(Some(note.to_owned()));
    }
    let folder = project.boards_root().context("the boards' workspace vanished")?;
    for board in project.boards()? {
        let mut cargo = command::cargo(&folder);
        toolchain.apply(&mut cargo, project);
        cargo.args(["clippy", "--release", "--target", TARGET, "--package", &board.name, "--", "-Dwarnings"]);
        command::run(&mut cargo)
            .with_context(|| format!("clippy found something in the board {}", board.name))?;
    }
    Ok(None)
}

//! Compiling for the microcontroller: the two `no_std` libraries, and the board images.
//!
//! Boards are built one at a time, because cargo would unify the features of all that are built
//! together, and the boards' chip features exclude each other.

use crate::consent::Consent;
use crate::project::{EMULATED_BOARD, EMULATED_CHECKS, Package, Project, TARGET};
use crate::toolchain::Toolchain;
use crate::{command, flat, sbom, setup, size};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};

/// The libraries that run on the microcontroller.
const LIBRARIES: [&str; 2] = ["jointrig-protocol", "jointrig-firmware"];

/// `cargo xtask firmware`.
pub fn command(project: &Project, only: Option<&str>) -> Result<()> {
    let boards = project.boards()?;
    if let Some(name) = only
        && !boards.iter().any(|board| board.name == name)
    {
        bail!("no board is called {name}: firmware/boards has {}", names(&boards));
    }
    let toolchain = setup::target(project, Consent::new(false))?;
    if boards.is_empty() {
        println!("  firmware/boards does not exist yet, so there is no image to build");
        return check(project, &toolchain);
    }
    build_boards(project, &toolchain, only)
}

/// Compiles the two libraries for the microcontroller, which verifies that they need neither `std`
/// nor anything else that the microcontroller lacks. The log uses `defmt` there, so that feature is
/// enabled for packages that have it. Machine code is generated only for the boards, which use a
/// different profile.
pub fn check(project: &Project, toolchain: &Toolchain) -> Result<()> {
    for name in LIBRARIES {
        let package =
            project.package(name).with_context(|| format!("the workspace has no package {name}"))?;
        let mut cargo = command::cargo(&project.root);
        toolchain.apply(&mut cargo, project);
        cargo.args(["check", "--release", "--target", TARGET, "--package", name, "--no-default-features"]);
        if package.features.iter().any(|feature| feature == "defmt") {
            cargo.args(["--features", "defmt"]);
        }
        command::run(&mut cargo).with_context(|| format!("{name} does not compile for {TARGET}"))?;
    }
    Ok(())
}

/// Builds all boards, or only the named one, prints a table of their sizes, and fails if one
/// exceeds its flash limit.
pub fn build_boards(project: &Project, toolchain: &Toolchain, only: Option<&str>) -> Result<()> {
    let (mut sizes, mut images) = (Vec::new(), Vec::new());
    for board in project.boards()?.iter().filter(|board| only.is_none_or(|name| board.name == name)) {
        let image = build_board(project, toolchain, &board.name)?;
        sizes.push((board.name.clone(), size::of_image(&image)?));
        if board.name != EMULATED_BOARD {
            images.push(flat::write(&image)?);
            if let Some(root) = project.boards_root() {
                println!("  what it is made of: {}", sbom::of_board(&root, &board.name, &image)?.display());
            }
        }
    }
    print!("\n{}", size::table(&sizes));
    for (file, first) in images {
        println!(
            "{}, from {first:#010x} on: to be flashed without Rust (docs/first-light.md)",
            file.display()
        );
    }
    size::enforce(&sizes)
}

/// Builds one board's image and returns its path.
pub fn build_board(project: &Project, toolchain: &Toolchain, name: &str) -> Result<PathBuf> {
    build_binary(project, toolchain, name, name)
}

/// Builds the emulated board's image with the golden vectors and the benchmark, and returns its
/// path.
pub fn build_checks(project: &Project, toolchain: &Toolchain) -> Result<PathBuf> {
    build_binary(project, toolchain, EMULATED_BOARD, EMULATED_CHECKS)
}

/// Builds one binary of a board; the board's own image is the binary with the board's name.
fn build_binary(project: &Project, toolchain: &Toolchain, name: &str, binary: &str) -> Result<PathBuf> {
    let missing = || format!("no board is called {name} in firmware/boards, with a binary {binary}");
    let folder = project.boards_root().with_context(missing)?;
    let board = board(project, name)?.with_context(missing)?;
    let binary = board.binaries.iter().find(|known| *known == binary).with_context(missing)?;
    let mut cargo = command::cargo(&folder);
    toolchain.apply(&mut cargo, project);
    cargo.args(["build", "--release", "--target", TARGET, "--package", name, "--bin", binary]);
    command::run(&mut cargo).with_context(|| format!("the image of {name} could not be built"))?;
    let image = project.firmware_target().join(TARGET).join("release").join(binary);
    keep_log_table(project, &image)?;
    Ok(image)
}

/// Stores a copy of the image under its build id, by which a host finds the strings of the log
/// messages: a controller may run a build older than the newest one here.
fn keep_log_table(project: &Project, image: &Path) -> Result<()> {
    let folder = project.target.join(jointrig_logs::FOLDER);
    let bytes = std::fs::read(image).with_context(|| format!("could not read {}", image.display()))?;
    let Some(build) = jointrig_logs::build_id(&bytes) else {
        bail!("{} has no build id: its build.rs must link with build-id.x and --build-id", image.display());
    };
    let table = folder.join(jointrig_logs::file_name(build));
    std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&table, bytes))
        .with_context(|| format!("could not keep the log strings in {}", table.display()))
}

/// One board, if it exists.
pub fn board(project: &Project, name: &str) -> Result<Option<Package>> {
    Ok(project.boards()?.into_iter().find(|board| board.name == name))
}

fn names(boards: &[Package]) -> String {
    if boards.is_empty() {
        return "no boards yet".to_owned();
    }
    boards.iter().map(|board| board.name.as_str()).collect::<Vec<_>>().join(", ")
}

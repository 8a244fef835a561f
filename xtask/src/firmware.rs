//! Compiling for the microcontroller: the two `no_std` libraries, and the board images, each also
//! as a flat file: the bytes of the flash, for boards that are flashed as a USB drive or by the
//! loader in ROM. And writing the image to the rig's controller.
//!
//! Boards are built one at a time, because cargo would unify the features of all that are built
//! together, and the boards' chip features exclude each other.

use crate::packages::Consent;
use crate::project::{EMULATED_BOARD, EMULATED_CHECKS, Package, Project, TARGET, WIRED_BOARD};
use crate::setup::Toolchain;
use crate::{command, sbom, setup, size};
use anyhow::{Context, Result, bail};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, elf};
use std::path::{Path, PathBuf};
use std::process::Command;

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
            images.push(write_flat(&image)?);
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
    let image = image_of(project, binary);
    keep_log_table(project, &image)?;
    Ok(image)
}

/// Where a board's image is built.
pub fn image_of(project: &Project, binary: &str) -> PathBuf {
    project.firmware_target().join(TARGET).join("release").join(binary)
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

/// Value of erased flash bytes.
const ERASED: u8 = 0xFF;

/// Maximum distance between two parts of one image, bytes: more than the size of any flash.
const LARGEST: usize = 16 << 20;

/// Writes the flash's bytes next to the image as `.bin`; returns the file and the address of its
/// first byte.
fn write_flat(image: &Path) -> Result<(PathBuf, u64)> {
    let bytes = std::fs::read(image).with_context(|| format!("could not read {}", image.display()))?;
    let (first, flat) =
        flat_image(&bytes).with_context(|| format!("{} cannot be flattened", image.display()))?;
    let file = image.with_extension("bin");
    std::fs::write(&file, flat).with_context(|| format!("could not write {}", file.display()))?;
    Ok((file, first))
}

/// The address of the first loaded segment, and the bytes of all segments at their physical
/// addresses.
fn flat_image(image: &[u8]) -> Result<(u64, Vec<u8>)> {
    let file = ElfFile32::<Endianness>::parse(image)?;
    let endian = Endianness::Little;
    let mut parts = Vec::new();
    for segment in file.elf_program_headers() {
        let data = segment.data(endian, image).ok().context("a segment lies outside the file")?;
        if segment.p_type(endian) == elf::PT_LOAD && !data.is_empty() {
            parts.push((u64::from(segment.p_paddr(endian)), data));
        }
    }
    parts.sort_by_key(|(at, _)| *at);
    let first = parts.first().context("nothing in it is loaded")?.0;
    let mut flat = Vec::new();
    for (at, data) in parts {
        let from = usize::try_from(at - first)?;
        if from < flat.len() || from > LARGEST {
            bail!("its part at {at:#010x} overlaps another or lies far from the first, at {first:#010x}");
        }
        flat.resize(from, ERASED);
        flat.extend_from_slice(data);
    }
    Ok((first, flat))
}

/// The chip of the rig's controller, as probe-rs names it.
const CHIP: &str = "STM32U5A5ZJTxQ";

/// `cargo xtask flash`: with `detach`, returns once the image is written; otherwise stays attached
/// and shows the board's log.
pub fn flash(project: &Project, detach: bool) -> Result<()> {
    // Everything that is missing is reported together, before anything is built.
    let mut missing = Vec::new();
    if board(project, WIRED_BOARD)?.is_none() {
        missing.push(format!("there is no board image: firmware/boards/{WIRED_BOARD} does not exist yet"));
    }
    let probe = command::find_program("probe-rs");
    if probe.is_none() {
        missing.push(
            "probe-rs is not installed: run `cargo install probe-rs-tools --locked` (on Linux it also needs the udev \
             rules of https://probe.rs/docs/getting-started/probe-setup/)"
                .to_owned(),
        );
    }
    let (Some(probe), true) = (probe, missing.is_empty()) else {
        bail!("cannot flash:\n  - {}", missing.join("\n  - "));
    };
    let toolchain = setup::target(project, Consent::new(false))?;
    let image = build_board(project, &toolchain, WIRED_BOARD)?;
    let mut command = Command::new(probe);
    command.args([if detach { "download" } else { "run" }, "--chip", CHIP]).arg(image);
    command::run(&mut command).context(
        "probe-rs could not write the image: is the board connected by its ST-LINK socket, and powered?",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 32-bit image with these segments: (virtual address, physical address, bytes, size in
    /// memory).
    fn image(segments: &[(u32, u32, &[u8], u32)]) -> Vec<u8> {
        let mut out = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let half =
            |out: &mut Vec<u8>, values: &[u16]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        let word =
            |out: &mut Vec<u8>, values: &[u32]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        half(&mut out, &[2, 40]);
        word(&mut out, &[1, 0, 52, 0, 0]);
        half(&mut out, &[52, 32, segments.len() as u16, 40, 0, 0]);
        let mut at = 52 + 32 * segments.len() as u32;
        for (virtual_address, physical, data, memory) in segments {
            word(&mut out, &[1, at, *virtual_address, *physical, data.len() as u32, *memory, 5, 4]);
            at += data.len() as u32;
        }
        for (_, _, data, _) in segments {
            out.extend_from_slice(data);
        }
        out
    }

    #[test]
    fn segments_stand_at_their_physical_addresses() {
        let text = (0x0800_0000, 0x0800_0000, &b"text"[..], 4);
        // initialised data is in RAM and is loaded from the flash after the text; uninitialised RAM
        // is not in the file
        let data = (0x2000_0000, 0x0800_0008, &b"data"[..], 4);
        let bss = (0x2000_0004, 0x2000_0004, &b""[..], 64);
        let (first, flat) = flat_image(&image(&[data, text, bss])).expect("an image");
        assert_eq!((first, flat.as_slice()), (0x0800_0000, &b"text\xFF\xFF\xFF\xFFdata"[..]));
    }

    #[test]
    fn what_is_no_flash_is_refused() {
        let far = image(&[(0x1000_0000, 0x1000_0000, b"a", 1), (0x3800_0000, 0x3800_0000, b"b", 1)]);
        assert!(flat_image(&far).is_err_and(|error| error.to_string().contains("0x38000000")));
        let twice = image(&[(0, 0, b"abcd", 4), (2, 2, b"efgh", 4)]);
        assert!(flat_image(&twice).is_err());
        assert!(flat_image(&image(&[])).is_err() && flat_image(b"no image").is_err());
    }
}

//! `cargo xtask setup`: installs once what the machine needs in addition to a Rust compiler: the
//! emulator, the browser, and a compiler for the microcontroller.
//!
//! For the last, rustup provides the target's precompiled `core`: `rustup target add` is enough if
//! rustup can download. If it cannot (only package mirrors, or no rustup at all), Debian's compiler
//! builds `core` from its own sources once; see [`crate::sysroot`]. The variable [`MODE_VARIABLE`]
//! selects the way.

use crate::packages::Consent;
use crate::project::{Project, TARGET};
use crate::sysroot::Sysroot;
use crate::{command, packages, sysroot};
use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;

/// The available choice, shown by `--help`.
pub const ENVIRONMENT_HELP: &str = "\
JOINTRIG_FIRMWARE_TOOLCHAIN chooses the compiler for the microcontroller:
  auto    (default) what is installed; else `rustup target add`; else the distribution
  rustup  rustup's target only
  distro  Debian's rustc-web, rust-web-src and rust-web-clippy; core is built once into a private sysroot";

/// Makes the target, the emulator and the browser available, and returns the compiler for the
/// target.
pub fn everything(project: &Project, consent: Consent) -> Result<Toolchain> {
    let toolchain = target(project, consent)?;
    packages::ensure_emulator(consent)?;
    packages::ensure_browser(consent)?;
    Ok(toolchain)
}

/// Makes the target available.
pub fn target(project: &Project, consent: Consent) -> Result<Toolchain> {
    ensure(project, Mode::from_environment()?, consent)
}

/// The environment variable that selects the [`Mode`].
pub const MODE_VARIABLE: &str = "JOINTRIG_FIRMWARE_TOOLCHAIN";

/// How the target is made available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// An existing toolchain; otherwise rustup; otherwise the distribution.
    Auto,
    /// Only rustup's target.
    Rustup,
    /// Only the distribution's compiler and sources.
    Distro,
}

impl FromStr for Mode {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "" | "auto" => Ok(Self::Auto),
            "rustup" => Ok(Self::Rustup),
            "distro" => Ok(Self::Distro),
            other => bail!("{MODE_VARIABLE}={other} is not known: use auto, rustup or distro"),
        }
    }
}

impl Mode {
    /// The mode set in the environment; `auto` if it is not set.
    pub fn from_environment() -> Result<Self> {
        let value = std::env::var_os(MODE_VARIABLE).unwrap_or_default();
        value.to_string_lossy().parse()
    }
}

/// A compiler that can build for [`TARGET`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Toolchain {
    /// The compiler that cargo uses by default has the target.
    Installed,
    /// The distribution's compiler with this private sysroot.
    Private {
        /// The sysroot; a wrapper in it replaces `rustc`.
        sysroot: PathBuf,
    },
}

impl Toolchain {
    /// Makes a cargo command compile with this toolchain, into the firmware's own target directory.
    pub fn apply(&self, command: &mut Command, project: &Project) {
        command.env("CARGO_TARGET_DIR", project.firmware_target());
        command.env("CARGO_ENCODED_RUSTFLAGS", short_paths(&project.root).join("\x1f"));
        if let Self::Private { sysroot } = self {
            command.env("RUSTC", sysroot::wrapper(sysroot));
            // These would be rustup's, and would belong to a compiler of another version.
            command.env_remove("RUSTC_WRAPPER").env_remove("RUSTC_WORKSPACE_WRAPPER");
        }
    }

    /// The command that runs this toolchain's clippy on `selection`, with warnings as errors.
    pub fn clippy(&self, folder: &Path, project: &Project, selection: &[&str]) -> Command {
        let mut command = command::cargo(folder);
        self.apply(&mut command, project);
        match self {
            Self::Installed => command.arg("clippy").args(selection).args(["--", "-Dwarnings"]),
            // `cargo clippy` would start rustup's clippy, which cannot read another compiler's
            // libraries: this does what it does internally, with the distribution's clippy.
            Self::Private { sysroot } => command
                .env("RUSTC_WORKSPACE_WRAPPER", sysroot::CLIPPY)
                .env("SYSROOT", sysroot)
                .env("CLIPPY_ARGS", "-Dwarnings")
                .arg("check")
                .args(selection),
        };
        command
    }
}

/// Shortens source paths to start from their package or the repository. A panic stores a file's
/// name and line, so every path is in the flash, and the size of an image would depend on the
/// folder in which it is built.
fn short_paths(root: &Path) -> Vec<String> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    // one folder per registry; none before the first download, and then the paths are long for one
    // build
    let registries = home.and_then(|home| std::fs::read_dir(home.join("registry/src")).ok());
    let folders = registries.into_iter().flatten().flatten().map(|entry| entry.path());
    folders
        .chain([root.to_path_buf()])
        .map(|folder| format!("--remap-path-prefix={}/=", folder.display()))
        .collect()
}

/// The ways to obtain the target, in the order in which they are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Installed,
    EarlierSysroot,
    RustupAdd,
    Distro,
}

/// The ways to try, in order, given those this machine offers. Nothing is downloaded if a working
/// toolchain is already installed, and an explicit mode never falls back to another.
fn ways(mode: Mode, offered: &[Way]) -> Vec<Way> {
    match mode {
        Mode::Distro => vec![Way::Distro],
        Mode::Auto | Mode::Rustup if offered.contains(&Way::Installed) => vec![Way::Installed],
        Mode::Rustup => vec![Way::RustupAdd],
        Mode::Auto if offered.contains(&Way::EarlierSysroot) => vec![Way::EarlierSysroot],
        Mode::Auto => [Way::RustupAdd, Way::Distro]
            .into_iter()
            .filter(|downloading| offered.contains(downloading))
            .collect(),
    }
}

/// The ways this machine offers for `mode`.
fn offered(project: &Project, mode: Mode) -> Result<Vec<Way>> {
    let mut offered = Vec::new();
    offered.extend((mode != Mode::Distro && target_installed()).then_some(Way::Installed));
    offered
        .extend((mode == Mode::Auto && sysroot::existing(project)?.is_some()).then_some(Way::EarlierSysroot));
    offered.extend(command::find_program("rustup").map(|_| Way::RustupAdd));
    offered.extend(packages::available().then_some(Way::Distro));
    Ok(offered)
}

/// Makes the target available and returns the compiler for it, printing at each step what it does
/// and why.
pub fn ensure(project: &Project, mode: Mode, consent: Consent) -> Result<Toolchain> {
    let mut failures = Vec::new();
    for way in ways(mode, &offered(project, mode)?) {
        match attempt(way, project, mode, consent) {
            Ok(toolchain) => return Ok(toolchain),
            Err(error) => {
                println!("  that did not work: {error:#}");
                failures.push(format!("{error:#}"));
            }
        }
    }
    if failures.is_empty() {
        failures.push("this machine has neither rustup nor apt-get".to_owned());
    }
    bail!("no compiler for {TARGET}: {}. {}", failures.join("; "), remedy(mode))
}

/// What to do when a mode did not provide a compiler.
fn remedy(mode: Mode) -> String {
    let rustup = format!("install rustup (https://rustup.rs) and run `rustup target add {TARGET}`");
    let distro = format!("on Debian, set {MODE_VARIABLE}=distro to use its packages");
    match mode {
        Mode::Auto => format!("Either {rustup}; or, {distro}; then run `cargo xtask setup` again"),
        Mode::Rustup => format!("Either {rustup} where it may download; or, {distro}"),
        Mode::Distro => format!("With {MODE_VARIABLE}=rustup, rustup's compiler is used instead"),
    }
}

fn attempt(way: Way, project: &Project, mode: Mode, consent: Consent) -> Result<Toolchain> {
    match way {
        Way::Installed => {
            println!("  {TARGET}: installed in the compiler cargo uses");
            Ok(Toolchain::Installed)
        }
        Way::EarlierSysroot => {
            println!(
                "  {TARGET}: not in the compiler cargo uses, but a private sysroot from an earlier set-up is there; \
                 {MODE_VARIABLE}=rustup would add it to rustup's instead"
            );
            sysroot::ensure(project, Sysroot::Firmware, consent).map(|sysroot| Toolchain::Private { sysroot })
        }
        Way::RustupAdd => {
            println!("  {TARGET}: not installed; rustup adds its ready-made core (about 10 MB to download)");
            if mode == Mode::Auto {
                println!("  {MODE_VARIABLE}=distro would build it from Debian's packages instead");
            }
            command::run(Command::new("rustup").args(["target", "add", TARGET]))
                .context("rustup could not add the target")?;
            if !target_installed() {
                bail!(
                    "rustup added {TARGET}, but the rustc on PATH does not have it: is it another one than rustup's?"
                );
            }
            Ok(Toolchain::Installed)
        }
        Way::Distro => {
            let why = if mode == Mode::Distro { "as chosen" } else { "because rustup could not supply it" };
            println!(
                "  {TARGET}: from the distribution's compiler and sources, {why} ({MODE_VARIABLE} chooses)"
            );
            sysroot::ensure(project, Sysroot::Firmware, consent).map(|sysroot| Toolchain::Private { sysroot })
        }
    }
}

/// Whether cargo's default compiler has the target's `core`.
fn target_installed() -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| OsString::from("rustc"));
    command::output(Command::new(rustc).args(["--print", "target-libdir", "--target", TARGET]))
        .is_ok_and(|libraries| sysroot::has_core(Path::new(libraries.trim())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_modes_are_read_and_others_refused() {
        assert_eq!("".parse::<Mode>().expect("empty means auto"), Mode::Auto);
        assert_eq!("auto".parse::<Mode>().expect("documented"), Mode::Auto);
        assert_eq!("rustup".parse::<Mode>().expect("documented"), Mode::Rustup);
        assert_eq!("distro".parse::<Mode>().expect("documented"), Mode::Distro);
        let message = "nix".parse::<Mode>().expect_err("not a mode").to_string();
        assert_eq!(message, "JOINTRIG_FIRMWARE_TOOLCHAIN=nix is not known: use auto, rustup or distro");
    }

    #[test]
    fn auto_prefers_what_is_there_then_rustup_then_the_distribution() {
        let all = [Way::Installed, Way::EarlierSysroot, Way::RustupAdd, Way::Distro];
        assert_eq!(ways(Mode::Auto, &all), [Way::Installed]);
        assert_eq!(ways(Mode::Auto, &all[1..]), [Way::EarlierSysroot]);
        assert_eq!(ways(Mode::Auto, &all[2..]), [Way::RustupAdd, Way::Distro]);
        assert_eq!(ways(Mode::Auto, &all[3..]), [Way::Distro]);
        assert!(ways(Mode::Auto, &[]).is_empty());
    }

    #[test]
    fn a_named_mode_never_falls_back() {
        let all = [Way::Installed, Way::EarlierSysroot, Way::RustupAdd, Way::Distro];
        assert_eq!(ways(Mode::Distro, &all), [Way::Distro]);
        assert_eq!(ways(Mode::Rustup, &all), [Way::Installed]);
        assert_eq!(ways(Mode::Rustup, &all[1..]), [Way::RustupAdd]);
    }
}

//! `cargo xtask setup`: installs once what the machine needs in addition to a Rust compiler.

use crate::packages::{self, Consent};
use crate::project::Project;
use crate::toolchain::{self, Mode, Toolchain};
use anyhow::Result;

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
    toolchain::ensure(project, Mode::from_environment()?, consent)
}

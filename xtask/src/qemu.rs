//! The QEMU program: detection and installation.

use crate::consent::Consent;
use crate::{command, packages};
use anyhow::{Result, bail};

/// The emulator of 32-bit Arm machines.
pub const PROGRAM: &str = "qemu-system-arm";

/// Makes QEMU available.
pub fn ensure(consent: Consent) -> Result<()> {
    if let Some(program) = command::find_program(PROGRAM) {
        println!("  {PROGRAM}: {}", program.display());
        return Ok(());
    }
    if !packages::available() {
        bail!("{PROGRAM} is not installed: {}", how_to_install(std::env::consts::OS));
    }
    println!("  {PROGRAM}: not installed; the firmware's own binary runs in it, so apt-get installs it");
    packages::install(&[PROGRAM], consent)?;
    if command::find_program(PROGRAM).is_none() {
        bail!("the package {PROGRAM} is installed, but no such program is on PATH: check PATH");
    }
    Ok(())
}

fn how_to_install(system: &str) -> &'static str {
    match system {
        "macos" => "run `brew install qemu`",
        "windows" => "run `winget install SoftwareFreedomConservancy.QEMU`, and add its folder to PATH",
        _ => {
            "install your distribution's package (Fedora: `dnf install qemu-system-arm-core`, Arch: \
             `pacman -S qemu-system-arm`, Alpine: `apk add qemu-system-arm`)"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_system_is_told_what_to_install() {
        assert!(how_to_install("macos").contains("brew"));
        assert!(how_to_install("linux").contains("dnf"));
    }
}

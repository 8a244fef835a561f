//! Chromium, the browser in which the report's page is tested: detection and installation.

use crate::consent::Consent;
use crate::{command, packages};
use anyhow::{Result, bail};

/// Names of the program in different distributions; the first is also the name of Debian's package.
const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Makes Chromium available.
pub fn ensure(consent: Consent) -> Result<()> {
    if let Some(program) = found() {
        println!("  {}: {}", PROGRAMS[0], program.display());
        return Ok(());
    }
    if !packages::available() {
        bail!("{} is not installed: {}", PROGRAMS[0], how_to_install(std::env::consts::OS));
    }
    println!("  {}: not installed; the report's page is tested in it, so apt-get installs it", PROGRAMS[0]);
    packages::install(&[PROGRAMS[0]], consent)?;
    if found().is_none() {
        bail!("the package {} is installed, but no such program is on PATH: check PATH", PROGRAMS[0]);
    }
    Ok(())
}

fn found() -> Option<std::path::PathBuf> {
    PROGRAMS.into_iter().find_map(command::find_program)
}

fn how_to_install(system: &str) -> &'static str {
    match system {
        "macos" => "run `brew install chromium`",
        "windows" => "run `winget install Hibbiki.Chromium`, and add its folder to PATH",
        _ => "install your distribution's package (Fedora, Arch, Alpine: `chromium`)",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_system_is_told_what_to_install() {
        assert!(how_to_install("macos").contains("brew"));
        assert!(how_to_install("linux").contains("chromium"));
    }
}

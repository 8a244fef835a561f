//! Programs of the system that cargo cannot fetch, as Debian packages: a compiler with sources,
//! QEMU, and Chromium, in which the report's page is tested. A user at a terminal is asked before
//! packages are installed.

use crate::command;
use anyhow::{Context, Result, bail};
use std::io::{IsTerminal, Write};
use std::process::Command;

/// Whether this system installs its packages with apt-get.
pub fn available() -> bool {
    command::find_program("apt-get").is_some()
}

/// Installs `packages` with apt-get, through sudo unless root. The package lists are refreshed
/// first: outdated ones, for example in an image that is some months old, name packages that no
/// longer exist, or versions that are too old. If the refresh fails, the existing lists may still
/// work.
pub fn install(packages: &[&str], consent: Consent) -> Result<()> {
    let names = packages.join(" ");
    if !available() {
        bail!("cannot install {names}: this system has no apt-get");
    }
    let prefix = privileges(consent)?;
    consent.require(&format!("Install {names} with apt-get"))?;
    if let Err(error) = command::run(&mut apt(&prefix, consent, &["update"])) {
        println!("  the package lists could not be refreshed ({error}); those that are there are used");
    }
    command::run(&mut apt(&prefix, consent, &install_arguments(packages))).with_context(|| {
        format!(
            "{names} could not be installed; check the network and /etc/apt/sources.list; `apt-cache policy {names}` says whether \
             this system offers them"
        )
    })
}

/// The words before apt-get: none for root, sudo for others (which must not wait for a password
/// that nobody enters).
fn privileges(consent: Consent) -> Result<Vec<&'static str>> {
    let user = command::output(Command::new("id").arg("-u"))?;
    if user.trim() == "0" {
        return Ok(vec!["env"]);
    }
    if command::find_program("sudo").is_none() {
        bail!(
            "installing packages needs root, and there is no sudo here: run `cargo xtask setup` once as root"
        );
    }
    Ok(if consent == Consent::Ask { vec!["sudo", "env"] } else { vec!["sudo", "-n", "env"] })
}

fn install_arguments<'a>(packages: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["install", "--yes", "--no-install-recommends"];
    arguments.extend(packages);
    arguments
}

fn apt(prefix: &[&str], consent: Consent, arguments: &[&str]) -> Command {
    let mut command = Command::new(prefix[0]);
    command.args(&prefix[1..]).args([
        "DEBIAN_FRONTEND=noninteractive",
        "apt-get",
        "--quiet",
        // Another apt-get may be running, for example on a machine that has just started.
        "-oDPkg::Lock::Timeout=300",
    ]);
    command.args(arguments);
    if consent == Consent::Given {
        command.stdin(std::process::Stdio::null());
    }
    command
}

/// Permission to install system packages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Given in advance: by `--yes`, by `CI`, or because stdin is not a terminal.
    Given,
    /// stdin is a terminal: ask the user.
    Ask,
}

impl Consent {
    /// Asks only if stdin is a terminal and `CI` is not set.
    pub fn new(yes: bool) -> Self {
        let interactive = std::io::stdin().is_terminal() && std::env::var_os("CI").is_none();
        if yes || !interactive { Self::Given } else { Self::Ask }
    }

    /// Returns if `what` is permitted; otherwise the error states what was declined.
    pub fn require(self, what: &str) -> Result<()> {
        if self == Self::Given {
            return Ok(());
        }
        print!("  {what}? [Y/n] ");
        std::io::stdout().flush().context("could not write to the terminal")?;
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).context("could not read the answer from the terminal")?;
        if !is_yes(&answer) {
            bail!("declined: {what}");
        }
        Ok(())
    }
}

fn is_yes(answer: &str) -> bool {
    matches!(answer.trim().to_ascii_lowercase().as_str(), "" | "y" | "yes")
}

/// The emulator of 32-bit Arm machines.
pub const EMULATOR: &str = "qemu-system-arm";

/// Makes QEMU available.
pub fn ensure_emulator(consent: Consent) -> Result<()> {
    if let Some(program) = command::find_program(EMULATOR) {
        println!("  {EMULATOR}: {}", program.display());
        return Ok(());
    }
    if !available() {
        bail!("{EMULATOR} is not installed: {}", how_to_install_emulator(std::env::consts::OS));
    }
    println!("  {EMULATOR}: not installed; the firmware's own binary runs in it, so apt-get installs it");
    install(&[EMULATOR], consent)?;
    if command::find_program(EMULATOR).is_none() {
        bail!("the package {EMULATOR} is installed, but no such program is on PATH: check PATH");
    }
    Ok(())
}

fn how_to_install_emulator(system: &str) -> &'static str {
    match system {
        "macos" => "run `brew install qemu`",
        "windows" => "run `winget install SoftwareFreedomConservancy.QEMU`, and add its folder to PATH",
        _ => {
            "install your distribution's package (Fedora: `dnf install qemu-system-arm-core`, Arch: \
             `pacman -S qemu-system-arm`, Alpine: `apk add qemu-system-arm`)"
        }
    }
}

/// Names of the program in different distributions; the first is also the name of Debian's package.
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Makes Chromium available.
pub fn ensure_browser(consent: Consent) -> Result<()> {
    if let Some(program) = found_browser() {
        println!("  {}: {}", BROWSERS[0], program.display());
        return Ok(());
    }
    if !available() {
        bail!("{} is not installed: {}", BROWSERS[0], how_to_install_browser(std::env::consts::OS));
    }
    println!("  {}: not installed; the report's page is tested in it, so apt-get installs it", BROWSERS[0]);
    install(&[BROWSERS[0]], consent)?;
    if found_browser().is_none() {
        bail!("the package {} is installed, but no such program is on PATH: check PATH", BROWSERS[0]);
    }
    Ok(())
}

fn found_browser() -> Option<std::path::PathBuf> {
    BROWSERS.into_iter().find_map(command::find_program)
}

fn how_to_install_browser(system: &str) -> &'static str {
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
    fn nothing_waits_for_a_person_when_consent_was_given() {
        let command = apt(&["sudo", "-n", "env"], Consent::Given, &install_arguments(&["lld"]));
        let line = command::line(&command);
        assert!(line.starts_with("sudo -n env DEBIAN_FRONTEND=noninteractive apt-get"), "{line}");
        assert!(line.ends_with("install --yes --no-install-recommends lld"), "{line}");
    }
}

#[cfg(test)]
mod consent_tests {
    use super::*;

    #[test]
    fn only_yes_or_a_bare_return_is_consent() {
        assert!(is_yes("\n") && is_yes("Y\n") && is_yes("yes\n"));
        assert!(!is_yes("n\n") && !is_yes("what?\n"));
    }

    #[test]
    fn yes_on_the_command_line_is_consent() {
        assert_eq!(Consent::new(true), Consent::Given);
        assert!(Consent::Given.require("install nothing").is_ok());
    }
}

#[cfg(test)]
mod qemu_tests {
    use super::*;

    #[test]
    fn every_system_is_told_what_to_install() {
        assert!(how_to_install_emulator("macos").contains("brew"));
        assert!(how_to_install_emulator("linux").contains("dnf"));
    }
}

#[cfg(test)]
mod chromium_tests {
    use super::*;

    #[test]
    fn every_system_is_told_what_to_install() {
        assert!(how_to_install_browser("macos").contains("brew"));
        assert!(how_to_install_browser("linux").contains("chromium"));
    }
}

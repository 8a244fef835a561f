//! Debian packages, for what cargo cannot fetch: a compiler with sources, QEMU, and the browser.

use crate::command;
use crate::consent::Consent;
use anyhow::{Context, Result, bail};
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

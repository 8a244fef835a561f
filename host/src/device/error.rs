//! Errors between host and device, worded for the operator.

use std::io;
use std::path::Path;

use jointrig_protocol::answer::Refusal;
use jointrig_protocol::hello::Mismatch;
use jointrig_protocol::sync::ClockFault;

/// Advice for "permission denied" on Linux.
pub(super) const INSTALL_UDEV_RULE: &str = "install the udev rule (`jointrig devices --udev-rule | sudo tee \
     /etc/udev/rules.d/70-jointrig.rules`, then `sudo udevadm control --reload && sudo udevadm trigger`)";

/// The udev rule by which Linux lets the person at the machine open the controller.
pub const UDEV_RULE: &str = include_str!("../../../docs/udev/70-jointrig.rules");

/// Folders from which udev reads rules.
const UDEV_FOLDERS: [&str; 4] =
    ["/etc/udev/rules.d", "/run/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d"];

/// What to do so that a controller may be opened on this system.
pub fn permission_advice() -> String {
    if cfg!(windows) {
        return "no driver is needed from Windows 8.1 on, which loads WinUSB and usbser itself; if the device manager \
                shows a yellow mark, see docs/first-light.md, \"USB\""
            .into();
    }
    if !cfg!(target_os = "linux") {
        return "no driver is needed; end other programs that hold the controller".into();
    }
    linux_advice(&UDEV_FOLDERS.map(Path::new))
}

/// The same for Linux, whose udev reads rules from these folders.
fn linux_advice(folders: &[&Path]) -> String {
    let installed =
        folders.iter().find_map(|folder| std::fs::read_to_string(folder.join("70-jointrig.rules")).ok());
    match installed {
        None => INSTALL_UDEV_RULE.into(),
        Some(rule) if rule == UDEV_RULE => {
            "the udev rule is installed, and permits access to the user at this PC's screen: unplug the controller \
             and plug it in again"
                .into()
        }
        Some(_) => format!("the installed udev rule is not that of this program: {INSTALL_UDEV_RULE}"),
    }
}

/// The firmware file that matches this program, for the device at an address.
pub fn flash_file(address: &str) -> &'static str {
    if address.starts_with("qemu:") {
        "the image mps2-an505, which `cargo xtask firmware` of this program's sources builds"
    } else {
        "nucleo-u5a5.bin, which `cargo xtask firmware` of this program's sources makes; how: docs/first-light.md, \"The board alone\""
    }
}

/// Why a device could not be opened or used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The address does not have a known form.
    #[error("`{given}` is not a device address: {why}")]
    Address {
        /// The address given.
        given: String,
        /// What is wrong with it.
        why: String,
    },
    /// The address has a known form that this build does not support.
    #[error(
        "device address `{given}`: `{scheme}:` is not built into this version; use serial:, usb: or tcp:"
    )]
    NotBuilt {
        /// The address given.
        given: String,
        /// Its scheme.
        scheme: String,
    },
    /// The device could not be opened.
    #[error("cannot open {address}: {why}")]
    Open {
        /// The device.
        address: String,
        /// The cause, and what to do.
        why: String,
    },
    /// The link broke while in use.
    #[error(
        "the link to {address} broke while {doing}: {source}\ncheck cable and power, then run the same command again"
    )]
    Link {
        /// The device.
        address: String,
        /// What was being done.
        doing: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
    /// No answer after every retry.
    #[error(
        "{address} did not answer `{request}` ({tries} tries): check that it is powered, that the address is right \
         and that no other program holds it"
    )]
    NoAnswer {
        /// The device.
        address: String,
        /// The request.
        request: &'static str,
        /// How often it was sent.
        tries: u32,
    },
    /// The protocol versions do not match.
    #[error("{address}: {mismatch} ({})", flash_file(address))]
    Version {
        /// The device.
        address: String,
        /// Both versions, and what to do.
        mismatch: Mismatch,
    },
    /// The device refused a request.
    #[error("{address} refused `{request}`: {refusal}")]
    Refused {
        /// The device.
        address: String,
        /// The request.
        request: &'static str,
        /// Why it was refused.
        refusal: Box<Refusal>,
    },
    /// The answer does not match the request.
    #[error("{address} answered `{request}` with something else ({got}): firmware and program do not match")]
    WrongAnswer {
        /// The device.
        address: String,
        /// The request.
        request: &'static str,
        /// The answer received.
        got: String,
    },
    /// The device restarted, or its stream ended without a request.
    #[error(
        "{address} restarted or ended its stream (epoch {epoch}) in the middle of the work; \
         run the same command again: it resumes where this one stopped"
    )]
    Restarted {
        /// The device.
        address: String,
        /// The epoch that was running.
        epoch: u32,
    },
    /// A report of the device is impossible.
    #[error(
        "{address} {what}; it is not used any further: check its firmware ({}), then run the same command again",
        flash_file(address)
    )]
    Nonsense {
        /// The device.
        address: String,
        /// What it reports, and what is possible.
        what: String,
    },
    /// A stream is running, but almost no scans arrive.
    #[error(
        "{address} sent {got} scans in {seconds} s although its stream runs (waiting for scan {scan}): \
         reset the controller, then run the same command again"
    )]
    Stalled {
        /// The device.
        address: String,
        /// How long almost nothing arrived, s.
        seconds: u64,
        /// Scans that arrived in that time.
        got: u64,
        /// The scan that was waited for.
        scan: u64,
    },
    /// A stream is needed, but none was started.
    #[error("{address}: no stream was started")]
    NoStream {
        /// The device.
        address: String,
    },
    /// The device's firmware is too old for a request.
    #[error(
        "{address} speaks protocol {}.{}, in which it cannot {what}: flash firmware of protocol {}.{} or newer ({})",
        speaks.0, speaks.1, needs.0, needs.1, flash_file(address)
    )]
    TooOld {
        /// The device.
        address: String,
        /// Major and minor version of its protocol.
        speaks: (u16, u16),
        /// The first version that supports the request.
        needs: (u16, u16),
        /// What it cannot do.
        what: &'static str,
    },
    /// The clock that was to time the scans has a fault.
    #[error("{address}: {fault}")]
    Clock {
        /// The device.
        address: String,
        /// The fault, and what to do.
        fault: ClockFault,
    },
    /// The channels do not suit the purpose.
    #[error("{address}: {what}")]
    Channels {
        /// The device.
        address: String,
        /// What is wrong, and what to do.
        what: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_or_changed_udev_rule_is_told_with_the_command_that_installs_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("70-jointrig.rules");
        let said = || linux_advice(&[&folder.path().join("none"), folder.path()]);
        assert!(said().starts_with("install the udev rule (`jointrig devices --udev-rule"), "{}", said());
        std::fs::write(&path, "# another").expect("written");
        assert!(said().contains("is not that of this program: install"), "{}", said());
        std::fs::write(&path, UDEV_RULE).expect("written");
        assert!(said().contains("plug it in again") && !said().contains("sudo"), "{}", said());
    }
}

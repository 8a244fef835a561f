//! Errors between host and device, worded for the operator.

use std::io;

use jointrig_protocol::answer::Refusal;
use jointrig_protocol::hello::Mismatch;
use jointrig_protocol::sync::ClockFault;

/// Advice for "permission denied" on Linux.
pub(super) const INSTALL_UDEV_RULE: &str = "install docs/udev/70-jointrig.rules (`sudo cp` it to /etc/udev/rules.d, \
     then `sudo udevadm control --reload && sudo udevadm trigger`)";

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

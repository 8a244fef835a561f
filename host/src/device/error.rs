//! What can go wrong between host and device, in the words of whoever stands at the rig.

use std::io;

use jointrig_protocol::answer::Refusal;
use jointrig_protocol::hello::Mismatch;
use jointrig_protocol::sync::ClockFault;

/// What to do about "permission denied" on Linux.
pub(super) const INSTALL_UDEV_RULE: &str = "install docs/udev/70-jointrig.rules (`sudo cp` it to /etc/udev/rules.d, \
     then `sudo udevadm control --reload && sudo udevadm trigger`)";

/// The file whose firmware belongs to this program, for the device at an address.
pub fn flash_file(address: &str) -> &'static str {
    if address.starts_with("qemu:") {
        "the image mps2-an505, which `cargo xtask firmware` of this program's sources builds"
    } else {
        "nucleo-u5a5.bin, which `cargo xtask firmware` of this program's sources makes; how: docs/first-light.md, \"The board alone\""
    }
}

/// Why a device could not be reached or used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The address is not one of the known forms.
    #[error("`{given}` is not a device address: {why}")]
    Address {
        /// What was given.
        given: String,
        /// What is wrong with it.
        why: String,
    },
    /// The address is a known form that this build does not serve.
    #[error(
        "device address `{given}`: `{scheme}:` is not built into this version; use sim:, serial:, usb: or tcp:"
    )]
    NotBuilt {
        /// What was given.
        given: String,
        /// Its scheme.
        scheme: String,
    },
    /// The device could not be opened.
    #[error("cannot open {address}: {why}")]
    Open {
        /// Which device.
        address: String,
        /// Why, and what to do.
        why: String,
    },
    /// The link broke while in use.
    #[error(
        "the link to {address} broke while {doing}: {source}\ncheck cable and power, then run the same command again"
    )]
    Link {
        /// Which device.
        address: String,
        /// What was being done.
        doing: &'static str,
        /// What the operating system said.
        source: io::Error,
    },
    /// No answer after every retry.
    #[error(
        "{address} did not answer `{request}` ({tries} tries): check that it is powered, that the address is right \
         and that no other program holds it"
    )]
    NoAnswer {
        /// Which device.
        address: String,
        /// What was asked.
        request: &'static str,
        /// How often it was asked.
        tries: u32,
    },
    /// The versions do not fit.
    #[error("{address}: {mismatch} ({})", flash_file(address))]
    Version {
        /// Which device.
        address: String,
        /// Both versions, and what to do.
        mismatch: Mismatch,
    },
    /// The device refused.
    #[error("{address} refused `{request}`: {refusal}")]
    Refused {
        /// Which device.
        address: String,
        /// What was asked.
        request: &'static str,
        /// Why it was refused.
        refusal: Box<Refusal>,
    },
    /// The device answered something that was not asked.
    #[error("{address} answered `{request}` with something else ({got}): firmware and program do not fit")]
    WrongAnswer {
        /// Which device.
        address: String,
        /// What was asked.
        request: &'static str,
        /// What came.
        got: String,
    },
    /// The device started anew or its stream ended unasked.
    #[error(
        "{address} restarted or ended its stream (epoch {epoch}) in the middle of the work; \
         run the same command again: it resumes where this one stopped"
    )]
    Restarted {
        /// Which device.
        address: String,
        /// The epoch that was running.
        epoch: u32,
    },
    /// What it says cannot be.
    #[error(
        "{address} {what}; nothing more is done with it: check its firmware ({}), then run the same command again",
        flash_file(address)
    )]
    Nonsense {
        /// Which device.
        address: String,
        /// What it says, and what can be.
        what: String,
    },
    /// No samples although a stream runs, or next to none.
    #[error(
        "{address} sent {got} scans in {seconds} s although its stream runs (waiting for scan {scan}): \
         reset the controller, then run the same command again"
    )]
    Stalled {
        /// Which device.
        address: String,
        /// How long next to nothing came, s.
        seconds: u64,
        /// What came, scans.
        got: u64,
        /// The scan that was waited for.
        scan: u64,
    },
    /// Something needs a stream and there is none.
    #[error("{address}: no stream was started")]
    NoStream {
        /// Which device.
        address: String,
    },
    /// The device's firmware is older than what is asked of it.
    #[error(
        "{address} speaks protocol {}.{}, in which it cannot {what}: flash firmware of protocol {}.{} or newer ({})",
        speaks.0, speaks.1, needs.0, needs.1, flash_file(address)
    )]
    TooOld {
        /// Which device.
        address: String,
        /// Major and minor of its protocol.
        speaks: (u16, u16),
        /// The first that can.
        needs: (u16, u16),
        /// What it cannot.
        what: &'static str,
    },
    /// The clock that was to time the scans is not good.
    #[error("{address}: {fault}")]
    Clock {
        /// Which device.
        address: String,
        /// What is wrong with it, and what to do.
        fault: ClockFault,
    },
    /// The channels do not serve the purpose.
    #[error("{address}: {what}")]
    Channels {
        /// Which device.
        address: String,
        /// What is wrong, and what to do.
        what: String,
    },
}

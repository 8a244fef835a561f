//! Errors of a converter, with messages for the operator at the rig.

use core::fmt;

use super::frames::CrcMismatch;
use super::part::Range;
use crate::sentence::{Sentence, Tell};

/// Why the converter cannot be used. `S` is the serial port's error, `P` the pins'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error<S, P> {
    /// The serial port failed.
    Spi(S),
    /// A pin failed.
    Pin(P),
    /// After a reset pulse the chip does not report a reset.
    NotReset {
        /// Its STATUS register.
        status: u8,
    },
    /// A different chip responds, or none.
    Identity {
        /// The value of the ID register.
        found: u8,
        /// The expected part.
        part: &'static str,
    },
    /// The response to a register command has a wrong CRC.
    RegisterCrc {
        /// The address of the register read.
        address: u8,
    },
    /// A register does not hold the value written to it.
    Readback {
        /// The register.
        address: u8,
        /// What was written.
        wrote: u8,
        /// What it holds.
        holds: u8,
    },
    /// The part does not support this range.
    NoRange {
        /// The requested range.
        range: Range,
        /// The part.
        part: &'static str,
    },
    /// The part does not support this data layout.
    NoLayout {
        /// The part.
        part: &'static str,
    },
    /// BUSY did not fall in time.
    BusyStuck {
        /// The waiting time, µs.
        after_us: u32,
    },
    /// The data of a conversion have a wrong CRC.
    Data(CrcMismatch),
    /// The test pattern was not received: a line is broken, shorted or clocked too fast.
    Pattern {
        /// The channel, from 0.
        channel: usize,
        /// The value received.
        found: u16,
    },
    /// The chip reports digital errors: the bits of DIGITAL_DIAG_ERROR.
    Digital {
        /// See [`super::registers`].
        bits: u8,
    },
}

impl<S, P> Tell for Error<S, P> {
    fn tell(&self, to: &mut Sentence) {
        match self {
            Self::Spi(_) => to.text("the serial port failed"),
            Self::Pin(_) => to.text("a pin failed"),
            Self::NotReset { status } => {
                to.text("not reset (status ").hex((*status).into(), 2).text("): check RESET and OS pins")
            }
            Self::Identity { found, part } => {
                to.text("ID ").hex((*found).into(), 2).text(" is no ").text(part);
                to.text(": check supply, SDI, DOUTA, CS")
            }
            Self::RegisterCrc { address } => {
                to.text("register ").hex((*address).into(), 2).text(": wrong CRC in the answer")
            }
            Self::Readback { address, wrote, holds } => {
                to.text("register ").hex((*address).into(), 2).text(": wrote ").hex((*wrote).into(), 2);
                to.text(", holds ").hex((*holds).into(), 2)
            }
            Self::NoRange { range, part } => {
                to.text(part).text(" has no range of code ").number(range.code().into())
            }
            Self::NoLayout { part } => to.text(part).text(" cannot send on so many lines"),
            Self::BusyStuck { after_us } => to.text("BUSY still high after ").number(*after_us).text(" us"),
            Self::Data(CrcMismatch { sent, due }) => {
                to.text("data CRC ").hex((*sent).into(), 4).text(" where ").hex((*due).into(), 4);
                to.text(" is due")
            }
            Self::Pattern { channel, found } => {
                to.text("test pattern of V").number(*channel as u32 + 1).text(": ").hex((*found).into(), 4)
            }
            Self::Digital { bits } => to.text("digital error ").hex((*bits).into(), 2),
        };
    }
}

impl<S, P> fmt::Display for Error<S, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Sentence::of(self).fmt(f)
    }
}

impl<S: fmt::Debug, P: fmt::Debug> core::error::Error for Error<S, P> {}

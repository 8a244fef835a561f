//! What can go wrong with a converter, in words for whoever stands at the rig.

use core::fmt;

use super::frames::CrcMismatch;
use super::range::Range;

/// Why the converter cannot be used. `S` is the serial port's error, `P` the pins'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error<S, P> {
    /// The serial port failed.
    Spi(S),
    /// A pin failed.
    Pin(P),
    /// After a reset pulse the chip does not say that it was reset.
    NotReset {
        /// Its STATUS register.
        status: u8,
    },
    /// Another chip, or none.
    Identity {
        /// The ID register.
        found: u8,
        /// The part that should be there.
        part: &'static str,
    },
    /// The chip's answer to a register command has a wrong CRC.
    RegisterCrc {
        /// The address that was read.
        address: u8,
    },
    /// A register does not hold what was written to it.
    Readback {
        /// The register.
        address: u8,
        /// What was written.
        wrote: u8,
        /// What it holds.
        holds: u8,
    },
    /// The part has no such range.
    NoRange {
        /// The range asked for.
        range: Range,
        /// The part.
        part: &'static str,
    },
    /// The part cannot send its data like this.
    NoLayout {
        /// The part.
        part: &'static str,
    },
    /// BUSY did not fall.
    BusyStuck {
        /// How long was waited, µs.
        after_us: u32,
    },
    /// The data of a conversion have a wrong CRC.
    Data(CrcMismatch),
    /// The known pattern did not arrive: a line is broken, shorted or too fast.
    Pattern {
        /// The channel, from 0.
        channel: usize,
        /// What arrived.
        found: u16,
    },
    /// The chip reports digital errors: the bits of DIGITAL_DIAG_ERROR.
    Digital {
        /// See [`super::registers`].
        bits: u8,
    },
}

impl<S: fmt::Debug, P: fmt::Debug> fmt::Display for Error<S, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spi(error) => write!(f, "serial port: {error:?}"),
            Self::Pin(error) => write!(f, "pin: {error:?}"),
            Self::NotReset { status } => {
                write!(f, "not reset (status {status:#04x}): check RESET and OS pins")
            }
            Self::Identity { found, part } => {
                write!(f, "ID {found:#04x} is no {part}: check supply, SDI, DOUTA, CS")
            }
            Self::RegisterCrc { address } => write!(f, "register {address:#04x}: wrong CRC in the answer"),
            Self::Readback { address, wrote, holds } => {
                write!(f, "register {address:#04x}: wrote {wrote:#04x}, holds {holds:#04x}")
            }
            // not as a number: formatting floats costs 12 kB of flash
            Self::NoRange { range, part } => write!(f, "{part} has no range {range:?}"),
            Self::NoLayout { part } => write!(f, "{part} cannot send on so many lines"),
            Self::BusyStuck { after_us } => write!(f, "BUSY still high after {after_us} us"),
            Self::Data(CrcMismatch { sent, due }) => {
                write!(f, "data CRC {sent:#06x} where {due:#06x} is due")
            }
            Self::Pattern { channel, found } => {
                write!(f, "test pattern of V{}: {found:#06x}", channel + 1)
            }
            Self::Digital { bits } => write!(f, "digital error {bits:#04x}"),
        }
    }
}

impl<S: fmt::Debug, P: fmt::Debug> core::error::Error for Error<S, P> {}

//! Addresses, bits and command frames: AD7606B Rev. 0, "Register Summary" and "Register Details".

use crc::{Algorithm, Crc, Table};

/// RESET_DETECT, DIGITAL_ERROR, OPEN_DETECTED.
pub const STATUS: u8 = 0x01;
/// STATUS: a reset has happened; reading clears it.
pub const RESET_DETECT: u8 = 1 << 7;
/// STATUS: see [`DIGITAL_DIAG_ERROR`] for details.
pub const DIGITAL_ERROR: u8 = 1 << 6;
/// STATUS: see [`OPEN_DETECTED`] for details.
pub const OPEN_CIRCUIT: u8 = 1 << 5;

/// DOUT lines and power.
pub const CONFIG: u8 = 0x02;
/// Position of the number of lines in CONFIG.
pub const LINES_SHIFT: u8 = 3;

/// Ranges of channels 1 and 2; the next three registers hold the other pairs. The odd channel is in
/// the lower half.
pub const RANGE_CH1_CH2: u8 = 0x03;
/// One bit per channel: 1 selects 220 kHz (AD7606C only).
pub const BANDWIDTH: u8 = 0x07;
/// OS_RATIO in the lower half.
pub const OVERSAMPLING: u8 = 0x08;

/// Enables the chip's self-diagnostics.
pub const DIGITAL_DIAG_ENABLE: u8 = 0x21;
/// Errors found; writing 1 to a bit clears it.
pub const DIGITAL_DIAG_ERROR: u8 = 0x22;
/// The chip's own ROM has a wrong CRC.
pub const ROM_CRC: u8 = 1 << 0;
/// The register map changed without a write.
pub const MEMORY_MAP_CRC: u8 = 1 << 1;
/// CRC on data and on register frames.
pub const INTERFACE_CRC: u8 = 1 << 2;
/// A write addressed a register that cannot be written.
pub const SPI_WRITE: u8 = 1 << 3;
/// A read addressed a register that does not exist.
pub const SPI_READ: u8 = 1 << 4;
/// BUSY was high for more than 4 µs after a conversion should have ended.
pub const BUSY_STUCK_HIGH: u8 = 1 << 5;
/// Conversions are replaced by [`super::frames::INTERFACE_PATTERN`] (in the enable register only).
pub const INTERFACE_CHECK: u8 = 1 << 7;

/// One bit per channel: enables open-circuit detection.
pub const OPEN_DETECT_ENABLE: u8 = 0x23;
/// One bit per channel: the input is open; writing 1 to a bit clears it.
pub const OPEN_DETECTED: u8 = 0x24;
/// Number of consistent conversions before an input counts as open; 1 selects manual mode.
pub const OPEN_DETECT_QUEUE: u8 = 0x2C;
/// DEVICE_ID in the upper half, SILICON_REVISION in the lower half.
pub const ID: u8 = 0x2F;

/// The command that reads `address`; the value arrives with the next frame.
#[must_use]
pub const fn read_command(address: u8) -> [u8; 2] {
    [0x40 | (address & 0x3F), 0]
}

/// The command that writes `value` to `address`.
#[must_use]
pub const fn write_command(address: u8, value: u8) -> [u8; 2] {
    [address & 0x3F, value]
}

/// The command that returns to ADC mode.
pub const LEAVE: [u8; 2] = [0, 0];

/// x⁸ + x² + x + 1, initial value zero: the third byte of a register frame while [`INTERFACE_CRC`]
/// is set.
const FRAME_CRC: Algorithm<u8> = Algorithm {
    width: 8,
    poly: 0x07,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    // CRC of "123456789"
    check: 0xF4,
    residue: 0,
};
const FRAME: Crc<u8, Table<0>> = Crc::<u8, Table<0>>::new(&FRAME_CRC);

/// The CRC of a register frame.
#[must_use]
pub const fn frame_crc(frame: [u8; 2]) -> u8 {
    FRAME.checksum(&frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_the_data_sheets() {
        assert_eq!(read_command(ID), [0x6F, 0]);
        assert_eq!(write_command(CONFIG, 0x08), [0x02, 0x08]);
        assert_eq!(FRAME.checksum(b"123456789"), 0xF4);
    }
}

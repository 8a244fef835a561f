//! Data on the DOUT lines after a conversion, and the CRC that follows them.
//!
//! Channels are sent in order, most significant bit first, divided evenly between the lines in use:
//! one line carries V1…V8, two carry V1…V4 and V5…V8, and so on. With the CRC enabled, each line
//! ends with a 16-bit CRC over the data of that line only (AD7606B Rev. 0, "Interface CRC
//! Checksum").

use crc::{Algorithm, Crc, NoTable};

use super::CHANNELS;
use super::part::{Lines, Part};

/// Bytes of the CRC at the end of a line's data.
pub const CRC_BYTES: usize = 2;
/// Most bytes that one line carries after one conversion: eight channels of 18 bits and the CRC.
pub const LINE_BYTES_MAX: usize = CHANNELS * 18 / 8 + CRC_BYTES;

/// Values of the channels while INTERFACE_CHECK is set: AD7606B Rev. 0, "Interface Check".
pub const INTERFACE_PATTERN: [u16; CHANNELS] =
    [0xACCA, 0x5CC5, 0xA33A, 0x5335, 0xCAAC, 0xC55C, 0x3AA3, 0x3553];

/// x¹⁶ + x¹⁴ + x¹³ + x¹² + x¹⁰ + x⁸ + x⁶ + x⁴ + x³ + x + 1, initial value zero.
const DATA_CRC: Algorithm<u16> = Algorithm {
    width: 16,
    poly: 0x755B,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    // CRC of "123456789", computed bit by bit in the test below
    check: 0x2E8F,
    residue: 0,
};
/// Computed bit by bit, because it is used only for the few conversions during set-up.
/// [`jointrig_hot::pair`] is used for every scan.
const DATA: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&DATA_CRC);

/// The CRC over a line's data.
#[must_use]
pub fn data_crc(data: &[u8]) -> u16 {
    DATA.checksum(data)
}

/// The CRC received on a line does not match its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CrcMismatch {
    /// The CRC received.
    pub sent: u16,
    /// The CRC computed from the data.
    pub due: u16,
}

/// Layout of the data on one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    bits: u8,
    channels: usize,
    crc: bool,
}

impl Layout {
    /// The layout of each of `lines` lines; `None` when the part does not have that many, or when a
    /// line would not carry whole bytes (18 bits on four or eight lines).
    #[must_use]
    pub fn new(part: &Part, lines: Lines, crc: bool) -> Option<Self> {
        let channels = CHANNELS / lines.count();
        let whole = (channels * usize::from(part.bits)).is_multiple_of(8);
        (lines <= part.most_lines && whole).then_some(Self { bits: part.bits, channels, crc })
    }

    /// Channels on one line.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// Bytes that one line carries after one conversion.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.data_bytes() + if self.crc { CRC_BYTES } else { 0 }
    }

    fn data_bytes(&self) -> usize {
        self.channels * usize::from(self.bits) / 8
    }

    /// Decodes one line's bytes into the codes of its channels, sign-extended. Channels for which
    /// `line` or `codes` is too short are left unchanged.
    ///
    /// # Errors
    /// [`CrcMismatch`]; `codes` is then unchanged.
    pub fn decode(&self, line: &[u8], codes: &mut [i32]) -> Result<(), CrcMismatch> {
        let (data, rest) = line.split_at(self.data_bytes().min(line.len()));
        if self.crc {
            let sent = rest.first_chunk().map_or(0, |bytes| u16::from_be_bytes(*bytes));
            let due = data_crc(data);
            if sent != due {
                return Err(CrcMismatch { sent, due });
            }
        }
        let (mut held, mut held_bits) = (0_u32, 0_u8);
        let mut bytes = data.iter();
        for code in codes.iter_mut().take(self.channels) {
            while held_bits < self.bits {
                let Some(byte) = bytes.next() else { return Ok(()) };
                held = held << 8 | u32::from(*byte);
                held_bits += 8;
            }
            held_bits -= self.bits;
            let unused = 32 - self.bits;
            *code = ((held >> held_bits) << unused).cast_signed() >> unused;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::part::{AD7606B, AD7606C_18};
    use super::*;

    /// Polynomial division bit by bit, as the data sheet describes it.
    fn by_hand(data: &[u8]) -> u16 {
        let bits = data.iter().flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1));
        bits.fold(0, |crc: u16, bit| {
            let out = crc >> 15 ^ u16::from(bit);
            crc << 1 ^ if out == 1 { 0x755B } else { 0 }
        })
    }

    #[test]
    fn the_crc_is_the_polynomials() {
        for data in [&b"123456789"[..], &[0; 16], &[0xFF; 16], &[0x12, 0x34]] {
            assert_eq!(data_crc(data), by_hand(data));
        }
    }

    #[test]
    fn an_18_bit_line_is_read_bit_by_bit() {
        let layout = Layout::new(&AD7606C_18, Lines::Two, false).expect("four times 18 bits are nine bytes");
        let mut codes = [0; 4];
        // 0x1FFFF, 0x20000, 1, 0x3FFFF
        let packed: u128 = 0x1_FFFF << 54 | 0x2_0000 << 36 | 1 << 18 | 0x3_FFFF;
        let line = &packed.to_be_bytes()[16 - 9..];
        assert_eq!(layout.decode(line, &mut codes), Ok(()));
        assert_eq!(codes, [131_071, -131_072, 1, -1]);
        assert_eq!(Layout::new(&AD7606C_18, Lines::Four, true), None);
        assert_eq!(Layout::new(&AD7606B, Lines::Eight, true), None);
    }
}

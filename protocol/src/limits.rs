//! The sizes and bounds that both ends agree on. Each is part of the schema hash.

/// Most channels in one scan of a controller: two simultaneous-sampling converters with eight
/// channels each.
pub const MAX_CHANNELS: usize = 16;

/// Most channels in one scan that this build has room for. A front end on a PC (the bridge) has up
/// to 64 (feature `many-channels`); the controller's memory is sized for [`MAX_CHANNELS`]. Lists
/// are sent with their length, so that both builds read each other's frames, and the schema hash
/// is the same.
pub const CHANNEL_CAPACITY: usize = if cfg!(feature = "many-channels") { 64 } else { MAX_CHANNELS };

/// Most 16-bit words in one scan: two for each channel if all are wide.
pub const MAX_WORDS: usize = 2 * CHANNEL_CAPACITY;

/// Bytes of samples in one block: 15 scans of 16 channels, 24 scans of 10 channels, of 16 bits
/// each.
pub const BLOCK_SAMPLE_BYTES: usize = 480;

/// Bytes of a block's fixed header, its kind byte included.
pub const BLOCK_HEADER_BYTES: usize = 16;

/// Bytes of the frozen part of a Hello.
pub const HELLO_BYTES: usize = 32;

/// Bytes of the CRC-32 that ends every frame.
pub const CRC_BYTES: usize = 4;

/// Longest frame before COBS: kind, payload, CRC. A full sample block has exactly this length.
pub const MAX_FRAME: usize = BLOCK_HEADER_BYTES + BLOCK_SAMPLE_BYTES + CRC_BYTES;

/// Longest frame on the wire: COBS adds one byte per 254 bytes or part thereof, and the delimiter
/// one more. 503 < 512, so that one frame is one short high-speed bulk packet and never needs a
/// zero-length packet after it.
pub const MAX_WIRE: usize = MAX_FRAME + MAX_FRAME.div_ceil(254) + 1;

/// Bytes before a frame that is sent as a packet ([`crate::packet`]).
pub const HEAD_BYTES: usize = 4;

/// The length of a packet is a multiple of this many bytes.
pub const WORD: usize = 4;

/// Longest packet: 504 < 512, so that it is also one short high-speed bulk packet.
pub const MAX_PACKET: usize = HEAD_BYTES + MAX_FRAME;

/// Longest name of a channel, point or board, in bytes of UTF-8.
pub const NAME_BYTES: usize = 24;

/// Longest sentence in a refusal or event, in bytes of UTF-8.
pub const SENTENCE_BYTES: usize = 120;

/// Longest coil pulse that any firmware may accept, in µs. A board's own cap may only be shorter.
pub const COIL_PULSE_CAP_US: u32 = 8_000;

/// Longest validity of one arming, in ms.
pub const ARM_VALID_CAP_MS: u32 = 60_000;

/// A front end that delivers nothing for this long has failed: hammer and shaker come to rest (ms
/// of the device's time).
pub const SCAN_SILENCE_MS: u32 = 100;

/// Longest validity of one shaker request, in ms; a host that needs more time renews the request.
pub const SHAKE_VALID_CAP_MS: u32 = 60_000;

/// Shortest time in which the shaker's drive may ramp from rest to full scale, in ms. Every stop
/// that is not an emergency ramps down at the same slope.
pub const SHAKE_RAMP_MS: u32 = 50;

/// The shaker's highest frequency, given as the smallest number of scans per cycle.
pub const SHAKE_SCANS_PER_CYCLE: u32 = 10;

/// Largest factor by which a session's scale may differ from the built-in scale. All ranges of a
/// vibrometer's decoder or an amplifier's range switch lie within it; confusing V with mV does not.
pub const SCALE_FACTOR_CAP: u32 = 100;

/// A host from which nothing was received for this long is considered gone: the hammer disarms and
/// the shaker comes to rest (ms of the device's time).
pub const LINK_SILENCE_MS: u32 = 1_000;

/// Scans of `words` 16-bit words ([`crate::channel::words_per_scan`]) that fit one block; `None`
/// when there are none or too many.
#[must_use]
pub const fn scans_per_block(words: usize) -> Option<usize> {
    if words == 0 || words > MAX_WORDS { None } else { Some(BLOCK_SAMPLE_BYTES / (2 * words)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_block_is_one_short_high_speed_packet() {
        assert_eq!(MAX_FRAME, 500);
        assert_eq!(MAX_WIRE, 503);
        assert_eq!(MAX_PACKET, 504);
        assert_eq!(MAX_PACKET % WORD, 0);
        assert_eq!(scans_per_block(16), Some(15));
        assert_eq!(scans_per_block(10), Some(24));
        assert_eq!(scans_per_block(0), None);
        assert_eq!(scans_per_block(MAX_WORDS), Some(240 / MAX_WORDS));
        assert_eq!(scans_per_block(MAX_WORDS + 1), None);
    }
}

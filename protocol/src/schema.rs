//! The version of the protocol, and the hash that distinguishes two builds of it.
//!
//! `postcard-schema` covers types, fields and variants, but neither the capacity of a string or
//! vector nor the hand-written layouts; [`LAYOUT`] adds these.

use postcard_schema::key::Key;

use crate::{acknowledge, answer, block, event, limits, request, slow, sync};

/// Major version; different majors are incompatible.
pub const MAJOR: u16 = 1;

/// Minor version; a new minor only adds at the end of enumerations and structures.
pub const MINOR: u16 = 2;

/// Everything that determines the meaning of bytes and is not part of the types. Update this when a
/// layout changes.
pub const LAYOUT: &[u64] = &[
    limits::MAX_CHANNELS as u64,
    limits::BLOCK_SAMPLE_BYTES as u64,
    limits::BLOCK_HEADER_BYTES as u64,
    limits::MAX_FRAME as u64,
    limits::NAME_BYTES as u64,
    limits::SENTENCE_BYTES as u64,
    limits::COIL_PULSE_CAP_US as u64,
    limits::ARM_VALID_CAP_MS as u64,
    limits::LINK_SILENCE_MS as u64,
    limits::SCAN_SILENCE_MS as u64,
    limits::SHAKE_VALID_CAP_MS as u64,
    limits::SHAKE_RAMP_MS as u64,
    limits::SHAKE_SCANS_PER_CYCLE as u64,
    limits::HELLO_BYTES as u64,
    limits::SCALE_FACTOR_CAP as u64,
    slow::MAX_SUPPLIES as u64,
    sync::CLOCK_TOLERANCE_PPM as u64,
    acknowledge::BYTES as u64,
    block::HEADER_PAYLOAD as u64,
    limits::HEAD_BYTES as u64,
    // revision of the hand-written layouts in `block`, `acknowledge`, `frame`, `packet` and of the
    // bytes after the frozen part of `hello`; since 3, channels of more than 18 bits have two words
    3,
];

/// Hash of the types and [`LAYOUT`].
pub const HASH: u64 = {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    hash = mix(hash, u64::from_le_bytes(Key::for_path::<request::Numbered>("request").to_bytes()));
    hash = mix(hash, u64::from_le_bytes(Key::for_path::<answer::Numbered>("answer").to_bytes()));
    hash = mix(hash, u64::from_le_bytes(Key::for_path::<event::Numbered>("event").to_bytes()));
    let mut i = 0;
    while i < LAYOUT.len() {
        hash = mix(hash, LAYOUT[i]);
        i += 1;
    }
    hash
};

/// FNV-1a over the eight bytes of `value`.
const fn mix(mut hash: u64, value: u64) -> u64 {
    let bytes = value.to_le_bytes();
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

//! The loops that run over every byte of every scan: a frame's CRC-32 and COBS encoding, the
//! converters' CRC, and the check for the ends of their range.
//!
//! They form a separate crate because the optimisation level (size or speed) is set per crate: a
//! controller builds this crate for speed and everything else for size. Therefore nothing here is
//! generic or inlined, because that would move its code into the calling crate.
#![no_std]
#![forbid(unsafe_code)]
#![allow(clippy::inline_always, reason = "a call in these loops costs more than what is called")]

pub mod cobs;
pub mod codes;
pub mod crc32;
pub mod half_band;
pub mod pair;

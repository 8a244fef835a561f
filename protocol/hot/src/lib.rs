//! The loops that run over every byte of every scan: a frame's CRC-32 and COBS, the converters' CRC, the ends of their range.
//!
//! They are a crate of their own because a compiler chooses between size and speed by the crate: a controller builds this
//! one for speed and everything else for size. So nothing here is generic or inlined, which would put its code into whoever calls it.
#![no_std]
#![forbid(unsafe_code)]
#![allow(clippy::inline_always, reason = "a call in these loops costs more than what is called")]

pub mod cobs;
pub mod column;
pub mod crc32;
pub mod half_band;
pub mod pair;
pub mod range;

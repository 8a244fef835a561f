//! Any program that writes blocks of samples becomes a device.
//!
//! A program that reads a recorder (NI, openDAQ, a sound card, …) writes a description and then
//! blocks of samples to a stream of bytes: its standard output, or a socket. This crate reads them
//! and runs the firmware's own core over them: the host then finds the hits, asks for scans again
//! and counts losses as with the controller. There is no drive and no stage, and a coil only if the
//! program announces that one of its outputs may fire a hammer ([`orders`]).
//!
//! # The stream
//!
//! First one line of JSON ([`header`]), ended by a line feed, then blocks ([`blocks`]),
//! little-endian:
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 4 | magic `JRBK` |
//! | 4 | 4 | number of scans in this block (u32, may be 0) |
//! | 8 | 8 | number of scans that were lost before this block (u64) |
//! | 16 | 4 | flags: bit 0 = more scans were lost before this block, their number is unknown |
//! | 20 | 4 | 0 |
//! | 24 | … | the scans: one sample of every channel, then the next scan |
//!
//! The stream ends when the program ends; the host reports that as a broken link, and the next run
//! resumes.
//!
//! # What becomes of it
//!
//! - Samples are converted to codes at the stated full scale ([`convert`]), with the recorder's
//!   number of bits: 16-bit samples unchanged, 24 bits for floating-point ones that state nothing
//!   else. Rounding adds 0.29 codes rms: 0.17 µV at ±5 V with 24 bits, 44 µV with 16.
//! - A scan with a sample that is not a number counts as lost. So do the scans that the program
//!   reports as lost, and those that do not fit the queue of [`queue::QUEUE_S`] because this
//!   computer is too slow: a recorder does not wait. All of them reach the host as lost scans.
//! - For an overrun of unknown length, the number is estimated from the computer's clock, and is at
//!   least 1.
//! - A source that can wait says so (`"held": true`): it is read only as fast as the host
//!   acknowledges, which makes a measurement from a file or a simulation repeatable.
#![forbid(unsafe_code)]

pub mod blocks;
pub mod board;
pub mod convert;
pub mod header;
pub mod orders;
pub mod queue;

//! The AD7606B: eight channels, 16 bit, sampled together on one edge of CONVST; and its 16- and
//! 18-bit successors AD7606C-16 and AD7606C-18, which share its pins, registers and frames.
//!
//! The driver stands on embedded-hal's traits, so that the same code talks to the chip and to the
//! model of it that the tests use. Setting up is its business, and so is the meaning of what the
//! chip clocks out; moving sixteen channels at 51.2 kHz is a board's, by DMA, and [`reader`] makes
//! scans of the words.
//!
//! The chip has two faces on one serial port. In *ADC mode* a frame of CS clocks out the last
//! conversion while SDI is low. A frame whose SDI says "read a register" leads into *register
//! mode*, where every frame is a command and a read's answer comes with the next frame; writing 0
//! to address 0 leads back. Data sheet: AD7606B Rev. 0, "Software Mode", "Digital Interface",
//! "Register Summary".
//!
//! | file | what it holds |
//! |---|---|
//! | [`part`] | what differs between the parts |
//! | [`range`] | input ranges, codes to volts and back |
//! | [`registers`] | addresses and bits |
//! | [`frames`] | what comes out of the DOUT lines, and its CRC |
//! | [`converter`] | one chip: reset, identity, settings, diagnostics, single conversions |
//! | [`alignment`] | two chips: whether what they sent is in step with their clock |
//! | [`reader`] | two chips: sixteen channels per scan, and scans that went missing |

pub mod alignment;
pub mod converter;
pub mod error;
pub mod frames;
pub mod part;
pub mod range;
pub mod reader;
pub mod registers;
pub mod trouble;

pub use converter::{Converter, Settings};
pub use error::Error;
pub use part::{Oversampling, Part};
pub use range::Range;

/// Channels of one chip.
pub const CHANNELS: usize = 8;

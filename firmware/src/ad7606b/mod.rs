//! The AD7606B: eight channels, 16 bit, sampled simultaneously on one edge of CONVST; and its 16-
//! and 18-bit successors AD7606C-16 and AD7606C-18, which have the same pins, registers and frames.
//!
//! The driver uses the traits of embedded-hal, so that the same code runs with the chip and with
//! the model of it that the tests use. It covers set-up and the interpretation of the chip's data.
//! Transferring sixteen channels at 51.2 kHz is the board's task, by DMA; [`reader`] assembles
//! scans from the words.
//!
//! The chip has two modes on one serial port. In *ADC mode* a frame of CS clocks out the last
//! conversion while SDI is low. A frame whose SDI contains a register read command switches to
//! *register mode*, where every frame is a command and the value read arrives with the next frame;
//! writing 0 to address 0 returns to ADC mode. Data sheet: AD7606B Rev. 0, "Software Mode",
//! "Digital Interface", "Register Summary".
//!
//! | file | content |
//! |---|---|
//! | [`part`] | differences between the parts; input ranges, conversion between codes and volts |
//! | [`frames`] | data on the DOUT lines, and its CRC |
//! | [`converter`] | one chip: registers, reset, settings, diagnostics, single conversions |
//! | [`reader`] | two chips: alignment with their clock, sixteen channels per scan, faults |

pub mod converter;
pub mod frames;
pub mod part;
pub mod reader;

pub use converter::Error;
pub use converter::{Converter, Settings, registers};
pub use part::{Oversampling, Part, Range};

/// Channels of one chip.
pub const CHANNELS: usize = 8;

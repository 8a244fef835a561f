//! One chip: reset, identity, settings, diagnostics, single conversions; and its errors, with
//! messages for the operator at the rig.
//!
//! A register access takes two or three bytes, so it blocks for a few µs during set-up. Only the
//! end of a conversion is awaited asynchronously, for at most [`BUSY_PATIENCE`] times the data
//! sheet's longest conversion time.

use self::registers as reg;
use super::CHANNELS;
use super::frames::{CrcMismatch, INTERFACE_PATTERN, LINE_BYTES_MAX, Layout};
use super::part::{Lines, Oversampling, Part, Range};
use crate::sentence::{Sentence, Tell};
use core::fmt;
use embassy_futures::select::{Either, select};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::delay::DelayNs as WaitNs;
use embedded_hal_async::digital::Wait;

/// A RESET pulse of more than 3.2 µs is a full reset: AD7606B Rev. 0, "Timing Specifications",
/// tRESET.
const RESET_NS: u32 = 5_000;
/// After a full reset the chip loads its own calibration: tDEVICE_SETUP is 253 µs.
const SETUP_US: u32 = 300;
/// CONVST must be low for 10 ns before it rises: tLP_CNV. Switching a pin takes longer than that in
/// any case.
const CONVST_LOW_NS: u32 = 100;
/// Multiple of the longest conversion time after which BUSY is considered stuck.
pub const BUSY_PATIENCE: u32 = 3;
/// Diagnostics that are always enabled: ROM, register map, addresses, BUSY.
const WATCHED: u8 =
    reg::ROM_CRC | reg::MEMORY_MAP_CRC | reg::SPI_WRITE | reg::SPI_READ | reg::BUSY_STUCK_HIGH;

/// Configuration of the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Range of each channel.
    pub ranges: [Range; CHANNELS],
    /// Conversions averaged per sample.
    pub oversampling: Oversampling,
    /// DOUT lines in use.
    pub lines: Lines,
    /// Whether data and register frames carry a CRC.
    pub crc: bool,
    /// Bandwidth of 220 kHz instead of 25 kHz for the filters, on parts that support it.
    pub wide_band: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            ranges: [Range::Volts10; CHANNELS],
            oversampling: Oversampling::X8,
            lines: Lines::One,
            crc: true,
            wide_band: false,
        }
    }
}

/// One chip in software mode (OS0…OS2 tied high), on its own port: `S` frames each access with CS,
/// `R` is its RESET pin.
///
/// The port must use SPI mode 2 (clock idles high, data are sampled on its falling edge): AD7606B
/// Rev. 0, "Serial Interface".
#[derive(Debug)]
pub struct Converter<S, R> {
    spi: S,
    reset: R,
    part: &'static Part,
    settings: Settings,
    /// The chip is in register mode.
    in_registers: bool,
    /// Register frames carry a CRC.
    crc: bool,
}

/// Result type of a converter's methods.
type Done<S, R, T = ()> = Result<
    T,
    Error<<S as embedded_hal::spi::ErrorType>::Error, <R as embedded_hal::digital::ErrorType>::Error>,
>;

impl<S: SpiDevice, R: OutputPin> Converter<S, R> {
    /// A driver for a chip in unknown state; call [`Self::reset`] first.
    pub fn new(spi: S, reset: R, part: &'static Part) -> Self {
        Self { spi, reset, part, settings: Settings::default(), in_registers: false, crc: false }
    }

    /// Returns port and pin, with the chip in ADC mode, for a board that reads data by DMA.
    ///
    /// # Errors
    /// [`Error::Spi`].
    pub fn into_adc_mode(mut self) -> Done<S, R, (S, R)> {
        self.leave_registers()?;
        Ok((self.spi, self.reset))
    }

    /// Full reset: all registers return to their default values. Then checks that the chip was
    /// actually reset and that it is the expected part.
    ///
    /// # Errors
    /// [`Error::NotReset`], [`Error::Identity`], or the port's and pin's own.
    pub fn reset(&mut self, delay: &mut impl DelayNs) -> Done<S, R> {
        self.reset.set_high().map_err(Error::Pin)?;
        delay.delay_ns(RESET_NS);
        self.reset.set_low().map_err(Error::Pin)?;
        delay.delay_us(SETUP_US);
        self.in_registers = false;
        self.crc = false;
        // identity first: without a chip, the status is meaningless
        let found = self.read(reg::ID)?;
        if !self.part.device_ids.contains(&(found >> 4)) {
            return Err(Error::Identity { found, part: self.part.name });
        }
        let status = self.read(reg::STATUS)?;
        if status & reg::RESET_DETECT == 0 {
            return Err(Error::NotReset { status });
        }
        Ok(())
    }

    /// Applies the settings and reads each of them back.
    ///
    /// # Errors
    /// [`Error::NoRange`], [`Error::NoLayout`] before anything is written; [`Error::Readback`] when
    /// the chip did not accept a value.
    pub fn configure(&mut self, settings: &Settings) -> Done<S, R> {
        let part = self.part.name;
        if let Some(range) = settings.ranges.into_iter().find(|range| !self.part.ranges.contains(range)) {
            return Err(Error::NoRange { range, part });
        }
        if Layout::new(self.part, settings.lines, settings.crc).is_none() {
            return Err(Error::NoLayout { part });
        }
        // enable the CRC first, so that it protects the remaining accesses
        self.watch_itself(settings.crc, false)?;
        self.write(reg::CONFIG, settings.lines.code() << reg::LINES_SHIFT)?;
        for (pair, address) in settings.ranges.as_chunks::<2>().0.iter().zip(reg::RANGE_CH1_CH2..) {
            self.write(address, pair[0].code() | pair[1].code() << 4)?;
        }
        if self.part.has_bandwidth {
            self.write(reg::BANDWIDTH, if settings.wide_band { 0xFF } else { 0 })?;
        }
        self.write(reg::OVERSAMPLING, settings.oversampling.code())?;
        self.settings = *settings;
        Ok(())
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Digital errors since the last call; reading clears them. The bits are those of
    /// [`registers`].
    ///
    /// # Errors
    /// Errors of the port.
    pub fn digital_errors(&mut self) -> Done<S, R, u8> {
        let bits = self.read(reg::DIGITAL_DIAG_ERROR)?;
        if bits != 0 {
            self.send(reg::write_command(reg::DIGITAL_DIAG_ERROR, bits))?;
        }
        Ok(bits)
    }

    /// Enables the chip's automatic open-circuit detection on the channels whose bits are set. An
    /// input counts as open when it gave small codes for `conversions` consecutive conversions and
    /// then follows a change of the amplifier's common mode, which a driven input does not (AD7606B
    /// Rev. 0, "Open Circuit Detection"; each input needs 10 kΩ across it at the source end).
    ///
    /// # Errors
    /// Errors of the port, or [`Error::Readback`].
    pub fn watch_inputs(&mut self, channels: u8, conversions: u8) -> Done<S, R> {
        // 1 selects manual mode, in which the chip makes no decision
        self.write(reg::OPEN_DETECT_QUEUE, conversions.max(2))?;
        self.write(reg::OPEN_DETECT_ENABLE, channels)
    }

    /// Channels found open since the last call, one bit each; reading clears them.
    ///
    /// # Errors
    /// Errors of the port.
    pub fn open_inputs(&mut self) -> Done<S, R, u8> {
        let bits = self.read(reg::OPEN_DETECTED)?;
        if bits != 0 {
            self.send(reg::write_command(reg::OPEN_DETECTED, bits))?;
        }
        Ok(bits)
    }

    /// Whether the chip was reset since the last call: by a supply dip, unless the driver did it.
    ///
    /// # Errors
    /// Errors of the port.
    pub fn was_reset(&mut self) -> Done<S, R, bool> {
        Ok(self.read(reg::STATUS)? & reg::RESET_DETECT != 0)
    }

    /// Starts one conversion, waits for its end and reads the result through DOUTA. With several
    /// lines in use, the channels of the other lines stay 0, because a single port reads a single
    /// line.
    ///
    /// # Errors
    /// [`Error::BusyStuck`], [`Error::Data`], or errors of the port and pins.
    pub async fn convert<C, B>(
        &mut self,
        convst: &mut C,
        busy: &mut B,
        delay: &mut (impl DelayNs + WaitNs),
    ) -> Done<S, R, [i32; CHANNELS]>
    where
        C: OutputPin<Error = R::Error>,
        B: Wait<Error = R::Error>,
    {
        self.leave_registers()?;
        convst.set_low().map_err(Error::Pin)?;
        DelayNs::delay_ns(delay, CONVST_LOW_NS);
        convst.set_high().map_err(Error::Pin)?;
        let after_us = BUSY_PATIENCE * self.part.conversion_us(self.settings.oversampling);
        match select(busy.wait_for_low(), WaitNs::delay_us(delay, after_us)).await {
            Either::First(fallen) => fallen.map_err(Error::Pin)?,
            Either::Second(()) => return Err(Error::BusyStuck { after_us }),
        }
        // read only the first line, also when others are in use: bytes after a line's own data are
        // not read
        let layout = Layout::new(self.part, self.settings.lines, self.settings.crc)
            .ok_or(Error::NoLayout { part: self.part.name })?;
        let mut line = [0; LINE_BYTES_MAX];
        let line = &mut line[..layout.bytes()];
        // zeros on SDI: anything else could be interpreted as a command
        self.spi.transfer_in_place(line).map_err(Error::Spi)?;
        let mut codes = [0; CHANNELS];
        layout.decode(line, &mut codes).map_err(Error::Data)?;
        Ok(codes)
    }

    /// Makes the chip send its known test pattern instead of a conversion, checks the received
    /// data, and then reads the chip's own diagnostics.
    ///
    /// # Errors
    /// [`Error::Pattern`], [`Error::Digital`], and all errors of [`Self::convert`].
    pub async fn self_test<C, B>(
        &mut self,
        convst: &mut C,
        busy: &mut B,
        delay: &mut (impl DelayNs + WaitNs),
    ) -> Done<S, R>
    where
        C: OutputPin<Error = R::Error>,
        B: Wait<Error = R::Error>,
    {
        self.watch_itself(self.crc, true)?;
        // the first conversion after the switch still returns old data
        self.convert(convst, busy, delay).await?;
        let codes = self.convert(convst, busy, delay).await?;
        self.watch_itself(self.crc, false)?;
        let on_line = CHANNELS / self.settings.lines.count();
        for (channel, (code, due)) in codes.into_iter().zip(INTERFACE_PATTERN).take(on_line).enumerate() {
            // an 18-bit part sends the pattern in its upper 16 bits
            let found = (code >> (self.part.bits - 16)) as u16;
            if found != due {
                return Err(Error::Pattern { channel, found });
            }
        }
        match self.digital_errors()? {
            0 => Ok(()),
            bits => Err(Error::Digital { bits }),
        }
    }

    /// Writes DIGITAL_DIAG_ENABLE. The frame that enables the CRC does not carry one yet; the frame
    /// that disables it still does.
    fn watch_itself(&mut self, crc: bool, pattern: bool) -> Done<S, R> {
        let value = WATCHED
            | if crc { reg::INTERFACE_CRC } else { 0 }
            | if pattern { reg::INTERFACE_CHECK } else { 0 };
        self.enter_registers()?;
        self.send(reg::write_command(reg::DIGITAL_DIAG_ENABLE, value))?;
        self.crc = crc;
        self.confirm(reg::DIGITAL_DIAG_ENABLE, value)
    }

    fn write(&mut self, address: u8, value: u8) -> Done<S, R> {
        self.enter_registers()?;
        self.send(reg::write_command(address, value))?;
        self.confirm(address, value)
    }

    fn confirm(&mut self, address: u8, wrote: u8) -> Done<S, R> {
        let holds = self.read(address)?;
        if holds == wrote { Ok(()) } else { Err(Error::Readback { address, wrote, holds }) }
    }

    fn read(&mut self, address: u8) -> Done<S, R, u8> {
        self.send(reg::read_command(address))?;
        self.in_registers = true;
        // the value arrives with the next frame; repeating the same command has no side effect
        let [echo, value, crc] = self.send(reg::read_command(address))?;
        if self.crc && crc != reg::frame_crc([echo, value]) {
            return Err(Error::RegisterCrc { address });
        }
        Ok(value)
    }

    fn enter_registers(&mut self) -> Done<S, R> {
        if !self.in_registers {
            self.read(reg::ID)?;
        }
        Ok(())
    }

    fn leave_registers(&mut self) -> Done<S, R> {
        if self.in_registers {
            self.send(reg::LEAVE)?;
            self.in_registers = false;
        }
        Ok(())
    }

    /// Transfers one frame and returns the bytes received meanwhile.
    fn send(&mut self, command: [u8; 2]) -> Done<S, R, [u8; 3]> {
        let mut frame = [command[0], command[1], reg::frame_crc(command)];
        let used = if self.crc { 3 } else { 2 };
        self.spi.transfer_in_place(&mut frame[..used]).map_err(Error::Spi)?;
        Ok(frame)
    }
}

pub mod registers {
    //! Addresses, bits and command frames: AD7606B Rev. 0, "Register Summary" and "Register
    //! Details".

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

    /// Ranges of channels 1 and 2; the next three registers hold the other pairs. The odd channel
    /// is in the lower half.
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
    /// Conversions are replaced by [`super::super::frames::INTERFACE_PATTERN`] (in the enable
    /// register only).
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

    /// x⁸ + x² + x + 1, initial value zero: the third byte of a register frame while
    /// [`INTERFACE_CRC`] is set.
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
}

/// Why the converter cannot be used. `S` is the serial port's error, `P` the pins'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error<S, P> {
    /// The serial port failed.
    Spi(S),
    /// A pin failed.
    Pin(P),
    /// After a reset pulse the chip does not report a reset.
    NotReset {
        /// Its STATUS register.
        status: u8,
    },
    /// A different chip responds, or none.
    Identity {
        /// The value of the ID register.
        found: u8,
        /// The expected part.
        part: &'static str,
    },
    /// The response to a register command has a wrong CRC.
    RegisterCrc {
        /// The address of the register read.
        address: u8,
    },
    /// A register does not hold the value written to it.
    Readback {
        /// The register.
        address: u8,
        /// What was written.
        wrote: u8,
        /// What it holds.
        holds: u8,
    },
    /// The part does not support this range.
    NoRange {
        /// The requested range.
        range: Range,
        /// The part.
        part: &'static str,
    },
    /// The part does not support this data layout.
    NoLayout {
        /// The part.
        part: &'static str,
    },
    /// BUSY did not fall in time.
    BusyStuck {
        /// The waiting time, µs.
        after_us: u32,
    },
    /// The data of a conversion have a wrong CRC.
    Data(CrcMismatch),
    /// The test pattern was not received: a line is broken, shorted or clocked too fast.
    Pattern {
        /// The channel, from 0.
        channel: usize,
        /// The value received.
        found: u16,
    },
    /// The chip reports digital errors: the bits of DIGITAL_DIAG_ERROR.
    Digital {
        /// See [`super::registers`].
        bits: u8,
    },
}

impl<S, P> Tell for Error<S, P> {
    fn tell(&self, to: &mut Sentence) {
        match self {
            Self::Spi(_) => to.text("the serial port failed"),
            Self::Pin(_) => to.text("a pin failed"),
            Self::NotReset { status } => {
                to.text("not reset (status ").hex((*status).into(), 2).text("): check RESET and OS pins")
            }
            Self::Identity { found, part } => {
                to.text("ID ").hex((*found).into(), 2).text(" is no ").text(part);
                to.text(": check supply, SDI, DOUTA, CS")
            }
            Self::RegisterCrc { address } => {
                to.text("register ").hex((*address).into(), 2).text(": wrong CRC in the answer")
            }
            Self::Readback { address, wrote, holds } => {
                to.text("register ").hex((*address).into(), 2).text(": wrote ").hex((*wrote).into(), 2);
                to.text(", holds ").hex((*holds).into(), 2)
            }
            Self::NoRange { range, part } => {
                to.text(part).text(" has no range of code ").number(range.code().into())
            }
            Self::NoLayout { part } => to.text(part).text(" cannot send on so many lines"),
            Self::BusyStuck { after_us } => to.text("BUSY still high after ").number(*after_us).text(" us"),
            Self::Data(CrcMismatch { sent, due }) => {
                to.text("data CRC ").hex((*sent).into(), 4).text(" where ").hex((*due).into(), 4);
                to.text(" is due")
            }
            Self::Pattern { channel, found } => {
                to.text("test pattern of V").number(*channel as u32 + 1).text(": ").hex((*found).into(), 4)
            }
            Self::Digital { bits } => to.text("digital error ").hex((*bits).into(), 2),
        };
    }
}

impl<S, P> fmt::Display for Error<S, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Sentence::of(self).fmt(f)
    }
}

impl<S: fmt::Debug, P: fmt::Debug> core::error::Error for Error<S, P> {}

//! Model of the converter as in its data sheet: registers, the two modes of the port, RESET, CONVST
//! and BUSY with their timing, CRCs; and possible faults. Time is simulated: each wait advances it.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use embedded_hal::digital::{ErrorType as PinError, OutputPin};
use embedded_hal::spi::{ErrorType as SpiError, Operation, SpiDevice};

/// Faults of the chip or its wiring.
#[derive(Clone, Copy, Debug, Default)]
#[allow(clippy::struct_excessive_bools, reason = "faults come in any combination")]
pub struct Faults {
    /// BUSY never falls.
    pub busy_stuck: bool,
    /// This bit of every conversion's frame arrives inverted.
    pub flipped_bit: Option<usize>,
    /// The values returned by register reads arrive with their lowest data bit inverted.
    pub bad_answers: bool,
    /// The ID of another chip.
    pub id: Option<u8>,
    /// Writes to the range registers are ignored.
    pub ranges_stick: bool,
    /// DOUTA is not connected; a pull-up holds it high.
    pub no_dout: bool,
    /// RESET is not connected.
    pub no_reset: bool,
}

/// Internal state of the chip.
pub struct State {
    pub faults: Faults,
    /// Volts at V1 to V8.
    pub volts: [f64; 8],
    /// Inputs with nothing connected, one bit each.
    pub open: u8,
    pub now_ns: u64,
    pub conversions: u32,
    registers: [u8; 0x30],
    in_registers: bool,
    answer: [u8; 2],
    codes: [u16; 8],
    next_codes: [u16; 8],
    pattern_before: bool,
    busy_until_ns: u64,
    reset_at_ns: Option<u64>,
    ready_at_ns: u64,
    convst_high: bool,
    quiet: u32,
}

const PATTERN: [u16; 8] = [0xACCA, 0x5CC5, 0xA33A, 0x5335, 0xCAAC, 0xC55C, 0x3AA3, 0x3553];
const CONVERSION_NS: [u64; 9] = [850, 2_300, 4_800, 9_900, 20_000, 40_200, 80_800, 161_900, 324_000];

impl State {
    fn full_reset(&mut self) {
        self.registers = [0; 0x30];
        self.registers[0x01] = 0x80;
        self.registers[0x02] = 0x08;
        self.registers[0x03..=0x06].fill(0x33);
        self.registers[0x21] = 0x01;
        self.registers[0x2F] = self.faults.id.unwrap_or(0x14);
        self.in_registers = false;
        self.busy_until_ns = 0;
        self.ready_at_ns = self.now_ns + 253_000;
    }

    fn crc_on(&self) -> bool {
        self.registers[0x21] & 0x04 != 0
    }

    fn convst_rises(&mut self) {
        self.conversions += 1;
        let ratio = usize::from(self.registers[0x08] & 0x0F).min(8);
        self.busy_until_ns =
            if self.faults.busy_stuck { u64::MAX } else { self.now_ns + CONVERSION_NS[ratio] };
        if self.faults.busy_stuck {
            self.registers[0x22] |= self.registers[0x21] & 0x20;
        }
        let pattern = self.registers[0x21] & 0x80 != 0;
        self.codes = self.next_codes;
        self.next_codes = std::array::from_fn(|i| {
            if pattern && self.pattern_before {
                return PATTERN[i];
            }
            let range = self.registers[0x03 + i / 2] >> (4 * (i % 2)) & 0x0F;
            let full_scale = [2.5, 5.0].get(usize::from(range)).copied().unwrap_or(10.0);
            let volts = if self.open >> i & 1 == 1 { 0.0 } else { self.volts[i] };
            (volts / full_scale * 32_768.0).round().clamp(-32_768.0, 32_767.0) as i16 as u16
        });
        self.codes = self.next_codes;
        self.pattern_before = pattern;
        self.quiet += 1;
        let queue = self.registers[0x2C];
        if queue > 1 && self.quiet >= u32::from(queue) {
            self.registers[0x24] |= self.open & self.registers[0x23];
        }
    }

    /// One frame of CS: returns the output while `sdi` is the input.
    fn frame(&mut self, sdi: &[u8]) -> Vec<u8> {
        if self.faults.no_dout || self.now_ns < self.ready_at_ns {
            return vec![0xFF; sdi.len()];
        }
        let command = (sdi.len() >= 2 && (self.in_registers || sdi[0] & 0xC0 == 0x40))
            .then(|| (sdi[0], sdi[1], sdi.get(2).copied()));
        let mut out = if self.in_registers { self.register_answer() } else { self.conversion() };
        out.resize(sdi.len(), 0);
        if let Some((first, second, crc)) = command {
            let sound = !self.crc_on() || crc == Some(crc8(&[first, second]));
            if sound {
                self.obey(first, second);
            }
        }
        out
    }

    fn register_answer(&self) -> Vec<u8> {
        let mut out = self.answer.to_vec();
        out.push(crc8(&out));
        if self.faults.bad_answers {
            out[1] ^= 1;
        }
        out
    }

    fn conversion(&self) -> Vec<u8> {
        let lines = 1 << (self.registers[0x02] >> 3 & 3);
        let mut out: Vec<u8> = self.codes[..8 / lines].iter().flat_map(|code| code.to_be_bytes()).collect();
        if self.crc_on() {
            out.extend(crc16(&out).to_be_bytes());
        }
        if let Some(bit) = self.faults.flipped_bit {
            out[bit / 8] ^= 0x80 >> (bit % 8);
        }
        out
    }

    fn obey(&mut self, first: u8, value: u8) {
        let address = usize::from(first & 0x3F);
        if first & 0x40 != 0 {
            self.in_registers = true;
            match self.registers.get(address) {
                Some(held) => self.answer = [address as u8, *held],
                None => self.registers[0x22] |= self.registers[0x21] & 0x10,
            }
            if address == 0x01 {
                self.registers[0x01] &= 0x7F;
            }
            return;
        }
        match address {
            0x00 => self.in_registers = false,
            0x03..=0x06 if self.faults.ranges_stick => {}
            0x22 | 0x24 | 0x26 | 0x27 => self.registers[address] &= !value,
            0x02..=0x2C => self.registers[address] = value,
            _ => self.registers[0x22] |= self.registers[0x21] & 0x08,
        }
    }
}

fn divide<const WIDTH: u32>(polynomial: u32, data: &[u8]) -> u32 {
    data.iter().fold(0, |crc, byte| {
        (0..8).rev().fold(crc, |crc: u32, i| {
            let out = (crc >> (WIDTH - 1) ^ u32::from(byte >> i)) & 1;
            ((crc << 1) ^ (out * polynomial)) & ((1 << WIDTH) - 1)
        })
    })
}

fn crc8(data: &[u8]) -> u8 {
    divide::<8>(0x07, data) as u8
}

fn crc16(data: &[u8]) -> u16 {
    divide::<16>(0x755B, data) as u16
}

/// The chip and its pins.
#[derive(Clone)]
pub struct Model(Rc<RefCell<State>>);

impl Model {
    pub fn new(faults: Faults) -> Self {
        let mut state = State {
            faults,
            volts: [0.0; 8],
            open: 0,
            now_ns: 0,
            conversions: 0,
            registers: [0; 0x30],
            in_registers: false,
            answer: [0; 2],
            codes: [0; 8],
            next_codes: [0; 8],
            pattern_before: false,
            busy_until_ns: 0,
            reset_at_ns: None,
            ready_at_ns: 0,
            convst_high: true,
            quiet: 0,
        };
        state.full_reset();
        // a chip powered up earlier, whose status was already read
        state.registers[0x01] = 0;
        state.ready_at_ns = 0;
        Self(Rc::new(RefCell::new(state)))
    }

    pub fn with<R>(&self, f: impl FnOnce(&mut State) -> R) -> R {
        f(&mut self.0.borrow_mut())
    }

    pub fn register(&self, address: usize) -> u8 {
        self.with(|state| state.registers[address])
    }

    pub fn in_registers(&self) -> bool {
        self.with(|state| state.in_registers)
    }

    pub fn port(&self) -> Port {
        Port(self.clone())
    }

    pub fn reset_pin(&self) -> ResetPin {
        ResetPin(self.clone())
    }

    pub fn convst(&self) -> Convst {
        Convst(self.clone())
    }

    pub fn busy(&self) -> Busy {
        Busy(self.clone())
    }

    pub fn clock(&self) -> Clock {
        Clock(self.clone())
    }
}

pub struct Port(Model);
pub struct ResetPin(Model);
pub struct Convst(Model);
pub struct Busy(Model);
pub struct Clock(Model);

impl SpiError for Port {
    type Error = Infallible;
}

impl SpiDevice for Port {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        assert_eq!(operations.len(), 1, "one operation per frame is all the driver needs");
        for operation in operations {
            match operation {
                Operation::TransferInPlace(bytes) => {
                    let out = self.0.with(|state| state.frame(bytes));
                    bytes.copy_from_slice(&out);
                }
                other => panic!("SDI would not be defined in {other:?}"),
            }
        }
        Ok(())
    }
}

impl PinError for ResetPin {
    type Error = Infallible;
}

impl OutputPin for ResetPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.with(|state| {
            let held_ns = state.reset_at_ns.take().map_or(0, |at| state.now_ns - at);
            if held_ns >= 3_200 && !state.faults.no_reset {
                state.full_reset();
            }
        });
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.with(|state| state.reset_at_ns = Some(state.now_ns));
        Ok(())
    }
}

impl PinError for Convst {
    type Error = Infallible;
}

impl OutputPin for Convst {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.with(|state| state.convst_high = false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.with(|state| {
            if !state.convst_high {
                state.convst_high = true;
                state.convst_rises();
            }
        });
        Ok(())
    }
}

impl PinError for Busy {
    type Error = Infallible;
}

impl embedded_hal_async::digital::Wait for Busy {
    async fn wait_for_high(&mut self) -> Result<(), Infallible> {
        unreachable!("the driver waits for the end of BUSY only")
    }

    async fn wait_for_low(&mut self) -> Result<(), Infallible> {
        poll_fn(|_| {
            if self.0.with(|state| state.now_ns >= state.busy_until_ns) {
                Poll::Ready(Ok(()))
            } else {
                Poll::Pending
            }
        })
        .await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), Infallible> {
        unreachable!()
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        unreachable!()
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        unreachable!()
    }
}

impl embedded_hal::delay::DelayNs for Clock {
    fn delay_ns(&mut self, ns: u32) {
        self.0.with(|state| state.now_ns += u64::from(ns));
    }
}

impl embedded_hal_async::delay::DelayNs for Clock {
    async fn delay_ns(&mut self, ns: u32) {
        let end = self.0.with(|state| state.now_ns) + u64::from(ns);
        poll_fn(|context| {
            // 0.1 µs per poll, so that other waiting tasks observe the instants they wait for
            let now = self.0.with(|state| {
                state.now_ns += 100;
                state.now_ns
            });
            if now >= end {
                return Poll::Ready(());
            }
            context.waker().wake_by_ref();
            Poll::Pending
        })
        .await;
    }
}

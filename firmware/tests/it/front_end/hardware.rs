//! Register model of the hardware that reads two converters without the CPU: the CONVST clock with
//! its count of periods, the BUSY signal of each chip, an SPI port that must be disabled and
//! enabled between two transfers, and a DMA channel that writes its ring.

use jointrig_firmware::ad7606b::reader::{Clock, Moment, SCAN_WORDS};
use jointrig_hot::pair::{CHANNELS, CHIP_BYTES, data_crc};

/// Counts of the timer in a period, as on the board: 160 MHz / 51 200 Hz.
pub const PERIOD: u64 = 3_125;
/// Timer count at which the ports are disabled and enabled.
pub const RESTART: u64 = 40;
const EDGE: u64 = 160;
const CONVERSION: u64 = 1_584;
/// Timer counts per word: 16 bits of 25 ns.
const WORD: u64 = 64;
pub const BLOCK_SCANS: usize = 15;
pub const BLOCKS: usize = 8;
const RING_WORDS: usize = BLOCKS * BLOCK_SCANS * SCAN_WORDS as usize;
/// The same values as on the board.
pub const CLOCK: Clock = Clock { settled: 32, read_from: 960, read_by: 2_512 };

/// A fault in one read-out of one chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slip {
    /// The falling edge of BUSY is missed.
    Missed,
    /// A glitch on BUSY starts a second read-out.
    Twice,
    /// One word is lost in transfer.
    WordLost,
}

/// The SPI port, as far as RM0456 specifies what starts a transfer.
#[derive(Clone, Copy, Default)]
struct Port {
    /// SPE was set after the last transfer ended.
    ready: bool,
}

impl Port {
    /// A write to CR1.
    fn cr1(&mut self, spe: bool) {
        self.ready = spe;
    }

    /// A trigger; returns whether a transfer starts.
    fn trigger(&mut self) -> bool {
        std::mem::take(&mut self.ready)
    }
}

struct Chip {
    port: Port,
    ring: Vec<u16>,
    /// Words written since the start.
    written: u64,
}

/// Both chips and the clock, simulated scan by scan.
pub struct Hardware {
    chips: [Chip; 2],
    /// Whether a DMA channel restarts the ports.
    restarts: bool,
    slip: Option<(u64, usize, Slip)>,
    /// Words being read or to be read: (instant of their end, chip, word).
    pending: Vec<(u64, usize, u16)>,
    /// Simulated up to this instant, in counts.
    now: u64,
}

impl Hardware {
    /// Starts the hardware, with a slip of one chip at one scan.
    pub fn new(restarts: bool, slip: Option<(u64, usize, Slip)>) -> Self {
        let chip = || Chip { port: Port { ready: true }, ring: vec![0; RING_WORDS], written: 0 };
        Self { chips: [chip(), chip()], restarts, slip, pending: Vec::new(), now: 0 }
    }

    /// The code of a channel in a scan; different for every channel.
    pub fn code(scan: u64, channel: usize) -> i16 {
        (scan * 31 + channel as u64 * 977) as i16
    }

    /// Advances the time to this instant, in counts.
    pub fn go_on(&mut self, until: u64) {
        while self.now < until {
            let (scan, phase) = (self.now / PERIOD, self.now % PERIOD);
            if phase == RESTART && self.restarts {
                for chip in &mut self.chips {
                    chip.port.cr1(false);
                    chip.port.cr1(true);
                }
            }
            if phase == EDGE + CONVERSION {
                for number in 0..2 {
                    self.end_of_busy(scan, number);
                }
            }
            let now = self.now;
            while let Some(at) = self.pending.iter().position(|word| word.0 == now) {
                let (_, number, word) = self.pending.remove(at);
                let chip = &mut self.chips[number];
                chip.ring[(chip.written % RING_WORDS as u64) as usize] = word;
                chip.written += 1;
            }
            self.now += 1;
        }
    }

    fn end_of_busy(&mut self, scan: u64, number: usize) {
        let slip = self.slip.filter(|(at, chip, _)| (*at, *chip) == (scan, number)).map(|(_, _, slip)| slip);
        if slip == Some(Slip::Missed) {
            return;
        }
        let times = if slip == Some(Slip::Twice) { 2 } else { 1 };
        for time in 0..times {
            if time == 1 {
                // the glitch coincides with a restart, otherwise it would have no effect
                self.chips[number].port.cr1(true);
            }
            if !self.chips[number].port.trigger() {
                continue;
            }
            let codes: [i16; CHANNELS] = std::array::from_fn(|i| Self::code(scan, number * CHANNELS + i));
            let words = codes.into_iter().map(i16::cast_unsigned).chain([data_crc(&codes)]);
            let lost = usize::from(slip == Some(Slip::WordLost));
            for (place, word) in words.skip(lost).enumerate() {
                let end = self.now + time * 5 + (place as u64 + 1) * WORD;
                self.pending.push((end, number, word));
            }
        }
    }

    /// Whether both chips have sent block `number`, counted by words as the DMA's interrupts do.
    pub fn has(&self, number: u32) -> bool {
        let end = (u64::from(number) + 1) * BLOCK_SCANS as u64 * u64::from(SCAN_WORDS);
        self.chips.iter().all(|chip| chip.written >= end)
    }

    /// A block of one chip as it is in memory now.
    pub fn block(&self, chip: usize, number: u32) -> Vec<[u8; CHIP_BYTES]> {
        let words = BLOCK_SCANS * SCAN_WORDS as usize;
        let begin = number as usize % BLOCKS * words;
        let bytes: Vec<u8> =
            self.chips[chip].ring[begin..begin + words].iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.as_chunks().0.to_vec()
    }

    /// The values that the program reads now.
    pub fn look(&self) -> Moment {
        let words = [0, 1].map(|chip: usize| (self.chips[chip].written % RING_WORDS as u64) as u32);
        Moment { periods: (self.now / PERIOD) as u32, phase: (self.now % PERIOD) as u32, words }
    }

    /// The present instant, in counts.
    pub fn now(&self) -> u64 {
        self.now
    }
}

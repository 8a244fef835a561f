//! The two converters of an emulated board and the rings that they are read into, as hardware would
//! fill them.

use jointrig_firmware::ad7606b::reader::{Moment, SCAN_WORDS};
use jointrig_firmware::lockstep::{CLOCK, Delivery, RING_BLOCKS};
use jointrig_hot::pair::{CHANNELS, CHIP_BYTES, data_crc};

/// Alignment errors that the hardware introduces into a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slip {
    /// Words that each converter did not send, from some scan of the block on; negative if sent
    /// twice. A scan is nine words.
    pub lags: [i32; 2],
    /// Scans by which the program appears to be late.
    pub late: u32,
}

/// Words of a block of both converters, and the time at which the program reads them.
pub struct FrontEnd {
    per_block: usize,
    channels: usize,
    /// The first scan in the rings.
    started_at: u64,
}

impl FrontEnd {
    /// Rings that have not started yet.
    pub fn new(per_block: usize, channels: usize) -> Self {
        Self { per_block, channels, started_at: 0 }
    }

    /// Restarts the rings with this scan.
    pub fn join(&mut self, first_scan: u64) {
        self.started_at = first_scan;
    }

    /// Blocks that must be converted until both rings contain a whole one and the program reads
    /// them.
    pub fn blocks_for(&self, slip: &Slip) -> usize {
        1 + (scans_of(slip.lags) + slip.late as usize).div_ceil(self.per_block)
    }

    /// The delivery of the block that begins with scan `first`, and its words, taken from `codes`
    /// (scan by scan, as many blocks as [`FrontEnd::blocks_for`] returns). The slip occurs at scan
    /// `at` of the block.
    pub fn deliver(&self, first: u64, codes: &[i16], slip: &Slip, at: usize) -> (Delivery, Vec<u8>) {
        let read = self.per_block + scans_of(slip.lags) + slip.late as usize;
        let words =
            (0..2).flat_map(|chip| self.sent(codes, chip, slip.lags[chip], at)).flat_map(u16::to_le_bytes);
        let ring = i64::from(RING_BLOCKS * SCAN_WORDS) * (self.per_block as u64).cast_signed();
        let since = (first - self.started_at + read as u64).cast_signed();
        let place = |lag: i32| (since * i64::from(SCAN_WORDS) - i64::from(lag)).rem_euclid(ring) as u32;
        let moment = Moment {
            periods: (first as u32).wrapping_add(read as u32).wrapping_sub(1),
            phase: CLOCK.read_by,
            words: slip.lags.map(place),
        };
        let produced = first + (codes.len() / self.channels) as u64;
        let delivery = Delivery {
            scans: self.per_block as u32,
            periods: produced as u32,
            moment,
            ..Delivery::default()
        };
        (delivery, words.collect())
    }

    /// The delivery after the converters stopped at scan `first` for `scans` scans.
    pub fn stood_still(&self, first: u64, scans: u64) -> (Delivery, Vec<u8>) {
        let ring = u64::from(RING_BLOCKS * SCAN_WORDS) * self.per_block as u64;
        let place = (first - self.started_at) * u64::from(SCAN_WORDS) % ring;
        let periods = (first + scans) as u32;
        let moment =
            Moment { periods: periods.wrapping_sub(1), phase: CLOCK.read_by, words: [place as u32; 2] };
        let delivery = Delivery { scans: self.per_block as u32, periods, moment, ..Delivery::default() };
        (delivery, vec![0; 2 * self.per_block * CHIP_BYTES])
    }

    /// Words that one converter has put into its ring for this block.
    fn sent(&self, codes: &[i16], chip: usize, lag: i32, at: usize) -> Vec<u16> {
        let mut words: Vec<u16> = codes
            .chunks_exact(self.channels)
            .flat_map(|scan| {
                let code = |i: usize| scan.get(chip * CHANNELS + i).copied().unwrap_or(0);
                let eight: [i16; CHANNELS] = std::array::from_fn(code);
                eight.into_iter().map(i16::cast_unsigned).chain([data_crc(&eight)])
            })
            .collect();
        let from = at * SCAN_WORDS as usize;
        let count = lag.unsigned_abs() as usize;
        if lag > 0 {
            words.drain(from..from + count);
        } else {
            let again = words[from.saturating_sub(count)..from.max(count)].to_vec();
            words.splice(from..from, again);
        }
        words.truncate(self.per_block * SCAN_WORDS as usize);
        words
    }
}

/// Scans until the converter that lags most has sent a whole block.
fn scans_of(lags: [i32; 2]) -> usize {
    lags.map(|lag| lag.max(0).cast_unsigned().div_ceil(SCAN_WORDS) as usize).into_iter().max().unwrap_or(0)
}

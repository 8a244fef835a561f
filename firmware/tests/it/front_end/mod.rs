//! Tests of two converters that are read without the CPU, with a model of the registers: slips of
//! every kind, a program that reads at any time, and ports that need a restart; and the timing of a
//! bit, from the data sheets.

mod hardware;
mod noise;
mod timing;

use hardware::{BLOCK_SCANS, BLOCKS, CLOCK, Hardware, PERIOD, Slip};
use jointrig_firmware::ad7606b::reader::{Alignment, Moment, Reader, Trouble, Verdict};

const CHANNELS: usize = 16;

fn alignment() -> Alignment {
    Alignment { clock: CLOCK, block_scans: BLOCK_SCANS as u32, blocks: BLOCKS as u32 }
}

/// Reads until a fault occurs or `blocks` blocks have arrived; `late` gives the delay of each read
/// in counts. Compares every delivered scan with the converted values. Returns the number of scans
/// and the fault.
fn read(hardware: &mut Hardware, blocks: u32, mut late: impl FnMut(u32) -> u64) -> (u64, Option<Trouble>) {
    let mut reader = Reader::new(alignment(), CHANNELS, 0);
    reader.start(0);
    let mut scans = 0;
    for number in 0..blocks {
        let patience = hardware.now() + 5 * BLOCK_SCANS as u64 * PERIOD;
        while !hardware.has(number) {
            hardware.go_on(hardware.now() + 1);
            if hardware.now() > patience {
                return (scans, Some(Trouble::Silent(number, number)));
            }
        }
        hardware.go_on(hardware.now() + late(number));
        let chips = [hardware.block(0, number), hardware.block(1, number)];
        let mut out = [0; BLOCK_SCANS * CHANNELS * 2];
        let look = || {
            hardware.go_on(hardware.now() + 20);
            hardware.look()
        };
        match reader.take([&chips[0], &chips[1]], look, &mut out) {
            Ok((delivered, trouble)) => {
                assert_eq!(delivered.missed, 0);
                for (scan, codes) in
                    out.as_chunks::<{ CHANNELS * 2 }>().0[..delivered.scans.into()].iter().enumerate()
                {
                    for (channel, code) in codes.as_chunks().0.iter().enumerate() {
                        let due = Hardware::code(scans + scan as u64, channel);
                        assert_eq!(i16::from_le_bytes(*code), due, "scan {scan} of block {number}");
                    }
                }
                scans += u64::from(delivered.scans);
                if trouble.is_some() {
                    return (scans, trouble);
                }
            }
            Err(trouble) => return (scans, Some(trouble)),
        }
    }
    (scans, None)
}

#[test]
fn blocks_that_are_looked_at_at_any_time_are_proven() {
    // anywhere in a period, and up to six blocks late: seven blocks are safe from being overwritten
    for late in (0..6 * BLOCK_SCANS as u64 * PERIOD).step_by(1_237) {
        let mut hardware = Hardware::new(true, None);
        let late_once = |number: u32| if number == 3 { late } else { 0 };
        assert_eq!(read(&mut hardware, 12, late_once), (12 * BLOCK_SCANS as u64, None), "{late} counts late");
    }
}

#[test]
fn a_block_that_may_have_been_overwritten_is_not_believed() {
    for blocks_late in [7_u64, 8, 9, 15, 16, 17] {
        let mut hardware = Hardware::new(true, None);
        let late = blocks_late * BLOCK_SCANS as u64 * PERIOD;
        let late_once = |number: u32| if number == 3 { late } else { 0 };
        let (scans, trouble) = read(&mut hardware, 12, late_once);
        assert_eq!(
            (scans, trouble),
            (3 * BLOCK_SCANS as u64, Some(Trouble::Overrun)),
            "{blocks_late} blocks late"
        );
    }
}

#[test]
fn every_slip_is_found_in_its_own_block_however_late_the_program_is() {
    for slip in [Slip::Missed, Slip::Twice, Slip::WordLost] {
        for chip in [0, 1] {
            for at in [45, 52, 59] {
                for late in [0, 1_000, 3_000, 20_000, 100_000, 250_000] {
                    let mut hardware = Hardware::new(true, Some((at, chip, slip)));
                    let (scans, trouble) =
                        read(&mut hardware, 12, |number| if number == 3 { late } else { 0 });
                    let words = match slip {
                        Slip::Missed => 9,
                        Slip::Twice => -9,
                        Slip::WordLost => 1,
                    };
                    let due = if chip == 0 { Trouble::Slipped(words, 0) } else { Trouble::Slipped(0, words) };
                    // nothing of its block and nothing after it was delivered
                    assert_eq!((scans, trouble), (45, Some(due)), "{slip:?} of {chip} at {at}, {late} late");
                }
            }
        }
    }
}

#[test]
fn without_a_restart_the_ports_read_once_and_never_again() {
    let mut hardware = Hardware::new(false, None);
    assert_eq!(read(&mut hardware, 4, |_| 0), (0, Some(Trouble::Silent(0, 0))));
}

#[test]
fn counts_may_wrap() {
    // the count of periods wraps after a day; the ring has a power of two of blocks, so the count
    // of blocks may wrap
    let number = u32::MAX - 2;
    let begin = number.wrapping_mul(BLOCK_SCANS as u32);
    let words =
        (number % BLOCKS as u32 * BLOCK_SCANS as u32 + BLOCK_SCANS as u32) * 9 % (BLOCKS as u32 * 135);
    let moment = Moment { periods: begin.wrapping_add(14), phase: CLOCK.read_by, words: [words; 2] };
    assert_eq!(alignment().judge(number, &moment), Verdict::Proven);
}

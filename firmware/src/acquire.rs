//! Acquisition: blocks of scans from the converters, through the hammer's machine, into the ring.
//!
//! One block is 15 scans of 16 channels, 293 µs at 51.2 kHz: that is the time this task has for each. What
//! it does with a block is bounded and done under one lock; the orders for coil and drive that come of it
//! are carried out right after.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use jointrig_protocol::block::{OVER_RANGE, TRIGGER};
use jointrig_protocol::event::{Event, Loss, Reason};
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;

use crate::Core;
use crate::board::{Coil, Delivered, Drive, Inputs, Scans};
use crate::hammer::{CoilOrder, Scanned};
use crate::ring::Range;

/// Runs for ever.
pub async fn acquire<M: RawMutex, S: Scans, C: Coil, D: Drive, I: Inputs>(
    core: &Core<'_, M>,
    scans: &mut S,
    coil: &mut C,
    drive: &mut D,
    inputs: &mut I,
) -> ! {
    let mut samples = Aligned([0; BLOCK_SAMPLE_BYTES]);
    let mut codes = [0; BLOCK_SAMPLE_BYTES / 2];
    loop {
        if scans.can_be_held() {
            core.wait_until_it_may_run().await;
        }
        let delivered = scans.next(&mut samples.0).await;
        core.watch_inputs(inputs);
        let given = core.take(delivered, &samples.0, &mut codes);
        let (coil_order, drive_off) =
            core.with(|state| (state.coil.take(), core::mem::take(&mut state.drive_off)));
        match coil_order {
            Some(CoilOrder::Pulse(width_us)) => coil.pulse(width_us.min(coil.cap_us())),
            Some(CoilOrder::Off) => coil.off(),
            None => {}
        }
        if drive_off {
            drive.rest();
        } else if given.codes > 0 && drive.play(&codes[..given.codes]).is_err() {
            core.with(|state| {
                let stops = state.shaker.halt(Reason::RanDry);
                state.tell_of_shaker(stops);
            });
        } else if given.last {
            // a drive that has just taken codes takes their end
            let _ = drive.play(&[]);
        }
        core.to_send.signal(());
    }
}

/// What a block has yielded for the drive.
#[derive(Clone, Copy, Default)]
struct Given {
    codes: usize,
    /// The shaker is at rest after these.
    last: bool,
}

/// Words are copied faster than bytes.
#[repr(align(4))]
struct Aligned([u8; BLOCK_SAMPLE_BYTES]);

/// The block in hand, for the hammer's machine.
struct InHand<'a> {
    first_scan: u64,
    channels: usize,
    samples: &'a [[u8; 2]],
}

impl Scanned for InHand<'_> {
    fn first_scan(&self) -> u64 {
        self.first_scan
    }

    fn scans(&self) -> usize {
        self.samples.len() / self.channels
    }

    fn code(&self, scan: usize, channel: usize) -> i16 {
        i16::from_le_bytes(self.samples[scan * self.channels + channel])
    }
}

/// Whether any code is at the end of the converter's range.
fn over_range(codes: &[[u8; 2]]) -> bool {
    // sign and next bit differ in every code beyond half of the range: two codes at a time tell the usual
    // block, which needs no closer look
    let (words, rest) = codes.as_flattened().as_chunks::<4>();
    let large = words.iter().fold(0, |large, word| {
        let word = u32::from_le_bytes(*word);
        large | (word ^ (word << 1))
    }) & 0x8000_8000;
    (large != 0 || !rest.is_empty())
        && codes.iter().any(|pair| matches!(i16::from_le_bytes(*pair), i16::MAX | i16::MIN))
}

impl<M: RawMutex> Core<'_, M> {
    /// A front end that can be held waits here: without a stream, and half a ring ahead of the host.
    async fn wait_until_it_may_run(&self) {
        loop {
            let runs = self.with(|state| {
                let ahead = state.next_scan.saturating_sub(state.acknowledged);
                state.streaming && ahead < u64::from(state.ring.capacity_scans() / 2)
            });
            if runs {
                return;
            }
            self.may_run.wait().await;
        }
    }

    /// Interlock and emergency stop, once a block. The hardware acts on both by itself; this is how the
    /// machine learns of it. A board whose inputs interrupt tells sooner ([`Core::see_inputs`]).
    fn watch_inputs(&self, inputs: &mut impl Inputs) {
        let closed = inputs.interlock_closed();
        let pressed = inputs.emergency_stop();
        let reset = inputs.local_reset();
        if let Some(fault) = inputs.fault() {
            self.report_fault(fault);
        }
        self.with(|state| {
            if state.emergency_stop && !pressed && reset {
                state.emergency_stop = false;
                state.say(Event::EmergencyStop(false));
            }
            state.heed(closed, pressed);
        });
    }

    /// Takes one delivered block, and writes the codes for the drive.
    fn take(&self, delivered: Delivered, samples: &[u8; BLOCK_SAMPLE_BYTES], codes: &mut [i16]) -> Given {
        let channels = self.facts.channels.len();
        let (pairs, _) = samples.as_chunks::<2>();
        let count = (usize::from(delivered.scans) * channels).min(pairs.len() / channels * channels);
        let pairs = &pairs[..count];
        let over = over_range(pairs);
        self.with(|state| {
            state.last_block = Instant::now();
            if delivered.missed > 0 {
                // whatever was to move was to move by what these scans would have shown
                state.bring_to_rest(Reason::FrontEnd);
                state.counters.scans_missed += u64::from(delivered.missed);
                if state.streaming {
                    // what waited to be sent may still hold an unreported loss of its own
                    state.report_loss(Loss::LinkSlow);
                    let range = Range { first_scan: state.next_scan, scans: u64::from(delivered.missed) };
                    state.ring.report(range);
                    state.report_loss(Loss::FrontEnd);
                }
                state.next_scan += u64::from(delivered.missed);
            }
            let block = InHand { first_scan: state.next_scan, channels, samples: pairs };
            let scans = block.scans();
            if scans == 0 {
                return Given::default();
            }
            let outcome = state.hammer.block(&block, state.friction.as_ref());
            if let Some(friction) = &state.friction {
                state.friction_n = friction.mean_of(scans, |scan, channel| block.code(scan, channel));
            }
            let flags = if over { OVER_RANGE } else { 0 } | if outcome.trigger { TRIGGER } else { 0 };
            if state.streaming {
                let dropped = state.ring.push(state.next_scan, flags, scans as u8, samples);
                state.counters.scans_dropped += dropped;
                state.counters.scans_produced += scans as u64;
            }
            let moves = state.shaker.moves();
            if moves {
                let events = state.shaker.block(&block, &mut codes[..scans]);
                state.tell_of_shaker(events.into_iter().flatten());
            }
            state.next_scan += scans as u64;
            state.tell(&outcome);
            Given { codes: if moves { scans } else { 0 }, last: moves && !state.shaker.moves() }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_of_the_range_are_seen_wherever_they_stand() {
        for end in [i16::MIN, i16::MAX] {
            for count in 1..=9 {
                for at in 0..count {
                    let mut codes = [[0x34, 0x12]; 9];
                    assert!(!over_range(&codes[..count]));
                    codes[at] = end.to_le_bytes();
                    assert!(over_range(&codes[..count]), "{end} at {at} of {count}");
                }
            }
        }
        for near in [i16::MIN + 1, i16::MAX - 1, i16::MAX / 2 + 1, -1, 0] {
            assert!(!over_range(&[near.to_le_bytes(); 8]));
        }
    }
}

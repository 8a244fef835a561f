//! Acquisition: takes blocks of scans from the converters, passes them through the hammer's state
//! machine, and puts them into the ring.
//!
//! One block is 15 scans of 16 channels, 293 µs at 51.2 kHz: this is the time budget per block. The
//! work per block is bounded and done under one lock; the resulting orders for coil and drive are
//! carried out immediately afterwards.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_hot::codes;
use jointrig_protocol::block::{OVER_RANGE, TRIGGER};
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;

use crate::Core;
use crate::board::{Coil, Delivered, Drive, Inputs, Scans};
use crate::hammer::{CoilOrder, Scanned};
use crate::safety::{Driven, Orders};
use crate::state::State;

/// Unsent blocks at which the transmit task is woken: waking it costs a tenth of the processing of
/// a block, and no block is that urgent. A smaller remainder is sent after the next period of
/// [`crate::safety`], at most 0.1 s later.
const BLOCKS_PER_WAKE: u64 = 4;

/// Runs forever.
pub async fn acquire<M: RawMutex, S: Scans, C: Coil, D: Drive, I: Inputs>(
    core: &Core<'_, M>,
    scans: &mut S,
    coil: &mut C,
    drive: &mut D,
    inputs: &mut I,
) -> ! {
    let mut samples = Aligned([0; BLOCK_SAMPLE_BYTES]);
    let mut codes = [0; BLOCK_SAMPLE_BYTES / 2];
    // a host may ask for the inputs before a stream runs
    core.watch_inputs(inputs);
    loop {
        if scans.can_be_held() {
            // a clock can be requested while no stream runs
            while !core.wait_until_it_may_run().await {
                core.keep_in_step(scans);
            }
        }
        let delivered = scans.next(&mut samples.0).await;
        core.watch_inputs(inputs);
        let given = core.take(delivered, &samples.0, &mut codes);
        match given.coil {
            Some(CoilOrder::Pulse(width_us)) => coil.pulse(width_us.min(coil.cap_us())),
            Some(CoilOrder::Off) => coil.off(),
            None => {}
        }
        if given.drive_off {
            drive.rest();
        } else if given.codes > 0 && drive.play(&codes[..given.codes]).is_err() {
            core.with(|state| state.safety().drive_ran_dry());
        } else if given.last {
            // ignored: a drive that has just accepted codes also accepts their end
            let _ = drive.play(&[]);
        }
        if let Some(seen) = scans.seen() {
            core.see(seen, S::PERIOD);
        }
        if given.sync {
            core.keep_in_step(scans);
        }
        if given.send {
            core.to_send.signal(());
        }
    }
}

/// Results of a block.
#[derive(Clone, Copy, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own, true or not")]
struct Given {
    /// Codes for the drive.
    codes: usize,
    /// The shaker is at rest after these codes.
    last: bool,
    /// An order for the coil, from this block or from another task.
    coil: Option<CoilOrder>,
    /// The drive must go to rest immediately.
    drive_off: bool,
    /// The transmit task must be woken.
    send: bool,
    /// The board must apply a clock change or raise the sync output.
    sync: bool,
}

/// Aligned, because words are copied faster than bytes.
#[repr(align(4))]
struct Aligned([u8; BLOCK_SAMPLE_BYTES]);

/// The current block, as the hammer's state machine reads it.
struct InHand<'a> {
    first_scan: u64,
    /// 16-bit words per scan.
    words: usize,
    samples: &'a [[u8; 2]],
}

impl Scanned for InHand<'_> {
    fn first_scan(&self) -> u64 {
        self.first_scan
    }

    fn scans(&self) -> usize {
        self.samples.len() / self.words
    }

    fn code(&self, scan: usize, channel: usize) -> i16 {
        i16::from_le_bytes(self.samples[scan * self.words + channel])
    }
}

impl<M: RawMutex> Core<'_, M> {
    /// Waits while a front end that can be held must not run: without a stream, or when it is half
    /// a ring ahead of the host's acknowledgement. Returns false when the board must first apply a
    /// clock change or raise the sync output.
    async fn wait_until_it_may_run(&self) -> bool {
        loop {
            let (runs, due) = self.with(|state| (state.may_scan(), state.in_step().is_due()));
            if due {
                return false;
            }
            if runs {
                return true;
            }
            // send what remains of the delivered blocks
            self.to_send.signal(());
            self.may_run.wait().await;
        }
    }

    /// Reads interlock and emergency stop, once per block. The hardware acts on both independently;
    /// this call informs the state machine. A board whose inputs trigger interrupts reports changes
    /// sooner ([`Core::see_inputs`]).
    fn watch_inputs(&self, inputs: &mut impl Inputs) {
        let closed = inputs.interlock_closed();
        let pressed = inputs.emergency_stop();
        let reset = inputs.local_reset();
        if let Some(fault) = inputs.fault() {
            self.report_fault(fault);
        }
        if let Some(slow) = inputs.slow() {
            self.with(|state| state.safety().take_slow(slow));
        }
        self.with(|state| state.safety().poll_inputs(closed, pressed, reset));
    }

    /// Processes one delivered block and writes the codes for the drive.
    fn take(&self, delivered: Delivered, samples: &[u8; BLOCK_SAMPLE_BYTES], codes: &mut [i16]) -> Given {
        let words = self.words;
        let (pairs, _) = samples.as_chunks::<2>();
        let pairs = &pairs[..(usize::from(delivered.scans) * words).min(pairs.len())];
        let over = delivered.loud && codes::is_over(pairs);
        self.with(|state| {
            let given = state.take(delivered, words, pairs, over, samples, codes);
            let send = state.unsent_blocks() >= BLOCKS_PER_WAKE || state.has_words();
            let sync = state.in_step().is_due();
            let Orders { coil, drive_off } = state.safety().take_orders();
            Given { coil, drive_off, send, sync, ..given }
        })
    }
}

impl State<'_> {
    /// Processes a block that follows `delivered.missed` missed scans; `pairs` are its codes, in
    /// whole scans.
    fn take(
        &mut self,
        delivered: Delivered,
        words: usize,
        pairs: &[[u8; 2]],
        over: bool,
        samples: &[u8; BLOCK_SAMPLE_BYTES],
        codes: &mut [i16],
    ) -> Given {
        self.safety().scans_arrived();
        if delivered.missed > 0 {
            self.lose_scans(delivered.missed);
        }
        let block = InHand { first_scan: self.safety().next_scan(), words, samples: pairs };
        let scans = block.scans();
        if scans == 0 {
            return Given::default();
        }
        let outcome = self.judge(&block);
        let trigger = outcome.as_ref().is_some_and(|outcome| outcome.trigger);
        let flags = if over { OVER_RANGE } else { 0 } | if trigger { TRIGGER } else { 0 };
        self.keep(flags, scans, samples, pairs, words);
        let Driven { codes, last } = self.safety().drive(&block, codes);
        self.safety().advance(scans as u64);
        if let Some(outcome) = &outcome {
            self.follow(outcome);
        }
        Given { codes, last, ..Given::default() }
    }
}

//! The scans between the thread that reads the stream and the thread of the device.
//!
//! A recorder does not wait: what does not fit the queue is counted as lost, and the scan index
//! advances over it. A source that can wait is read only as fast as the device takes its scans.

use std::collections::VecDeque;
use std::future::poll_fn;
use std::io::Read;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use embassy_time::{Duration, Timer};
use jointrig_firmware::board::{Delivered, Scans};
use jointrig_native::link::DeviceEnd;
use jointrig_protocol::channel::words_per_scan;
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, scans_per_block};

use crate::blocks::Blocks;
use crate::convert::{Converter, Run};
use crate::header::Header;

/// Duration of the scans that the queue holds, s.
pub const QUEUE_S: f64 = 2.0;

/// The same for a source that can wait, s: what is read ahead is old when the host acts.
const QUEUE_HELD_S: f64 = 0.05;

/// Blocks that are taken before the other tasks of the device run: a burst after a pause must be
/// sent while it is taken, or it would overwrite itself in the ring.
const BLOCKS_PER_TURN: u32 = 4;

/// Wait between the last scan and the end of the device, in which the last blocks are sent: the
/// transmit task looks for a remainder every 0.1 s.
const LAST_BLOCKS: Duration = Duration::from_millis(250);

/// Longest block of a program with a hammer, s: 0.1 s without scans disarm it, and a PC delivers
/// none exactly on time.
const BLOCK_WITH_HAMMER_S: f64 = 0.05;

/// Most remarks that wait to be read.
const REMARKS_KEPT: usize = 256;

/// An entry of the queue.
#[derive(Debug)]
enum Entry {
    /// Words of scans, of which the first `taken` have left the queue.
    Codes {
        words: Vec<i16>,
        taken: usize,
    },
    Lost(u64),
}

#[derive(Debug, Default)]
struct State {
    entries: VecDeque<Entry>,
    /// Scans of all entries with codes.
    scans: u64,
    /// Scans that did not fit since the last entry.
    overflowed: u64,
    told_overflow: bool,
    /// Why no more scans come.
    ended: Option<String>,
    /// The device has ended.
    closed: bool,
    waker: Option<Waker>,
    remarks: VecDeque<String>,
    longest_block: u32,
}

/// The queue of one stream.
#[derive(Debug)]
pub struct Queue {
    state: Mutex<State>,
    /// Signals that the queue has room again, or that the device has ended.
    room: Condvar,
    /// 16-bit words per scan.
    words: usize,
    most: u64,
    held: bool,
}

impl Queue {
    /// An empty queue for the scans of this header.
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let seconds = if header.held { QUEUE_HELD_S } else { QUEUE_S };
        Self {
            state: Mutex::default(),
            room: Condvar::new(),
            words: words_per_scan(&header.channels),
            most: (seconds * header.rate_hz).ceil() as u64,
            held: header.held,
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // every change of the state is complete before anything can panic
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Why no more scans come, once they do not.
    pub fn ended(&self) -> Option<String> {
        self.lock().ended.clone()
    }

    /// Sentences about the recorder since the last call.
    pub fn take_remarks(&self) -> Vec<String> {
        self.lock().remarks.drain(..).collect()
    }

    /// Scans of the longest block so far.
    pub fn longest_block(&self) -> u32 {
        self.lock().longest_block
    }

    /// Ends the reading thread at its next block.
    pub fn close(&self) {
        self.lock().closed = true;
        self.room.notify_all();
    }

    fn remark(&self, remarks: impl IntoIterator<Item = String>) {
        let mut state = self.lock();
        for remark in remarks {
            if state.remarks.len() == REMARKS_KEPT {
                state.remarks.pop_front();
            }
            state.remarks.push_back(remark);
        }
    }

    /// Adds scans; false when the device has ended.
    fn push(&self, codes: &[i16]) -> bool {
        let scans = (codes.len() / self.words) as u64;
        let mut state = self.lock();
        while self.held && state.scans >= self.most && !state.closed {
            state = self.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.closed {
            return false;
        }
        if !self.held && state.scans + scans > self.most && state.scans > 0 {
            state.overflowed += scans;
            if !std::mem::replace(&mut state.told_overflow, true) {
                state.remarks.push_back(format!(
                    "this computer was too slow: {scans} scans that the recorder delivered did not fit the queue of {QUEUE_S} s \
                     and are lost"
                ));
            }
            return true;
        }
        let lost = std::mem::take(&mut state.overflowed);
        state.note_lost(lost);
        state.entries.push_back(Entry::Codes { words: codes.to_vec(), taken: 0 });
        state.scans += scans;
        true
    }

    /// Adds lost scans.
    fn lose(&self, scans: u64) {
        let mut state = self.lock();
        let lost = std::mem::take(&mut state.overflowed) + scans;
        state.note_lost(lost);
    }

    pub(crate) fn end(&self, why: String) {
        let mut state = self.lock();
        let lost = std::mem::take(&mut state.overflowed);
        state.note_lost(lost);
        state.ended = Some(why);
    }

    /// Wakes the device's task; the caller then nudges its thread.
    pub(crate) fn wake(&self) {
        let waker = self.lock().waker.take();
        if let Some(waker) = waker {
            waker.wake();
        }
    }
}

impl State {
    fn note_lost(&mut self, scans: u64) {
        match self.entries.back_mut() {
            _ if scans == 0 => {}
            Some(Entry::Lost(before)) => *before += scans,
            _ => self.entries.push_back(Entry::Lost(scans)),
        }
    }
}

/// Reads blocks until the stream or the device ends.
pub fn read_stream(header: &Header, source: impl Read, queue: &Queue, link: &DeviceEnd) {
    let mut blocks = Blocks::new(source, header.scan_bytes());
    let mut converter = Converter::new(header);
    let mut arrivals = Arrivals::new(header.rate_hz);
    let mut told_long = false;
    let why = loop {
        let block = match blocks.next_block() {
            Ok(Some(block)) => block,
            Ok(None) => break "its output ended".to_owned(),
            Err(error) => break error.to_string(),
        };
        let scans = block.bytes.len() / header.scan_bytes();
        let now_s = arrivals.begun.elapsed().as_secs_f64();
        let mut lost = block.lost;
        if block.overrun {
            // the time that a source waited for says nothing about its scans
            let estimate = if header.held { 1 } else { arrivals.missing(now_s, lost + scans as u64).max(1) };
            lost += estimate;
            queue.remark([format!(
                "the recorder reports an overrun of unknown length: {estimate} scans are counted as lost{}",
                if header.held { "" } else { ", by the computer's clock" }
            )]);
        }
        if !header.held {
            queue.remark(arrivals.arrived(now_s, lost + scans as u64));
        }
        queue.lose(lost);
        let mut goes_on = true;
        let remarks = converter.convert(block.bytes, |run| match run {
            Run::Codes(codes) => {
                goes_on &= queue.push(codes);
                // a source that can wait may wait within this block
                queue.wake();
                link.nudge();
            }
            Run::Invalid(scans) => queue.lose(scans),
        });
        queue.remark(remarks);
        let block_s = scans as f64 / header.rate_hz;
        if header.hammer.is_some()
            && block_s > BLOCK_WITH_HAMMER_S
            && !std::mem::replace(&mut told_long, true)
        {
            queue.remark([format!(
                "the program writes blocks of {:.0} ms: with a hammer write 10 to 20 ms, because 100 ms without scans disarm it",
                1e3 * block_s
            )]);
        }
        {
            let mut state = queue.lock();
            state.longest_block = state.longest_block.max(scans as u32);
            goes_on &= !state.closed;
        }
        queue.wake();
        link.nudge();
        if !goes_on {
            return;
        }
    };
    queue.end(why);
    queue.wake();
    link.nudge();
}

/// Span in which the earliest arrival is searched for, s: two clocks that differ by 100 ppm drift
/// apart by 1 ms meanwhile, less than a block.
const LEAD_S: f64 = 10.0;

/// Largest relative difference between the stated and the real rate; blocks of 0.1 s make the
/// rate over [`LEAD_S`] uncertain by 1 %.
const RATE_OFF: f64 = 0.02;

/// When blocks arrive, by the computer's clock: how many scans an overrun cost, and whether the
/// stated rate is right.
///
/// The *lead* of a block is the number of scans so far minus those that the clock allows. It is
/// largest for the blocks that arrived with the least delay.
#[derive(Debug)]
struct Arrivals {
    rate_hz: f64,
    begun: Instant,
    scans: u64,
    /// Time, s, and lead, scans, of the blocks in the last [`LEAD_S`]; the leads decrease.
    leads: VecDeque<(f64, f64)>,
    /// The largest lead in the first half of [`LEAD_S`], until the rate has been checked.
    first: Option<(f64, f64)>,
    checked: bool,
}

impl Arrivals {
    fn new(rate_hz: f64) -> Self {
        Self { rate_hz, begun: Instant::now(), scans: 0, leads: VecDeque::new(), first: None, checked: false }
    }

    /// Scans that are missing by the clock if a block arrives now with which `scans` more are
    /// accounted for.
    fn missing(&self, now_s: f64, scans: u64) -> u64 {
        let lead = (self.scans + scans) as f64 - now_s * self.rate_hz;
        self.leads.front().map_or(0.0, |(_, best)| best - lead).round().max(0.0) as u64
    }

    /// Notes a block that accounts for `scans`; returns a sentence if the rate is wrong.
    fn arrived(&mut self, now_s: f64, scans: u64) -> Option<String> {
        self.scans += scans;
        let lead = self.scans as f64 - now_s * self.rate_hz;
        while self.leads.back().is_some_and(|(_, other)| *other <= lead) {
            self.leads.pop_back();
        }
        self.leads.push_back((now_s, lead));
        while self.leads.front().is_some_and(|(at, _)| now_s - at > LEAD_S) {
            self.leads.pop_front();
        }
        if self.checked {
            return None;
        }
        // in the first second a recorder may deliver what it had gathered before
        if (1.0..LEAD_S / 2.0).contains(&now_s) && self.first.is_none_or(|(_, other)| lead > other) {
            self.first = Some((now_s, lead));
        }
        let (from_s, first) = self.first?;
        if now_s - from_s < LEAD_S {
            return None;
        }
        self.checked = true;
        let half = self.leads.iter().find(|(at, _)| *at > from_s + LEAD_S / 2.0)?;
        let off = (half.1 - first) / (half.0 - from_s);
        (off.abs() > RATE_OFF * self.rate_hz).then(|| {
            format!(
                "the recorder delivers about {:.0} scans a second and states {} Hz: state its real rate, every time and \
                 frequency is computed from it",
                self.rate_hz + off,
                self.rate_hz
            )
        })
    }
}

/// The converters of the device: the scans of the queue.
pub struct QueuedScans {
    queue: Arc<Queue>,
    link: DeviceEnd,
    per_block: usize,
    turns: u32,
}

impl QueuedScans {
    /// Takes the scans of this queue; closes the link when no more come.
    #[must_use]
    pub fn new(queue: &Arc<Queue>, link: &DeviceEnd) -> Self {
        let per_block = scans_per_block(queue.words).unwrap_or(1);
        Self { queue: Arc::clone(queue), link: link.clone(), per_block, turns: 0 }
    }

    /// The next block; `None` when no more come.
    fn poll_block(
        &mut self,
        context: &Context<'_>,
        block: &mut [u8; BLOCK_SAMPLE_BYTES],
    ) -> Poll<Option<Delivered>> {
        self.turns += 1;
        if self.turns > BLOCKS_PER_TURN {
            self.turns = 0;
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let (per_scan, per_block) = (self.queue.words, self.per_block);
        let mut locked = self.queue.lock();
        let state = &mut *locked;
        let delivered = match state.entries.front_mut() {
            None if state.ended.is_some() => return Poll::Ready(None),
            None => {
                state.waker = Some(context.waker().clone());
                self.turns = 0;
                return Poll::Pending;
            }
            Some(Entry::Lost(scans)) => {
                let missed = (*scans).min(u32::MAX.into()) as u32;
                *scans -= u64::from(missed);
                if *scans == 0 {
                    state.entries.pop_front();
                }
                Delivered { scans: 0, missed, loud: false }
            }
            Some(Entry::Codes { words, taken }) => {
                let rest = &words[*taken..];
                let count = rest.len().min(per_block * per_scan);
                for (bytes, word) in block.as_chunks_mut::<2>().0.iter_mut().zip(&rest[..count]) {
                    *bytes = word.to_le_bytes();
                }
                *taken += count;
                if *taken == words.len() {
                    state.entries.pop_front();
                }
                let scans = count / per_scan;
                state.scans -= scans as u64;
                Delivered { scans: scans as u8, missed: 0, loud: true }
            }
        };
        let has_room = state.scans < self.queue.most;
        drop(locked);
        if has_room && self.queue.held {
            self.queue.room.notify_one();
        }
        Poll::Ready(Some(delivered))
    }
}

impl Scans for QueuedScans {
    fn can_be_held(&self) -> bool {
        self.queue.held
    }

    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        if let Some(delivered) = poll_fn(|context| self.poll_block(context, block)).await {
            return delivered;
        }
        Timer::after(LAST_BLOCKS).await;
        self.link.close();
        std::future::pending().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_overrun_is_estimated_from_the_least_delayed_blocks() {
        let mut arrivals = Arrivals::new(1000.0);
        // blocks of 100 scans, each up to 30 ms late, by a clock that is 100 ppm off
        for block in 1..=600_u32 {
            let late_s = 0.03 * f64::from(block * 7 % 10) / 10.0;
            let at_s = 0.1 * f64::from(block) * 1.0001 + late_s;
            assert_eq!(arrivals.arrived(at_s, 100), None);
        }
        // 5000 scans never came
        let missing = arrivals.missing(600.0 * 0.1 * 1.0001 + 5.1, 100);
        assert!(missing.abs_diff(5000) < 40, "{missing}");
    }

    #[test]
    fn a_wrong_rate_is_told_once() {
        let mut arrivals = Arrivals::new(48_000.0);
        let told: Vec<String> =
            (1..400_u32).filter_map(|block| arrivals.arrived(0.1 * f64::from(block), 4410)).collect();
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(told[0].contains("about 44100 scans a second and states 48000 Hz"), "{told:?}");
    }
}

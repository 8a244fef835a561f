//! Assembles the sample stream strictly in scan order, each scan once, and records every loss.
//!
//! Blocks may be lost, duplicated, late or sent again. Early blocks are held; [`Stream::missing`]
//! names the missing scans, so that the session can request them; scans that the device reports as
//! lost for good are recorded as a lost range, and the stream continues after it.
//!
//! Up to here 16-bit words are kept one scan after another, as the link delivers them.
//! [`Stream::cut`] takes a part of the stream out of it one channel after another, as everything
//! above uses it; a [`Recording`] is the part around one impact.

use super::channels::ChannelMap;
use super::samples::{ChannelSamples, ChannelView, Samples};
use super::tap::Tap;
use jointrig_protocol::block::{Block, RESENT};
use jointrig_protocol::channel::{NARROW_BITS, joined_code, words_per_scan};
use jointrig_protocol::shot::Shot;
use std::collections::BTreeMap;
use std::ops::Range;

/// Counts of a stream's scans. At the end `sent = received + recovered + lost`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Accounts {
    /// Scans that arrived when first sent.
    pub received: u64,
    /// Scans that arrived after a repeated request.
    pub recovered: u64,
    /// Scans that the device reported as lost for good.
    pub lost: u64,
    /// Scans that arrived more than once and were ignored.
    pub duplicates: u64,
    /// Scans that the device produced according to its counters.
    pub sent: u64,
}

impl Accounts {
    /// Scans that are unaccounted for; any value but 0 at the end of a stream is an error.
    pub fn unexplained(&self) -> u64 {
        self.sent.abs_diff(self.received + self.recovered + self.lost)
    }
}

/// Most codes on the tape when scans are lost: 20 s of the fastest rig, 256 MB.
const TAPE_KEPT: u64 = 1 << 27;

/// Most ranges of lost scans that wait for the scans before them.
const GONE_KEPT: usize = 4096;

/// What the 16-bit words of a scan are: one for each channel, and after the last one a second word
/// for each wide channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScanLayout {
    /// Bits of each channel.
    bits: Vec<u8>,
    words: usize,
}

impl From<&ChannelMap> for ScanLayout {
    fn from(map: &ChannelMap) -> Self {
        Self {
            bits: map.channels.iter().map(|channel| channel.bits).collect(),
            words: words_per_scan(&map.channels),
        }
    }
}

/// As many channels of 16 bits.
impl From<usize> for ScanLayout {
    fn from(channels: usize) -> Self {
        Self { bits: vec![16; channels], words: channels }
    }
}

impl ScanLayout {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.bits.len()
    }

    /// 16-bit words per scan.
    pub fn words(&self) -> usize {
        self.words
    }

    /// `scans` samples of each channel, of which those from `at` on are in `words` (whole scans,
    /// one after another) and the others are 0.
    ///
    /// # Panics
    /// Never: all channels get the same number of samples.
    pub fn samples(&self, scans: usize, at: usize, words: &[i16]) -> Samples {
        let mut lower = self.bits.len()..;
        let mut of = |(place, bits): (usize, &u8)| {
            let own = |word: usize| words.iter().skip(word).step_by(self.words).copied();
            if *bits <= NARROW_BITS {
                let mut codes = vec![0; scans];
                codes.iter_mut().skip(at).zip(own(place)).for_each(|(code, own)| *code = own);
                return ChannelSamples::I16(codes);
            }
            let both = own(place).zip(own(lower.next().unwrap_or(place)));
            let mut codes = vec![0; scans];
            let joined = both.map(|(upper, lower)| joined_code([upper, lower], *bits));
            codes.iter_mut().skip(at).zip(joined).for_each(|(code, own)| *code = own);
            ChannelSamples::I32(codes)
        };
        Samples::new(self.bits.iter().enumerate().map(&mut of).collect()).expect("all have `scans` samples")
    }
}

/// A stream being assembled.
pub struct Stream {
    epoch: u32,
    map: u8,
    first_scan: u64,
    layout: ScanLayout,
    /// Most scans that are held ahead of a gap, and the widest gap that is filled with zeros.
    bound: u64,
    expected: u64,
    newest: u64,
    tail: u64,
    held: BTreeMap<u64, Held>,
    /// Number of scans held.
    held_scans: u64,
    gone: Vec<Range<u64>>,
    lost: Vec<Range<u64>>,
    tape: Vec<i16>,
    tape_first: u64,
    accounts: Accounts,
    tap: Option<Tap>,
}

#[derive(Debug)]
struct Held {
    codes: Vec<i16>,
    again: bool,
}

impl Stream {
    /// An empty stream whose scans have this layout and whose first scan is `first_scan`;
    /// `ring_scans` is the number of scans that the device can send again.
    pub fn new(epoch: u32, map: u8, first_scan: u64, layout: impl Into<ScanLayout>, ring_scans: u32) -> Self {
        Self {
            epoch,
            map,
            first_scan,
            layout: layout.into(),
            bound: 4 * u64::from(ring_scans.max(1)),
            expected: first_scan,
            newest: first_scan,
            tail: first_scan,
            held: BTreeMap::new(),
            held_scans: 0,
            gone: Vec::new(),
            lost: Vec::new(),
            tape: Vec::new(),
            tape_first: first_scan,
            accounts: Accounts::default(),
            tap: None,
        }
    }

    /// Attaches a tap, which receives every scan; `rate_hz` is the scan rate.
    pub fn tapped(&mut self, tap: Option<Tap>, rate_hz: f64) {
        self.tap = tap;
        if let Some(tap) = &mut self.tap {
            tap.begin(self.layout.channels(), self.layout.words(), self.expected, rate_hz);
        }
    }

    /// Returns the tap for the next stream.
    pub fn into_tap(self) -> Option<Tap> {
        self.tap
    }

    /// The stream's epoch.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The first scan.
    pub fn first_scan(&self) -> u64 {
        self.first_scan
    }

    /// The next scan that has not arrived; all scans before it have arrived or are lost for good.
    pub fn expected(&self) -> u64 {
        self.expected
    }

    /// The scan after the newest one received: the scan clock as far as the host knows it.
    pub fn newest(&self) -> u64 {
        self.newest
    }

    /// Counts of received, recovered and lost scans so far.
    pub fn accounts(&self) -> Accounts {
        self.accounts
    }

    /// Scans that are lost for good, in order.
    pub fn lost(&self) -> &[Range<u64>] {
        &self.lost
    }

    /// Takes a block. Returns whether it belongs to this stream.
    pub fn take(&mut self, block: &Block<'_>) -> bool {
        let first = block.header.first_scan;
        if block.header.epoch != self.epoch
            || block.header.map != self.map
            || block.words_per_scan() != self.words()
            || first < self.first_scan
        {
            return false;
        }
        let again = block.header.flags & RESENT != 0 || first < self.newest;
        self.newest = self.newest.max(block.end_scan());
        if block.end_scan() <= self.expected || self.held.contains_key(&first) {
            self.accounts.duplicates += u64::from(block.header.scans);
        } else if first <= self.expected {
            self.append(first, block.codes(), again);
            self.advance();
        } else if (first - self.expected < self.bound && self.held_scans < self.bound) || self.held.is_empty()
        {
            self.held_scans += u64::from(block.header.scans);
            self.held.insert(first, Held { codes: block.codes().collect(), again });
            self.advance();
        }
        true
    }

    /// Records scans that the device can never send (again). Scans that have arrived stay. Returns
    /// false when the list of ranges waiting for their turn is full.
    pub fn mark_lost(&mut self, range: Range<u64>) -> bool {
        if range.end > self.expected && range.start < range.end {
            if self.gone.len() == GONE_KEPT {
                return false;
            }
            let place = self.gone.partition_point(|other| other.start < range.start);
            self.gone.insert(place, range);
            self.advance();
        }
        true
    }

    /// Notes that the device produced scans up to `next_scan` and nothing more is under way: whole
    /// blocks that have not arrived (when `ended`, partial ones too) are missing.
    pub fn note_tail(&mut self, next_scan: u64, ended: bool) {
        let block = jointrig_protocol::limits::scans_per_block(self.words()).unwrap_or(1) as u64;
        let behind = next_scan.saturating_sub(self.expected);
        self.tail = self.expected + if ended { behind } else { behind / block * block };
        if ended {
            self.accounts.sent = next_scan - self.first_scan.min(next_scan);
        }
    }

    /// The first scans known to be missing, for the session to request.
    pub fn missing(&self) -> Option<Range<u64>> {
        let seen = self.held.first_key_value().map_or(self.tail, |(first, _)| *first);
        let end = self.gone.first().map_or(seen, |range| seen.min(range.start));
        (end > self.expected).then_some(self.expected..end)
    }

    fn words(&self) -> usize {
        self.layout.words()
    }

    fn append(&mut self, first: u64, codes: impl Iterator<Item = i16>, again: bool) {
        let skip = (self.expected - first) as usize * self.words();
        let before = self.tape.len();
        self.tape.extend(codes.skip(skip));
        if let Some(tap) = &mut self.tap {
            tap.fold(&self.tape[before..]);
        }
        let scans = ((self.tape.len() - before) / self.words()) as u64;
        self.expected += scans;
        if again {
            self.accounts.recovered += scans;
        } else {
            self.accounts.received += scans;
        }
    }

    /// Advances over all scans that are held or known to be lost.
    fn advance(&mut self) {
        loop {
            while self.gone.first().is_some_and(|range| range.end <= self.expected) {
                self.gone.remove(0);
            }
            if let Some(entry) = self.held.first_entry()
                && *entry.key() <= self.expected
            {
                let first = *entry.key();
                let held = entry.remove();
                self.held_scans -= (held.codes.len() / self.words()) as u64;
                if first + (held.codes.len() / self.words()) as u64 > self.expected {
                    self.append(first, held.codes.into_iter(), held.again);
                } else {
                    self.accounts.duplicates += (held.codes.len() / self.words()) as u64;
                }
            } else if self.gone.first().is_some_and(|range| range.start <= self.expected) {
                let held = self.held.first_key_value().map_or(u64::MAX, |(first, _)| *first);
                let end = self.gone[0].end.min(held);
                self.skip_to(end);
            } else {
                break;
            }
        }
    }

    fn skip_to(&mut self, end: u64) {
        let scans = end - self.expected;
        self.accounts.lost += scans;
        if let Some(tap) = &mut self.tap {
            tap.skip(scans);
        }
        match self.lost.last_mut() {
            Some(last) if last.end == self.expected => last.end = end,
            _ => self.lost.push(self.expected..end),
        }
        self.expected = end;
        self.newest = self.newest.max(end);
        // bounds the memory that a faulty device can claim: after a long gap the tape starts again
        // behind it, also if the caller never releases samples
        if scans > self.bound || self.tape.len() as u64 + scans * self.words() as u64 > TAPE_KEPT {
            // too many zeros to keep: the tape starts again after the gap
            self.tape.clear();
            self.tape_first = end;
        } else {
            self.tape.resize(self.tape.len() + scans as usize * self.words(), 0);
        }
    }

    /// Releases the samples before `scan`.
    pub fn forget_before(&mut self, scan: u64) {
        let scan = scan.clamp(self.tape_first, self.expected);
        // moving the tape costs time proportional to its length, so wait until half of it is
        // released
        let stale = (scan - self.tape_first) as usize * self.words();
        if stale > self.tape.len() / 2 {
            self.tape.drain(..stale);
            self.tape_first = scan;
        }
    }

    /// The samples of each channel in `range`, and the missing scans as index ranges into it; their
    /// samples are 0.
    pub fn cut(&self, range: Range<u64>) -> (Samples, Vec<Range<usize>>) {
        let scans = (range.end - range.start) as usize;
        let there = range.start.max(self.tape_first)..range.end.min(self.expected);
        let mut gaps = Vec::new();
        let mut gap = |missing: Range<u64>| {
            let (start, end) = (missing.start.max(range.start), missing.end.min(range.end));
            if start < end {
                gaps.push((start - range.start) as usize..(end - range.start) as usize);
            }
        };
        if there.start >= there.end {
            gap(range.clone());
            return (self.layout.samples(scans, 0, &[]), gaps);
        }
        gap(range.start..there.start);
        for lost in &self.lost {
            gap(lost.start.max(there.start)..lost.end.min(there.end));
        }
        gap(there.end..range.end);
        let from = (there.start - self.tape_first) as usize * self.words();
        let to = (there.end - self.tape_first) as usize * self.words();
        let at = (there.start - range.start) as usize;
        (self.layout.samples(scans, at, &self.tape[from..to]), gaps)
    }
}

/// One impact as measured; the raw samples are never changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Epoch of the stream from which it was cut.
    pub epoch: u32,
    /// Scan index of its first sample in that stream.
    pub first_scan: u64,
    /// Number of samples before the trigger, which is also the trigger's index.
    pub trigger_index: usize,
    /// The samples of each channel.
    pub samples: Samples,
    /// Index ranges of samples that were lost for good; they are 0 and invalid.
    pub gaps: Vec<Range<usize>>,
    /// The device's report on the shot.
    pub shot: Shot,
}

impl Recording {
    /// Samples per channel.
    pub fn scans(&self) -> usize {
        self.samples.scans()
    }

    /// The samples of one channel; empty outside the map.
    pub fn channel(&self, place: usize) -> ChannelView<'_> {
        self.samples.channel(place)
    }
}

#[cfg(test)]
#[path = "stream_tests.rs"]
mod tests;

//! A view of the running stream: the smallest and the largest code of every channel in each
//! millisecond.
//!
//! The writing end ([`Tap`]) belongs to the measuring thread: its memory is fixed, it allocates
//! nothing and never waits. It hands its data over on request by swapping two buffers; without
//! requests it continues, and its stretches get coarser. The reading end ([`View`]) belongs to
//! another thread.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, TryLockError};
use std::thread::Thread;
use std::time::{Duration, Instant};

use jointrig_protocol::limits::CHANNEL_CAPACITY;

/// Most stretches of one envelope: two frames of a screen at the finest resolution. Even, so that
/// pairs can be joined.
pub const MOST_STRETCHES: usize = 64;

/// Duration of a stretch at the finest resolution, s.
const FINEST_S: f64 = 1e-3;

/// A stretch without any scan: its smallest code is greater than its largest.
pub const NOTHING: [i16; 2] = [i16::MAX, i16::MIN];

/// A section of the stream: the smallest and the largest code of each channel in each of its
/// stretches.
#[derive(Clone, Debug)]
pub struct Envelope {
    /// Channels per scan.
    pub channels: usize,
    /// The first scan.
    pub first_scan: u64,
    /// Scans per stretch.
    pub scans_per_stretch: u32,
    /// Number of stretches.
    pub stretches: usize,
    ends: Box<[[i16; 2]]>,
    /// Scans that arrived; the others of the envelope are lost.
    pub arrived: u64,
    sums: [i64; CHANNEL_CAPACITY],
    squares: [u64; CHANNEL_CAPACITY],
}

impl Envelope {
    fn empty() -> Self {
        Self {
            channels: 0,
            first_scan: 0,
            scans_per_stretch: 1,
            stretches: 0,
            ends: vec![NOTHING; MOST_STRETCHES * CHANNEL_CAPACITY].into(),
            arrived: 0,
            sums: [0; CHANNEL_CAPACITY],
            squares: [0; CHANNEL_CAPACITY],
        }
    }

    fn begin(&mut self, channels: usize, first_scan: u64, scans_per_stretch: u32) {
        (self.channels, self.first_scan, self.scans_per_stretch) = (channels, first_scan, scans_per_stretch);
        (self.stretches, self.arrived) = (0, 0);
        (self.sums, self.squares) = ([0; CHANNEL_CAPACITY], [0; CHANNEL_CAPACITY]);
    }

    /// Smallest and largest code, channel by channel within each stretch; [`NOTHING`] where every
    /// scan was lost.
    pub fn ends(&self) -> &[[i16; 2]] {
        &self.ends[..self.stretches * self.channels]
    }

    /// Sum and sum of squares of one channel's codes over the scans that arrived.
    pub fn sums(&self, channel: usize) -> (i64, u64) {
        (self.sums.get(channel).copied().unwrap_or(0), self.squares.get(channel).copied().unwrap_or(0))
    }

    /// Joins the stretches in pairs.
    fn coarsen(&mut self) {
        let channels = self.channels;
        for stretch in 0..self.stretches / 2 {
            for channel in 0..channels {
                let [early, late] =
                    [2 * stretch, 2 * stretch + 1].map(|from| self.ends[from * channels + channel]);
                self.ends[stretch * channels + channel] = [early[0].min(late[0]), early[1].max(late[1])];
            }
        }
        self.stretches /= 2;
        self.scans_per_stretch *= 2;
    }
}

/// The buffer that is handed over, and whether it was not read yet.
struct Slot {
    envelope: Box<Envelope>,
    fresh: bool,
}

struct Shared {
    wanted: AtomicBool,
    slot: Mutex<Slot>,
    looks: OnceLock<Thread>,
}

/// The writing end.
pub struct Tap {
    shared: Arc<Shared>,
    making: Box<Envelope>,
    finest: u32,
    /// 16-bit words per scan; the first ones are the channels' codes.
    words: usize,
    /// Codes of the current stretch, and how many of its scans are done.
    open: [[i16; 2]; CHANNEL_CAPACITY],
    over: u32,
}

/// The reading end.
pub struct View {
    shared: Arc<Shared>,
    own: Box<Envelope>,
}

/// Creates both ends.
pub fn tap() -> (Tap, View) {
    let empty = || Box::new(Envelope::empty());
    let shared = Arc::new(Shared {
        wanted: AtomicBool::new(false),
        slot: Mutex::new(Slot { envelope: empty(), fresh: false }),
        looks: OnceLock::new(),
    });
    let tap = Tap {
        shared: shared.clone(),
        making: empty(),
        finest: 1,
        words: 0,
        open: [NOTHING; CHANNEL_CAPACITY],
        over: 0,
    };
    (tap, View { shared, own: empty() })
}

impl Tap {
    /// Begins a new stream at `first_scan`, whose scans have `words` 16-bit words, first one of each
    /// channel; an incomplete envelope is discarded.
    pub fn begin(&mut self, channels: usize, words: usize, first_scan: u64, rate_hz: f64) {
        let channels = channels.min(CHANNEL_CAPACITY);
        self.words = words.max(1);
        self.finest = ((FINEST_S * rate_hz).round() as u32).max(1);
        self.restart(channels, first_scan);
    }

    fn restart(&mut self, channels: usize, first_scan: u64) {
        self.making.begin(channels, first_scan, self.finest);
        (self.open, self.over) = ([NOTHING; CHANNEL_CAPACITY], 0);
    }

    /// Adds the next scans; `codes` holds the words of one scan after another. Of a wide channel the
    /// upper 16 bits are shown.
    pub fn fold(&mut self, mut codes: &[i16]) {
        let channels = self.making.channels;
        if channels == 0 {
            return;
        }
        while codes.len() >= self.words {
            let scans = (codes.len() / self.words).min((self.making.scans_per_stretch - self.over) as usize);
            let (now, rest) = codes.split_at(scans * self.words);
            for scan in now.chunks_exact(self.words) {
                for (channel, code) in scan[..channels].iter().enumerate() {
                    let [least, most] = &mut self.open[channel];
                    (*least, *most) = ((*least).min(*code), (*most).max(*code));
                    let wide = i64::from(*code);
                    self.making.sums[channel] += wide;
                    self.making.squares[channel] += (wide * wide).unsigned_abs();
                }
            }
            self.making.arrived += scans as u64;
            self.advance(scans as u32);
            codes = rest;
        }
    }

    /// Marks the next `scans` scans as lost.
    pub fn skip(&mut self, scans: u64) {
        let making = &self.making;
        if making.channels == 0 {
            return;
        }
        let room = u64::from(making.scans_per_stretch) * MOST_STRETCHES as u64;
        if scans > room {
            // longer than an envelope: start a new one after the gap
            let at = making.first_scan
                + making.stretches as u64 * u64::from(making.scans_per_stretch)
                + u64::from(self.over);
            let channels = making.channels;
            self.restart(channels, at + scans);
            return;
        }
        let mut left = scans as u32;
        while left > 0 {
            let step = left.min(self.making.scans_per_stretch - self.over);
            self.advance(step);
            left -= step;
        }
    }

    /// Advances by `scans` scans, which do not exceed the current stretch.
    fn advance(&mut self, scans: u32) {
        self.over += scans;
        if self.over < self.making.scans_per_stretch {
            return;
        }
        let making = &mut self.making;
        let at = making.stretches * making.channels;
        making.ends[at..at + making.channels].copy_from_slice(&self.open[..making.channels]);
        making.stretches += 1;
        (self.open, self.over) = ([NOTHING; CHANNEL_CAPACITY], 0);
        if self.shared.wanted.load(Ordering::Acquire) {
            self.hand_over();
        }
        if self.making.stretches == MOST_STRETCHES {
            if self.making.scans_per_stretch > u32::MAX / 2 {
                // not read for days
                let end =
                    self.making.first_scan + MOST_STRETCHES as u64 * u64::from(self.making.scans_per_stretch);
                self.restart(self.making.channels, end);
            } else {
                self.making.coarsen();
            }
        }
    }

    /// Swaps the buffers, unless the other one is locked at this moment; then the next stretch
    /// tries again.
    fn hand_over(&mut self) {
        let mut slot = match self.shared.slot.try_lock() {
            Ok(slot) => slot,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        let (channels, next) = (
            self.making.channels,
            self.making.first_scan + self.making.stretches as u64 * u64::from(self.making.scans_per_stretch),
        );
        std::mem::swap(&mut self.making, &mut slot.envelope);
        slot.fresh = true;
        drop(slot);
        self.making.begin(channels, next, self.finest);
        self.shared.wanted.store(false, Ordering::Release);
        if let Some(thread) = self.shared.looks.get() {
            thread.unpark();
        }
    }
}

impl View {
    /// Requests the data since the last call and waits at most `patience` for them. Call it from
    /// one thread only.
    pub fn next(&mut self, patience: Duration) -> Option<&Envelope> {
        self.shared.looks.get_or_init(std::thread::current);
        let until = Instant::now() + patience;
        self.shared.wanted.store(true, Ordering::Release);
        loop {
            {
                let mut slot = self.shared.slot.lock().unwrap_or_else(PoisonError::into_inner);
                if slot.fresh {
                    slot.fresh = false;
                    std::mem::swap(&mut self.own, &mut slot.envelope);
                    return Some(&self.own);
                }
            }
            let left = until.checked_duration_since(Instant::now())?;
            std::thread::park_timeout(left);
        }
    }
}

#[cfg(test)]
#[path = "tap_tests.rs"]
mod tests;

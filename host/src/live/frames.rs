//! Frames of the stream for pages: the newest few, numbered. A late page skips the frames that were
//! dropped.
//!
//! A frame's layout, little endian: `u8` kind (1), `u8` version (1), `u16` channels, `u32`
//! stretches, `u64` first scan, `u32` scans per stretch, `u32` frames that this page missed before
//! it, `f64` ms since 1970; then for each stretch and channel the smallest and the largest code as
//! `i16`. In a stretch of which nothing arrived the smallest code is greater than the largest.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::watch;

use crate::device::tap::Envelope;

/// Frames that are kept for late pages.
pub const KEPT: usize = 8;

/// Kind and version, the first two bytes.
const KIND: [u8; 2] = [1, 1];

/// Offset of the number of missed frames.
const MISSED_AT: usize = 20;

/// Bytes before the codes.
pub const HEAD: usize = 32;

/// The last few frames.
#[derive(Debug)]
pub struct Frames {
    ring: Mutex<VecDeque<Arc<[u8]>>>,
    newest: watch::Sender<u64>,
    lookers: AtomicUsize,
}

impl Default for Frames {
    fn default() -> Self {
        Self { ring: Mutex::default(), newest: watch::Sender::new(0), lookers: AtomicUsize::new(0) }
    }
}

impl Frames {
    /// Adds a frame; drops the oldest if necessary.
    pub fn push(&self, envelope: &Envelope, unix_ms: f64) {
        let frame: Arc<[u8]> = bytes(envelope, unix_ms).into();
        let mut ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        if ring.len() == KEPT {
            ring.pop_front();
        }
        ring.push_back(frame);
        self.newest.send_modify(|newest| *newest += 1);
    }

    /// The first frame after number `after` that is still kept: its number, and its bytes, in which
    /// the number of missed frames is `missed` plus the frames skipped.
    pub fn after(&self, after: u64, missed: u32) -> Option<(u64, Vec<u8>)> {
        let ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        let newest = *self.newest.borrow();
        let oldest = newest + 1 - ring.len() as u64;
        let number = (after + 1).max(oldest);
        let mut frame = ring.get(usize::try_from(number.checked_sub(oldest)?).ok()?)?.to_vec();
        let missed = missed.saturating_add(u32::try_from(number - after - 1).unwrap_or(u32::MAX));
        frame[MISSED_AT..MISSED_AT + 4].copy_from_slice(&missed.to_le_bytes());
        Some((number, frame))
    }

    /// A receiver of the newest frame's number, which also signals new frames.
    pub fn newest(&self) -> watch::Receiver<u64> {
        self.newest.subscribe()
    }

    /// Whether any page shows the stream.
    pub fn looked_at(&self) -> bool {
        self.lookers.load(Ordering::Relaxed) > 0
    }

    /// Registers a page that shows the stream for as long as the returned value lives.
    pub fn look(self: &Arc<Self>) -> Looker {
        self.lookers.fetch_add(1, Ordering::Relaxed);
        Looker(self.clone())
    }
}

/// Registration of a page that shows the stream.
pub struct Looker(Arc<Frames>);

impl Drop for Looker {
    fn drop(&mut self) {
        self.0.lookers.fetch_sub(1, Ordering::Relaxed);
    }
}

fn bytes(envelope: &Envelope, unix_ms: f64) -> Vec<u8> {
    let ends = envelope.ends();
    let mut frame = Vec::with_capacity(HEAD + 4 * ends.len());
    frame.extend(KIND);
    frame.extend((envelope.channels as u16).to_le_bytes());
    frame.extend((envelope.stretches as u32).to_le_bytes());
    frame.extend(envelope.first_scan.to_le_bytes());
    frame.extend(envelope.scans_per_stretch.to_le_bytes());
    frame.extend(0_u32.to_le_bytes());
    frame.extend(unix_ms.to_le_bytes());
    frame.extend(ends.iter().flatten().flat_map(|code| code.to_le_bytes()));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::tap::tap;
    use std::time::Duration;

    #[test]
    fn who_is_late_is_told_how_much_it_missed() {
        let frames = Frames::default();
        assert!(frames.after(0, 0).is_none());
        let (mut tap, mut view) = tap();
        tap.begin(2, 2, 7, 1_000.0);
        for n in 0..11_i16 {
            assert!(view.next(Duration::ZERO).is_none());
            tap.fold(&[n, -n]);
            frames.push(view.next(Duration::ZERO).expect("a stretch"), 1.5);
        }
        let (number, frame) = frames.after(0, 2).expect("a frame");
        assert_eq!((number, frame.len()), (4, HEAD + 8));
        assert_eq!(frame[..8], [1, 1, 2, 0, 1, 0, 0, 0]);
        assert_eq!(frame[8..20], [10, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(frame[20..24], [5, 0, 0, 0], "three passed over here, two before");
        assert_eq!(frame[24..32], 1.5_f64.to_le_bytes());
        assert_eq!(frame[32..], [3, 0, 3, 0, 253, 255, 253, 255]);
        let (number, frame) = frames.after(10, 0).expect("the newest");
        assert_eq!((number, &frame[20..24]), (11, &[0, 0, 0, 0][..]));
        assert!(frames.after(11, 0).is_none());
    }

    #[test]
    fn pages_that_look_are_counted() {
        let frames = Arc::<Frames>::default();
        let [one, other] = [frames.look(), frames.look()];
        drop(one);
        assert!(frames.looked_at());
        drop(other);
        assert!(!frames.looked_at());
    }
}

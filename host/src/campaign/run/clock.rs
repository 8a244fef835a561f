//! The time of a scan in UTC, and its uncertainty.
//!
//! The device's clock is its scan index. Every status answer yields a mark: its `next_scan` was
//! true at some moment between question and answer. From the marks follow two estimates.
//!
//! - A **bracket** that relies on order alone: scan s was sampled after the question of a mark that
//!   had not passed it, and before the answer of a mark that had.
//! - A **line** through the marks if the clock runs at its rate: averaging over the marks reduces
//!   the uncertainty to their scatter. The time of a virtual board stands still and jumps; there
//!   the line does not fit, and only the bracket remains.

use std::collections::VecDeque;
use std::time::Instant;

use jiff::{SignedDuration, Timestamp};

/// Number of marks kept: some minutes of hits, over which a crystal drifts by less than a
/// millisecond.
const MEMORY: usize = 64;

/// Minimum number of marks for a line.
const ENOUGH: usize = 6;

/// Largest relative rate error of a crystal.
const OFF: f64 = 5e-4;

/// At some moment between `asked` and `answered` (s since the start), `scan` was the next to be
/// sampled.
#[derive(Clone, Copy, Debug)]
struct Mark {
    scan: u64,
    asked: f64,
    answered: f64,
}

/// The scan clock of one stream against UTC.
#[derive(Debug)]
pub(super) struct ScanClock {
    rate_hz: f64,
    /// The device counts whole blocks: a scan may have been sampled this long before it is counted,
    /// s.
    block_s: f64,
    start: Instant,
    start_utc: Timestamp,
    marks: VecDeque<Mark>,
}

impl ScanClock {
    /// For a stream of `rate_hz` that is counted in blocks of `block` scans.
    pub(super) fn new(rate_hz: f64, block: usize) -> Self {
        Self {
            rate_hz,
            block_s: block as f64 / rate_hz,
            start: Instant::now(),
            start_utc: Timestamp::now(),
            marks: VecDeque::new(),
        }
    }

    /// The device delivers blocks of up to `block` scans.
    pub(super) fn widen(&mut self, block: usize) {
        self.block_s = self.block_s.max(block as f64 / self.rate_hz);
    }

    /// Adds a mark: the device answered `next_scan` to a question.
    pub(super) fn mark(&mut self, next_scan: u64, asked: Instant, answered: Instant) {
        let since = |moment: Instant| moment.saturating_duration_since(self.start).as_secs_f64();
        let mark = Mark { scan: next_scan, asked: since(asked), answered: since(answered) };
        if self.marks.len() == MEMORY {
            self.marks.pop_front();
        }
        self.marks.push_back(mark);
    }

    /// When `scan` was sampled, and the uncertainty ± s. Without a mark before and after it: the
    /// current time, and `None`.
    pub(super) fn utc(&self, scan: u64) -> (Timestamp, Option<f64>) {
        match self.moment(scan) {
            Some((seconds, error)) => {
                let since = SignedDuration::try_from_secs_f64(seconds).unwrap_or_default();
                (self.start_utc.checked_add(since).unwrap_or(self.start_utc), Some(error))
            }
            None => (Timestamp::now(), None),
        }
    }

    /// Time of `scan` in seconds since the start, and its uncertainty ± s.
    fn moment(&self, scan: u64) -> Option<(f64, f64)> {
        let earliest =
            self.marks.iter().filter(|mark| mark.scan <= scan).map(|mark| mark.asked).reduce(f64::max)?;
        let latest =
            self.marks.iter().filter(|mark| mark.scan > scan).map(|mark| mark.answered).reduce(f64::min)?;
        let (from, to) = (earliest - self.block_s, latest.max(earliest));
        let bracket = (f64::midpoint(from, to), (to - from) / 2.0);
        match self.line(scan) {
            Some((at, error)) if error < bracket.1 && (from..=to).contains(&at) => Some((at, error)),
            _ => Some(bracket),
        }
    }

    /// Least-squares line through the marks' midpoints, if the clock runs at its rate.
    fn line(&self, scan: u64) -> Option<(f64, f64)> {
        if self.marks.len() < ENOUGH {
            return None;
        }
        let n = self.marks.len() as f64;
        let first = self.marks.front()?.scan as f64;
        let points = || {
            self.marks.iter().map(|mark| {
                // a block is counted at its end, so on average half a block is in progress
                let middle = f64::midpoint(mark.asked, mark.answered) - self.block_s / 2.0;
                ((mark.scan as f64 - first) / self.rate_hz, middle)
            })
        };
        let (mx, my) = points().fold((0.0, 0.0), |(x, y), (px, py)| (x + px / n, y + py / n));
        let (sxx, sxy) = points()
            .fold((0.0, 0.0), |(xx, xy), (px, py)| (xx + (px - mx).powi(2), xy + (px - mx) * (py - my)));
        let slope = sxy / sxx;
        if !slope.is_finite() || (slope - 1.0).abs() > OFF {
            return None;
        }
        let worst = points().map(|(x, y)| (y - my - slope * (x - mx)).abs()).fold(0.0, f64::max);
        let x = (scan as f64 - first) / self.rate_hz;
        // a constant difference between the delays of question and answer does not average out: at
        // most half the shortest round trip is unknown
        let round = self.marks.iter().map(|mark| mark.answered - mark.asked).fold(f64::INFINITY, f64::min);
        Some((my + slope * (x - mx), worst + round / 2.0 + self.block_s / 2.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn after(moment: Instant, seconds: f64) -> Instant {
        moment + Duration::from_secs_f64(seconds)
    }

    #[test]
    fn a_crystals_clock_is_known_better_than_its_brackets() {
        let mut clock = ScanClock::new(51_200.0, 48);
        let start = clock.start;
        // 30 ppm fast, started 0.25 s after the clock; answers take 2 to 8 ms
        let truth = |scan: f64| 0.25 + scan / (51_200.0 * 1.000_03);
        for hit in 0..40_u32 {
            let at = 1.0 + 3.0 * f64::from(hit) + 0.01 * f64::from(hit % 7);
            let scan = ((at - 0.25) * 51_200.0 * 1.000_03 / 48.0).floor() * 48.0;
            let way = 0.002 + 0.001 * f64::from(hit * 13 % 7);
            clock.mark(scan as u64, after(start, at - way / 2.0), after(start, at + way / 2.0));
        }
        for scan in [200_000_u64, 3_000_000, 5_500_000] {
            let (at, error) = clock.moment(scan).expect("between marks");
            assert!((at - truth(scan as f64)).abs() <= error, "{at} {error}");
            assert!(error < 0.01, "{error}: brackets are three seconds wide");
        }
        assert_eq!(clock.moment(99_000_000), None, "no mark after it");
        assert!(clock.utc(99_000_000).1.is_none());
    }

    #[test]
    fn a_clock_that_leaps_is_known_to_its_brackets_only() {
        let mut clock = ScanClock::new(51_200.0, 48);
        let start = clock.start;
        for hit in 0..40_u32 {
            // 300 000 virtual scans in 50 ms, then a pause of 20 ms
            let at = 0.07 * f64::from(hit);
            let scan = u64::from(hit) * 300_000 + u64::from(hit % 3) * 77_000;
            clock.mark(scan, after(start, at), after(start, at + 0.001));
        }
        let (at, error) = clock.moment(3_100_000).expect("between marks");
        assert!(error > 0.02 && error < 0.1, "{error}");
        assert!((at - error..=at + error).contains(&0.74), "{at} {error}");
    }
}

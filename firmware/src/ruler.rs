//! Time on a board: converts timer counts to instants in scans, and between times and scans; checks
//! an external clock; and holds the state of scan clock, sync input and sync output.
//!
//! A board has a timer whose period is a scan, a counter of those periods, and a third,
//! free-running timer whose inputs capture its count at an edge. An edge is thus known in counts of
//! the third timer; one reading of all three, at any later time, yields how many scans ago it was.
//! With an external clock, a period deviates from its nominal count; over a block of scans this is
//! an error of less than 0.003 of a scan.
//!
//! The conversions between times and scans need no 64-bit division: this processor has none, and
//! the code for it takes a kilobyte of flash.

use jointrig_protocol::sync::{CLOCK_TOLERANCE_PPM, Clock, ClockFault, Line, Sync};

/// An instant, relative to the next scan that will be delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ago {
    /// Number of scans by which the last scan at or before the instant precedes the next one to be
    /// delivered; negative if it follows it.
    pub scans: i32,
    /// Fraction of a scan that had passed since then, in units of 2⁻¹⁶.
    pub part: u16,
}

/// A scan in counts of a board's timers.
#[derive(Clone, Copy, Debug)]
pub struct Ruler {
    /// Counts of a nominal scan, below 65536.
    pub period: u32,
    /// Counts from the beginning of a period to the sampling instant of its scan.
    pub taken_at: u32,
}

impl Ruler {
    /// The position of an instant that lies `since` counts before a reading at which the timer was
    /// `phase` counts into period `now`, when scan `next` (in the same count of periods) is the
    /// next one to be delivered. `since` is at most 2³⁰: 6 s at 160 MHz.
    #[must_use]
    pub fn place(&self, now: u32, phase: u32, since: u32, next: u32) -> Ago {
        let back = since.wrapping_add(self.taken_at).wrapping_sub(phase).cast_signed();
        let period = self.period.cast_signed();
        let forward = back.wrapping_neg();
        let scan = now.wrapping_add(forward.div_euclid(period).cast_unsigned());
        let rest = forward.rem_euclid(period).cast_unsigned();
        Ago { scans: next.wrapping_sub(scan).cast_signed(), part: ((rest << 16) / self.period) as u16 }
    }
}

/// Duration of a number of scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// Number of scans.
    pub scans: u32,
    /// Counts of the board's own crystal.
    pub counts: u32,
}

/// Good spans after which an external clock is trusted: 16 blocks of 0.3 ms are 5 ms.
const PROOF: u32 = 16;
/// Scans after which the mean of a clock's rate is restarted: 5 minutes at 51.2 kHz.
const MEAN_OVER: u32 = 1 << 24;
/// Possible error of a span in counts: both ends are read in whole counts, after a synchroniser of
/// one more.
const SLACK: u32 = 4;

/// Monitors an external clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClockWatch {
    good: u32,
    scans: u32,
    off: i32,
}

impl ClockWatch {
    /// Whether the clock has been within the tolerance long enough to be trusted.
    #[must_use]
    pub fn trusts(&self) -> bool {
        self.good >= PROOF
    }

    /// Evaluates one span; returns whether it is within the tolerance.
    pub fn is_good(&mut self, span: Span, period: u32) -> bool {
        let nominal = span.scans.wrapping_mul(period);
        let off = span.counts.wrapping_sub(nominal).cast_signed();
        // a million is a multiple of the tolerance, so no product exceeds 32 bits
        if off.unsigned_abs() > nominal / (1_000_000 / CLOCK_TOLERANCE_PPM) + SLACK {
            return false;
        }
        if self.scans > MEAN_OVER {
            (self.scans, self.off) = (0, 0);
        }
        self.scans += span.scans;
        self.off = self.off.saturating_add(off);
        self.good = (self.good + 1).min(PROOF);
        true
    }

    /// How much faster than nominal the clock is, as a mean over the last minutes, ppm.
    #[must_use]
    pub fn ppm(&self, period: u32) -> f32 {
        match self.scans {
            0 => 0.0,
            scans => -1e6 * self.off as f32 / (scans as f32 * period as f32),
        }
    }
}

const _: () = assert!(1_000_000 % CLOCK_TOLERANCE_PPM == 0);

/// State of scan clock, sync input and sync output, and pending actions.
#[derive(Default)]
pub(crate) struct InStep {
    /// Clock and counters, as reported to the host.
    now: Sync,
    /// Quality of the external clock so far.
    watch: ClockWatch,
    /// The board must select this clock.
    order: Option<Clock>,
    /// The sync output must pulse for this.
    due: Option<Line>,
}

impl InStep {
    /// Clock and counters, as reported to the host.
    pub fn now(&self) -> Sync {
        self.now
    }

    /// Whether the board has a pending action.
    #[inline]
    pub fn is_due(&self) -> bool {
        self.order.is_some() | self.due.is_some()
    }

    /// Takes the pending actions: the clock to be selected, and the reason for a pulse.
    pub fn take_due(&mut self) -> (Option<Clock>, Option<Line>) {
        (self.order.take(), self.due.take())
    }

    /// Requests a pulse of the sync output with the next block.
    pub fn mark(&mut self, line: Line) {
        self.due = Some(line);
    }

    /// Counts a pulse of the sync output; returns its number.
    pub fn count_pulse(&mut self) -> u32 {
        self.now.pulses += 1;
        self.now.pulses
    }

    /// Counts edges at the sync input, of which `lost` have no instant and one more does if
    /// `timed`; returns the number of the latter.
    pub fn count_edges(&mut self, lost: u32, timed: bool) -> u32 {
        self.now.edges += lost + u32::from(timed);
        self.now.edges_lost += lost;
        self.now.edges
    }

    /// Selects a clock; an external one is unproven at first.
    pub fn select(&mut self, clock: Clock) {
        let fault = (clock != Clock::Internal).then_some(ClockFault::Unproven);
        self.now = Sync { clock, fault, ppm: 0.0, ..self.now };
        (self.watch, self.order) = (ClockWatch::default(), Some(clock));
    }

    /// Whether an external clock is being measured, for which scans must be taken without a stream.
    pub fn is_measured(&self) -> bool {
        self.now.fault == Some(ClockFault::Unproven)
    }

    /// Selects the board's own clock at the end of a session.
    pub fn forget(&mut self) {
        if self.now.clock != Clock::Internal || self.now.fault.is_some() {
            self.select(Clock::Internal);
        }
    }

    /// Returns to the board's own clock because the selected one failed; the fault is kept until
    /// the host selects a clock.
    pub fn fail(&mut self, fault: ClockFault) {
        let asked = self.now.clock;
        self.select(Clock::Internal);
        self.now = Sync { clock: asked, fault: Some(fault), ..self.now };
    }

    /// Evaluates a span of the external clock.
    ///
    /// # Errors
    /// The fault that the span reveals.
    pub fn check(&mut self, span: Span, period: u32) -> Result<(), ClockFault> {
        // a span of the previous clock, or of one that is no longer used
        if self.order.is_some() || self.now.clock == Clock::Internal {
            return Ok(());
        }
        let proven = self.watch.trusts();
        if !self.watch.is_good(span, period) {
            return Err(if proven { ClockFault::Lost } else { ClockFault::Rate });
        }
        if self.watch.trusts() {
            self.now.fault = None;
            self.now.ppm = self.watch.ppm(period);
        }
        Ok(())
    }
}

/// Number of scans in `ms`, rounded down; exact for times up to a day at any rate below 4 MHz.
pub(crate) fn scans_in_ms(ms: u32, rate_hz: u32) -> u64 {
    u64::from(ms / 1000) * u64::from(rate_hz) + u64::from(ms % 1000 * rate_hz / 1000)
}

/// Duration of `scans` in ms, with a relative accuracy of 1e-6. Durations above 2³² scans saturate.
pub(crate) fn ms_of_scans(scans: u64, rate_hz: u32) -> u32 {
    (u32::try_from(scans).unwrap_or(u32::MAX) as f32 * (1000.0 / rate_hz as f32)) as u32
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    /// As on the nucleo board: 160 MHz, 51.2 kHz, CONVST rises after 1 µs.
    const RULER: Ruler = Ruler { period: 3125, taken_at: 160 };

    #[test]
    fn an_edge_lies_where_it_was_whenever_it_is_looked_at() {
        // time in counts; scan k is taken at 3125 k + 160; the count of periods wraps during the
        // test
        let started = u32::MAX - 3;
        for edge in (0..40_000_u32).step_by(37).chain([159, 160, 161, 3284, 3285, 3286]) {
            let after = edge.wrapping_sub(160).cast_signed();
            let (scan, part) = (after.div_euclid(3125), after.rem_euclid(3125).cast_unsigned());
            for later in [0, 1, 5, 159, 160, 3124, 3125, 46_875, 3_000_000] {
                let look = edge + later;
                let now = started.wrapping_add(look / 3125);
                for next in [0, 15, 30] {
                    let ago = RULER.place(now, look % 3125, later, started.wrapping_add(next));
                    assert_eq!(ago.scans, next.cast_signed() - scan, "edge {edge}, looked at {later} later");
                    assert_eq!(u32::from(ago.part), part * 65_536 / 3125);
                }
            }
        }
    }

    fn span(scans: u32, ppm: f64) -> Span {
        Span { scans, counts: (f64::from(scans * 3125) * (1.0 - ppm * 1e-6)).round() as u32 }
    }

    #[test]
    fn a_clock_is_trusted_after_a_while_and_its_rate_is_told() {
        for ppm in [-190.0, -50.0, 0.0, 120.0, 199.0] {
            let mut watch = ClockWatch::default();
            for _ in 0..PROOF {
                assert!(!watch.trusts());
                assert!(watch.is_good(span(15, ppm), 3125), "{ppm}");
            }
            assert!(watch.trusts());
            assert!((f64::from(watch.ppm(3125)) - ppm).abs() < 12.0, "half a count of a block is 11 ppm");
            // longer than the averaging period
            for _ in 0..20_000 {
                assert!(watch.is_good(span(1_500, ppm), 3125), "{ppm}");
            }
            assert!((f64::from(watch.ppm(3125)) - ppm).abs() < 0.2, "{} for {ppm}", watch.ppm(3125));
        }
    }

    #[test]
    fn beyond_its_tolerance_it_is_not_good() {
        for (scans, ppm) in [(15, 400.0), (15, -400.0), (1_500, 205.0), (1_500, -205.0), (15, 1e5)] {
            assert!(!ClockWatch::default().is_good(span(scans, ppm), 3125), "{ppm} ppm over {scans}");
        }
        // two of fifteen periods without an edge: the timer continues by itself, one per cent
        // slower
        assert!(!ClockWatch::default().is_good(Span { scans: 15, counts: 46_875 + 2 * 31 }, 3125));
        // a disturbance counted as an extra edge
        assert!(!ClockWatch::default().is_good(Span { scans: 15, counts: 46_875 - 1_500 }, 3125));
        assert!(!ClockWatch::default().is_good(Span { scans: 15, counts: 0 }, 3125));
    }
}

#[cfg(test)]
mod scan_time_tests {
    use super::*;

    #[test]
    fn they_agree_with_the_division() {
        for rate_hz in [1, 48_000, 51_200, 102_400] {
            for ms in [0, 1, 999, 1000, 1001, 59_999, 60_000, 86_400_000] {
                assert_eq!(scans_in_ms(ms, rate_hz), u64::from(ms) * u64::from(rate_hz) / 1000);
            }
            for scans in [0_u64, 51, 51_200, 3_072_000] {
                let exact = scans * 1000 / u64::from(rate_hz);
                let off = u64::from(ms_of_scans(scans, rate_hz)).abs_diff(exact);
                assert!(off <= 1 + exact / 1_000_000, "{scans} at {rate_hz}");
            }
        }
    }
}

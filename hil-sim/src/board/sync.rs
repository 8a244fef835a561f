//! The sync port of a virtual board, and the other recorder connected to it.
//!
//! Time is counted in scans: scan k is taken at time k. An external clock does not affect the rig
//! itself: its scans are equally long whatever clock times them.

use std::sync::{Mutex, PoisonError};

use jointrig_firmware::board::Seen;
pub use jointrig_firmware::lockstep::PERIOD;
use jointrig_firmware::ruler::{Ago, Span};
use jointrig_protocol::sync::{Clock, ClockFault};

/// Relative extension of a scan whose edge of the external clock does not arrive, as on the wired
/// board.
const FLYWHEEL: f64 = 0.01;
/// The largest difference, ppm, at which a board tries to use a clock.
const TRIED_PPM: f64 = 5_000.0;
/// Delay of the rising output after the end of a block, in scans: the program's run time.
const LATE: f64 = 0.25;

/// Another recorder.
#[derive(Clone, Debug, Default)]
struct Other {
    /// Its edges at the sync input that have not been read yet.
    edges: Vec<f64>,
    /// How much faster its clock is than the board's crystal, ppm; `None` if it provides no clock.
    clock_ppm: Option<f64>,
    /// Its clock stops at this scan.
    stops_at: Option<u64>,
    /// Times at which it saw the sync output rise.
    pulses: Vec<f64>,
}

/// The wires between a virtual board's sync port and another recorder.
#[derive(Debug, Default)]
pub struct Wires(Mutex<Other>);

impl Wires {
    fn with<R>(&self, f: impl FnOnce(&mut Other) -> R) -> R {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The other recorder sends an edge at this time, in scans.
    pub fn edge(&self, at: f64) {
        self.with(|other| other.edges.push(at));
    }

    /// Provides a clock that is this much faster than the board's crystal, ppm; or none.
    pub fn give_clock(&self, ppm: Option<f64>) {
        self.with(|other| (other.clock_ppm, other.stops_at) = (ppm, None));
    }

    /// Its clock stops at this scan.
    pub fn stop_clock_at(&self, scan: u64) {
        self.with(|other| other.stops_at = Some(scan));
    }

    /// Times at which it saw the sync output rise, in scans.
    pub fn pulses(&self) -> Vec<f64> {
        self.with(|other| other.pulses.clone())
    }
}

/// A board's end of the wires.
#[derive(Clone, Copy, Debug, Default)]
pub struct SyncPort {
    external: bool,
    /// Fractional part of a count that is carried over.
    rest: f64,
}

impl SyncPort {
    /// Events during the scans from `from` until before `to`.
    pub fn seen(&mut self, wires: &Wires, from: u64, to: u64) -> Option<Seen> {
        wires.with(|other| {
            let (mut came, later): (Vec<f64>, Vec<f64>) = other.edges.iter().partition(|at| **at < to as f64);
            other.edges = later;
            came.sort_by(f64::total_cmp);
            // only the newest edge is captured; earlier ones are only counted
            let edge = came.last().map(|at| Ago {
                scans: (to as f64 - at.floor()) as i32,
                part: ((at - at.floor()) * 65_536.0) as u16,
            });
            let lost = came.len().saturating_sub(1) as u32;
            let span = self.external.then(|| self.span(other, from, to));
            (edge.is_some() || span.is_some()).then_some(Seen { edge, lost, span })
        })
    }

    fn span(&mut self, other: &Other, from: u64, to: u64) -> Span {
        let stopped = other.stops_at.map_or(0, |at| to.saturating_sub(at.max(from)));
        let per_scan = 1.0 - other.clock_ppm.unwrap_or(0.0) * 1e-6;
        let scans = (to - from - stopped) as f64 * per_scan + stopped as f64 * (1.0 + FLYWHEEL);
        let counts = scans * f64::from(PERIOD) + self.rest;
        self.rest = counts.fract();
        Span { scans: (to - from) as u32, counts: counts as u32 }
    }

    /// Times the scans with this clock, from `now` on.
    ///
    /// # Errors
    /// No clock arrives, or its rate is wrong.
    pub fn clock(&mut self, wires: &Wires, now: u64, clock: Clock) -> Result<(), ClockFault> {
        self.external = false;
        if clock != Clock::Internal {
            let stands = |other: &Other| other.stops_at.is_some_and(|at| at <= now);
            let ppm = wires.with(|other| other.clock_ppm.filter(|_| !stands(other)));
            let ppm = ppm.ok_or(ClockFault::Absent)?;
            if ppm.abs() > TRIED_PPM {
                return Err(ClockFault::Rate);
            }
            *self = Self { external: true, rest: 0.0 };
        }
        Ok(())
    }

    /// Raises the output after the last scan before `next`.
    pub fn mark(wires: &Wires, next: u64) -> Ago {
        wires.with(|other| other.pulses.push(next as f64 + LATE));
        Ago { scans: 0, part: (LATE * 65_536.0) as u16 }
    }
}

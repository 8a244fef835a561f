//! The sync port of a virtual board, and what another recorder does at it.
//!
//! Time is counted in scans here too: scan k is taken at time k. The rig itself does not hear of another clock: whatever times them, its
//! scans are equally long.

use std::sync::{Mutex, PoisonError};

use jointrig_firmware::board::Seen;
pub use jointrig_firmware::lockstep::PERIOD;
use jointrig_firmware::ruler::{Ago, Span};
use jointrig_protocol::sync::{Clock, ClockFault};

/// By what part of itself a scan is longer when its edge of the external clock does not come, as on the wired board.
const FLYWHEEL: f64 = 0.01;
/// The largest difference, ppm, at which a board tries a clock at all.
const TRIED_PPM: f64 = 5_000.0;
/// After the end of a block the output rises, in parts of a scan: the program's own time.
const LATE: f64 = 0.25;

/// Another recorder.
#[derive(Clone, Debug, Default)]
struct Other {
    /// Its edges at the sync input that were not seen yet.
    edges: Vec<f64>,
    /// By how much its clock is faster than the board's crystal, ppm; none where it gives none.
    clock_ppm: Option<f64>,
    /// From this scan on its clock stands still.
    stops_at: Option<u64>,
    /// When it saw the sync output rise.
    pulses: Vec<f64>,
}

/// The wires between a virtual board's sync port and another recorder.
#[derive(Debug, Default)]
pub struct Wires(Mutex<Other>);

impl Wires {
    fn with<R>(&self, f: impl FnOnce(&mut Other) -> R) -> R {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The other recorder gives an edge at this time, in scans.
    pub fn edge(&self, at: f64) {
        self.with(|other| other.edges.push(at));
    }

    /// It gives a clock that is so much faster than the board's crystal, ppm; or none.
    pub fn give_clock(&self, ppm: Option<f64>) {
        self.with(|other| (other.clock_ppm, other.stops_at) = (ppm, None));
    }

    /// Its clock stands still from this scan on.
    pub fn stop_clock_at(&self, scan: u64) {
        self.with(|other| other.stops_at = Some(scan));
    }

    /// When it saw the sync output rise, in scans.
    pub fn pulses(&self) -> Vec<f64> {
        self.with(|other| other.pulses.clone())
    }
}

/// A board's end of the wires.
#[derive(Clone, Copy, Debug, Default)]
pub struct SyncPort {
    external: bool,
    /// What is left of a count.
    rest: f64,
}

impl SyncPort {
    /// What came during the scans from `from` until `to`, which is the next one.
    pub fn seen(&mut self, wires: &Wires, from: u64, to: u64) -> Option<Seen> {
        wires.with(|other| {
            let (mut came, later): (Vec<f64>, Vec<f64>) = other.edges.iter().partition(|at| **at < to as f64);
            other.edges = later;
            came.sort_by(f64::total_cmp);
            // the newest is caught, and those before it only leave their mark
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

    /// Lets this time the scans from `now` on.
    ///
    /// # Errors
    /// No clock comes, or one of quite another rate.
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

    /// Raises the output, after the scans before `next`.
    pub fn mark(wires: &Wires, next: u64) -> Ago {
        wires.with(|other| other.pulses.push(next as f64 + LATE));
        Ago { scans: 0, part: (LATE * 65_536.0) as u16 }
    }
}

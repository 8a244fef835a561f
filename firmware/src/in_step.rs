//! Part of the device's state: scan clock, sync input and sync output.

use jointrig_protocol::sync::{Clock, ClockFault, Line, Sync};

use crate::ruler::ClockWatch;

/// State of clock and edges, and pending actions.
#[derive(Default)]
pub(crate) struct InStep {
    /// Clock and counters, as reported to the host.
    pub now: Sync,
    /// Quality of the external clock so far.
    pub watch: ClockWatch,
    /// The board must select this clock.
    pub order: Option<Clock>,
    /// The sync output must pulse for this.
    pub due: Option<Line>,
}

impl InStep {
    /// Whether the board has a pending action.
    #[inline]
    pub fn is_due(&self) -> bool {
        self.order.is_some() | self.due.is_some()
    }

    /// Selects a clock; an external one is unproven at first.
    pub fn take(&mut self, clock: Clock) {
        let fault = (clock != Clock::Internal).then_some(ClockFault::Unproven);
        self.now = Sync { clock, fault, ppm: 0.0, ..self.now };
        (self.watch, self.order) = (ClockWatch::default(), Some(clock));
    }
}

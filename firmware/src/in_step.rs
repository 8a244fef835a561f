//! Clock of the scans, sync input and sync output as the device's state holds them.

use jointrig_protocol::sync::{Clock, ClockFault, Line, Sync};

use crate::ruler::ClockWatch;

/// What is known of clock and edges, and what is to be done about them.
#[derive(Default)]
pub(crate) struct InStep {
    /// Clock and counters, as the host is told.
    pub now: Sync,
    /// How good the external clock has been.
    pub watch: ClockWatch,
    /// The board is to take this clock.
    pub order: Option<Clock>,
    /// The output is to pulse for this.
    pub due: Option<Line>,
}

impl InStep {
    /// Whether the board has something to do.
    #[inline]
    pub fn is_due(&self) -> bool {
        self.order.is_some() | self.due.is_some()
    }

    /// Begins with a clock: an external one has yet to prove good.
    pub fn take(&mut self, clock: Clock) {
        let fault = (clock != Clock::Internal).then_some(ClockFault::Unproven);
        self.now = Sync { clock, fault, ppm: 0.0, ..self.now };
        (self.watch, self.order) = (ClockWatch::default(), Some(clock));
    }
}

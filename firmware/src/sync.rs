//! Synchronisation with another recorder: scan clock, edges at the sync input, pulses of the sync
//! output.
//!
//! Nothing here causes motion: an edge is reported, and a pulse marks an action of hammer or host.
//! An external clock that fails is treated as a failed front end: the stream ends, everything comes
//! to rest, and scans continue with the board's own crystal.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::{Answer, Refusal};
use jointrig_protocol::event::Event;
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Line, Moment};

use crate::Core;
use crate::board::{Scans, Seen};
use crate::ruler::Ago;
use crate::sentence::out_of_bounds;
use crate::state::State;

impl State<'_> {
    fn say_edge(&mut self, line: Line, number: u32, ago: Ago) {
        let scan = self.safety().next_scan().wrapping_add_signed(-i64::from(ago.scans));
        self.safety().say(Event::Edge(Edge { line, number, at: Moment { scan, part: ago.part } }));
    }

    /// Handles a faulty clock: ends the stream, and brings everything to rest.
    fn lose_clock(&mut self, fault: ClockFault) {
        self.in_step().fail(fault);
        self.safety().clock_fails(fault);
    }

    fn see(&mut self, seen: Seen, period: u32) {
        let number = self.in_step().count_edges(seen.lost, seen.edge.is_some());
        if let Some(ago) = seen.edge {
            self.say_edge(Line::Input, number, ago);
        }
        if let Some(span) = seen.span
            && let Err(fault) = self.in_step().check(span, period)
        {
            self.lose_clock(fault);
        }
    }
}

impl<M: RawMutex> Core<'_, M> {
    /// Processes the activity at the sync port during the block that was just taken.
    #[inline(never)]
    pub(crate) fn see(&self, seen: Seen, period: u32) {
        self.with(|state| state.see(seen, period));
    }

    /// Lets the board carry out pending actions.
    #[inline(never)]
    pub(crate) fn keep_in_step(&self, scans: &mut impl Scans) {
        let (order, due) = self.with(|state| state.in_step().take_due());
        if let Some(clock) = order
            && let Err(fault) = scans.clock(clock)
        {
            self.with(|state| state.lose_clock(fault));
        }
        if let Some(line) = due
            && let Some(ago) = scans.mark()
        {
            self.with(|state| {
                let number = state.in_step().count_pulse();
                state.say_edge(line, number, ago);
            });
        }
    }

    /// Selects the scan clock.
    pub(crate) fn ask_for_clock(&self, clock: Clock) -> Result<Answer, Refusal> {
        if !self.facts.sync {
            return Err(Refusal::Unsupported);
        }
        if let Clock::External { rate_hz } = clock
            && rate_hz != self.facts.scan_rate_hz
        {
            return Err(out_of_bounds("clock: its nominal rate must be that of the scans"));
        }
        self.with(|state| {
            if state.safety().is_streaming() {
                return Err(out_of_bounds("clock: end the stream first"));
            }
            state.in_step().select(clock);
            Ok(())
        })?;
        self.may_run.signal(());
        Ok(Answer::Done)
    }

    pub(crate) fn ask_for_mark(&self) -> Result<Answer, Refusal> {
        if !self.facts.sync {
            return Err(Refusal::Unsupported);
        }
        self.with(|state| {
            if !state.safety().is_streaming() {
                return Err(Refusal::NotStreaming);
            }
            state.in_step().mark(Line::Asked);
            Ok(Answer::Done)
        })
    }
}

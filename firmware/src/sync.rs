//! Synchronisation with another recorder: scan clock, edges at the sync input, pulses of the sync
//! output.
//!
//! Nothing here causes motion: an edge is reported, and a pulse marks an action of hammer or host.
//! An external clock that fails is treated as a failed front end: the stream ends, everything comes
//! to rest, and scans continue with the board's own crystal.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::{Answer, Refusal};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Line, Moment, Sync};

use crate::Core;
use crate::board::{Scans, Seen};
use crate::ruler::Ago;
use crate::sentence::out_of_bounds;
use crate::state::State;

impl State<'_> {
    /// Requests a pulse of the sync output with the next block.
    pub fn mark(&mut self, line: Line) {
        self.in_step.due = Some(line);
    }

    /// Whether scans must be taken without a stream, because an external clock is being measured.
    pub fn clock_is_measured(&self) -> bool {
        self.in_step.now.fault == Some(ClockFault::Unproven)
    }

    /// Resets the clock at the end of a session.
    pub fn forget_clock(&mut self) {
        if self.in_step.now.clock != Clock::Internal || self.in_step.now.fault.is_some() {
            self.in_step.take(Clock::Internal);
        }
    }

    fn say_edge(&mut self, line: Line, number: u32, ago: Ago) {
        let scan = self.next_scan.wrapping_add_signed(-i64::from(ago.scans));
        self.say(Event::Edge(Edge { line, number, at: Moment { scan, part: ago.part } }));
    }

    /// Handles a faulty clock: ends the stream, and brings everything to rest.
    fn lose_clock(&mut self, fault: ClockFault) {
        let asked = self.in_step.now.clock;
        self.in_step.take(Clock::Internal);
        self.in_step.now = Sync { clock: asked, fault: Some(fault), ..self.in_step.now };
        self.bring_to_rest(Reason::Clock);
        self.streaming = false;
        self.say(Event::Clock(fault));
    }

    fn see(&mut self, seen: Seen, period: u32) {
        let now = &mut self.in_step.now;
        now.edges += seen.lost;
        now.edges_lost += seen.lost;
        if let Some(ago) = seen.edge {
            now.edges += 1;
            let number = now.edges;
            self.say_edge(Line::Input, number, ago);
        }
        let Some(span) = seen.span else { return };
        // a span of the previous clock, or of one that is no longer used
        if self.in_step.order.is_some() || self.in_step.now.clock == Clock::Internal {
            return;
        }
        let proven = self.in_step.watch.trusts();
        if !self.in_step.watch.is_good(span, period) {
            self.lose_clock(if proven { ClockFault::Lost } else { ClockFault::Rate });
        } else if self.in_step.watch.trusts() {
            self.in_step.now.fault = None;
            self.in_step.now.ppm = self.in_step.watch.ppm(period);
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
        let (order, due) = self.with(|state| (state.in_step.order.take(), state.in_step.due.take()));
        if let Some(clock) = order
            && let Err(fault) = scans.clock(clock)
        {
            self.with(|state| state.lose_clock(fault));
        }
        if let Some(line) = due
            && let Some(ago) = scans.mark()
        {
            self.with(|state| {
                state.in_step.now.pulses += 1;
                state.say_edge(line, state.in_step.now.pulses, ago);
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
            if state.streaming {
                return Err(out_of_bounds("clock: end the stream first"));
            }
            state.in_step.take(clock);
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
            if !state.streaming {
                return Err(Refusal::NotStreaming);
            }
            state.mark(Line::Asked);
            Ok(Answer::Done)
        })
    }
}

//! In step with another recorder: which clock times the scans, and edges that both see.

use std::time::{Duration, Instant};

use jointrig_protocol::answer::Answer;
use jointrig_protocol::request::Request;
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Sync};

use super::error::DeviceError;
use super::session::Session;

/// The minor of the protocol since which a device knows of clocks and edges.
const SINCE: u16 = 2;
/// A clock is measured in some ms of the device's time.
const MEASURED_WITHIN: Duration = Duration::from_secs(5);

impl Session {
    /// Clock and edges as they are now; none on a device that knows of no such thing (protocol 1.1 and before).
    pub fn sync(&mut self) -> Result<Option<Sync>, DeviceError> {
        if self.hello.minor < SINCE {
            return Ok(None);
        }
        match self.ask(Request::Sync)? {
            Answer::Sync(sync) => Ok(Some(sync)),
            other => Err(self.wrong("sync", &other)),
        }
    }

    /// Lets this clock time the scans of the streams to come, and waits until it has proven good.
    ///
    /// # Errors
    /// It does not ([`DeviceError::Clock`] says why), the device's firmware is too old, or the device has no sync port.
    pub fn take_clock(&mut self, clock: Clock) -> Result<Sync, DeviceError> {
        if self.hello.minor < SINCE {
            return Err(DeviceError::TooOld {
                address: self.address.clone(),
                speaks: (self.hello.major, self.hello.minor),
                needs: (self.hello.major, SINCE),
                what: "take an external clock or tell of edges at its sync input, as the plan's [sync] asks",
            });
        }
        self.ask_done(Request::Clock(clock))?;
        let give_up = Instant::now() + MEASURED_WITHIN;
        loop {
            let fault = match self.sync()? {
                Some(sync) if sync.clock == clock && sync.fault.is_none() => return Ok(sync),
                Some(Sync { fault: Some(fault), .. }) => fault,
                // it says that another clock is in use
                _ => return Err(self.nonsense("does not take the clock that it was told to take".into())),
            };
            if fault != ClockFault::Unproven || Instant::now() > give_up {
                return Err(DeviceError::Clock { address: self.address.clone(), fault });
            }
        }
    }

    /// Lets the sync output pulse once, as soon as it can; the edge is among [`Session::edges`] later.
    ///
    /// # Errors
    /// No stream runs, or the device has no sync port.
    pub fn pulse_output(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Mark)
    }

    /// Edges at the sync input and output since this was asked last.
    pub fn edges(&mut self) -> Vec<Edge> {
        std::mem::take(&mut self.inbox.edges)
    }
}

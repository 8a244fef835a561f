//! Synchronisation with another recorder: the clock that times the scans, and edges that both
//! record.

use std::time::{Duration, Instant};

use jointrig_protocol::answer::Answer;
use jointrig_protocol::request::Request;
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Sync};

use super::error::DeviceError;
use super::session::Session;

/// Minor protocol version that introduced clocks and edges.
const SINCE: u16 = 2;
/// Timeout for the check of a clock, which takes some ms of device time.
const MEASURED_WITHIN: Duration = Duration::from_secs(5);

impl Session {
    /// Current clock and edges; `None` for a device without them (protocol 1.1 and before).
    pub fn sync(&mut self) -> Result<Option<Sync>, DeviceError> {
        if self.hello.minor < SINCE {
            return Ok(None);
        }
        match self.ask(Request::Sync)? {
            Answer::Sync(sync) => Ok(Some(sync)),
            other => Err(self.wrong("sync", &other)),
        }
    }

    /// Selects the clock for the scans of later streams, and waits until it was checked
    /// successfully.
    ///
    /// # Errors
    /// The check fails ([`DeviceError::Clock`] has the reason), the firmware is too old, or the
    /// device has no sync port.
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
                // another clock is in use
                _ => return Err(self.nonsense("does not take the clock that it was told to take".into())),
            };
            if fault != ClockFault::Unproven || Instant::now() > give_up {
                return Err(DeviceError::Clock { address: self.address.clone(), fault });
            }
        }
    }

    /// Emits one pulse at the sync output as soon as possible; its edge later appears in
    /// [`Session::edges`].
    ///
    /// # Errors
    /// No stream is running, or the device has no sync port.
    pub fn pulse_output(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Mark)
    }

    /// Edges at the sync input and output since the last call.
    pub fn edges(&mut self) -> Vec<Edge> {
        std::mem::take(&mut self.inbox.edges)
    }
}

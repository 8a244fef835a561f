//! The shaker from the host's side: an order, its renewal, rest.
//!
//! An order holds for a bounded time of the device's own clock and must be renewed ([`Session::shake`] again). A session that ends
//! while the shaker may be moving sends it to rest; one that is killed cannot, and then the device does so itself after a
//! second of silence.

use jointrig_protocol::answer::Shaker;
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Request, Shake};

use super::error::DeviceError;
use super::session::Session;

impl Session {
    /// Orders a sine, or renews or changes the one that runs.
    ///
    /// # Errors
    /// The device refuses it (no shaker, open guard, out of bounds), or is gone.
    pub fn shake(&mut self, order: Shake) -> Result<(), DeviceError> {
        // before it is answered: an answer that is lost leaves a shaker that moves
        self.shakes = true;
        self.ask_done(Request::Shake(order))
    }

    /// Has the shaker come to rest, over a ramp. [`Session::shaker_rests`] says when it has.
    ///
    /// # Errors
    /// The device is gone; it comes to rest by itself then.
    pub fn rest(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Rest)?;
        self.shakes = false;
        Ok(())
    }

    /// Whether the shaker is at rest now.
    ///
    /// # Errors
    /// The device is gone.
    pub fn shaker_rests(&mut self) -> Result<bool, DeviceError> {
        Ok(self.status()?.shaker == Shaker::Resting)
    }

    /// Why the shaker stopped since this was asked last, if it did. Other events wait for whoever wants them.
    pub fn shaker_stopped(&mut self) -> Option<Reason> {
        let mut reason = None;
        self.inbox.events.retain(|numbered| match numbered.event {
            Event::ShakerStops(why) => {
                reason = Some(why);
                false
            }
            Event::ShakerRuns | Event::ShakerRests => false,
            _ => true,
        });
        reason
    }

    /// Sends the shaker to rest without waiting for an answer: the last thing that an ending session says.
    pub(super) fn rest_at_last(&mut self) {
        if self.shakes
            && let Err(error) = self.background(Request::Rest)
        {
            log::warn!("{error}; the shaker comes to rest by itself, one second after the last word");
        }
    }
}

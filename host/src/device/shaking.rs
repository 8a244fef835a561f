//! The shaker from the host's side: order, renewal and rest.
//!
//! An order is valid for a limited time of the device's clock and must be renewed by another
//! [`Session::shake`]. A session that ends while the shaker may be moving orders it to rest. If the
//! process is killed, the device does so itself after one second without a message.

use jointrig_protocol::answer::Shaker;
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Request, Shake};

use super::error::DeviceError;
use super::session::Session;

impl Session {
    /// Orders a sine, or renews or changes the current one.
    ///
    /// # Errors
    /// The device refuses it (no shaker, open guard, out of bounds) or does not answer.
    pub fn shake(&mut self, order: Shake) -> Result<(), DeviceError> {
        // set before the answer: if the answer is lost, the shaker may be moving
        self.shakes = true;
        self.ask_done(Request::Shake(order))
    }

    /// Orders the shaker to rest, over a ramp. [`Session::shaker_rests`] reports when it is at
    /// rest.
    ///
    /// # Errors
    /// The device does not answer; the shaker then comes to rest by itself.
    pub fn rest(&mut self) -> Result<(), DeviceError> {
        self.ask_done(Request::Rest)?;
        self.shakes = false;
        Ok(())
    }

    /// Whether the shaker is at rest now.
    ///
    /// # Errors
    /// The device does not answer.
    pub fn shaker_rests(&mut self) -> Result<bool, DeviceError> {
        Ok(self.status()?.shaker == Shaker::Resting)
    }

    /// Why the shaker stopped since the last call, if it did. Other events stay in the queue.
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

    /// Orders the shaker to rest without waiting for an answer; called when a session ends.
    pub(super) fn rest_at_last(&mut self) {
        if self.shakes
            && let Err(error) = self.background(Request::Rest)
        {
            log::warn!("{error}; the shaker comes to rest by itself, one second after the last word");
        }
    }
}

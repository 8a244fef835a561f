//! Sensors fed with a constant current: an actuator that needs one does not move while the cable is
//! open or shorted.

use jointrig_protocol::answer::Refusal;
use jointrig_protocol::event::Reason;
use jointrig_protocol::slow::{Slow, Supply};

use crate::state::State;

impl State<'_> {
    /// Whether the sensor of a channel is present, as far as its supply can detect; channels
    /// without a supply are not checked.
    pub fn is_fed(&self, channel: Option<usize>) -> Result<(), Refusal> {
        let own = |supply: &&Supply| Some(usize::from(supply.channel)) == channel;
        let Some(supply) = self.slow.supplies.iter().find(own) else { return Ok(()) };
        supply.fault().map_or(Ok(()), |fault| Err(Refusal::Supply { channel: supply.channel, fault }))
    }

    /// Stores the measured values. If the force sensor of the hammer is missing, the hammer is
    /// disarmed; if that of the shaker is missing, the shaker comes to rest.
    #[inline(never)]
    pub fn take_slow(&mut self, slow: Slow) {
        self.slow = slow;
        if let Err(Refusal::Supply { channel, .. }) = self.is_fed(self.hammer.force_channel()) {
            self.disarm(Reason::Supply { channel });
        }
        if let Err(Refusal::Supply { channel, .. }) = self.is_fed(self.excitation) {
            let stops = self.shaker.stop(Reason::Supply { channel });
            self.tell_of_shaker(stops);
        }
    }
}

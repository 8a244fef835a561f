//! Selects the scales used for hammer, shaker and load cells: those of the board, or those sent in
//! the session.

use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::Channel;

use crate::scales::{UnitsPerCode, as_built, as_told};
use crate::state::State;

impl State<'_> {
    /// Uses these scales from now on.
    ///
    /// # Errors
    /// [`Refusal::OutOfBounds`]; [`Refusal::HammerArmed`] or [`Refusal::ShakerRuns`] while
    /// something may move based on the old scales.
    pub fn take_scales(&mut self, channels: &[Channel], units_per_volt: &[f32]) -> Result<(), Refusal> {
        let scales = as_told(channels, units_per_volt)?;
        match self.hammer.state() {
            answer::Hammer::Disarmed | answer::Hammer::HoldOff => {}
            _ => return Err(Refusal::HammerArmed),
        }
        if self.shaker.moves() {
            return Err(Refusal::ShakerRuns);
        }
        self.judge_by(&scales);
        self.scales_told = true;
        Ok(())
    }

    /// Restores the built-in scales if a session has changed them.
    pub fn forget_scales(&mut self, channels: &[Channel]) {
        if core::mem::take(&mut self.scales_told) {
            self.judge_by(&as_built(channels));
        }
    }

    fn judge_by(&mut self, scales: &UnitsPerCode) {
        self.hammer.judge_by(scales);
        self.shaker.judge_by(scales);
        if let Some(friction) = &mut self.friction {
            friction.judge_by(scales);
        }
    }
}

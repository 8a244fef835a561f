//! Which scales hammer, shaker and load cells are judged by: those of the board, or those that a
//! session brought.

use jointrig_protocol::answer::{self, Refusal};
use jointrig_protocol::channel::Channel;

use crate::scales::{UnitsPerCode, as_built, as_told};
use crate::state::State;

impl State<'_> {
    /// Judges by these scales from now on.
    ///
    /// # Errors
    /// [`Refusal::OutOfBounds`]; [`Refusal::HammerArmed`] or [`Refusal::ShakerRuns`] while
    /// something may move by the old ones.
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

    /// Forgets what a session said of the scales.
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

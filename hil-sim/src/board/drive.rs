//! The shaker's drive of a virtual board: codes that are given after one block are played during the next.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use jointrig_firmware::board::{Drive, RanDry};
use jointrig_firmware::lockstep::DRIVE_FULL_SCALE_V;

/// Codes on their way from the firmware to the rig.
#[derive(Clone, Debug, Default)]
pub struct VirtualDrive(Rc<RefCell<VecDeque<i16>>>);

impl VirtualDrive {
    /// The voltage of the next scan; 0 when nothing was given for it.
    pub fn next_v(&self) -> f64 {
        let code = self.0.borrow_mut().pop_front().unwrap_or(0);
        f64::from(code) / f64::from(i16::MAX) * f64::from(DRIVE_FULL_SCALE_V)
    }
}

impl Drive for VirtualDrive {
    fn full_scale_v(&self) -> f32 {
        DRIVE_FULL_SCALE_V
    }

    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry> {
        // the clock of the scans stands still until they are given: it cannot run dry
        self.0.borrow_mut().extend(codes);
        Ok(())
    }

    fn rest(&mut self) {
        self.0.borrow_mut().clear();
    }
}

//! The shaker's drive of a virtual board: codes that are given after one block are played during
//! the next.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use jointrig_firmware::board::{Drive, RanDry};
use jointrig_firmware::lockstep::DRIVE_FULL_SCALE_V;

/// Queue of drive codes from the firmware to the rig.
#[derive(Clone, Debug, Default)]
pub struct VirtualDrive(Rc<RefCell<Motion>>);

#[derive(Debug, Default)]
struct Motion {
    codes: VecDeque<i16>,
    /// More codes will follow.
    open: bool,
    /// A scan of an open motion found no code. The output stays at rest until the firmware has been
    /// notified.
    dry: bool,
}

impl VirtualDrive {
    /// The voltage of the next scan; 0 when nothing was given for it.
    pub fn next_v(&self) -> f64 {
        let mut motion = self.0.borrow_mut();
        let code = motion.codes.pop_front();
        motion.dry |= motion.open && code.is_none();
        f64::from(code.unwrap_or(0)) / f64::from(i16::MAX) * f64::from(DRIVE_FULL_SCALE_V)
    }
}

impl Drive for VirtualDrive {
    fn full_scale_v(&self) -> f32 {
        DRIVE_FULL_SCALE_V
    }

    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry> {
        let mut motion = self.0.borrow_mut();
        if motion.dry {
            *motion = Motion::default();
            return Err(RanDry);
        }
        motion.open = !codes.is_empty();
        motion.codes.extend(codes);
        Ok(())
    }

    fn rest(&mut self) {
        *self.0.borrow_mut() = Motion::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played(drive: &VirtualDrive, scans: usize) -> Vec<f64> {
        (0..scans).map(|_| drive.next_v()).collect()
    }

    #[test]
    fn a_motion_that_is_given_on_never_rests_and_one_that_is_not_runs_dry_once() {
        let mut drive = VirtualDrive::default();
        assert_eq!(played(&drive, 3), [0.0; 3], "nothing was begun");
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()));
        assert_eq!(played(&drive, 2), [10.0; 2]);
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()));
        assert_eq!(played(&drive, 4), [10.0, 10.0, 0.0, 0.0]);
        assert_eq!(drive.play(&[i16::MAX; 2]), Err(RanDry));
        assert_eq!(played(&drive, 2), [0.0; 2], "it took nothing");
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()), "another motion");
    }

    #[test]
    fn a_motion_that_ends_does_not_run_dry() {
        let mut drive = VirtualDrive::default();
        for _ in 0..2 {
            assert_eq!(drive.play(&[i16::MAX]), Ok(()));
            assert_eq!(drive.play(&[]), Ok(()));
            assert_eq!(played(&drive, 3), [10.0, 0.0, 0.0]);
        }
        assert_eq!(drive.play(&[i16::MAX; 5]), Ok(()));
        drive.rest();
        assert_eq!(played(&drive, 3), [0.0; 3]);
        assert_eq!(drive.play(&[i16::MAX]), Ok(()));
    }
}

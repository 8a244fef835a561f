//! A stepper together with the sliders of its joint.
//!
//! While stuck, a scan is one exact step of the linear structure under a constant force between the
//! specimens that remains from earlier slip. A scan in which an element would slip is undone and
//! repeated in steps.

use super::{Joint, ScanForces, Span, Stepper};
use crate::rig::sliders::Sliders;

/// The step's equation converges from any start while its slopes differ by less than a half.
const MOST_GAIN: f64 = 0.5;

/// The sliders, and how a scan is divided for them.
#[derive(Debug, Clone)]
pub struct Slipping {
    sliders: Sliders,
    receptance: f64,
    steps: u32,
    step_s: f64,
}

impl Slipping {
    /// At rest; `None` when the joint's step is too long for this structure.
    pub fn new(sliders: Sliders, joint: &Joint, stepper: &Stepper) -> Option<Self> {
        let receptance = stepper.receptance();
        let gain = receptance * sliders.stiffness();
        (0.0..MOST_GAIN).contains(&gain).then_some(Self {
            sliders,
            receptance,
            steps: joint.steps,
            step_s: joint.step_s,
        })
    }

    /// The sliders.
    pub fn sliders(&self) -> &Sliders {
        &self.sliders
    }

    /// Sets the normal load (N).
    pub fn load(&mut self, normal_load_n: f64) {
        self.sliders.load(normal_load_n);
    }

    /// Advances one scan period.
    #[inline]
    pub fn advance(&mut self, stepper: &mut Stepper, forces: &ScanForces<'_>) {
        if self.sliders.settled() {
            stepper.keep();
            stepper.advance(Span::Scan, forces);
            let push_n = self.sliders.push_n();
            if push_n != 0.0 {
                stepper.push(Span::Scan, push_n, push_n);
            }
            if self.sliders.hold(stepper.joint()) {
                return;
            }
            stepper.go_back();
        }
        self.slip(stepper, forces);
    }

    fn slip(&mut self, stepper: &mut Stepper, forces: &ScanForces<'_>) {
        let mut from_s = forces.from_s;
        let mut push_n = self.sliders.push_n();
        for step in 1..=self.steps {
            let to_s =
                if step == self.steps { forces.to_s } else { forces.from_s + f64::from(step) * self.step_s };
            stepper.advance(Span::Step, &ScanForces { from_s, to_s, ..*forces });
            stepper.push(Span::Step, push_n, 0.0);
            let next_n = self.sliders.slide(stepper.joint(), self.receptance);
            stepper.push(Span::Step, 0.0, next_n);
            (from_s, push_n) = (to_s, next_n);
        }
    }
}

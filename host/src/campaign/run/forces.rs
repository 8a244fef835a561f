//! Target force of each hit of a cell: the plan's force, and a lower one for every second hit if
//! the plan requests it. Each force has a separate closed loop.

use super::pulse::{FIRST_SLOPE, Hit, PulseLoop};
use crate::campaign::plan::Force;
use crate::campaign::verdict::Kind;

/// The closed loops of all forces.
#[derive(Clone, Debug)]
pub struct Forces(Vec<PulseLoop>);

impl Forces {
    /// Creates one loop, or two. `cap_us` is the device's longest pulse.
    pub fn new(force: &Force, cap_us: u32) -> Self {
        let mut loops = vec![PulseLoop::new(force, cap_us)];
        if let Some(softer) = force.softer {
            // a first guess that the loop corrects
            let pulse = f64::from(force.pulse_us) * softer.powf(FIRST_SLOPE.recip());
            let pulse_us = (pulse.round() as u32).max(force.pulse_bounds_us[0]);
            let soft = Force { target_n: softer * force.target_n, pulse_us, ..*force };
            loops.push(PulseLoop::new(&soft, cap_us));
        }
        Self(loops)
    }

    /// The pulse for the next shot in a cell with `kept` good hits, µs.
    pub fn pulse_us(&self, kept: u32) -> u32 {
        self.0[kept as usize % self.0.len()].pulse_us()
    }

    /// Updates the loop after a hit was judged. A record with missing samples is ignored: its peak
    /// may be among the missing samples, and the loop would lengthen the pulse because of a fault
    /// of the link.
    pub fn learn_judged(&mut self, judged: Kind, hit: Hit) {
        if judged != Kind::Gap {
            self.learn(hit);
        }
    }

    /// Updates the loop whose pulse is nearest to the hit's, so that replaying a stored campaign
    /// reproduces the state of the running one.
    fn learn(&mut self, hit: Hit) {
        if let Some(own) = self.0.iter_mut().min_by_key(|own| own.pulse_us().abs_diff(hit.pulse_us)) {
            own.learn(hit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: Force = Force {
        target_n: 50.0,
        softer: Some(0.7),
        tolerance: 0.05,
        pulse_us: 3_000,
        pulse_bounds_us: [500, 8_000],
    };

    fn strike(forces: &mut Forces, kept: u32) -> f64 {
        let pulse_us = forces.pulse_us(kept);
        let peak_n = (f64::from(pulse_us) - 1_500.0).max(0.0) * 0.02;
        forces.learn(Hit { pulse_us, peak_n });
        peak_n
    }

    #[test]
    fn every_second_good_hit_is_softer() {
        let mut forces = Forces::new(&FORCE, 8_000);
        let peaks: Vec<f64> = (0..24).map(|kept| strike(&mut forces, kept)).collect();
        for pair in peaks[16..].chunks(2) {
            assert!((pair[0] / 50.0 - 1.0).abs() < 0.06 && (pair[1] / 35.0 - 1.0).abs() < 0.06, "{peaks:?}");
        }
    }

    #[test]
    fn a_stored_campaign_teaches_what_the_running_one_did() {
        let mut forces = Forces::new(&FORCE, 8_000);
        let mut stored = Vec::new();
        // a refused hit is repeated with the same force
        for kept in [0, 0, 1, 2, 3, 3, 4, 5] {
            let pulse_us = forces.pulse_us(kept);
            stored.push(Hit { pulse_us, peak_n: (f64::from(pulse_us) - 1_500.0) * 0.025 });
            forces.learn(stored[stored.len() - 1]);
        }
        let mut resumed = Forces::new(&FORCE, 8_000);
        for hit in stored {
            resumed.learn(hit);
        }
        assert_eq!([0, 1].map(|kept| resumed.pulse_us(kept)), [0, 1].map(|kept| forces.pulse_us(kept)));
    }

    #[test]
    fn without_a_softer_force_all_hits_are_alike() {
        let forces = Forces::new(&Force { softer: None, ..FORCE }, 8_000);
        assert_eq!(forces.pulse_us(0), forces.pulse_us(1));
    }
}

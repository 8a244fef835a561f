//! Wear: every cycle of a long run reduced by itself, and the run summed by decades of cycles.
//!
//! [`analyse`](super::analyse()) averages the cycles of a record, which a contact that changes does
//! not allow, and looks for faults of the loop, which takes too long for millions of cycles.
//! [`reduce`] reads one closed cycle with the same definitions of stick part, plateau and loop
//! area. [`each`] cuts the cycles of a part of a run, whose period need not be a whole number of
//! samples, and [`Decades`] sums them up.
//!
//! Nothing is corrected: the force is the load cells' sum. The bias of such loops is that of raw
//! levels.

use super::HysteresisError;
use super::cycles::Steady;
use super::frequency::Timing;
use super::loops::{Cycle, closed_swing, energy};
use super::record::HysteresisRecord;
use super::stick::{
    bends, final_tangent, first_part, flank_part, friction_limit, slope_over, strokes, tangent_at_reversal,
};

/// A cycle is in gross slip if the tangent at its strokes' ends is below this fraction of the
/// initial one. It is larger than for a loop averaged over many cycles, because the structure still
/// rings there.
const PLATEAU: f64 = 0.1;

/// What one cycle shows. SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleReading {
    /// Half the swing of the relative displacement Δx, m.
    pub amplitude_m: f64,
    /// Area of the loop, J. Noise can make that of a stuck contact slightly negative.
    pub energy_j: f64,
    /// In gross slip k_T, the slope of the stick part; otherwise the tangent after the reversals,
    /// N/m. `None` if too few samples lie on that part, or nothing moves.
    pub stiffness_n_per_m: Option<f64>,
    /// μN, half the distance between the plateaus' medians, N; `None` without gross slip.
    pub friction_n: Option<f64>,
}

/// Reads one closed cycle, whose first point follows its last one.
///
/// The loop of one slider under a sine of 5 µm, k_T = 60 N/µm and μN = 150 N:
///
/// ```
/// use jointrig_analysis::hysteresis::{loops::Cycle, wear::reduce};
///
/// let (k, limit, amplitude) = (60e6, 150.0, 5e-6);
/// let x: Vec<f64> =
///     (0..1000).map(|i| amplitude * (std::f64::consts::TAU * i as f64 / 1000.0).sin()).collect();
/// let mut slider = 0.0;
/// let mut force = vec![0.0; 1000];
/// for i in 0..2000 {
///     let carried: f64 = (k * (x[i % 1000] - slider)).clamp(-limit, limit);
///     slider = x[i % 1000] - carried / k;
///     force[i % 1000] = carried;
/// }
/// let cycle = Cycle { displacement_m: x, velocity_m_per_s: vec![0.0; 1000], force_n: force };
/// let read = reduce(&cycle);
/// assert!((read.stiffness_n_per_m.unwrap() / k - 1.0).abs() < 1e-6);
/// assert!((read.friction_n.unwrap() / limit - 1.0).abs() < 1e-6);
/// assert!((read.energy_j / (4.0 * limit * (amplitude - limit / k)) - 1.0).abs() < 1e-3);
/// ```
pub fn reduce(cycle: &Cycle) -> CycleReading {
    let strokes = strokes(cycle);
    let early = first_part(cycle, &strokes);
    let tangent = |part| {
        if bends(part) { tangent_at_reversal(cycle, &strokes) } else { slope_over(cycle, &strokes, part) }
    };
    let known = |k: Option<f64>| k.filter(|k| k.is_finite());
    let initial = known(tangent(early));
    let slips = initial.is_some_and(|k| k > 0.0 && final_tangent(cycle, &strokes, k) < PLATEAU);
    CycleReading {
        amplitude_m: 0.5 * closed_swing(&cycle.displacement_m),
        energy_j: energy(cycle),
        stiffness_n_per_m: if slips { known(tangent(flank_part(cycle, &strokes))) } else { initial },
        friction_n: if slips { friction_limit(cycle, &strokes) } else { None },
    }
}

/// Reduces `cycles` cycles of a record, the first of which begins `begin` samples after its first
/// sample, and passes each with its reading to `look`. The record must contain one sample before
/// the first cycle and two after the last one. `period` is a cycle's length in samples.
///
/// # Errors
/// The record is unusable, too short, or has fewer than 16 samples per cycle.
pub fn each(
    record: &HysteresisRecord,
    begin: f64,
    period: f64,
    cycles: usize,
    mut look: impl FnMut(&Cycle, CycleReading),
) -> Result<(), HysteresisError> {
    record.check()?;
    let timing = Timing::steady(record.fs_hz / period);
    let samples = record.force_n.len();
    if cycles == 0 || begin < 0.0 || begin + period * cycles as f64 > samples as f64 {
        return Err(HysteresisError::TooShort { samples });
    }
    Steady::from_cycle(record, timing, begin / period, cycles)?
        .each_as_measured(|cycle| look(cycle, reduce(cycle)));
    Ok(())
}

/// Sums over consecutive cycles. The number of a cycle counts from 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CycleSums {
    /// Cycles, measured or not.
    pub cycles: u64,
    /// Number of the first and the last of them; 0 if there is none.
    pub numbers: [u64; 2],
    /// Energy dissipated in them, J.
    pub energy_j: f64,
    /// Cycles in gross slip.
    pub slipping: u64,
    stiffness: Mean,
    friction: Mean,
    coefficient: Mean,
    amplitude: Mean,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, value: Option<f64>) {
        if let Some(value) = value {
            self.sum += value;
            self.count += 1;
        }
    }

    fn get(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

impl CycleSums {
    /// Adds the cycle with this number, counted from 1; `None` for a cycle that was not measured.
    /// `energy_j` is what it dissipated, `normal_load_n` its normal load, if known.
    pub fn add(
        &mut self,
        number: u64,
        reading: Option<&CycleReading>,
        energy_j: f64,
        normal_load_n: Option<f64>,
    ) {
        if self.cycles == 0 {
            self.numbers[0] = number;
        }
        self.numbers[1] = number;
        self.cycles += 1;
        self.energy_j += energy_j;
        let Some(reading) = reading else { return };
        self.amplitude.add(Some(reading.amplitude_m));
        if let Some(friction_n) = reading.friction_n {
            if self.slipping == 0 {
                // from here on k_T alone counts
                self.stiffness = Mean::default();
            }
            self.slipping += 1;
            self.friction.add(Some(friction_n));
            self.coefficient.add(normal_load_n.filter(|n| *n > 0.0).map(|n| friction_n / n));
            self.stiffness.add(reading.stiffness_n_per_m);
        } else if self.slipping == 0 {
            self.stiffness.add(reading.stiffness_n_per_m);
        }
    }

    /// Mean k_T of the cycles in gross slip, or, if none slips, mean tangent stiffness, N/m.
    pub fn stiffness_n_per_m(&self) -> Option<f64> {
        self.stiffness.get()
    }

    /// Mean friction force of the cycles in gross slip, N.
    pub fn friction_n(&self) -> Option<f64> {
        self.friction.get()
    }

    /// Mean coefficient of friction of the cycles in gross slip whose normal load is known.
    pub fn friction_coefficient(&self) -> Option<f64> {
        self.coefficient.get()
    }

    /// Mean amplitude of Δx, m.
    pub fn amplitude_m(&self) -> Option<f64> {
        self.amplitude.get()
    }
}

/// The decades of a run, cycles 1 to 9, 10 to 99, 100 to 999 and so on, summed cycle by cycle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decades(Vec<CycleSums>);

impl Decades {
    /// The decade of the cycle with this number, counted from 1.
    pub fn of(&mut self, number: u64) -> &mut CycleSums {
        let place = number.max(1).ilog10() as usize;
        if self.0.len() <= place {
            self.0.resize(place + 1, CycleSums::default());
        }
        &mut self.0[place]
    }

    /// The decades with cycles, the first cycles first.
    pub fn iter(&self) -> impl Iterator<Item = &CycleSums> {
        self.0.iter().filter(|decade| decade.cycles > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::RelativeMotion;
    use super::*;
    use std::f64::consts::TAU;

    const FS_HZ: f64 = 51_200.0;

    /// Velocities and force of a Jenkins contact under x = X sin ωt.
    fn jenkins(k: f64, limit: f64, amplitude: f64, hz: f64, samples: usize) -> HysteresisRecord {
        let omega = TAU * hz;
        let at = |i: f64| omega * i / FS_HZ;
        let mut slider = 0.0;
        let mut force_n = Vec::with_capacity(samples);
        // one cycle before the record, so that it begins on the closed loop
        let before = (FS_HZ / hz).ceil() as usize;
        for i in 0..samples + before {
            let x = amplitude * at(i as f64 - before as f64).sin();
            let carried = (k * (x - slider)).clamp(-limit, limit);
            slider = x - carried / k;
            if i >= before {
                force_n.push(carried);
            }
        }
        let a_m_per_s = (0..samples).map(|i| amplitude * omega * at(i as f64).cos()).collect();
        let motion = RelativeMotion::Velocity { a_m_per_s, b_m_per_s: vec![0.0; samples] };
        HysteresisRecord { fs_hz: FS_HZ, motion, force_n, excitation_hz: Some(hz), normal_load_n: None }
    }

    #[test]
    fn a_jenkins_loop_has_its_closed_forms_whatever_the_period() {
        for (k, limit, amplitude, hz) in
            [(30e6, 60.0, 5e-6, 100.0), (180e6, 120.0, 3e-6, 87.3), (95e6, 200.0, 8e-6, 331.7)]
        {
            let period = FS_HZ / hz;
            let record = jenkins(k, limit, amplitude, hz, 20 * period as usize);
            let mut seen = 0;
            each(&record, 2.4, period, 15, |_, read| {
                seen += 1;
                let energy = 4.0 * limit * (amplitude - limit / k);
                assert!((read.energy_j / energy - 1.0).abs() < 4e-3, "{hz}: {} for {energy}", read.energy_j);
                let stiffness = read.stiffness_n_per_m.expect("a flank");
                assert!((stiffness / k - 1.0).abs() < 1e-2, "{hz}: {stiffness}");
                assert!((read.friction_n.expect("slips") / limit - 1.0).abs() < 2e-3);
                assert!((read.amplitude_m / amplitude - 1.0).abs() < 1e-4);
            })
            .expect("whole cycles");
            assert_eq!(seen, 15);
        }
    }

    #[test]
    fn a_stuck_contact_has_a_tangent_and_neither_energy_nor_a_limit() {
        let record = jenkins(120e6, 1e4, 0.5e-6, 100.0, 5_120);
        each(&record, 1.0, 512.0, 9, |_, read| {
            assert!((read.stiffness_n_per_m.expect("moves") / 120e6 - 1.0).abs() < 1e-4);
            assert_eq!(read.friction_n, None);
            assert!(read.energy_j.abs() < 1e-3 * 60.0 * 0.5e-6);
        })
        .expect("whole cycles");
    }

    #[test]
    fn nothing_that_moves_gives_no_stiffness() {
        let nothing = vec![0.0; 64];
        let [displacement_m, velocity_m_per_s, force_n] = [nothing.clone(), nothing.clone(), nothing];
        let read = reduce(&Cycle { displacement_m, velocity_m_per_s, force_n });
        assert_eq!((read.stiffness_n_per_m, read.friction_n, read.energy_j), (None, None, 0.0));
    }

    #[test]
    fn a_part_beyond_the_record_is_refused() {
        let record = jenkins(30e6, 60.0, 5e-6, 100.0, 5_000);
        assert!(matches!(
            each(&record, 1.0, 512.0, 10, |_, _| {}),
            Err(HysteresisError::TooShort { samples: 5_000 })
        ));
        let short = jenkins(30e6, 60.0, 5e-6, 4_000.0, 5_000);
        assert!(matches!(each(&short, 1.0, 12.8, 3, |_, _| {}), Err(HysteresisError::NoCycle { .. })));
    }

    #[test]
    fn decades_hold_every_cycle_once() {
        let mut decades = Decades::default();
        let reading = |friction_n| CycleReading {
            amplitude_m: 2e-6,
            energy_j: 1e-3,
            stiffness_n_per_m: Some(if friction_n == Some(50.0) { 3e7 } else { 9e7 }),
            friction_n,
        };
        for number in 1..=1_234 {
            // cycles 1 to 4 stick, 500 is missing
            let own = reading((number > 4).then_some(50.0));
            decades.of(number).add(number, (number != 500).then_some(&own), 1e-3, Some(100.0));
        }
        let all: Vec<CycleSums> = decades.iter().copied().collect();
        assert_eq!(all.iter().map(|d| d.cycles).collect::<Vec<_>>(), [9, 90, 900, 235]);
        assert_eq!(all.iter().map(|d| d.slipping).collect::<Vec<_>>(), [5, 90, 899, 235]);
        assert_eq!(all[3].numbers, [1_000, 1_234]);
        for decade in &all {
            assert_eq!(decade.stiffness_n_per_m(), Some(3e7));
            assert_eq!(decade.friction_n(), Some(50.0));
            assert_eq!(decade.friction_coefficient(), Some(0.5));
            assert!((decade.energy_j - 1e-3 * decade.cycles as f64).abs() < 1e-12);
        }
    }
}

//! Force in the assembly that passes beside the contact or the load cells, found with the joint
//! open: both sides in place, nothing touches.
//!
//! Between A and B, through a cable, a hose or a stop that joins both sides: the load cells show it
//! together with the contact's force, so that k_T comes out stiffer by about that part. With the
//! joint open it is all that reaches the load cells when A is struck. T over the displacement
//! between arm A and B is then the path's stiffness, and with the joint closed that of everything
//! between the arms; their ratio is the part sought.
//!
//! Between B and the ground, through a wire or a hose that holds B in the assembly but not while B
//! alone was measured: the load cells lack what it carries, so that k_T comes out softer by about
//! that part. When B is struck, the hammer is the force at the contact, and force over T is larger
//! by that part than on B alone.
//!
//! The same sensors measure both, so that their gains cancel. The path acts at another place than
//! the one where A is measured or B is struck, which the ratio leaves out: see [`PLACE`].

use super::BAND;
use crate::C;
use crate::band::Band;
use crate::frf::MotionQuantity;
use crate::frf::noise::shared_by_lines;
use crate::spectra::CrossSpectra;
use crate::substructuring::joint_over_bands::median;

/// The lines used: below the bending modes of arms and cables.
const LINES: Band = Band { low_hz: BAND.low_hz, high_hz: 300.0 };

/// Relative standard deviation of the part because the arm turns, and the path is not where A is
/// measured or B is struck.
const PLACE: f64 = 0.3;

/// Standard deviation of force over T at one place of arm B because of the hits' aim and tilt: on
/// eight drawn rigs, the three places along z of a plan, up to 22 mm apart, differed by 0.75 % at
/// most, and two at the same height by 0.22 % (rms).
const STRUCK: f64 = 0.0025;

/// Parts below this are no concern: k_T's interval is wider.
const MUCH: f64 = 0.005;

/// Standard deviations of the noise beyond which there is a path for certain, wherever it is.
const CERTAIN: f64 = 4.0;

/// Hits on A along the sliding direction: the response of arm A, v_A and v_B at the spots, and T.
#[derive(Debug, Clone, Copy)]
pub struct HitsOnA<'a> {
    /// The axes of arm A's response, then v_A, v_B and T.
    pub spectra: &'a CrossSpectra,
    /// Which of these axes is along the sliding direction.
    pub axis: usize,
    /// What the response is.
    pub quantity: MotionQuantity,
}

impl HitsOnA<'_> {
    /// T over the displacement of arm A relative to the spot on B, N/m.
    fn stiffness_n_per_m(&self, line: usize) -> Option<C> {
        let t = self.spectra.outputs().checked_sub(1)?;
        let s = self.spectra.s(line);
        let moved = self.spectra.h1(line, self.axis) * s.powi(-self.quantity.order_of_s())
            - self.spectra.h1(line, t.checked_sub(1)?) / s;
        Some(self.spectra.h1(line, t) / moved).filter(|k| k.is_finite())
    }
}

/// Hits on B along the sliding direction: the response of arm B, and T as the last output.
#[derive(Debug, Clone, Copy)]
pub struct HitsOnB<'a> {
    /// The axes of arm B's response; T is the last of all outputs.
    pub spectra: &'a CrossSpectra,
    /// Which of these axes is along the sliding direction.
    pub axis: usize,
    /// What the response is.
    pub quantity: MotionQuantity,
}

impl HitsOnB<'_> {
    /// The hammer's force over T.
    fn per_t(&self, line: usize) -> Option<C> {
        let t = self.spectra.outputs().checked_sub(1)?;
        Some(self.spectra.h1(line, t).inv()).filter(|ratio| ratio.is_finite())
    }

    /// Displacement of arm B over T, m/N.
    fn moved_per_t(&self, line: usize) -> Option<C> {
        let moved = self.spectra.h1(line, self.axis);
        let displacement = moved * self.spectra.s(line).powi(-self.quantity.order_of_s());
        Some(self.per_t(line)? * displacement)
    }
}

/// What a second path joins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Joins {
    /// The two sides, beside the contact.
    Sides,
    /// Side B and the ground, beside the load cells.
    Ground,
}

/// Force that passes beside the contact or the load cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondPath {
    /// What the path joins.
    pub joins: Joins,
    /// Its part of the force between A and B: 0.1 is a tenth. Negative if B was held more while it
    /// was measured alone.
    pub part: f64,
    /// Its standard deviation from noise, and from the hits' aim and tilt on B.
    pub noise: f64,
    /// The path's stiffness, N/m.
    pub stiffness_n_per_m: f64,
}

impl SecondPath {
    /// From hits with the joint open and closed; `None` if they have no lines in common or lack a
    /// signal.
    pub fn of(open: &HitsOnA<'_>, closed: &HitsOnA<'_>) -> Option<Self> {
        let frequency_hz = open.spectra.frequency_hz();
        if frequency_hz != closed.spectra.frequency_hz() {
            return None;
        }
        let lines = (0..frequency_hz.len()).filter(|l| LINES.contains(frequency_hz[*l]));
        let both = |l: usize| Some([open.stiffness_n_per_m(l)?, closed.stiffness_n_per_m(l)?]);
        let both: Vec<[C; 2]> = lines.filter_map(both).collect();
        let parts: Vec<f64> = both.iter().map(|[open, closed]| (open / closed).re).collect();
        let stiffness: Vec<f64> = both.iter().map(|[open, _]| open.re).collect();
        let noise = noise_of_median(open.spectra, &parts)?;
        Self { joins: Joins::Sides, part: median(&parts), noise, stiffness_n_per_m: median(&stiffness) }
            .checked()
    }

    /// What holds B in the assembly only, from hits with the joint open and on B alone; `None` if
    /// they have no lines in common or lack a signal.
    pub fn to_ground(open: &HitsOnB<'_>, alone: &HitsOnB<'_>) -> Option<Self> {
        let frequency_hz = open.spectra.frequency_hz();
        if frequency_hz != alone.spectra.frequency_hz() {
            return None;
        }
        let lines = (0..frequency_hz.len()).filter(|l| LINES.contains(frequency_hz[*l]));
        let both = |l: usize| Some([open.per_t(l)?, alone.per_t(l)?, open.moved_per_t(l)?]);
        let both: Vec<[C; 3]> = lines.filter_map(both).collect();
        let parts: Vec<f64> = both.iter().map(|[open, alone, _]| (open / alone).re - 1.0).collect();
        let stiffness: Vec<f64> =
            both.iter().map(|[open, alone, moved]| ((open - alone) / moved).re).collect();
        let noise = noise_of_median(open.spectra, &parts)?.hypot(STRUCK);
        Self { joins: Joins::Ground, part: median(&parts), noise, stiffness_n_per_m: median(&stiffness) }
            .checked()
    }

    fn checked(self) -> Option<Self> {
        (self.part.is_finite() && self.stiffness_n_per_m.is_finite() && self.std() > 0.0).then_some(self)
    }

    /// The part's standard deviation: noise, and the place of the path, which is not known.
    pub fn std(&self) -> f64 {
        self.noise.hypot(PLACE * self.part)
    }

    /// Whether there is a path that matters.
    pub fn found(&self) -> bool {
        let part = if self.joins == Joins::Sides { self.part } else { self.part.abs() };
        part > MUCH && part > CERTAIN * self.noise
    }
}

/// Standard deviation of the median of values at neighbouring lines, from their scatter; `None`
/// with fewer than two lines.
fn noise_of_median(spectra: &CrossSpectra, values: &[f64]) -> Option<f64> {
    let [first, second, ..] = spectra.frequency_hz()[..] else { return None };
    let centre = median(values);
    let deviations: Vec<f64> = values.iter().map(|own| (own - centre).abs()).collect();
    let shared = shared_by_lines(spectra.sigma_per_s(), second - first);
    let of_median = 0.5 * std::f64::consts::PI * shared / values.len() as f64;
    Some(OF_NORMAL * median(&deviations) * of_median.sqrt())
}

/// Standard deviation over the median absolute deviation of a normal distribution.
const OF_NORMAL: f64 = 1.482_602_218_505_602;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::cross_spectra::OutputSums;

    /// Hits on A: its response, v_A, v_B, T over the force.
    fn hits(values: impl Fn(C) -> [C; 4]) -> CrossSpectra {
        let frequency_hz: Vec<f64> = (200..=1200).map(|line| 0.5 * f64::from(line)).collect();
        let mut outputs = vec![OutputSums::default(); 4];
        for f in &frequency_hz {
            let value = values(C::new(50.0, std::f64::consts::TAU * f));
            for (sums, value) in outputs.iter_mut().zip(value) {
                sums.s_xf.push(value);
                sums.s_xx.push(value.norm_sqr());
            }
        }
        let lines = frequency_hz.len();
        CrossSpectra::new(1.0, frequency_hz, 50.0, 1, vec![1.0; lines], outputs).expect("alike")
    }

    /// A mass of 3 kg on a path, alone or beside a joint, to a B that gives.
    fn on(path_n_per_m: f64, joint_n_per_m: f64, noise_n: f64) -> CrossSpectra {
        let cells = 1.5e8;
        hits(|s| {
            let k = path_n_per_m + joint_n_per_m;
            let between = if k > 0.0 { k.recip() + 1.0 / cells } else { f64::INFINITY };
            let z_a = (3.0 * s * s + between.recip()).inv();
            let t = z_a * between.recip();
            // the sign changes from line to line
            let noise = noise_n * (1.7 * s.im).sin();
            [z_a * s, z_a * s, t / cells * s, t + noise]
        })
    }

    fn found(path_n_per_m: f64) -> SecondPath {
        let open = on(path_n_per_m, 0.0, 1e-3);
        let closed = on(path_n_per_m, 1.5e7, 1e-3);
        let of = |spectra| HitsOnA { spectra, axis: 0, quantity: MotionQuantity::Velocity };
        SecondPath::of(&of(&open), &of(&closed)).expect("all signals")
    }

    #[test]
    fn the_part_of_a_path_beside_the_joint_is_found() {
        let cable = found(3e6);
        assert!((cable.part / (3.0 / 18.0) - 1.0).abs() < 0.01, "{cable:?}");
        assert!((cable.stiffness_n_per_m / 3e6 - 1.0).abs() < 0.01, "{cable:?}");
        assert!(cable.found());
        let none = found(0.0);
        assert!(!none.found() && none.part.abs() < 1e-3, "{none:?}");
        // a thread
        assert!(!found(3e4).found());
    }

    /// B as a mass of 4 kg on the load cells, struck with `held_n_per_m` to the ground beside them.
    fn struck_b(held_n_per_m: f64) -> CrossSpectra {
        let cells = 1.5e8;
        hits(|s| {
            let z = (4.0 * s * s + cells + held_n_per_m).inv();
            let noise = 1e-3 * (1.7 * s.im).sin();
            [z * s, C::default(), C::default(), cells * z + noise]
        })
    }

    #[test]
    fn what_holds_b_in_the_assembly_only_is_found() {
        let alone = struck_b(1e6);
        let found = |held: f64| {
            let open = struck_b(held);
            let of = |spectra| HitsOnB { spectra, axis: 0, quantity: MotionQuantity::Velocity };
            SecondPath::to_ground(&of(&open), &of(&alone)).expect("all signals")
        };
        let wire = found(4e6);
        // F/T is 1 + held/cells + 4 s²/cells: 3/151 at rest, more where the mass takes part
        assert!((0.019..0.026).contains(&wire.part), "{wire:?}");
        assert!((wire.stiffness_n_per_m / 3e6 - 1.0).abs() < 0.01, "{wire:?}");
        assert!(wire.found());
        // what was there on B alone, and is gone
        let gone = found(0.0);
        assert!(gone.part < 0.0 && !gone.found(), "{gone:?}");
        assert!(found(0.0 - 3e6).found());
        assert!(!found(1e6).found());
    }
}

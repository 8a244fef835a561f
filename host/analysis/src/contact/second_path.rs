//! The part of the force between A and B that passes beside the contact, through a cable, a hose or
//! a stop that joins both sides: the load cells show it together with the contact's force, so that
//! k_T comes out stiffer by about that part.
//!
//! With the joint open (both sides in place, nothing touches) it is all that reaches the load cells
//! when A is struck. T over the displacement between arm A and B is then the path's stiffness, and
//! with the joint closed that of everything between the arms; their ratio is the part sought. The
//! same sensors measure both, so that their gains cancel. The path acts at another place than the
//! one where A is measured, which the ratio leaves out: see [`PLACE`].

use super::BAND;
use crate::C;
use crate::band::Band;
use crate::frf::MotionQuantity;
use crate::frf::noise::shared_by_lines;
use crate::spectra::CrossSpectra;
use crate::substructuring::joint_over_bands::median;

/// The lines used: below the bending modes of arms and cables.
const LINES: Band = Band { low_hz: BAND.low_hz, high_hz: 300.0 };

/// Relative standard deviation of the part because arm A turns, and the path is not where A is
/// measured.
const PLACE: f64 = 0.3;

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

/// The part of the force between A and B that passes beside the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondPath {
    /// That part: 0.1 is a tenth.
    pub part: f64,
    /// Its standard deviation from noise alone.
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
        let [first, second, ..] = frequency_hz[..] else { return None };
        let parts: Vec<f64> = both.iter().map(|[open, closed]| (open / closed).re).collect();
        let part = median(&parts);
        let deviations: Vec<f64> = parts.iter().map(|own| (own - part).abs()).collect();
        let shared = shared_by_lines(open.spectra.sigma_per_s(), second - first);
        let of_median = 0.5 * std::f64::consts::PI * shared / parts.len() as f64;
        let noise = OF_NORMAL * median(&deviations) * of_median.sqrt();
        let stiffness: Vec<f64> = both.iter().map(|[open, _]| open.re).collect();
        let found = Self { part, noise, stiffness_n_per_m: median(&stiffness) };
        (part.is_finite() && found.std() > 0.0).then_some(found)
    }

    /// The part's standard deviation: noise, and the place of the path, which is not known.
    pub fn std(&self) -> f64 {
        self.noise.hypot(PLACE * self.part)
    }

    /// Whether there is a path that matters.
    pub fn found(&self) -> bool {
        self.part > MUCH && self.part > CERTAIN * self.noise
    }
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
}

//! Identifies which specimen has a hidden resonance: the phase of each specimen relative to its own
//! arm, from the same impact (the paper's Fig. 8).

use num_complex::Complex;

/// The split is searched within this distance of the resonance, Hz: the phase changes fastest near
/// the peak of Δx/T.
const NEAR_HZ: f64 = 8.0;
/// Lines within ± this distance are averaged, Hz.
const AVERAGE_HZ: f64 = 0.75;
/// A smaller phase difference is noise, degrees.
const CLEAR_DEG: f64 = 5.0;

/// An FRF on evenly spaced lines.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Magnitude, \[line\], in one unit for all curves that are compared.
    pub magnitude: &'a [f64],
    /// Phase, degrees, \[line\].
    pub phase_deg: &'a [f64],
}

/// One of the two specimens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Specimen {
    /// On the moving arm.
    A,
    /// On the static arm.
    B,
}

/// Phase differences at one frequency, degrees, −180…180.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseSplit {
    /// The frequency, Hz.
    pub frequency_hz: f64,
    /// Specimen A relative to specimen B.
    pub specimens: f64,
    /// Specimen A relative to arm A.
    pub a: f64,
    /// Specimen B relative to arm B.
    pub b: f64,
    /// Arm A relative to arm B.
    pub arms: f64,
}

impl PhaseSplit {
    /// At the frequency near `resonance_hz` where x_A and x_B are furthest out of phase; `None` if
    /// the curves have no line there.
    pub fn near(
        [x_a, x_b]: [Curve<'_>; 2],
        [arm_a, arm_b]: [Curve<'_>; 2],
        resonance_hz: f64,
    ) -> Option<Self> {
        let lines = (0..x_a.phase_deg.len()).map(|l| x_a.frequency_hz(l));
        lines
            .filter(|f| (f - resonance_hz).abs() <= NEAR_HZ)
            .filter_map(|f| {
                Some(Self {
                    frequency_hz: f,
                    specimens: x_a.turned(&x_b, f)?,
                    a: x_a.turned(&arm_a, f)?,
                    b: x_b.turned(&arm_b, f)?,
                    arms: arm_a.turned(&arm_b, f)?,
                })
            })
            .max_by(|x, y| x.specimens.abs().total_cmp(&y.specimens.abs()))
    }

    /// The specimen that moves in its clamp, if its phase relative to its own arm clearly exceeds
    /// that of the other.
    pub fn moves(&self) -> Option<Specimen> {
        let (a, b) = (self.a.abs(), self.b.abs());
        if a > CLEAR_DEG && a > 2.0 * b {
            Some(Specimen::A)
        } else if b > CLEAR_DEG && b > 2.0 * a {
            Some(Specimen::B)
        } else {
            None
        }
    }
}

impl Curve<'_> {
    fn frequency_hz(&self, line: usize) -> f64 {
        self.first_hz + self.step_hz * line as f64
    }

    /// Sum of the lines around a frequency; `None` outside the lines.
    fn around(&self, frequency_hz: f64) -> Option<Complex<f64>> {
        let lines =
            (0..self.phase_deg.len()).filter(|&l| (self.frequency_hz(l) - frequency_hz).abs() <= AVERAGE_HZ);
        let sum: Complex<f64> =
            lines.map(|l| Complex::from_polar(self.magnitude[l], self.phase_deg[l].to_radians())).sum();
        (sum.norm() > 0.0).then_some(sum)
    }

    /// Phase relative to another curve around a frequency, degrees; `None` outside their lines.
    fn turned(&self, against: &Curve<'_>, frequency_hz: f64) -> Option<f64> {
        let phase = (self.around(frequency_hz)? * against.around(frequency_hz)?.conj()).arg().to_degrees();
        phase.is_finite().then_some(phase)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All curves move alike except the curve `own`, which has an additional mode at 192 Hz.
    fn curves(own: usize) -> [(Vec<f64>, Vec<f64>); 4] {
        [0, 1, 2, 3].map(|curve| {
            (0..400)
                .map(|l| {
                    let f = 100.0 + 0.5 * f64::from(l);
                    let alike = Complex::from_polar(1e-8, -0.01 * f);
                    let ratio = Complex::new(1.0 - (f / 192.0).powi(2), 0.02 * f / 192.0);
                    let y = if curve == own { alike * (1.0 + 0.02 * ratio.inv()) } else { alike };
                    (y.norm(), y.arg().to_degrees())
                })
                .unzip()
        })
    }

    #[test]
    fn the_specimen_that_leaves_its_arm_is_named() {
        for (own, name) in [(0, Specimen::A), (1, Specimen::B)] {
            let all = curves(own);
            let [x_a, x_b, arm_a, arm_b] = all.each_ref().map(|(magnitude, phase_deg)| Curve {
                first_hz: 100.0,
                step_hz: 0.5,
                magnitude,
                phase_deg,
            });
            let split = PhaseSplit::near([x_a, x_b], [arm_a, arm_b], 192.0).expect("lines there");
            assert_eq!(split.moves(), Some(name), "{split:?}");
            // the mode adds ±45° where it is half as large as at its peak: ratio 1 against 1
            assert!(split.specimens.abs() > 25.0, "{split:?}");
            assert!(split.arms.abs() < 1e-9, "{split:?}");
            assert_eq!(PhaseSplit::near([x_a, x_b], [arm_a, arm_b], 900.0), None);
        }
    }
}

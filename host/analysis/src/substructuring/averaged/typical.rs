//! Whether the noise is small enough to average a joint's compliance, judged at the typical
//! compliance of the band's lines.
//!
//! For one degree of freedom the measurement gives κ = W / (W + y), with W the admittance of A and
//! B together and y the joint's compliance. Noise changes κ, and so changes y by (W + y)² / W as
//! much. If the joint is far softer than A and B, as for the rotations of a small contact, noise
//! makes some lines stiff by chance. At its own small y such a line appears accurate, and a mean
//! weighted accordingly follows these lines alone: half a million N m/rad, "20 %", where 10 are
//! true. At the typical y they are recognised as noise.

use super::sensitivity::Sums;
use super::{Line, Priors, compliance};
use crate::substructuring::joint_over_bands::median;
use nalgebra::Complex;

/// Range of κ: from a joint with hardly any stiffness to one with hardly any compliance.
const ENDS: [f64; 2] = [1e-6, 1.0 - 1e-6];

/// If the joint's compliance is positive on less than this fraction of the lines, its sign is due
/// to chance: with noise only it is positive on half of them, and over hundreds of lines this
/// fraction is known to a few per cent.
const PUSHING: f64 = 0.6;

/// Typical magnitudes of one degree of freedom over the lines of a band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Typical {
    /// |W|, m/N (rotations scaled).
    structures: f64,
    /// |y|, in the same unit.
    joint: f64,
    /// Fraction of lines on which the joint's compliance is positive.
    pushing: f64,
}

impl Typical {
    /// Medians over lines along `d`, from the inverse interface admittance (2n_c × 2n_c): of |W|,
    /// and of κ, which is robust against single lines.
    pub(super) fn of(impedance: &[Line], d: usize) -> Typical {
        let structures: Vec<f64> = impedance
            .iter()
            .map(|z| {
                let n = z.nrows() / 2;
                // the diagonal blocks hold A or B plus the joint, the others minus the joint
                let [a, b] = [z[(d, d)] + z[(d, n + d)], z[(n + d, n + d)] + z[(n + d, d)]];
                (a.inv() + b.inv()).norm()
            })
            .collect();
        let structures = median(&structures);
        let kappa: Vec<f64> =
            impedance.iter().map(|z| (structures / (structures + compliance(z, d))).re).collect();
        let kappa = median(&kappa).clamp(ENDS[0], ENDS[1]);
        let pushing = impedance.iter().filter(|z| compliance(z, d).re > 0.0).count();
        Typical {
            structures,
            joint: structures * (1.0 / kappa - 1.0),
            pushing: pushing as f64 / impedance.len() as f64,
        }
    }

    /// The relative standard deviation of the lines' unweighted mean at the typical compliance,
    /// from the sensitivities of each line at its own compliance; infinite if noise decides the
    /// sign.
    pub(super) fn known(
        &self,
        lines: &[Sums],
        impedance: &[Line],
        d: usize,
        shared: f64,
        priors: &Priors,
    ) -> f64 {
        let there = impedance.iter().map(|z| self.instead_of(compliance(z, d)) / lines.len() as f64);
        let total = Sums::weighted(lines, there);
        let variance = total.noise_variance * shared + total.geometry_variance(priors);
        if self.pushing < PUSHING { f64::INFINITY } else { variance.sqrt() / self.joint }
    }

    /// The factor that converts a sensitivity at the compliance `y` to that at the typical one.
    fn instead_of(&self, y: Complex<f64>) -> f64 {
        ((self.structures + self.joint) / (self.structures + y.norm())).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A and B of 1 N/µm each and a joint between them.
    fn line(joint: f64) -> Line {
        let [own, joint] = [1e6, joint].map(Complex::from);
        Line::from_row_slice(2, 2, &[own + joint, -joint, -joint, own + joint])
    }

    #[test]
    fn a_line_off_the_others_is_judged_where_they_are() {
        for joint in [1e3, 1e6, 1e8] {
            let lines: Vec<Line> = [joint, joint, 50.0 * joint, joint, joint].map(line).into();
            let typical = Typical::of(&lines, 0);
            // W is 2 µm/N, and the outlier has no influence
            assert!((typical.structures / 2e-6 - 1.0).abs() < 1e-9, "{typical:?}");
            assert!((typical.joint * joint - 1.0).abs() < 1e-9, "{typical:?}");
            let [here, odd] = [1, 2].map(|l| typical.instead_of(compliance(&lines[l], 0)));
            assert!((here - 1.0).abs() < 1e-9 && odd >= 1.0, "{here} {odd}");
        }
        // a soft joint that is fifty times too stiff by chance: the scatter of its compliance is
        // 50² times what it seems
        let soft: Vec<Line> = [1e3, 1e3, 5e4].map(line).into();
        let factor = Typical::of(&soft, 0).instead_of(compliance(&soft[2], 0));
        assert!((factor / 2500.0 - 1.0).abs() < 0.25, "{factor}");
    }
}

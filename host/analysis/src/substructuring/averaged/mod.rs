//! The recommended estimate: Eq. (A.1) line by line, averaged as a compliance before it is
//! inverted, with an interval.
//!
//! Eq. (A.1) needs neither Y^A nor Y^B, so a clamp that changes between the configurations does not
//! affect it. From every line the joint's compliance along one degree of freedom, 1/Z^J_dd, is
//! taken: noise enters it almost linearly, while Z^J_dd = 1/(y + n) falls towards zero where |n| >
//! |y|, so that noise alone lowers a mean of stiffness over lines. The compliance of a spring and a
//! damper hardly changes over a band; it is averaged with weights according to each line's noise,
//! and inverted once. Whether the noise is small enough for an average is decided at the band's
//! typical compliance (`typical`).
//!
//! `sensitivity` holds the linear propagation: dy/dY of every cell, which gives the effect of noise
//! and of errors of position, aim and angle alike. The second-order effect of noise (the bias) is
//! simulated, with pairs ±n whose linear parts cancel.
//!
//! Whether the noise is small enough to average a joint's compliance, judged at the typical
//! compliance of the band's lines.
//!
//! For one degree of freedom the measurement gives κ = W / (W + y), with W the admittance of A and
//! B together and y the joint's compliance. Noise changes κ, and so changes y by (W + y)² / W as
//! much. If the joint is far softer than A and B, as for the rotations of a small contact, noise
//! makes some lines stiff by chance. At its own small y such a line appears accurate, and a mean
//! weighted accordingly follows these lines alone: half a million N m/rad, "20 %", where 10 are
//! true. At the typical y they are recognised as noise.
//!
//! Second-order effect of noise on the compliance, simulated because it has no short closed form.

use super::geometry::Geometry;
use super::idm::{Dof, IdmSet};
use super::interface_data::{InterfaceError, balance};
use super::joint_over_bands::{NORMAL_95, median, stiffness_and_damping};
use super::pseudo_inverse::{RankLost, full_rank_inverse};
use crate::Line;
use crate::band::Band;
use crate::frf::Frf;
use crate::frf::noise::shared_by_lines;
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::parallel::prelude::*;
use assembly::{Assembly, SensitivitySums};
use nalgebra::Complex;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;
use std::collections::BTreeMap;

pub use bootstrap::{CellHits, Replicates};

mod assembly;
mod bootstrap;

/// Largest relative half-width of the lines' unweighted mean, at the typical compliance: above it
/// the lines contain no information that weights could select.
const HIDDEN: f64 = 2.0;
/// The same for rotations, whose stiffness may be far below the arms' inertia: for them the
/// unweighted mean itself must be significant.
const HIDDEN_ROTATION: f64 = 0.3;

/// Standard deviations of quantities that are not known exactly. They belong to the experiment and
/// are stated with the result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Priors {
    /// Error of the position of a sensor or an impact, m along each axis; the same in all its
    /// cells.
    pub position_m: f64,
    /// Additional error of each re-aiming of a cell, m along each axis, for the sensor and for the
    /// hammer.
    pub aim_m: f64,
    /// Tilt of the hammer about each axis across its direction, rad; the same in all cells of an
    /// impact.
    pub hammer_angle_rad: f64,
}

impl Default for Priors {
    /// 0.5 mm, 0.2 mm, 2°: a careful manual campaign.
    fn default() -> Self {
        Priors { position_m: 0.5e-3, aim_m: 0.2e-3, hammer_angle_rad: 2f64.to_radians() }
    }
}

/// The reason why the estimate cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AveragedError {
    /// The virtual points cannot be formed, or a cell is not a number.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// A block is singular at a line.
    #[error("at {frequency_hz} Hz: {source}")]
    Line {
        /// The line, Hz.
        frequency_hz: f64,
        /// Why.
        source: RankLost,
    },
    /// Modes for which errors of position are not propagated.
    #[error(
        "an estimate with an interval is possible for rigid interface modes only, not for {0}: errors of position are not propagated for flexible modes"
    )]
    Flexible(Dof),
    /// Spectra of hits that do not match the FRFs.
    #[error("the hits' spectra do not fit the FRFs: {reason}")]
    Hits {
        /// The mismatch.
        reason: String,
    },
    /// No line in the band.
    #[error("no line of AJB lies in the band {low_hz}–{high_hz} Hz")]
    EmptyBand {
        /// Lowest frequency, Hz.
        low_hz: f64,
        /// Highest frequency, Hz.
        high_hz: f64,
    },
}

/// One degree of freedom of the joint with its uncertainty. N/m and N s/m; N m/rad and N m s/rad
/// for rotations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DofEstimate {
    /// Stiffness, corrected for the bias of noise.
    pub stiffness: f64,
    /// Standard deviation of the stiffness: from linear propagation, and the size of the bias.
    pub std: f64,
    /// The part due to the FRFs' noise.
    pub std_noise: f64,
    /// The part due to errors of position, aim and angle.
    pub std_geometry: f64,
    /// 95 % interval: that of the compliance, inverted, so it reaches further up than down.
    pub ci95: [f64; 2],
    /// Bias due to noise: expectation of the stiffness with noise minus value without, already
    /// subtracted. It is simulated at the noisy FRFs, so its uncertainty is its own size, which the
    /// interval contains.
    pub bias: f64,
    /// Damping.
    pub damping: f64,
    /// Whether the compliance differs from zero clearly enough to give a value.
    pub identified: bool,
}

/// The estimate over one band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Averaged {
    /// The band, Hz.
    pub band_hz: Band,
    /// Lines averaged.
    pub lines: usize,
    /// The interface deformation modes.
    pub idms: usize,
    /// Assumed errors of positions and angles.
    pub priors: Priors,
    /// Whether the FRFs' noise was known.
    pub noise_known: bool,
    /// Estimates by degree of freedom.
    pub joint: BTreeMap<Dof, DofEstimate>,
}

impl Averaged {
    /// The result for the sliding direction as a sentence, always with an interval or a limit.
    pub fn statement(&self) -> Option<String> {
        let z = self.joint.get(&Dof::Z)?;
        let micro = |k: f64| k * 1e-6;
        let origin = if self.noise_known {
            ""
        } else {
            " (the FRFs came without their variance, so the interval covers errors of position and angle only)"
        };
        Some(if z.identified {
            format!(
                "k_z = {:.1} N/µm, 95 % interval {:.1}…{:.1}{origin}.",
                micro(z.stiffness),
                micro(z.ci95[0]),
                micro(z.ci95[1])
            )
        } else {
            format!(
                "not identified: the noise exceeds the joint's admittance; the data only show that k_z is above {:.1} N/µm{origin}.",
                micro(z.ci95[0])
            )
        })
    }
}

/// The joint's compliance along `d` by Eq. (A.1) from the inverse `z` of one line's interface
/// admittance, averaged over both blocks.
fn compliance(z: &Line, d: usize) -> Complex<f64> {
    let n = z.nrows() / 2;
    -(0.5 * (z[(d, n + d)] + z[(n + d, d)])).inv()
}

fn invert(y: &Line) -> Result<Line, RankLost> {
    full_rank_inverse(y, "the assembly's interface admittance")
}

/// The recommended estimate of the joint over `band` from the assembly alone.
///
/// Every degree of freedom has its own weights.
///
/// # Errors
/// [`AveragedError`]: an interface that cannot be formed, a NaN, a singular line, an empty band.
pub fn averaged(
    ajb: &Frf,
    geometry: &Geometry,
    idms: IdmSet,
    band: Band,
    priors: &Priors,
) -> Result<Averaged, AveragedError> {
    Ok(Prepared::of(ajb, geometry, idms, band, priors)?.estimate())
}

/// The assembly decoupled line by line, and the weights of its lines: shared by estimate and
/// bootstrap.
pub struct Prepared {
    band_hz: Band,
    priors: Priors,
    idms: IdmSet,
    sigma_per_s: f64,
    order_of_s: i32,
    assembly: Assembly,
    /// Inverse of the interface admittance per line.
    impedance: Vec<Line>,
    /// Bias of the compliance due to noise \[degree of freedom\]\[line\].
    bias: Vec<Vec<Complex<f64>>>,
    /// Sensitivities \[degree of freedom\]\[line\].
    sums: Vec<Vec<SensitivitySums>>,
    /// Normalised weights \[degree of freedom\]\[line\].
    weights: Vec<Vec<f64>>,
    /// Relative standard deviation at the typical compliance \[degree of freedom\].
    typical: Vec<f64>,
}

impl Prepared {
    /// Decouples `ajb` over `band` and computes the weights of its lines; arguments as of
    /// [`averaged`].
    ///
    /// # Errors
    /// As [`averaged`].
    pub fn of(
        ajb: &Frf,
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
        priors: &Priors,
    ) -> Result<Prepared, AveragedError> {
        if let Some(flexible) = idms.dofs().into_iter().find(|dof| dof.is_flexible()) {
            return Err(AveragedError::Flexible(flexible));
        }
        let assembly = Assembly::of(ajb, geometry, idms, band)?;
        let impedance: Vec<Line> = assembly
            .cells
            .par_iter()
            .zip(&assembly.frequency_hz)
            .map(|(cells, &frequency_hz)| {
                invert(&assembly.layout.reduce(cells))
                    .map_err(|source| AveragedError::Line { frequency_hz, source })
            })
            .collect::<Result<_, AveragedError>>()?;
        let by_line = noise_bias(&assembly, &impedance);
        let bias = (0..idms.count()).map(|d| by_line.iter().map(|line| line[d]).collect()).collect();
        let by_line: Vec<Vec<SensitivitySums>> =
            (0..impedance.len()).into_par_iter().map(|l| assembly.sums(l, &impedance[l])).collect();
        let mut sums: Vec<Vec<SensitivitySums>> =
            (0..idms.count()).map(|_| Vec::with_capacity(by_line.len())).collect();
        for line in by_line {
            sums.iter_mut().zip(line).for_each(|(sums, own)| sums.push(own));
        }
        let shared = shared_by_lines(ajb.sigma_per_s(), assembly.step_hz());
        let weights = sums.par_iter().map(|lines| weights(lines, shared, priors)).collect();
        let typical = (sums.par_iter().enumerate())
            .map(|(d, lines)| Typical::of(&impedance, d).known(lines, &impedance, d, shared, priors))
            .collect();
        Ok(Prepared {
            band_hz: band,
            priors: *priors,
            idms,
            sigma_per_s: ajb.sigma_per_s(),
            order_of_s: ajb.quantity().order_of_s(),
            assembly,
            impedance,
            bias,
            sums,
            weights,
            typical,
        })
    }

    /// The estimate with its interval.
    pub fn estimate(&self) -> Averaged {
        let joint = (self.idms.dofs().par_iter().enumerate())
            .map(|(d, &dof)| {
                // N/m for translations, N m/rad for rotations
                let found = self.estimate_of(d).scaled(balance(self.idms)[d].powi(2));
                // noise makes a rotation that is soft compared with the arms' inertia look stiff,
                // so no lower limit is given for it
                let limited = found.identified || !dof.is_rotation();
                let low = if limited { found.ci95[0] } else { 0.0 };
                (dof, DofEstimate { ci95: [low, found.ci95[1]], ..found })
            })
            .collect();
        Averaged {
            band_hz: self.band_hz,
            lines: self.impedance.len(),
            idms: self.idms.count(),
            priors: self.priors,
            noise_known: self.assembly.variance.is_some(),
            joint,
        }
    }

    /// Variance factor for the noise that neighbouring lines share: see [`shared_by_lines`].
    fn shared(&self) -> f64 {
        shared_by_lines(self.sigma_per_s, self.assembly.step_hz())
    }

    fn mean_s(&self, d: usize) -> Complex<f64> {
        self.assembly.s.iter().zip(&self.weights[d]).map(|(s, w)| s * *w).sum()
    }

    /// One degree of freedom, rotations scaled: averages the compliance, propagates errors,
    /// inverts.
    fn estimate_of(&self, d: usize) -> DofEstimate {
        let (mut y, mut drawn) = (Complex::<f64>::default(), Complex::<f64>::default());
        for (l, w) in self.weights[d].iter().enumerate() {
            y += compliance(&self.impedance[l], d) * *w;
            drawn += self.bias[d][l] * *w;
        }
        let s = self.mean_s(d);
        let (stiffness, damping) = stiffness_and_damping((y - drawn).inv(), s);
        let total = SensitivitySums::weighted(&self.sums[d], self.weights[d].iter().copied());
        // dK = −K² dy, to second order in the loss factor
        let to_stiffness = stiffness * stiffness;
        let enough = if self.idms.dofs()[d].is_rotation() { HIDDEN_ROTATION } else { HIDDEN };
        DofEstimate {
            stiffness,
            std: 0.0,
            std_noise: 0.0,
            std_geometry: to_stiffness * total.geometry_variance(&self.priors).sqrt(),
            // if noise dominates, not even a limit is known
            ci95: [0.0, f64::INFINITY],
            bias: stiffness_and_damping(y.inv(), s).0 - stiffness,
            damping,
            identified: NORMAL_95 * self.typical[d] < enough,
        }
        .with_noise(to_stiffness * (total.noise_variance * self.shared()).sqrt())
    }
}

/// The 95 % interval of a stiffness whose compliance is normally distributed, and whether the upper
/// end is finite.
fn interval(stiffness: f64, std: f64) -> ([f64; 2], bool) {
    let relative = NORMAL_95 * std / stiffness.abs();
    let identified = relative < COMPLIANCE_HALF_WIDTH && stiffness > 0.0;
    let high = if identified { stiffness / (1.0 - relative) } else { f64::INFINITY };
    ([stiffness / (1.0 + relative), high], identified)
}

impl DofEstimate {
    /// The estimate with this standard deviation of the noise; an unidentified one stays
    /// unidentified.
    fn with_noise(self, std_noise: f64) -> DofEstimate {
        let std = std_noise.hypot(self.std_geometry).hypot(self.bias);
        let same = DofEstimate { std, std_noise, ..self };
        if !self.identified {
            return same;
        }
        let (ci95, identified) = interval(self.stiffness, std);
        DofEstimate { ci95, identified, ..same }
    }

    /// The estimate with rotations in N m/rad: everything except `identified` times `scale`.
    fn scaled(self, scale: f64) -> DofEstimate {
        DofEstimate {
            stiffness: scale * self.stiffness,
            std: scale * self.std,
            std_noise: scale * self.std_noise,
            std_geometry: scale * self.std_geometry,
            ci95: self.ci95.map(|k| scale * k),
            bias: scale * self.bias,
            damping: scale * self.damping,
            identified: self.identified,
        }
    }
}

/// Normalised weights: inverse of each line's noise variance after averaging plus its variance due
/// to geometry.
fn weights(lines: &[SensitivitySums], shared: f64, priors: &Priors) -> Vec<f64> {
    let averaging = (lines.len() as f64 / shared).max(1.0);
    let raw: Vec<f64> = lines
        .iter()
        .map(|line| 1.0 / (line.noise_variance + line.geometry_variance(priors) * averaging))
        .map(|w| if w.is_finite() { w } else { 0.0 })
        .collect();
    let sum: f64 = raw.iter().sum();
    if sum > 0.0 {
        raw.iter().map(|w| w / sum).collect()
    } else {
        // neither noise nor geometry errors: all lines are equivalent
        vec![1.0 / lines.len() as f64; lines.len()]
    }
}

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
    fn known(
        &self,
        lines: &[SensitivitySums],
        impedance: &[Line],
        d: usize,
        shared: f64,
        priors: &Priors,
    ) -> f64 {
        let there = impedance.iter().map(|z| self.instead_of(compliance(z, d)) / lines.len() as f64);
        let total = SensitivitySums::weighted(lines, there);
        let variance = total.noise_variance * shared + total.geometry_variance(priors);
        if self.pushing < PUSHING { f64::INFINITY } else { variance.sqrt() / self.joint }
    }

    /// The factor that converts a sensitivity at the compliance `y` to that at the typical one.
    fn instead_of(&self, y: Complex<f64>) -> f64 {
        ((self.structures + self.joint) / (self.structures + y.norm())).powi(2)
    }
}

/// Pairs of draws per line; averaging over hundreds of lines reduces the remaining scatter.
const PAIRS: u64 = 4;
/// Fixed seed, so that the same data give the same values.
const SEED: u64 = 0x6A6F_696E;

/// E\[y(Y + n)\] − y(Y) per line and degree of freedom; zero if the noise is not known. A pair ±n
/// cancels the linear part, so a few draws suffice.
fn noise_bias(assembly: &Assembly, impedance: &[Line]) -> Vec<Vec<Complex<f64>>> {
    let n = impedance[0].nrows() / 2;
    let Some(variance) = &assembly.variance else {
        return vec![vec![Complex::default(); n]; impedance.len()];
    };
    (0..impedance.len())
        .into_par_iter()
        .map(|l| {
            // a separate random stream for every line: the order of threads does not matter
            let mut stream = Xoshiro256PlusPlus::seed_from_u64(SEED ^ ((l as u64) << 20));
            let mut normal = || -> f64 { StandardNormal.sample(&mut stream) };
            let y = assembly.layout.reduce(&assembly.cells[l]);
            let mut sum = vec![Complex::default(); n];
            for _ in 0..PAIRS {
                let noise = variance[l].map(|v| Complex::new(normal(), normal()) * v.sqrt());
                let noise = assembly.layout.reduce(&noise);
                // a draw that makes Y singular to rounding has probability zero and is skipped
                let (Ok(plus), Ok(minus)) = (invert(&(&y + &noise)), invert(&(&y - &noise))) else {
                    continue;
                };
                for (d, sum) in sum.iter_mut().enumerate() {
                    let mean = 0.5 * (compliance(&plus, d) + compliance(&minus, d));
                    *sum += (mean - compliance(&impedance[l], d)) / PAIRS as f64;
                }
            }
            sum
        })
        .collect()
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod typical_tests {
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

//! Modes from FRFs: natural frequency, damping, shape and participation of each mode in a band,
//! with the residual terms of the modes outside it, all with their covariance, and no choice by
//! hand.
//!
//! The receptance (FRFs of other quantities are converted) on the lines s = σ + iω is
//!
//! X(s) = Σ_r [ψ_r ℓ_rᵀ/(s − λ_r) + conjugate] + Σ_q E_q s^q,
//!
//! with poles λ_r, shapes ψ_r at the outputs, participations ℓ_r at the inputs, and real residual
//! matrices E_q: inertia below the band (q = −2), stiffness above it (q = 0) and, where the data
//! show them, the next terms of the series. With an exponential window e^(−σt) the model is
//! evaluated on the window's line, so that λ and the damping are the structure's own; nothing has
//! to be subtracted.
//!
//! The steps:
//!
//! 1. poles of rising model orders by pLSCF, in the z-domain: also the stabilisation chart's data;
//! 2. those that many orders agree on start a maximum-likelihood fit of all parameters;
//! 3. modes without evidence are removed, peaks of the residual are added and tested, until nothing
//!    changes;
//! 4. the covariance of the result is that of the likelihood.
//!
//! pLSCF's damping is biased by noise; the likelihood's is not, which is why step 2 is done at all.
//!
//! ```
//! use jointrig_analysis::{band::Band, frf::{Frf, MotionQuantity}, modes};
//! use nalgebra::{Complex, DMatrix};
//!
//! // 2 kg on a spring, natural frequency 100 Hz, damping ratio 1 %
//! let omega = std::f64::consts::TAU * 100.0;
//! let frequency_hz: Vec<f64> = (40..400).map(|k| f64::from(k) * 0.5).collect();
//! let lines = frequency_hz.iter().map(|f| {
//!     let s = Complex::new(2.3, std::f64::consts::TAU * f);
//!     DMatrix::from_element(1, 1, s / (2.0 * (s * s + s * (0.02 * omega) + omega * omega)))
//! });
//! let lines = lines.collect();
//! let names = |name: &str| vec![name.to_owned()];
//! let frf = Frf::new(frequency_hz, 2.3, MotionQuantity::Velocity, names("a"), names("f"), lines)?;
//! let settings = modes::Settings::of(Band { low_hz: 20.0, high_hz: 200.0 });
//! let found = modes::identify(&frf, &settings)?;
//! assert_eq!(found.modes.len(), 1);
//! assert!((found.modes[0].frequency_hz - 100.0).abs() < 1e-7);
//! assert!((found.modes[0].damping_ratio - 0.01).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod data;
mod evidence;
mod follow;
mod likelihood;
mod plscf;
#[cfg(test)]
mod random_rigs;
#[cfg(test)]
mod tests;
mod uncertainty;

pub use follow::{Followed, follow};
pub use plscf::{STABLE_DAMPING, STABLE_FREQUENCY, STABLE_MAC};

use crate::C;
use crate::band::Band;
use crate::frf::{Frf, FrfError, MotionQuantity};
use data::Data;
use nalgebra::DMatrix;
use serde::Serialize;
use std::f64::consts::TAU;

/// Lines that a band needs at least: one mode and two residual terms have eight real parameters in
/// one cell, and a peak needs lines beside it.
const MIN_LINES: usize = 16;

/// What is to be identified.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The band; modes outside it are described by the residual terms.
    pub band: Band,
    /// Damping ratio above which a pole is not a mode but a smooth background.
    pub damping_limit: f64,
    /// Outputs and inputs at the same place and direction; they fix the scale of the shapes. None:
    /// the largest component of each shape is one.
    pub driving_points: Vec<DrivingPoint>,
    /// Multiplications after which the search for modes ends, roughly. It is a number and not a
    /// time, so that the result is the same on every machine: 10¹⁰ are 10 to 20 s on one core.
    pub most_work: u64,
}

/// Ten times what the most laborious of forty random rigs needs; a campaign's structure needs a
/// thousandth of it.
const MOST_WORK: u64 = 100_000_000_000;

impl Settings {
    /// A damping ratio up to 0.2, no driving points, a search of at most about two minutes.
    pub fn of(band: Band) -> Settings {
        Settings { band, damping_limit: 0.2, driving_points: vec![], most_work: MOST_WORK }
    }
}

/// An output and an input at the same place along the same line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrivingPoint {
    /// Index of the output.
    pub output: usize,
    /// Index of the input.
    pub input: usize,
    /// 1 if both point in the same direction, −1 if in opposite ones.
    pub sign: f64,
}

/// An output: its sensor, place and direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutputPoint {
    /// The sensor's name.
    pub name: String,
    /// Its position, m; null if it is not known.
    pub position_m: Option<[f64; 3]>,
    /// Unit vector of its positive direction; null if it is not known.
    pub direction: Option<[f64; 3]>,
}

/// How shape and participation are scaled; their product is the same for all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scaling {
    /// Modal A is one: at driving points shape and participation are equal (up to the sign), so
    /// that X(s) = Σ_r [φ_r φ_rᵀ/(s − λ_r) + conjugate], φ in √(m/(N s)). Multiplied by
    /// √(2 i ω_d), with ω_d = Im λ, φ of a mode in phase is scaled to unit modal mass (1/√kg, up to
    /// a sign): the residue of such a mode is φφᵀ/(2 i ω_d m).
    UnitModalA,
    /// The largest component of the shape is one; the participation has the residue's unit,
    /// m/(N s).
    LargestOutputIsOne,
}

/// Whether the variances of the FRFs are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoiseKnown {
    /// The FRFs have variances: χ² per degree of freedom tells whether the model fits.
    Given,
    /// They have none: all values count the same, the noise is estimated from the residuals, and
    /// χ² says nothing about the model.
    Estimated,
}

/// One mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Pole λ, 1/s; −Re λ is the decay of the free vibration, without a window's σ.
    pub pole_per_s: C,
    /// Covariance of its real and imaginary part, 1/s².
    pub pole_covariance: [[f64; 2]; 2],
    /// Natural frequency |λ|/2π, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation, Hz.
    pub frequency_std_hz: f64,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: f64,
    /// Its standard deviation.
    pub damping_ratio_std: f64,
    /// The scale of shape and participation.
    pub scaling: Scaling,
    /// Shape at each output.
    pub shape: Vec<C>,
    /// Standard deviations of the real and imaginary part of each component.
    pub shape_std: Vec<[f64; 2]>,
    /// Participation of each input: the residue of a cell's receptance is shape × participation.
    pub participation: Vec<C>,
    /// Standard deviations of the real and imaginary part of each component.
    pub participation_std: Vec<[f64; 2]>,
    /// By how much χ² would rise without this mode, in units of the noise, if the residues of the
    /// other modes adapted freely in every cell.
    pub evidence: f64,
}

impl Mode {
    /// Residue of one cell's receptance, m/(N s).
    pub fn residue(&self, output: usize, input: usize) -> C {
        self.shape[output] * self.participation[input]
    }
}

/// A real matrix times a power of s: what modes outside the band add to the receptance.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualTerm {
    /// Power of s.
    pub power: i32,
    /// Output × input, m/N times s to the negative power.
    pub value: DMatrix<f64>,
    /// Standard deviations.
    pub std: DMatrix<f64>,
}

/// One pole of one model order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartPole {
    /// Number of poles of the model.
    pub order: usize,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, without the window's.
    pub damping_ratio: f64,
    /// Whether the frequency differs by less than [`STABLE_FREQUENCY`] from the order below.
    pub stable_in_frequency: bool,
    /// Whether, in addition, the damping differs by less than [`STABLE_DAMPING`].
    pub stable_in_damping: bool,
    /// Whether, in addition to the frequency, the MAC of the shapes exceeds [`STABLE_MAC`]. With
    /// one output every shape is alike.
    pub stable_in_shape: bool,
}

/// The data of a stabilisation chart: poles of rising model orders by pLSCF, for people to look at.
/// Their damping is biased by noise; the modes are not read off the chart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// By rising order, then frequency.
    pub poles: Vec<ChartPole>,
}

/// The modes of a band.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// The band.
    pub band: Band,
    /// The modes with their peaks in the band, rising.
    pub modes: Vec<Mode>,
    /// Poles that are part of the model but not modes: outside the band, too near to its ends for
    /// the peak to be seen on both sides, or damped beyond the limit. They describe the data; their
    /// values are not those of modes.
    pub background: Vec<Mode>,
    /// The residual terms, lowest power first.
    pub residuals: Vec<ResidualTerm>,
    /// χ² per degree of freedom: near one if the model explains the data within their noise. Above
    /// one, all covariances are multiplied by it.
    pub chi2_per_dof: f64,
    /// Number of real values minus that of parameters.
    pub degrees_of_freedom: f64,
    /// Whether the noise was known.
    pub noise: NoiseKnown,
    /// Whether the search came to its end. If not, the FRFs have evidence for more poles than it
    /// looked for: they are not those of one linear structure within their noise. Modes may then be
    /// missing, and others may be none.
    pub complete: bool,
    /// The stabilisation chart.
    pub chart: Chart,
}

/// The modes of `frf` in the band of `settings`.
///
/// The variance of each value is averaged over neighbouring lines as everywhere in this crate. If
/// the FRFs have no variance, all values count the same and the noise is estimated.
///
/// # Errors
/// [`ModesError`].
pub fn identify(frf: &Frf, settings: &Settings) -> Result<Modes, ModesError> {
    settings.check(frf)?;
    let data = Data::new(frf, settings)?;
    let orders = plscf::poles(&data, settings);
    let starts = plscf::starts(&data, &orders);
    let (at, complete) = evidence::select(&data, &starts, settings);
    let (all, residuals) = uncertainty::results(&data, &at, &settings.driving_points)
        .ok_or(ModesError::Undetermined { modes: at.model.poles.len() })?;
    let (modes, background) = all
        .into_iter()
        .partition(|mode| evidence::is_mode(&data, mode.pole_per_s / data.omega_ref, settings));
    Ok(Modes {
        outputs: frf.outputs().to_vec(),
        inputs: frf.inputs().to_vec(),
        band: settings.band,
        modes,
        background,
        residuals,
        chi2_per_dof: at.chi2_per_dof(&data),
        degrees_of_freedom: likelihood::degrees_of_freedom(&data, &at.model),
        noise: data.noise,
        complete,
        chart: plscf::chart(&data, &orders),
    })
}

impl Settings {
    fn check(&self, frf: &Frf) -> Result<(), ModesError> {
        let Band { low_hz, high_hz } = self.band;
        if !(low_hz >= 0.0 && high_hz > low_hz && high_hz.is_finite()) {
            return Err(ModesError::Band { low_hz, high_hz });
        }
        if !(self.damping_limit > 0.0 && self.damping_limit < 1.0) {
            return Err(ModesError::DampingLimit(self.damping_limit));
        }
        let (outputs, inputs) = (frf.outputs().len(), frf.inputs().len());
        for at in &self.driving_points {
            if at.output >= outputs || at.input >= inputs || at.sign.abs() != 1.0 {
                return Err(ModesError::DrivingPoint { at: *at, outputs, inputs });
            }
        }
        Ok(())
    }
}

impl Modes {
    /// The FRFs of the modes, the background poles and the residual terms at other
    /// frequencies, with the same scale as measured ones.
    ///
    /// # Errors
    /// [`FrfError`] for frequencies that are not rising, or below zero; at s = 0 the inertia term
    /// is infinite, so that the values there are not finite.
    pub fn synthesise(
        &self,
        frequency_hz: Vec<f64>,
        sigma_per_s: f64,
        quantity: MotionQuantity,
    ) -> Result<Frf, FrfError> {
        let line = |f: &f64| {
            let s = C::new(sigma_per_s, TAU * f);
            let mut x = DMatrix::<C>::zeros(self.outputs.len(), self.inputs.len());
            for mode in self.modes.iter().chain(&self.background) {
                let (one, mirrored) = ((s - mode.pole_per_s).inv(), (s - mode.pole_per_s.conj()).inv());
                for (i, l) in mode.participation.iter().enumerate() {
                    for (o, psi) in mode.shape.iter().enumerate() {
                        let residue = psi * l;
                        x[(o, i)] += residue * one + residue.conj() * mirrored;
                    }
                }
            }
            for term in &self.residuals {
                let power = s.powi(term.power);
                x.zip_apply(&term.value, |x, value| *x += power * value);
            }
            x * s.powi(quantity.order_of_s())
        };
        let lines = frequency_hz.iter().map(line).collect();
        Frf::new(frequency_hz, sigma_per_s, quantity, self.outputs.clone(), self.inputs.clone(), lines)
    }
}

/// Modal assurance criterion of two shapes, |aᴴb|²/(aᴴa bᴴb): 1 if they are proportional (by any
/// complex factor), 0 if orthogonal or if one of them is zero. Components without a counterpart are
/// ignored.
pub fn mac(a: &[C], b: &[C]) -> f64 {
    let (mut product, mut of_a, mut of_b) = (C::from(0.0), 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        product += a.conj() * b;
        of_a += a.norm_sqr();
        of_b += b.norm_sqr();
    }
    let both = of_a * of_b;
    if both > 0.0 { (product.norm_sqr() / both).min(1.0) } else { 0.0 }
}

/// Modal phase collinearity of a shape: 1 if all components move in phase or in opposite phase
/// (a real shape times any complex factor), 0 for a travelling wave; 1 also for one component, and
/// for none that moves.
pub fn phase_collinearity(shape: &[C]) -> f64 {
    let (mut re_re, mut re_im, mut im_im) = (0.0, 0.0, 0.0);
    for v in shape {
        re_re += v.re * v.re;
        re_im += v.re * v.im;
        im_im += v.im * v.im;
    }
    let all: f64 = re_re + im_im;
    if all > 0.0 { (((re_re - im_im).powi(2) + 4.0 * re_im * re_im) / (all * all)).min(1.0) } else { 1.0 }
}

/// Why modes are not identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModesError {
    /// The band is empty, or not of finite positive numbers.
    #[error("the band {low_hz} to {high_hz} Hz is not a band: give 0 ≤ low < high")]
    Band {
        /// Lower end, Hz.
        low_hz: f64,
        /// Upper end, Hz.
        high_hz: f64,
    },
    /// The limit of the damping is not between 0 and 1.
    #[error("the limit of the damping ratio is {0}: it must lie between 0 and 1")]
    DampingLimit(f64),
    /// The FRFs have no outputs or no inputs.
    #[error("the FRFs have no outputs or no inputs")]
    NoCells,
    /// All values are zero.
    #[error("all FRFs are zero in the band")]
    AllZero,
    /// The band has too few lines.
    #[error("{lines} lines from {low_hz} to {high_hz} Hz: at least {MIN_LINES} are needed")]
    TooFewLines {
        /// Lines found.
        lines: usize,
        /// Lower end, Hz.
        low_hz: f64,
        /// Upper end, Hz.
        high_hz: f64,
    },
    /// Some values have no positive variance although others have one.
    #[error(
        "the variance of output `{output}`, input `{input}` at {frequency_hz} Hz is {variance}: \
         give a positive one for every value, or none at all"
    )]
    UnknownVariance {
        /// The output.
        output: String,
        /// The input.
        input: String,
        /// The line, Hz.
        frequency_hz: f64,
        /// The variance there.
        variance: f64,
    },
    /// A driving point that the FRFs do not have, or a sign other than ±1.
    #[error("the driving point {at:?} is not one of {outputs} outputs × {inputs} inputs with sign 1 or -1")]
    DrivingPoint {
        /// The driving point.
        at: DrivingPoint,
        /// Outputs of the FRFs.
        outputs: usize,
        /// Inputs of the FRFs.
        inputs: usize,
    },
    /// The normal equations of the result are singular.
    #[error("the data do not determine the {modes} modes found: the normal equations are singular")]
    Undetermined {
        /// Number of modes.
        modes: usize,
    },
    /// The FRFs themselves are not usable.
    #[error(transparent)]
    Frf(#[from] FrfError),
}

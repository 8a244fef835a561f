//! The stiffness of a joint from measurements: impact spectra, frequency-based substructuring,
//! hysteresis loops, friction laws.
//!
//! Input is arrays and geometry, output is numbers: this crate does not access devices, files or
//! screens. Stiffness is in N/m, time in seconds, and every FRF is on a line s = σ + i2πf.
//!
//! # A joint in ten lines
//!
//! Two masses, alone and joined by a spring of 180 N/µm. In a measurement the three admittances
//! come from hits; here they are written in closed form. The spring is then identified from them:
//!
//! ```
//! use jointrig_analysis::substructuring::{decoupling::interface, joint_over_bands::stiffness_and_damping};
//! use nalgebra::{Complex, DMatrix};
//!
//! let s = Complex::new(0.0, std::f64::consts::TAU * 400.0);
//! let (inertia_a, inertia_b, k) = (4.0 * s * s, 2.0 * s * s, Complex::from(180e6));
//! let y_a = DMatrix::from_element(1, 1, inertia_a.inv());
//! let y_b = DMatrix::from_element(1, 1, inertia_b.inv());
//! let joined = DMatrix::from_row_slice(2, 2, &[inertia_a + k, -k, -k, inertia_b + k]);
//! let y_ajb = joined.try_inverse().ok_or("no line of this rig is singular")?;
//! let joint = interface(&y_a, &y_b, &y_ajb)?;
//! let (stiffness_n_per_m, _damping) = stiffness_and_damping(joint[(0, 0)], s);
//! assert!((stiffness_n_per_m / 180e6 - 1.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Further reading
//!
//! - FRFs of many lines, points and directions:
//!   [`substructuring::identify`](fn@substructuring::identify) performs the whole identification;
//!   [`substructuring::averaged`] gives the value to quote, with its interval.
//! - FRFs from the records of a hammer: [`spectra::estimate`](fn@spectra::estimate).
//! - Modes of a structure from FRFs: [`modes::identify`](fn@modes::identify).
//! - k_T from a record of a sliding contact: [`hysteresis::analyse`](fn@hysteresis::analyse).
//! - A friction law from loops: [`friction::choose`].
//! - A quantity over several campaigns, and how much reassembly changes it: [`study::trend`].
//!
//! The feature `rayon` uses all cores; results are bit-identical with and without it.
#![forbid(unsafe_code)]

pub mod band;
pub mod contact;
mod errors_in_variables;
pub mod frf;
pub mod friction;
pub mod hysteresis;
pub mod identified;
pub mod median;
pub mod modes;
mod parallel;
pub mod spectra;
pub mod structure;
mod student;
pub mod study;
pub mod substructuring;
mod vectors;

/// A complex value at one line of a spectrum.
pub(crate) type C = nalgebra::Complex<f64>;
/// A complex matrix at one line of a spectrum, such as the FRFs of outputs × inputs.
pub(crate) type Line = nalgebra::DMatrix<C>;

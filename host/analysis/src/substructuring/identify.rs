//! The entry point: from three FRF matrices and the geometry to the joint's stiffness by every
//! requested method.

use super::coupling::BackCoupling;
use super::geometry::Geometry;
use super::idm::IdmSet;
use super::interface_data::{InterfaceError, Measured, MeasuredSet};
use super::joint_over_bands::{JointRow, JointSpectrum};
use super::line_noise::LineNoise;
use super::method::Method;
pub use super::quality::{Internals, VirtualPointQuality};
use super::reduced::{Reduced, RefusedReason};
use super::reduced::{Solution, Solutions};
use crate::Line;
use crate::band::Band;
use crate::frf::common_lines::{self, CommonLines, OtherLines};
use crate::frf::{Frf, MotionQuantity};
use crate::parallel::prelude::*;
use crate::structure::{Abc, Structure};
use nalgebra::{Complex, DMatrix};
use serde::Serialize;
use std::borrow::Cow;

/// The reason why these files allow no identification at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The files are not on the same lines.
    #[error(
        "{file} is on other frequency lines than A ({detail}): decoupling needs the same lines in all three; process the records alike"
    )]
    Axes {
        /// Which file.
        file: Structure,
        /// The first difference.
        detail: String,
    },
    /// The files hold different quantities.
    #[error(
        "{file} holds {}, A holds {}: convert them to one quantity first, or correct the label",
        found.frf_name(), expected.frf_name()
    )]
    Quantities {
        /// Which file.
        file: Structure,
        /// Its quantity.
        found: MotionQuantity,
        /// A's quantity.
        expected: MotionQuantity,
    },
    /// The files were windowed differently.
    #[error(
        "{file} has an exponential window of {found} 1/s, A of {expected} 1/s: every FRF must be on the same s = σ + iω"
    )]
    Damping {
        /// Which file.
        file: Structure,
        /// Its σ, 1/s.
        found: f64,
        /// A's σ, 1/s.
        expected: f64,
    },
    /// A band contains no line.
    #[error(
        "no line lies in the band {low_hz}–{high_hz} Hz: the files cover {from_hz}–{to_hz} Hz in {lines} lines above 0 Hz; choose a band within"
    )]
    EmptyBand {
        /// Lowest frequency requested, Hz.
        low_hz: f64,
        /// Highest frequency requested, Hz.
        high_hz: f64,
        /// First line, Hz.
        from_hz: f64,
        /// Last line, Hz.
        to_hz: f64,
        /// Number of lines.
        lines: usize,
    },
    /// No method, IDM set or band was given.
    #[error("nothing to do: at least one method, one IDM set and one band are needed")]
    NothingAsked,
}

/// A method and IDM set without a result, and the reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refused {
    /// The method.
    pub method: Method,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The reason, as a sentence.
    pub reason: String,
}

/// All results of an identification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// One row per method, IDM set and band that gave a result.
    pub joint: Vec<JointRow>,
    /// Z^J's diagonal over frequency, one per method and IDM set.
    pub spectra: Vec<JointSpectrum>,
    /// Methods that refused this data, with the reason.
    pub refused: Vec<Refused>,
    /// Quality of A's and B's virtual points.
    pub virtual_points: Vec<VirtualPointQuality>,
    /// n_i, n_c and ranks for the requested forms of Eq. (3).
    pub internals: Vec<Internals>,
}

/// Identifies the joint from FRFs of A, B and AJB (all three with the same lines, quantity and
/// window).
///
/// `internal` uses all impacts on A (Grouping 1 and 3) and all responses on B (2 and 4) as
/// internals, `internal-printed` the Grouping 3 impacts and the Grouping 4 responses. A row or
/// column is used if both the geometry and the files have it. A line at 0 Hz is left out.
///
/// # Errors
/// [`IdentifyError`] if the files do not fit together. A method that cannot use them is listed in
/// [`Identification::refused`] instead, so that the others still give results.
pub fn identify(
    a: &Frf,
    b: &Frf,
    ajb: &Frf,
    geometry: &Geometry,
    methods: &[Method],
    idms: &[IdmSet],
    bands: &[Band],
) -> Result<Identification, IdentifyError> {
    if methods.is_empty() || idms.is_empty() || bands.is_empty() {
        return Err(IdentifyError::NothingAsked);
    }
    check_alike(a, b, ajb)?;
    let files = [a, b, ajb].map(above_zero);
    for band in bands {
        if !files[0].frequency_hz().iter().any(|&f| band.contains(f)) {
            return Err(IdentifyError::EmptyBand {
                low_hz: band.low_hz,
                high_hz: band.high_hz,
                from_hz: files[0].frequency_hz().first().copied().unwrap_or(f64::NAN),
                to_hz: files[0].frequency_hz().last().copied().unwrap_or(f64::NAN),
                lines: files[0].lines().len(),
            });
        }
    }
    let measured_set = measured_set(&files, geometry);
    let mut out = Identification {
        joint: vec![],
        spectra: vec![],
        refused: vec![],
        virtual_points: vec![],
        internals: vec![],
    };
    for &set in idms {
        let reduced = Reduced::of(&measured_set, set);
        let (alone, solutions) = solve(&measured_set, &reduced, set, methods, true);
        if let (Ok(reduced), Some(alone)) = (&reduced, &alone) {
            out.virtual_points.extend(reduced.quality(&measured_set, [&alone[0], &alone[1]]));
        }
        let mut solved = Vec::new();
        for (method, solution) in solutions {
            match solution {
                Ok(solution) => solved.push((method, solution)),
                Err(refused) => out.refused.push(refused),
            }
        }
        let axis = &files[0];
        let results: Vec<(JointSpectrum, Vec<JointRow>)> = solved
            .par_iter()
            .map(|(method, Solution { z, notes, .. })| {
                let spectrum =
                    JointSpectrum::of(method.name(), set, axis.frequency_hz(), axis.sigma_per_s(), z);
                let mut rows: Vec<JointRow> = bands.iter().filter_map(|&band| spectrum.over(band)).collect();
                for row in &mut rows {
                    row.warnings.splice(0..0, notes.iter().cloned());
                }
                (spectrum, rows)
            })
            .collect();
        for ((spectrum, rows), (_, solution)) in results.into_iter().zip(solved) {
            out.internals.extend(solution.internals);
            out.joint.extend(rows);
            out.spectra.push(spectrum);
        }
    }
    Ok(out)
}

/// Z^J per line (n_c × n_c), or the reason why there is none.
pub type Decoupled = Result<Vec<DMatrix<Complex<f64>>>, Refused>;

/// Z^J of every line above 0 Hz by every requested method (n_c × n_c; N/m, N m/rad between
/// rotations): the matrices that [`identify`] takes its statistics of.
///
/// # Errors
/// [`IdentifyError`] if the files do not fit together; [`Refused`] for a method that cannot use
/// them.
pub fn decouple(
    a: &Frf,
    b: &Frf,
    ajb: &Frf,
    geometry: &Geometry,
    methods: &[Method],
    idms: IdmSet,
) -> Result<Vec<(Method, Decoupled)>, IdentifyError> {
    check_alike(a, b, ajb)?;
    let files = [a, b, ajb].map(above_zero);
    let measured_set = measured_set(&files, geometry);
    let reduced = Reduced::of(&measured_set, idms);
    let (_, solutions) = solve(&measured_set, &reduced, idms, methods, false);
    Ok(solutions.into_iter().map(|(method, found)| (method, found.map(|solution| solution.z))).collect())
}

/// The noise of a method's lines, or the reason why there is none.
pub type Propagated = Result<LineNoise, Refused>;

/// Effect of the FRFs' noise on every line above 0 Hz by every requested method: linear propagation
/// of the variances, smoothed over ± 10 Hz, through virtual points and method.
///
/// # Errors
/// [`IdentifyError`] if files or variances do not fit together; [`Refused`] for a method that
/// cannot use them.
pub fn line_noise(
    [a, b, ajb]: [&Frf; 3],
    geometry: &Geometry,
    methods: &[Method],
    idms: IdmSet,
) -> Result<Vec<(Method, Propagated)>, IdentifyError> {
    check_alike(a, b, ajb)?;
    let files = [a, b, ajb].map(above_zero);
    let [a, b, ajb] = files.each_ref().map(|frf| frf.smooth_variance());
    let measured_set = measured_set(&files, geometry);
    let reduced = Reduced::of(&measured_set, idms);
    let noise = |method| {
        let refused = |reason: String| Refused { method, idms: idms.count(), reason };
        let reduced = reduced.as_ref().map_err(|error| refused(error.to_string()))?;
        reduced.line_noise(&measured_set, [&a, &b, &ajb], method).map_err(|error| refused(error.to_string()))
    };
    Ok(methods.iter().map(|&method| (method, noise(method))).collect())
}

/// A and B coupled by the mean of Eq. (A.1) over `band`, compared with the measured assembly. None
/// if the files do not fit together, a virtual point cannot be formed, or no line lies in the band.
pub fn back_coupled(
    [a, b, ajb]: [&Frf; 3],
    geometry: &Geometry,
    idms: IdmSet,
    band: Band,
) -> Option<BackCoupling> {
    check_alike(a, b, ajb).ok()?;
    let files = [a, b, ajb].map(above_zero);
    let measured_set = measured_set(&files, geometry);
    let reduced = Reduced::of(&measured_set, idms).ok()?;
    let solution = reduced.solve(&measured_set, &[Method::Inverse], false).ok()?.by_method.pop()?.ok()?;
    reduced.back_coupling(&measured_set, &solution.z, band)
}

fn measured_set<'a>(files: &'a [Cow<'_, Frf>; 3], geometry: &'a Geometry) -> MeasuredSet<'a> {
    let [a, b, ajb] = files;
    MeasuredSet {
        a: Measured { file: Structure::A, frf: a, points: &geometry.a },
        b: Measured { file: Structure::B, frf: b, points: &geometry.b },
        ajb: Measured { file: Structure::Ajb, frf: ajb, points: &geometry.ajb },
        geometry,
    }
}

type Solved = (Method, Result<Solution, Refused>);

/// Every method's solution or refusal, and Y^A and Y^B if `alone` requests them and they exist.
fn solve(
    measured_set: &MeasuredSet<'_>,
    reduced: &Result<Reduced, InterfaceError>,
    idms: IdmSet,
    methods: &[Method],
    alone: bool,
) -> (Option<Vec<Vec<Line>>>, Vec<Solved>) {
    let refused =
        |method, reason: RefusedReason| Refused { method, idms: idms.count(), reason: reason.to_string() };
    let solutions = match reduced {
        Ok(reduced) => reduced.solve(measured_set, methods, alone),
        Err(error) => Err(error.clone().into()),
    };
    match solutions {
        Ok(Solutions { alone, by_method }) => {
            let by_method = methods.iter().zip(by_method);
            let by_method =
                by_method.map(|(&m, found)| (m, found.map_err(|reason| refused(m, reason)))).collect();
            (Some(alone), by_method)
        }
        Err(reason) => (None, methods.iter().map(|&m| (m, Err(refused(m, reason.clone())))).collect()),
    }
}

/// The file without a line at 0 Hz, where a mobility cannot be converted to a receptance.
fn above_zero(file: &Frf) -> Cow<'_, Frf> {
    if file.frequency_hz().first().is_some_and(|f| *f > 0.0) {
        Cow::Borrowed(file)
    } else {
        Cow::Owned(file.band(f64::MIN_POSITIVE, f64::MAX))
    }
}

fn other_lines(file: Structure, apart: OtherLines) -> IdentifyError {
    IdentifyError::Axes { file, detail: format!("{} Hz against {} Hz", apart.other_hz, apart.one_hz) }
}

/// Reduces FRFs of A, B and the assembly to the lines that all three have, and returns these if any
/// line was dropped: [`identify`] needs the same lines in all three.
///
/// # Errors
/// [`IdentifyError::Axes`] if they are on different lines; nothing is changed then.
pub fn keep_common_lines(files: &mut [Frf; 3]) -> Result<Option<CommonLines>, IdentifyError> {
    common_lines::keep_common_lines(files).map_err(|(file, apart)| other_lines(file, apart))
}

fn check_alike(a: &Frf, b: &Frf, ajb: &Frf) -> Result<(), IdentifyError> {
    for (file, y) in (Abc { a, b, ajb }).each() {
        if y.quantity() != a.quantity() {
            return Err(IdentifyError::Quantities { file, found: y.quantity(), expected: a.quantity() });
        }
        if (y.sigma_per_s() - a.sigma_per_s()).abs() > 1e-9 * a.sigma_per_s() {
            return Err(IdentifyError::Damping { file, found: y.sigma_per_s(), expected: a.sigma_per_s() });
        }
        if y.frequency_hz().len() != a.frequency_hz().len() {
            let detail = format!("{} lines against {}", y.frequency_hz().len(), a.frequency_hz().len());
            return Err(IdentifyError::Axes { file, detail });
        }
        common_lines::same(a.frequency_hz(), y.frequency_hz()).map_err(|apart| other_lines(file, apart))?;
    }
    Ok(())
}

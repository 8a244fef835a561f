//! The joint from FRFs of A, B and the assembly.

use std::path::PathBuf;

use jointrig::analyse::{Asked, IdmSets, Question};
use jointrig::exchange::read_geometry;
use jointrig::report::document;
use jointrig::results::Source;
use jointrig::substructuring::Band;
use jointrig::substructuring::averaged::Priors;
use pyo3::prelude::*;

use crate::analysis::{Analysis, Of};
use crate::frf::Frf;
use crate::{in_the_process_that_loaded_this, interruptible, raised};

/// Results of `jointrig identify` for these FRFs; the second value contains the messages about the
/// geometry that the command prints to stderr.
#[pyfunction]
#[pyo3(signature = (*, a, b, ajb, geometry, method, idms, band_hz, position_error_m=None, aim_error_m=None, angle_error_rad=None,
                    mounting_error=None, full_joint=false, noise=None))]
#[allow(clippy::too_many_arguments, reason = "Python names each of them")]
pub fn identify(
    py: Python<'_>,
    a: &Bound<'_, Frf>,
    b: &Bound<'_, Frf>,
    ajb: &Bound<'_, Frf>,
    geometry: PathBuf,
    method: Vec<String>,
    idms: Vec<String>,
    band_hz: Vec<(f64, f64)>,
    position_error_m: Option<f64>,
    aim_error_m: Option<f64>,
    angle_error_rad: Option<f64>,
    mounting_error: Option<f64>,
    full_joint: bool,
    noise: Option<f64>,
) -> PyResult<(Analysis, Vec<String>)> {
    in_the_process_that_loaded_this(py)?;
    let refused = |sentence: String| raised::refused(py, &sentence);
    for (name, given) in [
        ("position_error_m", position_error_m),
        ("aim_error_m", aim_error_m),
        ("angle_error_rad", angle_error_rad),
        ("mounting_error", mounting_error),
        ("noise", noise),
    ] {
        if given.is_some_and(|value| !(value.is_finite() && value >= 0.0)) {
            return Err(refused(format!("{name}: a standard deviation is a number, zero or more")));
        }
    }
    let usual = Question::default();
    let priors = Priors {
        position_m: position_error_m.unwrap_or(usual.priors.position_m),
        aim_m: aim_error_m.unwrap_or(usual.priors.aim_m),
        hammer_angle_rad: angle_error_rad.unwrap_or(usual.priors.hammer_angle_rad),
    };
    let methods = method.iter().map(|name| name.parse::<Asked>());
    let sets = idms.iter().map(|words| words.parse::<IdmSets>());
    let bands = band_hz.into_iter().map(|(low_hz, high_hz)| {
        let whole = low_hz.is_finite() && high_hz.is_finite() && 0.0 <= low_hz && low_hz <= high_hz;
        whole.then_some(Band { low_hz, high_hz }).ok_or_else(|| {
            format!(
                "band_hz: ({low_hz}, {high_hz}) is no band: give (low, high) in Hz, for example (300, 600)"
            )
        })
    });
    let question = Question {
        methods: methods.collect::<Result<_, _>>().map_err(refused)?,
        idms: sets
            .collect::<Result<Vec<_>, _>>()
            .map_err(refused)?
            .into_iter()
            .flat_map(|set| set.0)
            .collect(),
        bands: bands.collect::<Result<_, _>>().map_err(refused)?,
        priors,
        full_joint,
        noise,
        mounting: mounting_error.unwrap_or(usual.mounting),
    };
    let (geometry, mut notes) = py
        .detach(|| read_geometry(&geometry))
        .map_err(|error| raised::reading(py, &geometry, &error.to_string()))?;
    let mut frfs = Vec::new();
    for (name, frf, points) in [("A", a, &geometry.a), ("B", b, &geometry.b), ("AJB", ajb, &geometry.ajb)] {
        let (own, told) = frf.get().along(points).map_err(|what| refused(format!("{name}: {what}")))?;
        notes.extend(told.iter().map(|line| format!("{name}: {line}")));
        frfs.push(own);
    }
    let frfs: [_; 3] = frfs.try_into().map_err(|_| refused("three FRFs are needed".into()))?;
    let asked = question.clone();
    let source = Source { kind: "frf".into(), ..Source::default() };
    let found = interruptible::run(py, move |_| asked.answered(source, frfs, &geometry))?;
    let found = document(found.map_err(|error| refused(error.to_string()))?);
    question.was_answered(&found).map_err(refused)?;
    let given = [("A", a), ("B", b), ("AJB", ajb)].map(|(name, frf)| (name, frf.clone().unbind()));
    Ok((Analysis::of(found, Of::Frfs(given.into())), notes))
}

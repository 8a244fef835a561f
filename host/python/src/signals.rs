//! Analyses of arrays: FRFs of impact records, loops, modes, and the joint from FRFs of A, B and
//! the assembly.

use crate::frf::Frf;
use crate::lab::{Analysis, Of};
use crate::{in_the_process_that_loaded_this, interruptible, raised, values};
use jointrig::analyse::{Asked, Findings, FoundModes, IdmSets, Question, RecordLoops};
use jointrig::campaign::verdict::{Limits, Verdict, judge_all};
use jointrig::exchange::read_geometry;
use jointrig::hysteresis::{HysteresisError, HysteresisRecord, RelativeMotion, analyse};
use jointrig::report::{document, mode_rows};
use jointrig::results::Source;
use jointrig::spectra::{CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, estimate};
use jointrig::substructuring::Band;
use jointrig::substructuring::averaged::Priors;
use nalgebra::{Complex, DMatrix, Scalar};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// FRFs of the good hits of impact records, with the verdict on every hit: (Frf, verdicts).
#[pyfunction]
#[pyo3(signature = (*, fs_hz, force_n, response, quantity, estimator="H1", sigma_per_s=None, delay_s=None, outputs=None, input="impact"))]
#[allow(clippy::too_many_arguments, reason = "Python names each of them")]
pub fn frf<'py>(
    py: Python<'py>,
    fs_hz: f64,
    force_n: PyReadonlyArray2<'py, f64>,
    response: PyReadonlyArray3<'py, f64>,
    quantity: &str,
    estimator: &str,
    sigma_per_s: Option<f64>,
    delay_s: Option<Vec<f64>>,
    outputs: Option<Vec<String>>,
    input: &str,
) -> PyResult<(Frf, Vec<&'static str>)> {
    in_the_process_that_loaded_this(py)?;
    let Some(motion) = MotionQuantity::from_name(quantity) else {
        let sentence = format!("quantity is `{quantity}`: velocity, acceleration or displacement is needed");
        return Err(raised::refused(py, &sentence));
    };
    let Some(value) = estimated_by(estimator) else {
        let sentence = format!("estimator is `{estimator}`: H1, H2 or Hv is needed");
        return Err(raised::refused(py, &sentence));
    };
    if !(fs_hz.is_finite() && fs_hz > 0.0) {
        return Err(raised::refused(py, &format!("fs_hz is {fs_hz}: a positive number is needed")));
    }
    let (force, motions) = (force_n.as_array(), response.as_array());
    let ([hits, samples], [own_hits, channels, own_samples]) =
        ([force.shape()[0], force.shape()[1]], [motions.shape()[0], motions.shape()[1], motions.shape()[2]]);
    if hits == 0 || samples == 0 || channels == 0 || (hits, samples) != (own_hits, own_samples) {
        return Err(raised::refused(
            py,
            &format!(
                "force_n has shape ({hits}, {samples}) and response ({own_hits}, {channels}, {own_samples}): (hit, sample) and \
                 (hit, channel, sample) are needed, with one hit, channel and sample at least"
            ),
        ));
    }
    let records = ImpactRecords {
        fs_hz,
        force_n: force.rows().into_iter().map(|hit| hit.to_vec()).collect(),
        response: motions
            .outer_iter()
            .map(|hit| hit.rows().into_iter().map(|row| row.to_vec()).collect())
            .collect(),
        quantity: motion,
    };
    let all = records.force_n.iter().chain(records.response.iter().flatten());
    if all.flatten().any(|value| !value.is_finite()) {
        return Err(raised::data(py, "a sample is not a number: take its hit out"));
    }
    let mut settings = FrfSettings { delay_s: delay_s.unwrap_or_default(), ..FrfSettings::default() };
    if let Some(sigma) = sigma_per_s {
        settings.windowing.sigma_per_s = sigma;
    }
    let outputs =
        outputs.unwrap_or_else(|| (1..=channels).map(|channel| format!("response {channel}")).collect());
    let input = input.to_owned();
    let found = interruptible::run(py, move |_| {
        let verdicts = judge_all(&records, &Limits::default(), None);
        let used: Vec<bool> = verdicts.iter().map(|verdict| verdict.kind == Verdict::Good).collect();
        if !used.contains(&true) {
            let why: Vec<String> = verdicts.iter().map(|verdict| verdict.sentence.clone()).collect();
            return Err(format!("no hit is good, so there is nothing to average: {}", why.join("; ")));
        }
        let spectra = estimate(&records, &used, &settings).map_err(|error| error.to_string())?;
        let whole = spectra
            .to_matrix(motion, outputs, input)
            .and_then(|h1| h1.with_values(columns(spectra.rows(value))))
            .and_then(|frf| frf.with_variance(columns(spectra.rows(CrossSpectra::variance))))
            .and_then(|frf| frf.with_coherence(columns(spectra.rows(CrossSpectra::coherence))));
        let verdicts: Vec<&str> = verdicts.iter().map(|verdict| verdict.kind.name()).collect();
        Ok((whole.map_err(|error| error.to_string())?, verdicts))
    })?;
    let (frf, verdicts) = found.map_err(|what: String| raised::refused(py, &what))?;
    let used = verdicts.iter().filter(|verdict| **verdict == Verdict::Good.name()).count();
    let hits = nalgebra::DMatrix::from_element(frf.outputs().len(), 1, used);
    Ok((Frf::with_hits(frf, hits), verdicts))
}

/// The FRF at a line, from the force to an output.
type Estimator = fn(&CrossSpectra, usize, usize) -> Complex<f64>;

/// An estimator by its name.
fn estimated_by(name: &str) -> Option<Estimator> {
    match name {
        "H1" => Some(CrossSpectra::h1),
        "H2" => Some(CrossSpectra::h2),
        "Hv" => Some(|spectra, line, output| spectra.hv(line, output, None)),
        _ => None,
    }
}

/// One column per line.
fn columns<T: Scalar>(rows: Vec<Vec<T>>) -> Vec<DMatrix<T>> {
    rows.into_iter().map(|row| DMatrix::from_column_slice(row.len(), 1, &row)).collect()
}

/// Loops of a time record, as found by `jointrig hysteresis`.
#[pyfunction]
#[pyo3(signature = (*, fs_hz, velocity_a, velocity_b, force_n, excitation_hz=None, normal_load_n=None))]
pub fn hysteresis(
    py: Python<'_>,
    fs_hz: f64,
    velocity_a: PyReadonlyArray1<'_, f64>,
    velocity_b: PyReadonlyArray1<'_, f64>,
    force_n: PyReadonlyArray1<'_, f64>,
    excitation_hz: Option<f64>,
    normal_load_n: Option<f64>,
) -> PyResult<Analysis> {
    in_the_process_that_loaded_this(py)?;
    let signal = |array: &PyReadonlyArray1<'_, f64>| array.as_array().to_vec();
    let record = HysteresisRecord {
        fs_hz,
        motion: RelativeMotion::Velocity { a_m_per_s: signal(&velocity_a), b_m_per_s: signal(&velocity_b) },
        force_n: signal(&force_n),
        excitation_hz,
        normal_load_n,
    };
    let found = interruptible::run(py, move |_| {
        let raw = analyse(&record)?;
        let loops = RecordLoops { level: None, own: None, raw, corrected: None };
        let source = Source { kind: "record".into(), ..Source::default() };
        Ok(document(Findings { source, record: Some(loops), ..Findings::default() }))
    })?;
    found
        .map(|found| Analysis::of(found, Of::Frfs(Vec::new())))
        .map_err(|error: HysteresisError| raised::refused(py, &error.to_string()))
}

/// The modes of FRFs, as `jointrig modes FILE --json` prints them.
#[pyfunction]
#[pyo3(signature = (*, frf, band_hz, frf_error))]
pub fn modes<'py>(
    py: Python<'py>,
    frf: &Bound<'_, Frf>,
    band_hz: Option<(f64, f64)>,
    frf_error: f64,
) -> PyResult<Bound<'py, PyAny>> {
    in_the_process_that_loaded_this(py)?;
    if !(frf_error.is_finite() && frf_error >= 0.0) {
        return Err(raised::refused(py, "frf_error: a standard deviation is a number, zero or more"));
    }
    let band = band_hz.map(|(low_hz, high_hz)| Band { low_hz, high_hz });
    let read = frf.get().labelled();
    let found = interruptible::run(py, move |_| FoundModes::of_labelled(&read, band, frf_error))?;
    let found = found.map_err(|error| raised::refused(py, &error.to_string()))?;
    let (modes, modal) = mode_rows(&[found]);
    values(py, &json!({ "modes": modes, "modal": modal }).to_string())
}

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

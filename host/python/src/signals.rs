//! Analyses of arrays: FRFs of impact records, and loops.

use jointrig::analyse::{Findings, RecordLoops};
use jointrig::campaign::verdict::{Limits, Verdict, judge_all};
use jointrig::hysteresis::{HysteresisError, HysteresisRecord, RelativeMotion, analyse};
use jointrig::report::document;
use jointrig::results::Source;
use jointrig::spectra::{CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, estimate};
use nalgebra::{Complex, DMatrix, Scalar};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::analysis::{Analysis, Of};
use crate::frf::Frf;
use crate::{in_the_process_that_loaded_this, interruptible, raised};

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

//! `frf` of a folder: universal files whose labels name impacts and sensors become one matrix of
//! FRFs, in the form that `import` and `identify` read.

use std::path::Path;

use nalgebra::DMatrix;
use num_complex::Complex;

use super::error::CliError;
use super::hit_agreement::Agreement;
use super::import::universal_files;
use super::output;
use super::output::Waiting;
use crate::campaign::verdict::{Limits, Verdict, judge_all};
use crate::exchange::frf_npz::direction_extras;
use crate::exchange::labelled_frf::axis_name;
use crate::exchange::record_file::{Directions, RecordFile};
use crate::exchange::record_uff::{LabelledRecords, by_label, record_contents};
use crate::exchange::{StatedUnits, write_frf};
use crate::frf::Frf;
use crate::frf::common_lines::same;
use crate::spectra::{CrossSpectra, FrfSettings, MotionQuantity, estimate, usable_band};
use crate::untrusted_text::tell_line;

/// Options for converting records to FRFs.
pub(super) struct Wishes<'w> {
    pub(super) settings: &'w FrfSettings,
    /// Quantity of the FRFs; `None` keeps that of the records.
    pub(super) quantity: Option<MotionQuantity>,
    /// Frequency lines to output, Hz.
    pub(super) band: Option<(f64, f64)>,
    /// Units that override those of the labels.
    pub(super) units: &'w StatedUnits,
}

/// One impact position with one sensor.
struct Pair {
    impact: String,
    response: String,
    spectra: CrossSpectra,
    /// Axes of force and channels.
    directions: Directions,
}

/// Averages the good hits of every file in `folder` and writes the matrix to `out`.
///
/// # Errors
/// A file cannot be read, names are missing, or records are inconsistent with each other.
pub(super) fn average(folder: &Path, out: &Path, wishes: &Wishes<'_>) -> Result<(), CliError> {
    let bad = |what: String| CliError::Bad(what);
    let files = universal_files(folder)?;
    let waiting = Waiting::of("averaging files");
    let (mut pairs, mut told, mut quantity) = (Vec::<Pair>::new(), Vec::new(), wishes.quantity);
    let mut worst: Vec<(f64, String)> = Vec::new();
    let mut took = Vec::<(String, String)>::new();
    for (done, path) in files.iter().enumerate() {
        waiting.at(done, files.len());
        let wrong = |what: String| bad(format!("{}: {what}", path.display()));
        let contents = record_contents(path).map_err(|error| bad(error.to_string()))?;
        let (rows, notes) = by_label(&contents, wishes.units, &|_| false).map_err(wrong)?;
        drop(contents);
        told.extend(notes.iter().map(|note| format!("{}: {note}", path.display())));
        for LabelledRecords { impact, response, read } in rows {
            let RecordFile { records, delay_s, directions, taken, notes } = read.along_axes();
            told.extend(notes.iter().map(|note| format!("{}: {note}", path.display())));
            if !took.iter().any(|(known, _)| *known == taken) {
                took.push((taken, path.display().to_string()));
            }
            if pairs.iter().any(|pair| (&pair.impact, &pair.response) == (&impact, &response)) {
                return Err(wrong(format!("{impact} to {response} is in an earlier file too")));
            }
            let verdicts = judge_all(&records, &Limits::default(), None);
            let used: Vec<bool> = verdicts.iter().map(|v| v.kind == Verdict::Good).collect();
            let good = used.iter().filter(|good| **good).count();
            if good < used.len() {
                told.push(format!("{impact} to {response}: {good} of {} hits are good", used.len()));
            }
            for (hit, verdict) in verdicts.iter().enumerate().filter(|(hit, _)| !used[*hit]) {
                told.push(format!(
                    "{impact} to {response}: hit {hit}: {} ({})",
                    verdict.kind, verdict.sentence
                ));
            }
            if good == 0 {
                continue;
            }
            let of = |what: String| wrong(format!("{impact} to {response}: {what}"));
            let settings = FrfSettings { delay_s, ..wishes.settings.clone() };
            let found = estimate(&records, &used, &settings).map_err(|error| of(error.to_string()))?;
            let excited = usable_band(found.frequency_hz(), &found.force_spectrum(), 6.0);
            let channels = outputs_of(&response, found.outputs(), &directions);
            let agreement = Agreement::of(&records, &used, &settings, &found, excited, &channels)
                .map_err(|error| of(error.to_string()))?;
            told.extend(agreement.suspicions.iter().map(|what| format!("{impact} to {response}: {what}")));
            worst.extend(agreement.worst().map(|(o, median, lowest, hz)| {
                (
                    median,
                    format!(
                        "{} from {impact}: median {median:.3}, lowest {lowest:.3} at {hz:.1} Hz",
                        channels[o]
                    ),
                )
            }));
            let wanted = *quantity.get_or_insert(records.quantity);
            let mut spectra = found.converted(records.quantity, wanted);
            if let Some((low, high)) = wishes.band {
                spectra = spectra.band(low, high);
            }
            if spectra.lines() == 0 {
                return Err(CliError::Usage("--band contains no frequency line: widen it".into()));
            }
            let same_lines =
                |first: &Pair| same(first.spectra.frequency_hz(), spectra.frequency_hz()).is_ok();
            if !pairs.first().is_none_or(same_lines) {
                return Err(of("its frequency lines differ from those of the files before it: all records need the same length \
                    and rate".into()));
            }
            pairs.push(Pair { impact, response, spectra, directions });
        }
    }
    drop(waiting);
    let (Some(first), Some(quantity)) = (pairs.first(), quantity) else {
        let why: Vec<String> = told.iter().map(|line| format!("\n  {line}")).collect();
        return Err(bad(format!(
            "{}: no hit is good, so there is nothing to average{}",
            folder.display(),
            why.concat()
        )));
    };
    for (taken, file) in &took {
        tell_line!(
            "{file}{}: {taken}",
            if took.len() == 1 && files.len() > 1 { " and all others" } else { "" }
        );
    }
    let lines = first.spectra.lines();
    let (frf, outputs, inputs) = matrix(&pairs, quantity)?;
    write_frf(out, &frf, &direction_extras(&outputs, &inputs)).map_err(|error| bad(error.to_string()))?;
    let (rows, columns) = (frf.outputs().len(), frf.inputs().len());
    worst.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some((_, lowest)), Some((median, _))) = (worst.first(), worst.get(worst.len() / 2)) {
        told.push(format!(
            "coherence: the worst response is {lowest}; half of the pairs have {median:.3} or more"
        ));
    }
    told.push(format!(
        "{}: {} of {rows} outputs, {columns} inputs, {lines} lines",
        out.display(),
        quantity.frf_name()
    ));
    output::lines(told)
}

/// Names of a sensor's outputs: `NAME` for a single channel; for several, `NAME` with the axis,
/// `NAME:x`; if the labels give no axes, three channels are x, y and z, and any other number
/// `NAME:1`, `NAME:2`.
fn outputs_of(name: &str, channels: usize, directions: &Directions) -> Vec<String> {
    let axes = &directions.responses;
    let apart = (0..axes.len()).all(|i| (1..=3).contains(&axes[i]) && !axes[..i].contains(&axes[i]));
    match channels {
        1 => vec![name.to_owned()],
        _ if apart => {
            axes.iter().map(|axis| format!("{name}:{}", ["x", "y", "z"][*axis as usize - 1])).collect()
        }
        3 => ["x", "y", "z"].map(|axis| format!("{name}:{axis}")).to_vec(),
        channels => (1..=channels).map(|channel| format!("{name}:{channel}")).collect(),
    }
}

/// A matrix, and the directions of its outputs and inputs.
type Whole = (Frf, Vec<i64>, Vec<i64>);

/// All pairs in one matrix; unmeasured elements are NaN.
fn matrix(pairs: &[Pair], quantity: MotionQuantity) -> Result<Whole, CliError> {
    let (mut outputs, mut inputs) = (Vec::<String>::new(), Vec::<String>::new());
    let (mut along, mut push) = (Vec::new(), Vec::new());
    for pair in pairs {
        match inputs.iter().position(|own| *own == pair.impact) {
            None => {
                inputs.push(pair.impact.clone());
                push.push(pair.directions.force);
            }
            Some(at) if push[at] != pair.directions.force => {
                return Err(CliError::Bad(format!(
                    "{}: files have its hammer along {} and along {}: correct the labels",
                    pair.impact,
                    axis_name(push[at]).unwrap_or_else(|| "no axis".into()),
                    axis_name(pair.directions.force).unwrap_or_else(|| "no axis".into())
                )));
            }
            Some(_) => {}
        }
        let names = outputs_of(&pair.response, pair.spectra.outputs(), &pair.directions);
        for (name, axis) in names.into_iter().zip(&pair.directions.responses) {
            if !outputs.contains(&name) {
                outputs.push(name);
                along.push(*axis);
            }
        }
    }
    let first = &pairs[0].spectra;
    let hole = || vec![DMatrix::from_element(outputs.len(), inputs.len(), f64::NAN); first.lines()];
    let (mut variance, mut coherence) = (hole(), hole());
    let nowhere = Complex::new(f64::NAN, f64::NAN);
    let mut values = vec![DMatrix::from_element(outputs.len(), inputs.len(), nowhere); first.lines()];
    for pair in pairs {
        let y = &pair.spectra;
        let column = inputs.iter().position(|name| *name == pair.impact).unwrap_or(0);
        for (channel, name) in
            outputs_of(&pair.response, pair.spectra.outputs(), &pair.directions).iter().enumerate()
        {
            let at = (outputs.iter().position(|own| own == name).unwrap_or(0), column);
            for line in 0..y.lines() {
                values[line][at] = y.h1(line, channel);
                variance[line][at] = y.variance(line, channel);
                coherence[line][at] = y.coherence(line, channel);
            }
        }
    }
    let whole =
        Frf::new(first.frequency_hz().to_vec(), first.sigma_per_s(), quantity, outputs, inputs, values);
    let whole = whole.and_then(|frf| frf.with_variance(variance)?.with_coherence(coherence));
    whole.map(|frf| (frf, along, push)).map_err(|error| CliError::Bad(error.to_string()))
}

//! `hysteresis`: computes the loops of any time record.

use std::path::PathBuf;

use clap::Args;

use super::error::CliError;
use super::output;
use super::output::{not_negative, positive};
use crate::analyse::{Findings, RecordLoops};
use crate::exchange::{is_beside_the_contact, read_hysteresis};
use crate::hysteresis::{Correction, HysteresisRecord, analyse};
use crate::report::{document, words};
use crate::results::{BESIDE_THE_CONTACT, Hysteresis, RECORD, Source};

/// Compute the loops of any time record: stiffness, energy, shape, friction.
///
/// RECORD.npz contains `fs` (Hz), `velocity_a` and `velocity_b` (m/s) or `displacement_a` and
/// `displacement_b` (m), `force` (N) or `load_cells` (cell, sample), and if known `excitation` (Hz;
/// none for an impact) and `normal_load` (N).
#[derive(Debug, Args)]
pub struct Loops {
    /// The record.
    #[arg(value_name = "RECORD.npz")]
    record: PathBuf,
    /// Print results.json on stdout instead of the figures, findings and warnings as text.
    #[arg(long)]
    json: bool,
    /// Normal load, N, for the friction coefficient [default: that of the record].
    #[arg(long, value_name = "N", value_parser = positive)]
    normal_load: Option<f64>,
    /// Effective mass of the static arm at the contact, kg; if given, loops of the corrected force
    /// are shown in addition to the raw ones.
    #[arg(long, value_name = "KG", value_parser = not_negative)]
    effective_mass: Option<f64>,
    /// Stiffness to ground in parallel with the load cells, relative to theirs (a lower push rod).
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    parallel_path: Option<f64>,
}

impl Loops {
    pub fn run(self) -> Result<(), CliError> {
        let bad = |what: String| CliError::Bad(format!("{}: {what}", self.record.display()));
        let mut record = read_hysteresis(&self.record).map_err(|error| CliError::Bad(error.to_string()))?;
        record.normal_load_n = self.normal_load.or(record.normal_load_n);
        let found = |record: &HysteresisRecord| analyse(record).map_err(|error| bad(error.to_string()));
        let stated = self.effective_mass.is_some() || self.parallel_path.is_some();
        let correction = stated.then(|| Correction {
            effective_mass_kg: self.effective_mass.unwrap_or(0.0),
            parallel_path: self.parallel_path.unwrap_or(0.0),
        });
        let loops = RecordLoops {
            level: None,
            own: None,
            raw: found(&record)?,
            corrected: correction.map(|correction| found(&correction.applied(&record))).transpose()?,
        };
        let mut results =
            document(Findings { source: self.source(&record), record: Some(loops), ..Findings::default() });
        if is_beside_the_contact(&self.record).map_err(|error| CliError::Bad(error.to_string()))? {
            // the loop's slope is the stiffness of everything between the measurement spots
            results.hysteresis = results.hysteresis.into_iter().map(Hysteresis::between_spots).collect();
            results.source.settings.insert(BESIDE_THE_CONTACT.into(), "beside the contact".into());
        }
        if self.json { output::json(&results) } else { output::lines(words::summary(&results)) }
    }

    fn source(&self, record: &HysteresisRecord) -> Source {
        let mut source = Source {
            file: self.record.file_name().unwrap_or(self.record.as_os_str()).to_string_lossy().into_owned(),
            kind: RECORD.into(),
            ..Source::default()
        };
        let settings = [
            ("sampling_rate_hz", Some(record.fs_hz)),
            ("excitation_hz", record.excitation_hz),
            ("normal_load_n", record.normal_load_n),
            ("effective_mass_kg", self.effective_mass),
            ("parallel_path", self.parallel_path),
        ];
        for (name, value) in settings {
            if let Some(value) = value {
                source.settings.insert(name.into(), value.into());
            }
        }
        source
    }
}

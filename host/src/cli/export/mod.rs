//! `export`: writes a campaign file's content in formats that other programs read.
//!
//! FRFs and results of the file; its records are read once if the analysis forms all requested
//! lines.

use super::analyse::write_into;
use super::error::CliError;
use super::output::Waiting;
use super::{frf, output};
use crate::analyse::{CampaignFile, KnownContact, LINES_HZ, Progress, Wanted};
use crate::campaign::archive::{self, Exported};
use crate::campaign::store::Store;
use crate::campaign::store::record_table::RecordRow;
use crate::exchange::tables_output::write_positions;
use crate::exchange::{tables_output, uff_output, write_frf};
use crate::frf::Frf;
use crate::report::WithFrfs;
use crate::structure::Structure;
use crate::substructuring::geometry::Configuration;
use crate::{analyse, report};
use clap::{Args, ValueEnum};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use records::Records;

#[cfg(feature = "parquet")]
mod columns;
#[cfg(feature = "parquet")]
mod estimates;
pub(super) mod levels;
mod records;
mod tables;
mod wear;

/// Write everything that a campaign file contains in formats for other programs.
///
/// DIR/geometry: csv tables in the form of the pyFBS workbook. DIR/frf: one file for each
/// configuration, H1 of the good hits with coherence and variance, or the imported FRFs.
/// DIR/records: one file for each cell with force and response of the hits that count (--all: of
/// every hit); DIR/channels: the same with all other channels. DIR/records.csv: every record with
/// its original and current verdict, when and why it was overruled, and its place in these files;
/// DIR/channels.csv and calibrations.csv: scales, delays, sensors. DIR/levels: one file for each
/// level of the shaker (velocities of both specimens and the load cells' sum, aligned in time; npz
/// as `jointrig hysteresis` reads it), one with all its channels, and levels.csv with ordered and
/// reached amplitudes. DIR/wear.csv: every cycle of wear runs, which `import` does not read back.
/// DIR/results.json and report.html. DIR/plan.toml and archive.json: the plan,
/// and everything else of the file, with which `jointrig import DIR --into NEW.jrig` makes the same
/// campaign again.
///
/// --format parquet: columns for engines such as DuckDB, Polars and Spark. The tables are Parquet
/// files, frf.parquet has one row for each line, estimates.parquet one for each stiffness, and the
/// files in DIR/samples one row for each scan, with one column for each channel. docs/columns.md
/// has example queries.
#[derive(Debug, Args)]
pub struct Export {
    /// Format of FRFs and records.
    #[arg(long, value_enum)]
    format: Form,
    /// Parquet: write samples in SI units instead of as they came: 32-bit floats for i16 and f32,
    /// 64-bit ones for i32 and f64.
    #[arg(long)]
    si: bool,
    #[command(flatten)]
    what: What,
}

/// What is exported, and to which folder.
#[derive(Debug, Args)]
struct What {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Lines of the FRFs, Hz.
    #[arg(long, value_name = "LO:HI", value_parser = frf::band, default_value = "10:1000")]
    band: (f64, f64),
    /// Omit the time records (most of the data).
    #[arg(long)]
    without_records: bool,
    /// Also write the time records of refused and dropped hits.
    #[arg(long, conflicts_with = "without_records")]
    all: bool,
}

impl What {
    /// Whether a record's samples are written.
    fn counts(&self, row: &RecordRow) -> bool {
        row.scans > 0 && (self.all || row.kept())
    }
}

/// Formats of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Form {
    /// Universal files with data sets 58b, 2411, 151 and 164.
    Uff58,
    /// NumPy archives.
    Npz,
    /// Comma-separated text.
    Csv,
    /// Columns for query engines.
    Parquet,
}

/// Formats with separate files for each cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Uff58,
    Npz,
    Csv,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Format::Uff58 => "uff",
            Format::Npz => "npz",
            Format::Csv => "csv",
        }
    }
}

/// An export with one file for each cell.
struct Files<'a> {
    what: &'a What,
    format: Format,
}

fn make_folder(folder: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(folder).map_err(|source| CliError::File {
        path: folder.into(),
        doing: "making the folder",
        source,
    })
}

fn bad(error: impl std::fmt::Display) -> CliError {
    CliError::Bad(error.to_string())
}

impl Export {
    pub fn run(self) -> Result<(), CliError> {
        let Some(format) = self.form()? else { return self.columns() };
        Files { what: &self.what, format }.write()
    }

    /// The format with one file per cell; `None` for the columnar format.
    fn form(&self) -> Result<Option<Format>, CliError> {
        let format = match self.format {
            Form::Uff58 => Format::Uff58,
            Form::Npz => Format::Npz,
            Form::Csv => Format::Csv,
            Form::Parquet => return Ok(None),
        };
        if self.si {
            return Err(CliError::Usage(
                "--si is for --format parquet: the other formats are in SI already".into(),
            ));
        }
        Ok(Some(format))
    }

    #[cfg(feature = "parquet")]
    fn columns(&self) -> Result<(), CliError> {
        columns::Columns { what: &self.what, si: self.si }.write()
    }

    #[cfg(not(feature = "parquet"))]
    fn columns(&self) -> Result<(), CliError> {
        let (how, file) = ("cargo install --path host --features parquet", self.what.file.display());
        Err(CliError::Usage(format!(
            "{file}: this jointrig was built without Parquet; build it with it: `{how}`"
        )))
    }
}

impl Files<'_> {
    fn write(&self) -> Result<(), CliError> {
        let What { file, out, without_records, .. } = self.what;
        let store = Store::open_read_only(file)?;
        let folders = ["geometry", "frf", "records"].map(|name| out.join(name));
        for folder in &folders[..if *without_records { 2 } else { 3 }] {
            make_folder(folder)?;
        }
        let plan = store.plan()?;
        let geometry = analyse::geometry(&plan);
        write_positions(&folders[0], &geometry, "Velocity").map_err(bad)?;
        let records = if *without_records { Records::default() } else { self.write_records(&store)? };
        let mut tables = tables::write(&store, out, &records.written)?;
        let WithFrfs { frfs, mut told, results } = analysed(&store, self.what.band)?;
        // each file is compressed on one core: write all in parallel, together with the report,
        // starting with the last, the assembly's, which is the largest
        let write = |(structure, frf): &(Structure, Frf)| -> Result<String, CliError> {
            let path = folders[1].join(structure.name()).with_extension(self.format.extension());
            self.write_frf(&path, frf, geometry.points(*structure))?;
            let (outputs, inputs, lines) = (frf.outputs().len(), frf.inputs().len(), frf.lines().len());
            Ok(format!("{}: {outputs} outputs, {inputs} inputs, {lines} lines", path.display()))
        };
        let all = || frfs.par_iter().rev().map(write).collect::<Result<Vec<String>, CliError>>();
        let (reported, frfs_told) = rayon::join(|| write_into(&results, out, &[]), all);
        reported?;
        told.extend(frfs_told?.into_iter().rev());
        let folder = out.join("levels");
        let levels = levels::write(&store, &folder, self.format, !without_records)?;
        if levels.count > 0 {
            tables.push("levels/levels.csv".into());
            told.push(format!("{}: {} levels of the shaker", folder.display(), levels.count));
        }
        let worn = out.join("wear.csv");
        let cycles = wear::write_csv(&store, &worn)?;
        if cycles > 0 {
            told.push(format!(
                "{}: {cycles} cycles of wear runs; `jointrig import` does not read them back",
                worn.display()
            ));
        }
        let exported = Exported {
            with_records: !without_records,
            records: records.places,
            levels: levels.channels,
            tables,
        };
        archive::write(&store, out, &exported)?;
        told.push(format!("geometry, results.json and report.html are in {}", out.display()));
        output::lines(told)
    }

    fn write_frf(&self, path: &Path, frf: &Frf, points: &Configuration) -> Result<(), CliError> {
        match self.format {
            Format::Npz => write_frf(path, frf, &[]).map_err(bad),
            Format::Uff58 => uff_output::write_frf(path, frf, points).map_err(bad),
            Format::Csv => tables_output::write_frf(path, frf).map_err(bad),
        }
    }
}

/// Analyses the file and returns its results, with the FRFs between two frequencies, Hz, of each
/// structure that has any.
pub(super) fn analysed(store: &Store, (low_hz, high_hz): (f64, f64)) -> Result<WithFrfs, CliError> {
    let waiting = Waiting::of("analysing");
    let progress = |progress: Progress| waiting.at(progress.done, progress.total);
    let mut found = report::analysed_with_frfs(store, Wanted::default(), &progress)?;
    if low_hz < LINES_HZ[0] || LINES_HZ[1] < high_hz {
        (found.frfs, found.told) = measured_anew(store, [low_hz, high_hz])?;
    }
    let mut measured: HashMap<Structure, Frf> = std::mem::take(&mut found.frfs).into_iter().collect();
    for structure in Structure::ALL {
        let frf = match measured.remove(&structure) {
            Some(frf) => Some(frf.into_band(low_hz, high_hz)),
            None => store.frf(structure.name())?.map(|found| imported(found.frf)),
        };
        found.frfs.extend(Some(structure).zip(frf));
    }
    if found.frfs.is_empty() {
        found.told.push("the file has no good hit yet: there are no FRFs to export".into());
    }
    Ok(found)
}

/// FRFs, and messages about records that cannot be used.
type Measured = (Vec<(Structure, Frf)>, Vec<String>);

/// FRFs at lines that the analysis does not form, computed from the records.
fn measured_anew(store: &Store, lines_hz: [f64; 2]) -> Result<Measured, CliError> {
    let file = CampaignFile::open(store, KnownContact::default())?;
    let (mut frfs, mut told) = (Vec::new(), Vec::new());
    for structure in Structure::ALL {
        let (measured, complaints) = file.measured(structure, lines_hz);
        told.extend(complaints);
        frfs.extend(measured.map(|(frf, _)| (structure, frf)));
    }
    Ok((frfs, told))
}

/// Imported FRFs; their coherence is unknown, and their variance may be.
fn imported(frf: Frf) -> Frf {
    let unknown =
        vec![DMatrix::from_element(frf.outputs().len(), frf.inputs().len(), f64::NAN); frf.lines().len()];
    let variance = frf.variance().map_or_else(|| unknown.clone(), <[_]>::to_vec);
    let whole = frf.with_variance(variance).and_then(|frf| frf.with_coherence(unknown));
    whole.expect("one of each was made for every value")
}

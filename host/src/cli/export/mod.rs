//! `export`: what a campaign file holds, in forms that other programs read.

mod levels;
mod records;
mod tables;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use nalgebra::DMatrix;

use super::analyse::analyse_into;
use super::error::CliError;
use super::{frf, output};
use crate::analyse::{self, CampaignFile, KnownContact, Wanted};
use crate::campaign::store::Store;
use crate::exchange::positions_output::write_positions;
use crate::exchange::{tables_output, uff_output, write_frf};
use crate::frf::Frf;
use crate::structure::Structure;
use crate::substructuring::geometry::Configuration;

/// Write everything that a campaign file holds for other programs.
///
/// DIR/geometry: csv tables in the form of the pyFBS workbook. DIR/frf: one file for each configuration, H1 of the good hits
/// with coherence and variance, or what was imported. DIR/records: one file for each cell with force and response of the hits that count
/// (--all: of every hit); DIR/channels: the same with all other channels. DIR/records.csv: every record with verdict, standing, when and why
/// it was overruled, and its place in these files; DIR/channels.csv and calibrations.csv: scales, delays, sensors. DIR/levels: one file for each
/// level of the shaker (velocities of both specimens and the load cells' sum, in step; npz as `jointrig hysteresis` reads it) and
/// levels.csv, which says what was ordered and reached. DIR/results.json and report.html.
#[derive(Debug, Args)]
pub struct Export {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Form of FRFs and records.
    #[arg(long, value_enum)]
    format: Format,
    /// Folder for all of it; made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Lines of the FRFs, Hz.
    #[arg(long, value_name = "LO:HI", value_parser = frf::band, default_value = "10:1000")]
    band: (f64, f64),
    /// Leave the time records out (they are the bulk).
    #[arg(long)]
    without_records: bool,
    /// Write the time records of refused and dropped hits too, not only of those that count.
    #[arg(long, conflicts_with = "without_records")]
    all: bool,
}

/// Forms of FRFs and records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Universal files with data sets 58b, 2411, 151 and 164.
    Uff58,
    /// numpy archives.
    Npz,
    /// Text with commas.
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

fn bad(error: impl std::fmt::Display) -> CliError {
    CliError::Bad(error.to_string())
}

impl Export {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let folders = ["geometry", "frf", "records"].map(|name| self.out.join(name));
        for folder in &folders[..if self.without_records { 2 } else { 3 }] {
            std::fs::create_dir_all(folder).map_err(|source| CliError::File {
                path: folder.clone(),
                doing: "making the folder",
                source,
            })?;
        }
        let plan = store.plan()?;
        let geometry = analyse::geometry(&plan);
        write_positions(&folders[0], &geometry, "Velocity").map_err(bad)?;
        let written = if self.without_records { Vec::new() } else { self.write_records(&store)? };
        tables::write(&store, &self.out, &written)?;
        let file = CampaignFile::open(&store, KnownContact::default())?;
        let mut told = Vec::new();
        for structure in Structure::ALL {
            let (name, points) = (structure.name(), geometry.points(structure));
            let (measured, complaints) = file.measured(structure, [self.band.0, self.band.1]);
            told.extend(complaints);
            let imported =
                if measured.is_none() { store.frf(name)?.map(|found| imported(found.frf)) } else { None };
            if let Some(measured) = measured.or(imported) {
                let path = folders[1].join(name).with_extension(self.format.extension());
                self.write_frf(&path, &measured, points)?;
                told.push(format!(
                    "{}: {} outputs, {} inputs, {} lines",
                    path.display(),
                    measured.outputs().len(),
                    measured.inputs().len(),
                    measured.lines().len()
                ));
            }
        }
        if told.is_empty() {
            told.push("no good hit is in the file yet: there are no FRFs to export".into());
        }
        let folder = self.out.join("levels");
        let levels = levels::write(&store, &folder, self.format, !self.without_records)?;
        if levels > 0 {
            told.push(format!("{}: {levels} levels of the shaker", folder.display()));
        }
        analyse_into(&store, Wanted::default(), &self.out, &[])?;
        told.push(format!("geometry, results.json and report.html are in {}", self.out.display()));
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

/// FRFs from elsewhere; their coherence is not known, and their variance need not be.
fn imported(frf: Frf) -> Frf {
    let unknown =
        vec![DMatrix::from_element(frf.outputs().len(), frf.inputs().len(), f64::NAN); frf.lines().len()];
    let variance = frf.variance().map_or_else(|| unknown.clone(), <[_]>::to_vec);
    let whole = frf.with_variance(variance).and_then(|frf| frf.with_coherence(unknown));
    whole.expect("one of each was made for every value")
}

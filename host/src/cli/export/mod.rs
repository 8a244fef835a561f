//! `export`: what a campaign file holds, in forms that other programs read.

mod levels;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use jointrig_protocol::channel::{Quantity, Role};
use nalgebra::DMatrix;

use super::analyse::analyse_into;
use super::error::CliError;
use super::waiting::Waiting;
use super::{frf, output};
use crate::analyse::{self, CampaignFile, KnownContact, Wanted};
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::record_row::RecordRow;
use crate::exchange::positions_output::write_positions;
use crate::exchange::{tables_output, uff_output, write_frf, write_impacts};
use crate::frf::Frf;
use crate::spectra::{ImpactRecords, MotionQuantity};
use crate::structure::Structure;
use crate::substructuring::geometry::Configuration;

/// Write everything that a campaign file holds for other programs.
///
/// DIR/geometry: csv tables in the form of the pyFBS workbook. DIR/frf: one file for each configuration, H1 of the good hits
/// with coherence and variance, or what was imported. DIR/records: one file for each cell with all its hits. DIR/levels: one file for each
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
        if !self.without_records {
            self.write_all_records(&store, &folders[2])?;
        }
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

    /// One file for each cell that was hit.
    fn write_all_records(&self, store: &Store, folder: &Path) -> Result<(), CliError> {
        let rows = store.records()?;
        let cells = store.cells()?;
        let waiting = Waiting::of("writing records, by cell");
        for (done, cell) in cells.iter().enumerate() {
            waiting.at(done, cells.len());
            let own: Vec<&RecordRow> =
                rows.iter().flatten().filter(|r| r.cell == cell.id && r.scans > 0).collect();
            let Some(records) = self.records(store, &own)? else { continue };
            let name = configuration_name(cell.cell.configuration);
            let stem = folder.join(format!("{name}_{}_{}", cell.cell.impact, cell.cell.response));
            self.write_records(&stem, &records, &cell.cell.response, &cell.cell.impact)?;
        }
        Ok(())
    }

    /// All records of a cell in SI, as they were measured; none when it has none.
    fn records(&self, store: &Store, rows: &[&RecordRow]) -> Result<Option<ImpactRecords>, CliError> {
        let mut out: Option<ImpactRecords> = None;
        for row in rows {
            let wrong =
                |what: &str| Err(CliError::Bad(format!("{}: record {} {what}", self.file.display(), row.id)));
            // scales belong to the session: one cell may have several
            let map = store.channels(row.session)?;
            let (Some(force), Some(axes)) = (map.place(Role::HammerForce), map.responses()) else {
                return wrong("has no hammer force or no response");
            };
            let fs_hz = f64::from(map.rate_hz);
            let quantity = match map.channels[axes[0]].quantity {
                Quantity::Displacement => MotionQuantity::Displacement,
                Quantity::Acceleration => MotionQuantity::Acceleration,
                _ => MotionQuantity::Velocity,
            };
            let records = out.get_or_insert_with(|| ImpactRecords {
                fs_hz,
                force_n: Vec::new(),
                response: Vec::new(),
                quantity,
            });
            if (records.fs_hz, records.quantity) != (fs_hz, quantity) {
                return wrong(
                    "has another sampling rate or quantity than those of its cell before it: export --without-records",
                );
            }
            let samples = store.samples(row)?;
            records.force_n.push(map.to_si(force, samples.channel(force)));
            records
                .response
                .push(axes.iter().map(|place| map.to_si(*place, samples.channel(*place))).collect());
        }
        Ok(out)
    }

    fn write_records(
        &self,
        stem: &Path,
        records: &ImpactRecords,
        response: &str,
        impact: &str,
    ) -> Result<(), CliError> {
        // a name may have dots: the extension is put behind it
        let path = PathBuf::from(format!("{}.{}", stem.display(), self.format.extension()));
        match self.format {
            Format::Npz => write_impacts(&path, records).map_err(bad),
            Format::Uff58 => uff_output::write_records(&path, records, response, impact).map_err(bad),
            Format::Csv => tables_output::write_records(&path, records).map_err(bad),
        }
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

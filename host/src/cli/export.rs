//! `export`: what a campaign file holds, in forms that other programs read.

mod levels;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use jointrig_protocol::channel::{Quantity, Role};
use nalgebra::DMatrix;
use num_complex::Complex;

use super::analyse::analyse_into;
use super::error::CliError;
use super::{frf, output};
use crate::analyse::{self, Wanted};
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::frf_table::ImportedFrf;
use crate::campaign::store::record_row::RecordRow;
use crate::device::channels::ChannelMap;
use crate::exchange::npz::Array;
use crate::exchange::positions_output::write_positions;
use crate::exchange::{Extra, tables_output, uff_output, write_frf, write_impacts};
use crate::spectra::{AveragedFrf, FrfSettings, ImpactRecords, MotionQuantity, Windowing, estimate};
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::Configuration;

/// Samples before the trigger that the FRFs use, s: the force window begins 1 ms before the pulse.
const LEAD_S: f64 = 1.25e-3;

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

/// One cell's records as they were measured.
struct CellRecords {
    records: ImpactRecords,
    delay_s: Vec<f64>,
    trigger: Vec<usize>,
    kept: Vec<bool>,
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
        let mut told = Vec::new();
        let rows = store.records()?;
        for (name, points) in [("A", &geometry.a), ("B", &geometry.b), ("AJB", &geometry.ajb)] {
            let mut matrix: Option<Matrix> = None;
            for cell in store.cells()?.iter().filter(|c| configuration_name(c.cell.configuration) == name) {
                let of_cell: Vec<&RecordRow> =
                    rows.iter().flatten().filter(|r| r.cell == cell.id && r.scans > 0).collect();
                let Some(records) = self.cell(&store, &of_cell)? else { continue };
                if !self.without_records {
                    let stem = format!("{name}_{}_{}", cell.cell.impact, cell.cell.response);
                    self.write_records(
                        &folders[2].join(stem),
                        &records.records,
                        &cell.cell.response,
                        &cell.cell.impact,
                    )?;
                }
                if let Some(y) =
                    self.average(&records, plan.window.exponential_per_s, plan.record.get_ref().length_s)?
                {
                    let matrix =
                        matrix.get_or_insert_with(|| Matrix::new(points, &y, records.records.quantity));
                    matrix.put(points, &cell.cell.impact, &cell.cell.response, &y).map_err(|reason| {
                        CliError::Bad(format!(
                            "{}: cell {name} {}: {reason}",
                            self.file.display(),
                            cell.cell.impact
                        ))
                    })?;
                }
            }
            if matrix.is_none() {
                matrix = store.frf(name)?.map(Matrix::imported);
            }
            if let Some(matrix) = matrix {
                let path = folders[1].join(name).with_extension(self.format.extension());
                self.write_frf(&path, &matrix, points)?;
                told.push(format!(
                    "{}: {} outputs, {} inputs, {} lines",
                    path.display(),
                    matrix.frf.outputs.len(),
                    matrix.frf.inputs.len(),
                    matrix.frf.lines.len()
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
        analyse_into(&store, Wanted::default(), &self.out)?;
        told.push(format!("geometry, results.json and report.html are in {}", self.out.display()));
        output::lines(told)
    }

    /// All records of a cell in SI; none when it has none with the three axes.
    fn cell(&self, store: &Store, rows: &[&RecordRow]) -> Result<Option<CellRecords>, CliError> {
        let Some(first) = rows.first() else { return Ok(None) };
        let map = store.channels(first.session)?;
        let (Some(force), Some(axes)) = (map.place(Role::HammerForce), map.responses()) else {
            return Err(CliError::Bad(format!(
                "{}: record {} has no hammer force or not all of x, y, z",
                self.file.display(),
                first.id
            )));
        };
        let quantity = match map.channels[axes[0]].quantity {
            Quantity::Displacement => MotionQuantity::Displacement,
            Quantity::Acceleration => MotionQuantity::Acceleration,
            _ => MotionQuantity::Velocity,
        };
        let delay = |map: &ChannelMap, place: usize| f64::from(map.channels[place].delay_ns) * 1e-9;
        let mut out = CellRecords {
            records: ImpactRecords {
                fs_hz: f64::from(map.rate_hz),
                force_n: Vec::new(),
                response: Vec::new(),
                quantity,
            },
            delay_s: axes.map(|place| delay(&map, place) - delay(&map, force)).to_vec(),
            trigger: Vec::new(),
            kept: Vec::new(),
        };
        for row in rows {
            // scales belong to the session, lengths to the plan: one cell may have several sessions
            let map = store.channels(row.session)?;
            let samples = store.samples(row)?;
            out.records.force_n.push(map.to_si(force, samples.channel(force)));
            out.records.response.push(axes.map(|place| map.to_si(place, samples.channel(place))).to_vec());
            out.trigger.push(row.trigger_index);
            out.kept.push(row.kept());
        }
        Ok(Some(out))
    }

    /// FRFs of a cell's good hits, cut as the analysis cuts them; none without a good hit.
    fn average(
        &self,
        cell: &CellRecords,
        sigma_per_s: f64,
        length_s: f64,
    ) -> Result<Option<AveragedFrf>, CliError> {
        let fs_hz = cell.records.fs_hz;
        let (lead, length) = ((LEAD_S * fs_hz).round() as usize, (length_s * fs_hz).round() as usize);
        let mut cut = ImpactRecords { force_n: Vec::new(), response: Vec::new(), ..cell.records.clone() };
        for hit in (0..cell.kept.len()).filter(|hit| cell.kept[*hit]) {
            let from = cell.trigger[hit].saturating_sub(lead);
            let part = |x: &Vec<f64>| x[from.min(x.len())..(from + length).min(x.len())].to_vec();
            cut.force_n.push(part(&cell.records.force_n[hit]));
            cut.response.push(cell.records.response[hit].iter().map(part).collect());
        }
        if cut.force_n.is_empty() {
            return Ok(None);
        }
        let settings = FrfSettings {
            windowing: Windowing { sigma_per_s, ..Windowing::default() },
            delay_s: cell.delay_s.clone(),
            transform_samples: Some(length.max(cut.force_n[0].len())),
            ..FrfSettings::default()
        };
        let y = estimate(&cut, &vec![true; cut.force_n.len()], &settings)
            .map_err(|e| CliError::Bad(format!("{}: {e}", self.file.display())))?;
        Ok(Some(y.band(self.band.0, self.band.1)))
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

    fn write_frf(&self, path: &Path, m: &Matrix, points: &Configuration) -> Result<(), CliError> {
        let shape = vec![m.frf.lines.len(), m.frf.outputs.len(), m.frf.inputs.len()];
        let extra = |name: &str, values: &[f64]| {
            Extra::Real(name.into(), Array { shape: shape.clone(), values: values.to_vec() })
        };
        match self.format {
            Format::Npz => {
                let extras = [extra("coherence", &m.coherence), extra("variance", &m.variance)];
                write_frf(path, &m.frf, &extras).map_err(bad)
            }
            Format::Uff58 => uff_output::write_frf(path, &m.frf, &m.coherence, points).map_err(bad),
            Format::Csv => tables_output::write_frf(path, &m.frf, &m.coherence).map_err(bad),
        }
    }
}

/// The FRFs of a configuration; pairs that were not measured hold NaN. Coherence and variance are (line, output, input), in C order.
struct Matrix {
    frf: FrfMatrix,
    coherence: Vec<f64>,
    variance: Vec<f64>,
}

impl Matrix {
    fn new(points: &Configuration, y: &AveragedFrf, quantity: MotionQuantity) -> Self {
        let (outputs, inputs) = (points.output_names(), points.input_names());
        let hole = Complex::new(f64::NAN, f64::NAN);
        let entries = y.frequency_hz.len() * outputs.len() * inputs.len();
        Matrix {
            coherence: vec![f64::NAN; entries],
            variance: vec![f64::NAN; entries],
            frf: FrfMatrix {
                frequency_hz: y.frequency_hz.clone(),
                sigma_per_s: y.sigma_per_s,
                quantity: quantity.frf(),
                lines: vec![DMatrix::from_element(outputs.len(), inputs.len(), hole); y.frequency_hz.len()],
                outputs,
                inputs,
            },
        }
    }

    /// FRFs from elsewhere; their coherence is not known.
    fn imported(imported: ImportedFrf) -> Self {
        let ImportedFrf { frf, noise, .. } = imported;
        let entries = frf.lines.len() * frf.outputs.len() * frf.inputs.len();
        // C order is the transpose's columns
        let variance =
            noise.map(|n| n.variance.iter().flat_map(|v| v.transpose().data.as_vec().clone()).collect());
        Matrix {
            coherence: vec![f64::NAN; entries],
            variance: variance.unwrap_or_else(|| vec![f64::NAN; entries]),
            frf,
        }
    }

    fn put(
        &mut self,
        points: &Configuration,
        impact: &str,
        response: &str,
        y: &AveragedFrf,
    ) -> Result<(), String> {
        if y.frequency_hz != self.frf.frequency_hz {
            return Err("its lines differ from those of the other cells (another sampling rate?)".into());
        }
        let Some(column) = points.impacts.iter().position(|p| p.name == impact) else { return Ok(()) };
        // the plan's responses are measured along x, y and z, in this order
        let rows = points.channels.iter().enumerate().filter(|(_, p)| p.name == response).map(|(row, _)| row);
        for (axis, row) in rows.enumerate().take(3) {
            for (line, matrix) in self.frf.lines.iter_mut().enumerate() {
                matrix[(row, column)] = y.h1[line][axis];
                let at = (line * self.frf.outputs.len() + row) * self.frf.inputs.len() + column;
                self.coherence[at] = y.coherence[line][axis];
                self.variance[at] = y.variance[line][axis];
            }
        }
        Ok(())
    }
}

//! Exports the impact records: for each cell one file with force and response and one with its
//! other channels, and a table of all records.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use jointrig_protocol::channel::{Quantity, Role};

use super::{Files, Format, bad, make_folder};
use crate::campaign::archive::Place;
use crate::campaign::plan::{Plan, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::record_table::RecordRow;
use crate::campaign::store::rows::places;
use crate::cli::error::CliError;
use crate::cli::output::Waiting;
use crate::exchange::channel_records::{self, ChannelRecords};
use crate::exchange::{tables_output, uff_output, write_impacts};
use crate::spectra::{ImpactRecords, MotionQuantity};
use crate::untrusted_text::file_name;

/// The records that were written: their place in the tables, and in the archive.
#[derive(Default)]
pub(super) struct Records {
    pub(super) written: Vec<Written>,
    pub(super) places: HashMap<i64, Place>,
}

/// Place of a record in its cell's file.
pub(super) struct Written {
    pub(super) record: i64,
    pub(super) file: String,
    /// Index of the hit in the file, from 0.
    pub(super) hit: usize,
}

/// Force and response of a cell's hits, and the other channels.
struct OfCell {
    impacts: ImpactRecords,
    /// Those of the hits struck for this cell; `None` if they have none.
    others: Option<ChannelRecords>,
    /// Indices of force and responses among the channels of each hit.
    places: Vec<Vec<usize>>,
}

impl Files<'_> {
    /// Writes one file for each cell that has hits to be written; returns the place of each record.
    pub(super) fn write_records(&self, store: &Store) -> Result<Records, CliError> {
        let [folder, others] = ["records", "channels"].map(|name| self.what.out.join(name));
        let (rows, cells, shared) = (store.records()?, store.cells()?, store.rows()?);
        let plan = store.plan()?;
        let waiting = Waiting::of("writing records, by cell");
        let mut all = Records::default();
        for (done, cell) in cells.iter().enumerate() {
            waiting.at(done, cells.len());
            let struck = [Some(cell.id), shared.lead(cell.id)];
            let own: Vec<&RecordRow> = (rows.iter().flatten())
                .filter(|row| struck.contains(&Some(row.cell)) && self.what.counts(row))
                .collect();
            let Some(of_cell) = self.of_cell(store, &plan, cell, &own)? else { continue };
            // names may contain dots: append the extension instead of replacing one
            let name = format!("{}.{}", stem(cell), self.format.extension());
            self.write_impacts(&folder.join(&name), &of_cell.impacts, cell)?;
            let beside = of_cell.others.as_ref();
            if let Some(channels) = beside {
                self.write_others(&others, &name, channels)?;
            }
            for ((hit, row), channels) in own.iter().enumerate().zip(of_cell.places) {
                if row.cell != cell.id {
                    continue;
                }
                let file = format!("records/{name}");
                all.written.push(Written { record: row.id, file: file.clone(), hit });
                let others = beside.map(|_| format!("channels/{name}"));
                all.places.insert(row.id, Place { file, hit, channels, others });
            }
        }
        Ok(all)
    }

    /// All records of a cell in SI units; `None` if it has none.
    fn of_cell(
        &self,
        store: &Store,
        plan: &Plan,
        cell: &CellRow,
        rows: &[&RecordRow],
    ) -> Result<Option<OfCell>, CliError> {
        let mut out: Option<OfCell> = None;
        let id = cell.id;
        for row in rows {
            let wrong = |what: &str| {
                Err(CliError::Bad(format!("{}: record {} {what}", self.what.file.display(), row.id)))
            };
            // scales belong to the session, and one cell may have several
            let map = store.channels(row.session)?;
            let axes = places(plan, cell, row, &map);
            let (Some(force), Some(axes)) = (map.place(Role::HammerForce), axes) else {
                return wrong("has no hammer force or no response");
            };
            let fs_hz = map.fs_hz();
            let quantity = match map.channels[axes[0]].quantity {
                Quantity::Displacement => MotionQuantity::Displacement,
                Quantity::Acceleration => MotionQuantity::Acceleration,
                _ => MotionQuantity::Velocity,
            };
            let further: Vec<usize> =
                (0..map.len()).filter(|place| *place != force && !axes.contains(place)).collect();
            let names: Vec<String> = further.iter().map(|p| map.channels[*p].name.to_string()).collect();
            let quantities: Vec<Quantity> = further.iter().map(|p| map.channels[*p].quantity).collect();
            let cell = out.get_or_insert_with(|| OfCell {
                impacts: ImpactRecords { fs_hz, force_n: Vec::new(), response: Vec::new(), quantity },
                others: None,
                places: Vec::new(),
            });
            // of the hits of another cell that fill this one, that cell's file has the others
            let own = row.cell == id && !names.is_empty();
            if own && cell.others.is_none() {
                cell.others = Some(ChannelRecords {
                    fs_hz,
                    names: names.clone(),
                    quantities: quantities.clone(),
                    delay_s: Vec::new(),
                    records: Vec::new(),
                    signals: Vec::new(),
                });
            }
            let same = row.cell != id
                || cell
                    .others
                    .as_ref()
                    .map_or(names.is_empty(), |all| (&all.names, &all.quantities) == (&names, &quantities));
            if (cell.impacts.fs_hz, cell.impacts.quantity) != (fs_hz, quantity) || !same {
                return wrong(
                    "differs from the earlier records of its cell in sampling rate, quantity or channels: export --without-records",
                );
            }
            let samples = store.samples(row)?;
            let si = |place: &usize| map.to_si(*place, samples.channel(*place));
            cell.impacts.force_n.push(si(&force));
            cell.impacts.response.push(axes.iter().map(si).collect());
            cell.places.push(std::iter::once(force).chain(axes.iter().copied()).collect());
            if let Some(all) = cell.others.as_mut().filter(|_| own) {
                let late = |place: &usize| f64::from(map.channels[*place].delay_ns) * 1e-9;
                all.delay_s.push(further.iter().map(late).collect());
                all.records.push(row.id);
                all.signals.push(further.iter().map(si).collect());
            }
        }
        Ok(out)
    }

    fn write_impacts(&self, path: &Path, records: &ImpactRecords, cell: &CellRow) -> Result<(), CliError> {
        let (impact, response) = (&cell.cell.impact, &cell.cell.response);
        match self.format {
            Format::Npz => write_impacts(path, records).map_err(bad),
            Format::Uff58 => uff_output::write_records(path, records, response, impact).map_err(bad),
            Format::Csv => tables_output::write_records(path, records).map_err(bad),
        }
    }

    fn write_others(&self, folder: &Path, name: &str, all: &ChannelRecords) -> Result<(), CliError> {
        make_folder(folder)?;
        let path: PathBuf = folder.join(name);
        write_channels(&path, self.format, all)
    }
}

/// Writes channels in SI units.
pub(super) fn write_channels(path: &Path, format: Format, all: &ChannelRecords) -> Result<(), CliError> {
    match format {
        Format::Npz => channel_records::write_npz(path, all).map_err(bad),
        Format::Uff58 => channel_records::write_uff_file(path, all).map_err(bad),
        Format::Csv => channel_records::write_csv(path, all).map_err(bad),
    }
}

fn stem(cell: &CellRow) -> String {
    let name = configuration_name(cell.cell.configuration);
    file_name(&format!("{name}_{}_{}", cell.cell.impact, cell.cell.response))
}

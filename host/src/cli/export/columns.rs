//! The campaign in columnar form for query engines: a Parquet file for each table, and samples in
//! files of 64 records.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use jointrig_protocol::channel::Channel;
use rayon::prelude::*;
use serde_json::json;

use super::analysed;
use super::records::Written as Place;
use super::{What, bad, estimates, levels, make_folder, tables, wear};
use crate::analyse;
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::record_table::RecordRow;
use crate::cli::analyse::write_into;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::output::Waiting;
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelView, SampleType};
use crate::exchange::parquet::{ParquetFile, Stored, Values, Written, write_table};
use crate::exchange::tables_output::loop_signals;
use crate::exchange::tables_output::write_positions;
use crate::exchange::typed_table::{Kind, Table};
use crate::frf::Frf;
use crate::report;
use crate::report::WithFrfs;
use crate::structure::Structure;

/// Records in a file of samples: a few hundred megabytes, one row group per record.
const RECORDS_A_FILE: usize = 64;

/// Version of this layout.
const LAYOUT: u32 = 1;

/// Columns of `frf.parquet`: one row for each line of each measured FRF.
const FRF: [(&str, Stored); 10] = [
    ("configuration", Stored::Of(Kind::Text)),
    ("output", Stored::Of(Kind::Text)),
    ("input", Stored::Of(Kind::Text)),
    ("quantity", Stored::Of(Kind::Text)),
    ("sigma_per_s", Stored::Of(Kind::Real)),
    ("frequency_hz", Stored::Of(Kind::Real)),
    ("re", Stored::Of(Kind::Real)),
    ("im", Stored::Of(Kind::Real)),
    ("coherence", Stored::Of(Kind::Real)),
    ("variance", Stored::Of(Kind::Real)),
];

/// A columnar export.
pub(super) struct Columns<'a> {
    pub(super) what: &'a What,
    /// Whether samples are written in SI.
    pub(super) si: bool,
}

/// Name and type of each channel.
type TypedChannels<'a> = Vec<(&'a str, SampleType)>;

/// Records that share a file.
struct RecordPart<'a> {
    /// Path relative to the export's folder.
    file: String,
    configuration: &'static str,
    channels: TypedChannels<'a>,
    records: Vec<Sampled<'a>>,
}

/// A record, and its channels.
#[derive(Clone, Copy)]
struct Sampled<'a> {
    row: &'a RecordRow,
    map: &'a ChannelMap,
}

impl Columns<'_> {
    pub(super) fn write(&self) -> Result<(), CliError> {
        let What { file, out, without_records, .. } = self.what;
        let store = Store::open_read_only(file)?;
        for name in ["campaign.json", "samples"] {
            if out.join(name).exists() {
                let there = out.join(name);
                let what = format!(
                    "{}: this folder contains an export already; remove it, or name another folder",
                    there.display()
                );
                return Err(CliError::Bad(what));
            }
        }
        make_folder(out)?;
        let geometry = analyse::geometry(&store.plan()?);
        make_folder(&out.join("geometry"))?;
        write_positions(&out.join("geometry"), &geometry, "Velocity").map_err(bad)?;
        let mut files: BTreeMap<String, Written> = BTreeMap::new();
        let rows: Vec<RecordRow> = store.records()?.into_iter().flatten().collect();
        let mut maps: BTreeMap<i64, ChannelMap> = BTreeMap::new();
        for (session, _) in store.sessions()? {
            maps.insert(session, store.channels(session)?);
        }
        let parts = if *without_records { Vec::new() } else { self.parts(&store, &rows, &maps)? };
        files.extend(self.write_samples(&parts)?);
        let places = parts.iter().flat_map(|part| {
            let place =
                |(hit, one): (usize, &Sampled)| Place { record: one.row.id, file: part.file.clone(), hit };
            part.records.iter().enumerate().map(place).collect::<Vec<_>>()
        });
        let levels = self.write_levels(&store, &mut files)?;
        let WithFrfs { frfs, mut told, results } = analysed(&store, self.what.band)?;
        files.insert("frf.parquet".into(), write_frfs(&out.join("frf.parquet"), &frfs)?);
        write_into(&results, out, &[])?;
        let tables = [
            ("records.parquet", tables::records(&store, &places.collect::<Vec<_>>())?),
            ("cells.parquet", tables::cells(&store)?),
            ("channels.parquet", tables::channels(&store)?),
            ("calibrations.parquet", tables::calibrations(&store)?),
            ("edges.parquet", tables::edges(&store)?),
            ("overrules.parquet", tables::overrules(&store)?),
            ("levels.parquet", levels),
            ("estimates.parquet", estimates::table(&results)),
        ];
        for (name, table) in tables {
            files.insert(name.into(), write_table(&out.join(name), &table, &[]).map_err(bad)?);
        }
        if let Some(cycles) = wear::write_parquet(&store, &out.join("wear.parquet"))? {
            files.insert("wear.parquet".into(), cycles);
        }
        self.write_campaign(&store, &files)?;
        let bytes: u64 = files.values().map(|file| file.bytes).sum();
        told.push(format!("{}: {} files, {:.1} MB", out.display(), files.len(), bytes as f64 / 1e6));
        told.push(format!("geometry, results.json and report.html are in {}", out.display()));
        output::lines(told)
    }

    /// Groups the records that share a file: one configuration, same channels of the same types, in
    /// the order of measurement.
    fn parts<'r>(
        &self,
        store: &Store,
        rows: &'r [RecordRow],
        maps: &'r BTreeMap<i64, ChannelMap>,
    ) -> Result<Vec<RecordPart<'r>>, CliError> {
        let cells: BTreeMap<i64, Cell> = store.cells()?.into_iter().map(|row| (row.id, row.cell)).collect();
        let mut together: BTreeMap<(&'static str, TypedChannels<'_>), Vec<Sampled<'_>>> = BTreeMap::new();
        for row in rows.iter().filter(|row| self.what.counts(row)) {
            // foreign keys of the file guarantee that both exist
            let (Some(cell), Some(map)) = (cells.get(&row.cell), maps.get(&row.session)) else { continue };
            let of_channel = |(place, channel): (usize, &'r Channel)| {
                (channel.name.as_str(), row.sample_types.channel(place))
            };
            let channels = map.channels.iter().enumerate().map(of_channel).collect();
            let of = (configuration_name(cell.configuration), channels);
            together.entry(of).or_default().push(Sampled { row, map });
        }
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        let mut parts = Vec::new();
        for ((configuration, channels), records) in together {
            for records in records.chunks(RECORDS_A_FILE) {
                let number = count.entry(configuration).or_default();
                let file = format!("samples/configuration={configuration}/part-{number:04}.parquet");
                parts.push(RecordPart {
                    file,
                    configuration,
                    channels: channels.clone(),
                    records: records.to_vec(),
                });
                *number += 1;
            }
        }
        Ok(parts)
    }

    fn write_samples(&self, parts: &[RecordPart<'_>]) -> Result<Vec<(String, Written)>, CliError> {
        for part in parts {
            make_folder(&self.what.out.join(format!("samples/configuration={}", part.configuration)))?;
        }
        let (waiting, done) = (Waiting::of("writing samples, by record"), AtomicUsize::new(0));
        let all = parts.iter().map(|part| part.records.len()).sum();
        let tell = || waiting.at(done.fetch_add(1, Ordering::Relaxed) + 1, all);
        let one = |part: &RecordPart<'_>| Ok((part.file.clone(), self.write_part(part, &tell)?));
        parts.par_iter().map(one).collect()
    }

    fn write_part(&self, part: &RecordPart<'_>, tell: &dyn Fn()) -> Result<Written, CliError> {
        // connections cannot be shared between threads
        let store = Store::open_read_only(&self.what.file)?;
        let stored_as = |of: SampleType| {
            match of {
                SampleType::I16 if !self.si => Stored::Code,
                SampleType::I32 if !self.si => Stored::Wide,
                SampleType::I16 | SampleType::F32 => Stored::Single,
                // single precision would round these
                SampleType::I32 | SampleType::F64 => Stored::Double,
            }
        };
        let mut columns = vec![("record", Stored::Id), ("scan", Stored::Index)];
        columns.extend(part.channels.iter().map(|(name, of)| (*name, stored_as(*of))));
        let notes = [("jointrig.channels", scales(part).to_string())];
        let mut file = ParquetFile::create(&self.what.out.join(&part.file), &columns, &notes).map_err(bad)?;
        for Sampled { row, map } in &part.records {
            let samples = store.samples(row)?;
            let scans = i32::try_from(row.scans).map_err(|_| too_long(row))?;
            let mut values = vec![Values::Id(vec![row.id; row.scans]), Values::Whole((0..scans).collect())];
            for place in 0..part.channels.len() {
                let own = samples.channel(place);
                let si = || map.to_si(place, own);
                values.push(match own {
                    ChannelView::I16(codes) if !self.si => {
                        Values::Whole(codes.iter().map(|code| i32::from(*code)).collect())
                    }
                    ChannelView::I32(codes) if !self.si => Values::Whole(codes.to_vec()),
                    ChannelView::F32(values) if !self.si => Values::Single(values.to_vec()),
                    ChannelView::F64(values) if !self.si => Values::Double(values.to_vec()),
                    ChannelView::I16(_) | ChannelView::F32(_) => {
                        Values::Single(si().into_iter().map(|value| value as f32).collect())
                    }
                    ChannelView::I32(_) | ChannelView::F64(_) => Values::Double(si()),
                });
            }
            file.write(&values).map_err(bad)?;
            tell();
        }
        file.finish().map_err(bad)
    }

    /// The table of the shaker's levels; the samples of each complete level are written to a
    /// separate file.
    fn write_levels(&self, store: &Store, files: &mut BTreeMap<String, Written>) -> Result<Table, CliError> {
        levels::table(store, |row| {
            if self.what.without_records || !row.whole() {
                return Ok(None);
            }
            make_folder(&self.what.out.join("levels"))?;
            let name = format!("levels/level_{}.parquet", row.id);
            let record = levels::record(store, row)?;
            let time_s: Vec<f64> = (0..record.force_n.len()).map(|i| i as f64 / record.fs_hz).collect();
            let signals = loop_signals(&record);
            let all = || std::iter::once(("time_s", &time_s[..])).chain(signals);
            let columns: Vec<(&str, Stored)> =
                all().map(|(name, _)| (name, Stored::Of(Kind::Real))).collect();
            let values: Vec<Values> = all().map(|(_, signal)| known(signal)).collect();
            let mut file = ParquetFile::create(&self.what.out.join(&name), &columns, &[]).map_err(bad)?;
            file.write(&values).map_err(bad)?;
            files.insert(name.clone(), file.finish().map_err(bad)?);
            Ok(Some(name))
        })
    }

    /// Description of the folder, written last: if it is missing, the export did not finish.
    fn write_campaign(&self, store: &Store, files: &BTreeMap<String, Written>) -> Result<(), CliError> {
        let (plan, source) = store.plan_text()?;
        let sessions: Vec<_> = store
            .sessions()?
            .into_iter()
            .map(|(id, info)| {
                json!({
                    "session": id, "address": info.address, "board": info.board, "serial": info.serial,
                    "firmware_version": info.firmware_version,
                })
            })
            .collect();
        let files: serde_json::Map<_, _> = files
            .iter()
            .map(|(name, file)| {
                (name.clone(), json!({ "rows": file.rows, "bytes": file.bytes, "sha256": file.sha256 }))
            })
            .collect();
        let document = json!({
            "layout": LAYOUT,
            "jointrig": env!("CARGO_PKG_VERSION"),
            "campaign": self.what.file.file_name().unwrap_or_default().to_string_lossy(),
            "samples": if self.si { "si" } else { "codes" },
            "plan": { "text": plan, "source": source },
            "sessions": sessions,
            "files": files,
        });
        let path = self.what.out.join("campaign.json");
        let written = serde_json::to_string_pretty(&document)
            .map_err(std::io::Error::other)
            .and_then(|text| report::write_whole(&path, (text + "\n").as_bytes()));
        written.map_err(|source| CliError::File { path, doing: "writing what the folder holds", source })
    }
}

fn too_long(row: &RecordRow) -> CliError {
    CliError::Bad(format!("record {} has {} samples, more than can be counted in 32 bits", row.id, row.scans))
}

/// Data needed to convert samples: SI value = sample × units_per_code, by session.
fn scales(part: &RecordPart<'_>) -> serde_json::Value {
    let maps: BTreeMap<i64, &ChannelMap> =
        part.records.iter().map(|one| (one.row.session, one.map)).collect();
    let of_session = |(session, map): (i64, &ChannelMap)| {
        let channels: Vec<_> = map
            .channels
            .iter()
            .zip(&part.channels)
            .map(|(channel, (_, of))| {
                json!({
                    "channel": channel.name.as_str(), "unit": channel.quantity.unit(), "sample_type": of.name(),
                    "units_per_code": of.units(channel), "delay_s": f64::from(channel.delay_ns) * 1e-9,
                })
            })
            .collect();
        let rate_hz = map.exact_hz.map_or(json!(map.rate_hz), |rate| json!(rate));
        json!({ "session": session, "rate_hz": rate_hz, "channels": channels })
    };
    maps.into_iter().map(of_session).collect()
}

fn known(all: &[f64]) -> Values {
    Values::MaybeReal(all.iter().map(|value| (!value.is_nan()).then_some(*value)).collect())
}

/// One row for each line of each FRF, one row group for each impact; unmeasured FRFs are left out.
fn write_frfs(path: &Path, frfs: &[(Structure, Frf)]) -> Result<Written, CliError> {
    let mut file = ParquetFile::create(path, &FRF, &[]).map_err(bad)?;
    for (structure, frf) in frfs {
        for input in 0..frf.inputs().len() {
            let measured: Vec<(usize, usize)> = (0..frf.outputs().len())
                .flat_map(|output| (0..frf.lines().len()).map(move |line| (output, line)))
                .filter(|(output, line)| frf.lines()[*line][(*output, input)].re.is_finite())
                .collect();
            if measured.is_empty() {
                continue;
            }
            let text = |of: &dyn Fn(usize) -> String| {
                Values::MaybeText(measured.iter().map(|(output, _)| Some(of(*output))).collect())
            };
            let real = |of: &dyn Fn(usize, usize) -> f64| {
                known(&measured.iter().map(|(output, line)| of(*output, *line)).collect::<Vec<_>>())
            };
            let beside = |all: Option<&[nalgebra::DMatrix<f64>]>, output: usize, line: usize| {
                all.map_or(f64::NAN, |all| all[line][(output, input)])
            };
            file.write(&[
                text(&|_| structure.name().into()),
                text(&|output| frf.outputs()[output].clone()),
                text(&|_| frf.inputs()[input].clone()),
                text(&|_| frf.quantity().frf_name().into()),
                real(&|_, _| frf.sigma_per_s()),
                real(&|_, line| frf.frequency_hz()[line]),
                real(&|output, line| frf.lines()[line][(output, input)].re),
                real(&|output, line| frf.lines()[line][(output, input)].im),
                real(&|output, line| beside(frf.coherence(), output, line)),
                real(&|output, line| beside(frf.variance(), output, line)),
            ])
            .map_err(bad)?;
        }
    }
    file.finish().map_err(bad)
}

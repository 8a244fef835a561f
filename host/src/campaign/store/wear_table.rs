//! Wear runs in the campaign file: every cycle, in blocks, and raw loops of some of them.
//!
//! A block is the unit of commit: all its cycles, the raw loops kept from it, and their seals are
//! written in one transaction. A cycle exists when its block is committed. The first cycle of a
//! block follows the last one of the block before; any other is refused, so that no cycle can be
//! counted twice.
//!
//! The tables are created with the first block. Of a block, `cycles` holds 21 bytes for each cycle,
//! column after column, little-endian: stiffness (N/m), μN (N), energy (J), amplitude (m) and
//! normal load (N), each as f32 with NaN where there is none, and a byte that is 1 for a measured
//! cycle, 0 for one of which samples were lost or at an end of a channel's range.

use std::fmt;
use std::ops::Range;

use super::Store;
use super::codec::{self, CodecError};
use super::error::StoreError;
use super::notes::utc_now;
use super::row_seal;
use super::stored::SampleTypes;
use super::table::{Row, create, insert, stay, table};
use crate::device::samples::Samples;
use crate::hysteresis::wear::CycleReading;
use rusqlite::{Connection, OptionalExtension};

table! {
    /// A stored block without its cycles: the columns that the seal covers.
    #[derive(Clone, Debug, PartialEq)]
    pub struct WearBlockRow {
        "wear_blocks" {
            /// Its id.
            id: i64 = "id INTEGER PRIMARY KEY",
            /// The session, whose channels define the scales.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// When it was stored, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// Frequency of the cycles, Hz.
            frequency_hz: f64 = "frequency_hz REAL NOT NULL",
            /// Ordered amplitude of Δx, m.
            ordered_m: f64 = "ordered_m REAL NOT NULL",
            /// The drive's amplitude at the end of the block, V.
            drive_v: f64 = "drive_v REAL NOT NULL",
            /// Temperature of the specimen at its end, °C; `None` without a sensor.
            celsius: Option<f64> = "celsius REAL",
            /// Epoch of the stream.
            epoch: u32 = "epoch INTEGER NOT NULL",
            /// Where the first cycle begins, in scans of the stream.
            begin_scan: f64 = "begin_scan REAL NOT NULL",
            /// Length of a cycle, scans.
            period_scans: f64 = "period_scans REAL NOT NULL",
            /// Cycles before this block since the first wear run of the file.
            cycles_before: u64 = "cycles_before INTEGER NOT NULL UNIQUE",
            /// Cycles of this block.
            count: u64 = "count INTEGER NOT NULL",
            /// Those of them of which samples were lost or at an end of a channel's range. They
            /// count with the energy of the cycle before.
            unmeasured: u64 = "unmeasured INTEGER NOT NULL",
            /// Energy dissipated before this block since the first wear run of the file, J.
            energy_before_j: f64 = "energy_before_j REAL NOT NULL",
            /// Energy dissipated in this block, J.
            energy_j: f64 = "energy_j REAL NOT NULL",
            /// CRC-32 of the bytes that hold the cycles.
            bytes_crc: u32 = "bytes_crc32 INTEGER NOT NULL",
            "seal INTEGER NOT NULL",
            "cycles BLOB NOT NULL",
        }
    }
}

table! {
    /// A raw loop without its samples.
    #[derive(Clone, Debug, PartialEq)]
    pub struct WearLoopRow {
        "wear_loops" {
            /// Its id.
            id: i64 = "id INTEGER PRIMARY KEY",
            /// The session, whose channels define the scales.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// Number of its cycle since the first wear run of the file, from 1.
            cycle: u64 = "cycle INTEGER NOT NULL",
            /// Why it was kept: `spaced`, `begin`, `end` or `change`.
            why: String = "why TEXT NOT NULL",
            /// Energy dissipated before it, J.
            energy_before_j: f64 = "energy_before_j REAL NOT NULL",
            /// Epoch of the stream that it was cut from.
            epoch: u32 = "epoch INTEGER NOT NULL",
            /// Scan index of its first sample, some scans before the cycle.
            first_scan: u64 = "first_scan INTEGER NOT NULL",
            /// Where the cycle begins, in scans of the stream.
            begin_scan: f64 = "begin_scan REAL NOT NULL",
            /// Length of the cycle, scans.
            period_scans: f64 = "period_scans REAL NOT NULL",
            /// Samples per channel.
            scans: usize = "scans INTEGER NOT NULL",
            /// Number of channels.
            channels: usize = "channels INTEGER NOT NULL",
            /// Missing samples, as index ranges.
            gaps: Vec<Range<usize>> = "gaps TEXT NOT NULL",
            /// CRC-32 of the raw samples.
            crc: u32 = "crc32 INTEGER NOT NULL",
            /// CRC-32 of the bytes that hold the samples in the file.
            bytes_crc: u32 = "bytes_crc32 INTEGER NOT NULL",
            /// The type of each channel.
            sample_types: SampleTypes = "sample_types TEXT",
            "seal INTEGER NOT NULL",
            "samples BLOB NOT NULL",
        }
    }
}

/// Both tables, and how their triggers' messages call a row.
const TABLES: [(&str, &str); 2] = [("wear_blocks", "a block of cycles is"), ("wear_loops", "a raw loop is")];

/// The SQL that creates both tables.
pub(super) fn tables() -> String {
    create::<WearBlockRow>() + &create::<WearLoopRow>() + &TABLES.map(stay).concat()
}

/// Whether the file has wear runs.
pub(super) fn there(connection: &Connection) -> rusqlite::Result<bool> {
    connection.table_exists(None, TABLES[0].0)
}

/// One cycle of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WearCycle {
    /// What it shows; `None` if samples of it were lost or at an end of a channel's range.
    pub reading: Option<CycleReading>,
    /// The energy with which it counts, J: that of its loop, or of the cycle before.
    pub energy_j: f64,
    /// Its normal load, N, if known.
    pub normal_load_n: Option<f64>,
}

/// Bytes of a cycle: five f32 and a flag.
const CYCLE_BYTES: usize = 5 * 4 + 1;

fn pack(cycles: &[WearCycle]) -> Vec<u8> {
    let reading = |cycle: &WearCycle, of: fn(&CycleReading) -> Option<f64>| {
        cycle.reading.as_ref().and_then(of).unwrap_or(f64::NAN)
    };
    let columns: [&dyn Fn(&WearCycle) -> f64; 5] = [
        &|cycle| reading(cycle, |own| own.stiffness_n_per_m),
        &|cycle| reading(cycle, |own| own.friction_n),
        &|cycle| cycle.energy_j,
        &|cycle| reading(cycle, |own| Some(own.amplitude_m)),
        &|cycle| cycle.normal_load_n.unwrap_or(f64::NAN),
    ];
    let mut bytes = Vec::with_capacity(CYCLE_BYTES * cycles.len());
    for column in columns {
        bytes.extend(cycles.iter().flat_map(|cycle| (column(cycle) as f32).to_le_bytes()));
    }
    bytes.extend(cycles.iter().map(|cycle| u8::from(cycle.reading.is_some())));
    bytes
}

fn unpack(bytes: &[u8], count: u64) -> Option<Vec<WearCycle>> {
    let count = usize::try_from(count).ok()?;
    if bytes.len() != count.checked_mul(CYCLE_BYTES)? {
        return None;
    }
    let value = |column: usize, cycle: usize| {
        let at = 4 * (column * count + cycle);
        f64::from(f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]))
    };
    let known = |value: f64| (!value.is_nan()).then_some(value);
    let one = |cycle: usize| {
        let energy_j = value(2, cycle);
        let reading = (bytes[5 * 4 * count + cycle] == 1).then(|| CycleReading {
            stiffness_n_per_m: known(value(0, cycle)),
            friction_n: known(value(1, cycle)),
            energy_j,
            amplitude_m: value(3, cycle),
        });
        WearCycle { reading, energy_j, normal_load_n: known(value(4, cycle)) }
    };
    Some((0..count).map(one).collect())
}

/// Cycles and energy of all wear runs of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WearTotal {
    /// Cycles.
    pub cycles: u64,
    /// Energy that they dissipated, J.
    pub energy_j: f64,
}

/// A block to be stored, after what is in the file.
#[derive(Clone, Debug)]
pub struct NewWearBlock<'a> {
    /// The session.
    pub session: i64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Ordered amplitude of Δx, m.
    pub ordered_m: f64,
    /// The drive's amplitude, V.
    pub drive_v: f64,
    /// Temperature of the specimen, °C.
    pub celsius: Option<f64>,
    /// Epoch of the stream.
    pub epoch: u32,
    /// Where the first cycle begins, in scans of the stream.
    pub begin_scan: f64,
    /// Length of a cycle, scans.
    pub period_scans: f64,
    /// What is in the file before it.
    pub before: WearTotal,
    /// Its cycles; one at least.
    pub cycles: &'a [WearCycle],
}

impl NewWearBlock<'_> {
    /// The totals after it.
    pub fn after(&self) -> WearTotal {
        WearTotal {
            cycles: self.before.cycles + self.cycles.len() as u64,
            energy_j: self.before.energy_j + self.energy_j(),
        }
    }

    fn energy_j(&self) -> f64 {
        self.cycles.iter().map(|cycle| cycle.energy_j).sum()
    }
}

/// A raw loop to be stored with its block.
#[derive(Clone, Debug)]
pub struct NewWearLoop {
    /// Number of its cycle, from 1.
    pub cycle: u64,
    /// Why it is kept.
    pub why: &'static str,
    /// Energy dissipated before it, J.
    pub energy_before_j: f64,
    /// Scan index of its first sample.
    pub first_scan: u64,
    /// Where the cycle begins, in scans of the stream.
    pub begin_scan: f64,
    /// The samples of each channel.
    pub samples: Samples,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
}

/// A damaged block or loop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DamagedWear {
    /// Its table.
    pub table: &'static str,
    /// Its id.
    pub id: i64,
    /// What is wrong.
    pub what: String,
}

impl fmt::Display for DamagedWear {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = if self.table == TABLES[0].0 { "block of wear cycles" } else { "raw loop of a wear run" };
        write!(f, "the {name} {}: {}", self.id, self.what)
    }
}

impl Store {
    /// Cycles and energy of all wear runs so far; zero in a file without any.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn wear_total(&self) -> Result<WearTotal, StoreError> {
        let failed = self.failed("reading the wear runs");
        total(&self.connection).map_err(failed)
    }

    /// Stores one block and the raw loops kept from it, in one transaction.
    ///
    /// # Errors
    /// The file cannot be written, or it does not end where the block begins: then nothing is
    /// stored.
    pub fn insert_wear(&self, block: &NewWearBlock<'_>, loops: &[NewWearLoop]) -> Result<(), StoreError> {
        let found = self.wear_total()?;
        if found != block.before || block.cycles.is_empty() {
            return Err(self.content(format!(
                "a block of {} wear cycles after cycle {} cannot be stored: the file has {} cycles",
                block.cycles.len(),
                block.before.cycles,
                found.cycles
            )));
        }
        let bytes = pack(block.cycles);
        let utc = utc_now();
        let encoded = loops
            .iter()
            .map(|own| Ok((own, codec::encode(&own.samples)?)))
            .collect::<Result<Vec<_>, CodecError>>()
            .map_err(|error| self.content(format!("a raw loop cannot be stored: {error}")))?;
        self.change("storing wear cycles", |connection| {
            if !there(connection)? {
                connection.execute_batch(&tables())?;
            }
            let row = WearBlockRow {
                id: next_id(connection, TABLES[0].0)?,
                session: block.session,
                utc,
                frequency_hz: block.frequency_hz,
                ordered_m: block.ordered_m,
                drive_v: block.drive_v,
                celsius: block.celsius,
                epoch: block.epoch,
                begin_scan: block.begin_scan,
                period_scans: block.period_scans,
                cycles_before: block.before.cycles,
                count: block.cycles.len() as u64,
                unmeasured: block.cycles.iter().filter(|cycle| cycle.reading.is_none()).count() as u64,
                energy_before_j: block.before.energy_j,
                energy_j: block.energy_j(),
                bytes_crc: crc32fast::hash(&bytes),
            };
            let values = row.into_values()?;
            let seal = row_seal::of::<WearBlockRow>(&values);
            let beside: [(&str, &dyn rusqlite::ToSql); 2] = [("seal", &seal), ("cycles", &bytes)];
            insert::<WearBlockRow>(connection, TABLES[0].0, &values, &beside)?;
            for (own, bytes) in &encoded {
                let row = WearLoopRow {
                    id: next_id(connection, TABLES[1].0)?,
                    session: block.session,
                    cycle: own.cycle,
                    why: own.why.into(),
                    energy_before_j: own.energy_before_j,
                    epoch: block.epoch,
                    first_scan: own.first_scan,
                    begin_scan: own.begin_scan,
                    period_scans: block.period_scans,
                    scans: own.samples.scans(),
                    channels: own.samples.channels(),
                    gaps: own.gaps.clone(),
                    crc: codec::checksum(&own.samples),
                    bytes_crc: crc32fast::hash(bytes),
                    sample_types: SampleTypes::of(&own.samples),
                };
                let values = row.into_values()?;
                let seal = row_seal::of::<WearLoopRow>(&values);
                let beside: [(&str, &dyn rusqlite::ToSql); 2] = [("seal", &seal), ("samples", bytes)];
                insert::<WearLoopRow>(connection, TABLES[1].0, &values, &beside)?;
            }
            Ok(())
        })
    }

    fn has_wear(&self) -> Result<bool, StoreError> {
        there(&self.connection).map_err(self.failed("looking for wear runs"))
    }

    /// Calls `look` for every block with its cycles, in order; one block at a time is in memory.
    ///
    /// # Errors
    /// The file cannot be read. A damaged block is passed as such.
    pub fn each_wear_block(
        &self,
        mut look: impl FnMut(Result<(WearBlockRow, Vec<WearCycle>), DamagedWear>),
    ) -> Result<(), StoreError> {
        if !self.has_wear()? {
            return Ok(());
        }
        let mut read = || {
            let mut statement = self.connection.prepare(&select_block("ORDER BY id"))?;
            let mut rows = statement.query([])?;
            while let Some(row) = rows.next()? {
                look(block_of(row)?);
            }
            Ok(())
        };
        read().map_err(self.failed("reading wear cycles"))
    }

    /// The block that holds the cycle with this number (from 1), with its cycles; `None` if it is
    /// not in the file.
    ///
    /// # Errors
    /// The file cannot be read, or the block is damaged; the error names it.
    pub fn wear_block_with(&self, cycle: u64) -> Result<Option<(WearBlockRow, Vec<WearCycle>)>, StoreError> {
        if !self.has_wear()? {
            return Ok(None);
        }
        let sql = select_block("WHERE cycles_before < ?1 ORDER BY cycles_before DESC LIMIT 1");
        let failed = self.failed("reading wear cycles");
        let find =
            || self.connection.prepare_cached(&sql)?.query_row([cycle.cast_signed()], block_of).optional();
        let found = find().map_err(failed)?.transpose();
        let found = found.map_err(|damaged| self.damaged_block(&damaged))?;
        Ok(found.filter(|(row, _)| cycle <= row.cycles_before + row.count))
    }

    fn damaged_block(&self, damaged: &DamagedWear) -> StoreError {
        self.content(format!("{damaged}; `jointrig campaign verify` lists all damage"))
    }

    /// Calls `look` for every cycle, in order, with its block, its number from 1, and the energy
    /// dissipated up to its end (J).
    ///
    /// # Errors
    /// The file cannot be read, or a block is damaged; the error names it.
    pub fn each_wear_cycle(
        &self,
        mut look: impl FnMut(&WearBlockRow, u64, &WearCycle, f64),
    ) -> Result<(), StoreError> {
        let mut damaged = None;
        self.each_wear_block(|block| match block {
            Ok((row, cycles)) => {
                let mut energy_j = row.energy_before_j;
                for (number, cycle) in (row.cycles_before + 1..).zip(&cycles) {
                    energy_j += cycle.energy_j;
                    look(&row, number, cycle, energy_j);
                }
            }
            Err(error) => {
                damaged.get_or_insert(error);
            }
        })?;
        damaged.map_or(Ok(()), |damaged| Err(self.damaged_block(&damaged)))
    }

    /// Every raw loop without its samples, in order.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn wear_loops(&self) -> Result<Vec<Result<WearLoopRow, DamagedWear>>, StoreError> {
        if !self.has_wear()? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {}, seal FROM wear_loops ORDER BY id", WearLoopRow::list());
        let read = |row: &rusqlite::Row<'_>| {
            let id = row.get(0)?;
            Ok(row_seal::read(row)?.map_err(|what| DamagedWear { table: TABLES[1].0, id, what }))
        };
        self.all(&sql, [], read, "reading raw loops of wear runs")
    }

    /// The samples of one raw loop, verified against their checksums.
    ///
    /// # Errors
    /// They are damaged; the error names the loop.
    pub fn wear_loop_samples(&self, row: &WearLoopRow) -> Result<Samples, StoreError> {
        let damaged = |what: CodecError| {
            let what = what.to_string();
            self.content(DamagedWear { table: TABLES[1].0, id: row.id, what }.to_string())
        };
        let sql = "SELECT samples FROM wear_loops WHERE id = ?1";
        let read = self.connection.query_row(sql, [row.id], |row| row.get::<_, Vec<u8>>(0));
        let bytes = read.map_err(|error| damaged(CodecError::Unreadable(error.to_string())))?;
        let found = crc32fast::hash(&bytes);
        if found != row.bytes_crc {
            return Err(damaged(CodecError::Bytes { found, stored: row.bytes_crc }));
        }
        let types = row.sample_types.each(row.channels).map_err(damaged)?;
        codec::decode(&bytes, &types, row.scans, row.crc).map_err(damaged)
    }

    /// Damaged blocks and loops, and blocks that do not follow the one before.
    pub(super) fn damaged_wear(&self) -> Result<Vec<DamagedWear>, StoreError> {
        let mut damage = Vec::new();
        let mut cycles = 0;
        self.each_wear_block(|block| match block {
            Ok((row, _)) => {
                if row.cycles_before != cycles {
                    let what = format!("it follows cycle {}, not cycle {cycles}", row.cycles_before);
                    damage.push(DamagedWear { table: TABLES[0].0, id: row.id, what });
                }
                cycles = row.cycles_before + row.count;
            }
            Err(error) => damage.push(error),
        })?;
        for found in self.wear_loops()? {
            match found {
                Ok(row) => {
                    if let Err(error) = self.wear_loop_samples(&row) {
                        damage.push(DamagedWear { table: TABLES[1].0, id: row.id, what: error.to_string() });
                    }
                }
                Err(error) => damage.push(error),
            }
        }
        Ok(damage)
    }
}

/// Selects blocks, for [`block_of`].
fn select_block(which: &str) -> String {
    format!("SELECT {}, seal, cycles FROM wear_blocks {which}", WearBlockRow::list())
}

/// A block with its cycles, or what is damaged.
fn block_of(
    row: &rusqlite::Row<'_>,
) -> rusqlite::Result<Result<(WearBlockRow, Vec<WearCycle>), DamagedWear>> {
    let id = row.get(0)?;
    let damaged = |what: String| DamagedWear { table: TABLES[0].0, id, what };
    let bytes = row.get_ref(WearBlockRow::columns().count() + 1)?.as_blob().unwrap_or_default();
    Ok(row_seal::read::<WearBlockRow>(row)?.map_err(damaged).and_then(|own| {
        let found = crc32fast::hash(bytes);
        let stored = own.bytes_crc;
        if found != stored {
            return Err(damaged(CodecError::Bytes { found, stored }.to_string()));
        }
        let cycles = unpack(bytes, own.count);
        cycles.map(|cycles| (own, cycles)).ok_or_else(|| damaged(CodecError::Shape.to_string()))
    }))
}

fn total(connection: &Connection) -> rusqlite::Result<WearTotal> {
    if !there(connection)? {
        return Ok(WearTotal::default());
    }
    let sql =
        "SELECT cycles_before + count, energy_before_j + energy_j FROM wear_blocks ORDER BY id DESC LIMIT 1";
    let read = |row: &rusqlite::Row<'_>| {
        let cycles: i64 = row.get(0)?;
        Ok(WearTotal { cycles: cycles.unsigned_abs(), energy_j: row.get(1)? })
    };
    Ok(connection.prepare_cached(sql)?.query_row([], read).optional()?.unwrap_or_default())
}

fn next_id(connection: &Connection, table: &str) -> rusqlite::Result<i64> {
    let sql = format!("SELECT coalesce(max(id), 0) + 1 FROM {table}");
    connection.prepare_cached(&sql)?.query_row([], |row| row.get(0))
}

#[cfg(test)]
#[path = "wear_table_tests.rs"]
mod tests;

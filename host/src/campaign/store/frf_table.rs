//! Imported FRFs: one matrix per configuration, kept in the campaign file as imported.
//!
//! Append-only like the records; the latest matrix of a configuration counts. The values are f64,
//! little-endian: `frf` holds (line, output, input) with real and imaginary part interleaved,
//! `variance` the same order with one real value each. The checksum runs over every column that
//! describes them.

use jointrig_protocol::request::Configuration;
use nalgebra::DMatrix;
use num_complex::Complex;

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, table};
use crate::campaign::plan::configuration_name;
use crate::frf::{Frf, MotionQuantity};

/// Imported FRFs, with the variance if their file contained it.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedFrf {
    /// The file that they came from, without its folder.
    pub source: String,
    /// When they were imported, RFC 3339.
    pub utc: String,
    /// The FRFs.
    pub frf: Frf,
}

/// Description of imported FRFs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrfRow {
    /// The row.
    pub id: i64,
    /// `A`, `B` or `AJB`.
    pub configuration: String,
    /// The file that they came from, without its folder.
    pub source: String,
    /// When they were imported, RFC 3339.
    pub utc: String,
}

table! {
    /// The columns of the FRF table; the latest row of a configuration counts.
    pub(super) struct FrfColumns {
        "frfs" {
            "id INTEGER PRIMARY KEY",
            /// `A`, `B` or `AJB`.
            configuration: String = "configuration TEXT NOT NULL",
            /// When they were imported, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The file that they came from, without its folder.
            source: String = "source TEXT NOT NULL",
            /// Quantity of the FRFs.
            quantity: String = "quantity TEXT NOT NULL",
            /// Their shift from the imaginary axis, 1/s.
            sigma_per_s: f64 = "sigma_per_s REAL NOT NULL",
            /// Names of the outputs, as a JSON list.
            outputs: String = "outputs TEXT NOT NULL",
            /// Names of the inputs, as a JSON list.
            inputs: String = "inputs TEXT NOT NULL",
            /// The lines, Hz.
            frequency: Vec<u8> = "frequency BLOB NOT NULL",
            /// (line, output, input), real and imaginary part interleaved.
            frf: Vec<u8> = "frf BLOB NOT NULL",
            /// (line, output, input), variance of the real part.
            variance: Option<Vec<u8>> = "variance BLOB",
            "crc32 INTEGER NOT NULL",
        }
    }
}

impl FrfColumns {
    fn crc(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        let texts =
            [&self.configuration, &self.utc, &self.source, &self.quantity, &self.outputs, &self.inputs];
        let texts = texts.map(String::as_bytes);
        let sigma = self.sigma_per_s.to_le_bytes();
        let blobs = [&self.frequency, &self.frf, self.variance.as_ref().unwrap_or(const { &Vec::new() })];
        for part in texts.into_iter().chain([&sigma[..]]).chain(blobs.map(Vec::as_slice)) {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
        hasher.finalize()
    }

    /// The FRFs of this row; an error message if it is inconsistent.
    fn decoded(self) -> Result<ImportedFrf, String> {
        let names = |text: &str| serde_json::from_str::<Vec<String>>(text).map_err(|e| e.to_string());
        let (outputs, inputs) = (names(&self.outputs)?, names(&self.inputs)?);
        let frequency_hz = numbers(&self.frequency);
        let (rows, columns) = (outputs.len(), inputs.len());
        let entries = frequency_hz.len() * rows * columns;
        let values = numbers(&self.frf);
        if values.len() != 2 * entries || self.variance.as_ref().is_some_and(|v| v.len() != 8 * entries) {
            return Err(format!("it does not have {} × {rows} × {columns} values", frequency_hz.len()));
        }
        let place = |line: usize, row: usize, column: usize| (line * rows + row) * columns + column;
        let lines = 0..frequency_hz.len();
        let matrix = |line| {
            DMatrix::from_fn(rows, columns, |row, column| {
                let at = 2 * place(line, row, column);
                Complex::new(values[at], values[at + 1])
            })
        };
        let variance = self.variance.as_deref().map(numbers).map(|variance| {
            let of_line = |line| DMatrix::from_fn(rows, columns, |r, c| variance[place(line, r, c)]);
            lines.clone().map(of_line).collect()
        });
        let quantity = MotionQuantity::from_frf_name(&self.quantity)
            .ok_or_else(|| format!("`{}` is not a kind of FRF", self.quantity))?;
        let lines = lines.map(matrix).collect();
        let frf = Frf::new(frequency_hz, self.sigma_per_s, quantity, outputs, inputs, lines);
        let whole = frf.and_then(|frf| match variance {
            Some(variance) => frf.with_variance(variance),
            None => Ok(frf),
        });
        let frf = whole.map_err(|e| e.to_string())?;
        Ok(ImportedFrf { source: self.source, utc: self.utc, frf })
    }
}

impl Store {
    /// Stores FRFs of a configuration; they replace earlier ones in the analysis.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn insert_frf(
        &self,
        configuration: Configuration,
        source: &str,
        frf: &Frf,
    ) -> Result<(), StoreError> {
        // row-major order, obtained as the columns of the transpose in nalgebra
        let values = frf.lines().iter().flat_map(|y| y.transpose().iter().copied().collect::<Vec<_>>());
        let variances = |all: &[DMatrix<f64>]| {
            bytes(all.iter().flat_map(|v| v.transpose().iter().copied().collect::<Vec<_>>()))
        };
        let row = FrfColumns {
            configuration: configuration_name(configuration).into(),
            utc: utc_now(),
            source: source.into(),
            quantity: frf.quantity().frf_name().into(),
            sigma_per_s: frf.sigma_per_s(),
            outputs: serde_json::json!(frf.outputs()).to_string(),
            inputs: serde_json::json!(frf.inputs()).to_string(),
            frequency: bytes(frf.frequency_hz().iter().copied()),
            frf: bytes(values.flat_map(|v| [v.re, v.im])),
            variance: frf.variance().map(variances),
        };
        let crc = row.crc();
        self.change("storing FRFs", |connection| row.insert(connection, &[("crc32", &crc)]))
    }

    /// The latest FRFs of each configuration, without their values.
    pub fn frf_rows(&self) -> Result<Vec<FrfRow>, StoreError> {
        let sql = "SELECT max(id), configuration, source, utc FROM frfs GROUP BY configuration ORDER BY 1";
        let read = |row: &rusqlite::Row<'_>| {
            Ok(FrfRow { id: row.get(0)?, configuration: row.get(1)?, source: row.get(2)?, utc: row.get(3)? })
        };
        self.all(sql, [], read, "reading FRFs")
    }

    /// The imported FRFs of a configuration, if there are any.
    ///
    /// # Errors
    /// They are damaged, or the file cannot be read.
    pub fn frf(&self, configuration: &str) -> Result<Option<ImportedFrf>, StoreError> {
        let found = self.frf_rows()?.into_iter().find(|row| row.configuration == configuration);
        found.map(|row| self.frf_of(row.id)).transpose()
    }

    /// The FRFs of the row with that id.
    ///
    /// # Errors
    /// As [`Store::frf`].
    pub(super) fn frf_of(&self, id: i64) -> Result<ImportedFrf, StoreError> {
        let sql = format!("SELECT {}, crc32 FROM frfs WHERE id = ?1", FrfColumns::list());
        let read = |row: &rusqlite::Row<'_>| Ok((FrfColumns::read(row)?, row.get::<_, u32>("crc32")?));
        let (row, crc) = self.connection.query_row(&sql, [id], read).map_err(self.failed("reading FRFs"))?;
        let name = format!("the FRFs of {} from {}", row.configuration, row.source);
        let read = if row.crc() == crc { row.decoded() } else { Err("their checksum does not match".into()) };
        read.map_err(|what| self.content(format!("{name} are damaged ({what}): import them again")))
    }
}

fn bytes(numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    numbers.flat_map(f64::to_le_bytes).collect()
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect()
}

#[cfg(test)]
#[path = "frf_table_tests.rs"]
mod tests;

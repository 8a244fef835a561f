//! Writes Parquet files, compressed with zstd, for query engines (DuckDB, Polars, Spark).
//!
//! A file gets its final name only when it is complete. The same content gives the same bytes with
//! the same version of jointrig.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, LogicalType, Repetition, TimeUnit, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use sha2::{Digest, Sha256};

use super::typed_table::{Kind, Table, Value};
use crate::advice;

/// Compression level: 9 makes records of hits no smaller and takes three times as long.
const ZSTD: i32 = 3;

/// Rows of a table that are written as one group.
const ROWS_AT_ONCE: usize = 65_536;

/// Why a Parquet file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ParquetFileError {
    /// An error of the operating system.
    #[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// An error of the Parquet library.
    #[error("{}: cannot be written as Parquet: {what}; report it with the campaign file", path.display())]
    Library {
        /// The file.
        path: PathBuf,
        /// The cause.
        what: String,
    },
}

/// How a column is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stored {
    /// Converter codes: 16 bits, delta packed.
    Code,
    /// Converter codes of 32 bits, delta packed.
    Wide,
    /// An increasing index: 32 bits, delta packed.
    Index,
    /// Repeating numbers: 64 bits, with a dictionary.
    Id,
    /// SI values: 32 bits, split into byte streams.
    Single,
    /// As `Single`, 64 bits.
    Double,
    /// A column of a table, in which any value may be missing.
    Of(Kind),
}

/// Values of one column in a row group.
#[derive(Debug, Clone)]
pub enum Values {
    /// For [`Stored::Code`], [`Stored::Wide`] and [`Stored::Index`].
    Whole(Vec<i32>),
    /// For [`Stored::Id`].
    Id(Vec<i64>),
    /// For [`Stored::Single`].
    Single(Vec<f32>),
    /// For [`Stored::Double`].
    Double(Vec<f64>),
    /// For [`Stored::Of`]: integers, and times in microseconds since 1970.
    MaybeWhole(Vec<Option<i64>>),
    /// For [`Stored::Of`]: real numbers.
    MaybeReal(Vec<Option<f64>>),
    /// For [`Stored::Of`]: text.
    MaybeText(Vec<Option<String>>),
}

/// Size and checksum of a file that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Number of rows.
    pub rows: u64,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// A file being written; it is removed if it is not finished.
pub struct ParquetFile {
    path: PathBuf,
    beside: Beside,
    writer: SerializedFileWriter<Summed>,
    rows: u64,
}

/// The temporary name of an unfinished file. Dropping it removes the file.
struct Beside(PathBuf);

impl Drop for Beside {
    fn drop(&mut self) {
        // a complete file has been renamed by now, so that nothing is removed
        let _ = std::fs::remove_file(&self.0);
    }
}

impl ParquetFile {
    /// Creates a file with these columns and notes that describe it.
    ///
    /// # Errors
    /// [`ParquetFileError`].
    pub fn create(
        path: &Path,
        columns: &[(&str, Stored)],
        notes: &[(&str, String)],
    ) -> Result<Self, ParquetFileError> {
        let beside = Beside(path.with_added_extension(format!("{}.part", std::process::id())));
        let failed = |source| ParquetFileError::Write { path: path.into(), source };
        let file = File::create(&beside.0).map_err(failed)?;
        let out = Summed { file: BufWriter::new(file), sum: Sha256::new(), bytes: 0 };
        let made = schema(columns).and_then(|schema| {
            SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties(columns, notes)))
        });
        let writer = made.map_err(|error| failed_with(path, error))?;
        Ok(Self { path: path.into(), beside, writer, rows: 0 })
    }

    /// Adds a row group: the values of each column, in order.
    ///
    /// # Errors
    /// [`ParquetFileError`].
    pub fn write(&mut self, columns: &[Values]) -> Result<(), ParquetFileError> {
        self.rows += group(&mut self.writer, columns).map_err(|error| failed_with(&self.path, error))?;
        Ok(())
    }

    /// Completes the file and gives it its final name.
    ///
    /// # Errors
    /// [`ParquetFileError`].
    pub fn finish(self) -> Result<Written, ParquetFileError> {
        let Self { path, beside, writer, rows } = self;
        let ended = || -> Result<Summed, ParquetError> {
            let mut out = writer.into_inner()?;
            out.flush()?;
            out.file.get_ref().sync_all()?;
            std::fs::rename(&beside.0, &path)?;
            Ok(out)
        };
        let Summed { sum, bytes, .. } = ended().map_err(|error| failed_with(&path, error))?;
        Ok(Written { rows, bytes, sha256: hexadecimal(&sum.finalize()) })
    }
}

fn failed_with(path: &Path, error: ParquetError) -> ParquetFileError {
    let path = path.to_owned();
    match error {
        ParquetError::External(source) => match source.downcast::<std::io::Error>() {
            Ok(source) => ParquetFileError::Write { path, source: *source },
            Err(other) => ParquetFileError::Library { path, what: other.to_string() },
        },
        other => ParquetFileError::Library { path, what: other.to_string() },
    }
}

/// Writes a table.
///
/// # Errors
/// [`ParquetFileError`].
pub fn write_table(
    path: &Path,
    table: &Table,
    notes: &[(&str, String)],
) -> Result<Written, ParquetFileError> {
    let columns: Vec<(&str, Stored)> =
        table.columns().iter().map(|(name, kind)| (name.as_str(), Stored::Of(*kind))).collect();
    let mut file = ParquetFile::create(path, &columns, notes)?;
    for rows in table.rows().chunks(ROWS_AT_ONCE) {
        let of = |(place, (_, kind)): (usize, &(String, Kind))| {
            values(*kind, rows.iter().map(|row| &row[place])).ok_or_else(|| ParquetFileError::Library {
                path: path.into(),
                what: format!("column {place} contains a value of the wrong type"),
            })
        };
        let columns: Result<Vec<Values>, _> = table.columns().iter().enumerate().map(of).collect();
        file.write(&columns?)?;
    }
    file.finish()
}

/// The values of a table's column; `None` where a value is of another kind.
fn values<'a>(kind: Kind, of: impl Iterator<Item = &'a Value>) -> Option<Values> {
    Some(match kind {
        Kind::Whole => Values::MaybeWhole(column(of, |value| match value {
            Value::Whole(value) => Some(Some(*value)),
            _ => None,
        })?),
        Kind::Utc => Values::MaybeWhole(column(of, |value| match value {
            Value::Text(text) => Some(Some(text.parse::<jiff::Timestamp>().ok()?.as_microsecond())),
            _ => None,
        })?),
        Kind::Real => Values::MaybeReal(column(of, |value| match value {
            Value::Real(value) => Some((!value.is_nan()).then_some(*value)),
            Value::Single(value) => Some((!value.is_nan()).then_some(f64::from(*value))),
            _ => None,
        })?),
        Kind::Text => Values::MaybeText(column(of, |value| match value {
            Value::Text(text) => Some(Some(text.clone())),
            _ => None,
        })?),
    })
}

/// Converts each value with `known`; a missing value is null in any column.
fn column<'a, T>(
    of: impl Iterator<Item = &'a Value>,
    known: impl Fn(&Value) -> Option<Option<T>>,
) -> Option<Vec<Option<T>>> {
    of.map(|value| if *value == Value::Missing { Some(None) } else { known(value) }).collect()
}

fn schema(columns: &[(&str, Stored)]) -> Result<Type, ParquetError> {
    let field = |(name, stored): &(&str, Stored)| {
        let (physical, logical) = match stored {
            Stored::Code => (Physical::INT32, Some(LogicalType::integer(16, true))),
            Stored::Wide | Stored::Index => (Physical::INT32, None),
            Stored::Id | Stored::Of(Kind::Whole) => (Physical::INT64, None),
            Stored::Single => (Physical::FLOAT, None),
            Stored::Double | Stored::Of(Kind::Real) => (Physical::DOUBLE, None),
            Stored::Of(Kind::Text) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Stored::Of(Kind::Utc) => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::MICROS))),
        };
        let repetition =
            if matches!(stored, Stored::Of(_)) { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        Type::primitive_type_builder(name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
            .map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("jointrig").with_fields(fields).build()
}

fn properties(columns: &[(&str, Stored)], notes: &[(&str, String)]) -> WriterProperties {
    let level = ZstdLevel::try_new(ZSTD).unwrap_or_default();
    let notes = notes.iter().map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone())).collect();
    let mut properties = WriterProperties::builder()
        .set_created_by(format!("jointrig {}", env!("CARGO_PKG_VERSION")))
        .set_key_value_metadata(Some(notes))
        .set_compression(Compression::ZSTD(level))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_max_row_group_row_count(None);
    for (name, stored) in columns {
        let path = || ColumnPath::from(*name);
        let encoding = match stored {
            Stored::Code | Stored::Wide | Stored::Index => Encoding::DELTA_BINARY_PACKED,
            Stored::Single | Stored::Double => Encoding::BYTE_STREAM_SPLIT,
            Stored::Id | Stored::Of(_) => continue,
        };
        properties =
            properties.set_column_dictionary_enabled(path(), false).set_column_encoding(path(), encoding);
    }
    properties.build()
}

/// Writes a row group; returns its number of rows.
fn group(writer: &mut SerializedFileWriter<Summed>, columns: &[Values]) -> Result<u64, ParquetError> {
    let mut group = writer.next_row_group()?;
    for values in columns {
        let Some(mut column) = group.next_column()? else {
            return Err(ParquetError::General("there are more values than columns".into()));
        };
        match (column.untyped(), values) {
            (ColumnWriter::Int32ColumnWriter(out), Values::Whole(all)) => out.write_batch(all, None, None)?,
            (ColumnWriter::Int64ColumnWriter(out), Values::Id(all)) => out.write_batch(all, None, None)?,
            (ColumnWriter::FloatColumnWriter(out), Values::Single(all)) => {
                out.write_batch(all, None, None)?
            }
            (ColumnWriter::DoubleColumnWriter(out), Values::Double(all)) => {
                out.write_batch(all, None, None)?
            }
            (ColumnWriter::Int64ColumnWriter(out), Values::MaybeWhole(all)) => {
                let there: Vec<i64> = all.iter().flatten().copied().collect();
                out.write_batch(&there, Some(&levels(all)), None)?
            }
            (ColumnWriter::DoubleColumnWriter(out), Values::MaybeReal(all)) => {
                let there: Vec<f64> = all.iter().flatten().copied().collect();
                out.write_batch(&there, Some(&levels(all)), None)?
            }
            (ColumnWriter::ByteArrayColumnWriter(out), Values::MaybeText(all)) => {
                let there: Vec<ByteArray> = all.iter().flatten().map(|text| text.as_str().into()).collect();
                out.write_batch(&there, Some(&levels(all)), None)?
            }
            _ => return Err(ParquetError::General("values of another type than their column".into())),
        };
        column.close()?;
    }
    Ok(group.close()?.num_rows().unsigned_abs())
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // writing to a String cannot fail
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Definition levels: 1 where there is a value, 0 where it is missing.
fn levels<T>(all: &[Option<T>]) -> Vec<i16> {
    all.iter().map(|value| i16::from(value.is_some())).collect()
}

/// A file whose SHA-256 is computed while it is written.
struct Summed {
    file: BufWriter<File>,
    sum: Sha256,
    bytes: u64,
}

impl Write for Summed {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.sum.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

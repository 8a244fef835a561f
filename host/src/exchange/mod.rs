//! Reads and writes formats of other programs; the only module between the analysis and such files.
//!
//! [`npz`] reads and writes arrays; [`frf_npz`] and [`record_npz`] define which
//! arrays make an FRF matrix, impact records or a hysteresis record. [`positions`] reads the pyFBS
//! workbook, as xlsx or as a folder of csv tables. [`uff`] is the universal file; [`frf_uff`] and
//! [`record_uff`] define which of its functions make FRFs or records; [`frf_file`] accepts either
//! form. [`modes_output`] writes modes in both. [`units`] holds the only table of units,
//! [`labelled_frf`] the only rule for signed directions; it and [`record_file`] hold what was read
//! with both. A [`typed_table::Table`] is written as comma-separated text or, with the feature `parquet`, as
//! typed columns.
//! `parquet`, columns for engines.

#[cfg(test)]
mod any_bytes_tests;
pub mod channel_records;
pub mod exported;
pub mod frf_file;
pub mod frf_npz;
pub mod frf_uff;
pub mod labelled_frf;
pub mod loop_table;
pub mod modes_output;
mod npy_header;
pub mod npz;
pub mod npz_long;
mod other_formats;
#[cfg(feature = "parquet")]
pub mod parquet;
pub mod positions;
pub mod record_file;
pub mod record_npz;
pub mod record_uff;
#[cfg(test)]
mod round_trip_tests;
pub mod study_table;
mod tables;
pub mod tables_output;
pub mod typed_table;
mod uff_axes;
pub mod uff_output;
pub mod units;

pub use jointrig_uff as uff;

pub(crate) use tables::delimiter;

pub use frf_file::{FrfFileError, read_frf_file};
pub use frf_npz::{Extra, read_frf, write_frf};
pub use frf_uff::FrfUffError;
pub use labelled_frf::LabelledFrf;
pub use npz::NpzError;
pub use positions::{GeometryFileError, read_geometry};
pub use positions::{PositionsError, read_positions};
pub use record_npz::{
    is_beside_the_contact, read_hysteresis, read_impacts, write_hysteresis, write_impacts, write_level,
};
pub use units::StatedUnits;

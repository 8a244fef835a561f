//! The cycles of wear runs: one row for each, as text or as Parquet, some thousands at a time.

use std::io::{BufWriter, Write};
use std::path::Path;

use crate::campaign::store::Store;
use crate::campaign::store::wear_table::WearCycle;
use crate::cli::error::CliError;
#[cfg(feature = "parquet")]
use crate::exchange::parquet::{ParquetFile, Stored, Values, Written};
#[cfg(feature = "parquet")]
use crate::exchange::typed_table::Kind;

/// The columns of real numbers after the cycle's number, the session and the frequency.
const REALS: [&str; 8] = [
    "frequency_hz",
    "amplitude_m",
    "stiffness_n_per_m",
    "friction_n",
    "friction_coefficient",
    "energy_j",
    "energy_to_j",
    "normal_load_n",
];

/// Their values; `None` where there is none.
fn reals(frequency_hz: f64, cycle: &WearCycle, energy_to_j: f64) -> [Option<f64>; REALS.len()] {
    let reading = cycle.reading.as_ref();
    let friction_n = reading.and_then(|own| own.friction_n);
    let coefficient = friction_n.zip(cycle.normal_load_n.filter(|load| *load > 0.0));
    [
        Some(frequency_hz),
        reading.map(|own| own.amplitude_m),
        reading.and_then(|own| own.stiffness_n_per_m),
        friction_n,
        coefficient.map(|(friction, load)| friction / load),
        Some(cycle.energy_j),
        Some(energy_to_j),
        cycle.normal_load_n,
    ]
}

/// Writes `path` as comma-separated text; returns the number of rows. Without a wear run no file is
/// written.
pub(super) fn write_csv(store: &Store, path: &Path) -> Result<u64, CliError> {
    if store.wear_total()?.cycles == 0 {
        return Ok(0);
    }
    let failed =
        |source| CliError::File { path: path.into(), doing: "writing the cycles of wear runs", source };
    let mut out = BufWriter::new(std::fs::File::create(path).map_err(failed)?);
    let mut written = writeln!(out, "cycle,session,{}", REALS.join(","));
    let mut rows = 0;
    store.each_wear_cycle(|block, number, cycle, energy_to_j| {
        rows += 1;
        if written.is_err() {
            return;
        }
        let mut line = format!("{number},{}", block.session);
        for value in reals(block.frequency_hz, cycle, energy_to_j) {
            line.push(',');
            line.extend(value.map(|value| value.to_string()));
        }
        written = writeln!(out, "{line}");
    })?;
    written.and_then(|()| out.flush()).map_err(failed)?;
    Ok(rows)
}

/// Rows in a row group.
#[cfg(feature = "parquet")]
const ROWS: usize = 1 << 16;

/// The rows of one group.
#[cfg(feature = "parquet")]
#[derive(Default)]
struct Group {
    numbers: Vec<Option<i64>>,
    sessions: Vec<Option<i64>>,
    reals: [Vec<Option<f64>>; REALS.len()],
}

#[cfg(feature = "parquet")]
impl Group {
    fn write(&mut self, file: &mut ParquetFile) -> Result<(), CliError> {
        if self.numbers.is_empty() {
            return Ok(());
        }
        let Self { numbers, sessions, reals } = std::mem::take(self);
        let whole = [numbers, sessions].into_iter().map(Values::MaybeWhole);
        let values: Vec<Values> = whole.chain(reals.into_iter().map(Values::MaybeReal)).collect();
        file.write(&values).map_err(super::bad)
    }
}

/// Writes `path` as Parquet; `None` without a wear run.
#[cfg(feature = "parquet")]
pub(super) fn write_parquet(store: &Store, path: &Path) -> Result<Option<Written>, CliError> {
    if store.wear_total()?.cycles == 0 {
        return Ok(None);
    }
    let whole = ["cycle", "session"].map(|name| (name, Stored::Of(Kind::Whole)));
    let real = REALS.map(|name| (name, Stored::Of(Kind::Real)));
    let columns: Vec<(&str, Stored)> = whole.into_iter().chain(real).collect();
    let mut file = ParquetFile::create(path, &columns, &[]).map_err(super::bad)?;
    let (mut group, mut written) = (Group::default(), Ok(()));
    store.each_wear_cycle(|block, number, cycle, energy_to_j| {
        if written.is_err() {
            return;
        }
        group.numbers.push(Some(number.cast_signed()));
        group.sessions.push(Some(block.session));
        for (column, value) in group.reals.iter_mut().zip(reals(block.frequency_hz, cycle, energy_to_j)) {
            column.push(value);
        }
        if group.numbers.len() == ROWS {
            written = group.write(&mut file);
        }
    })?;
    written?;
    group.write(&mut file)?;
    file.finish().map(Some).map_err(super::bad)
}

//! Tables with typed columns, written as comma-separated text for people and spreadsheets or as
//! Parquet for query engines.

use std::path::Path;

use super::tables_output::{TableError, write_rows_of};

/// The type of a column. Any value may be missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Integers.
    Whole,
    /// Real numbers.
    Real,
    /// Text.
    Text,
    /// Times in RFC 3339 format.
    Utc,
}

/// One value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Missing or unknown.
    Missing,
    /// An integer.
    Whole(i64),
    /// A real number; NaN counts as missing.
    Real(f64),
    /// A number that is stored in 32 bits and printed with no more digits than that. NaN counts as
    /// missing.
    Single(f32),
    /// Text or a time.
    Text(String),
}

impl Value {
    /// The value as text; empty where it is missing.
    fn text(&self) -> String {
        match self {
            Value::Missing => String::new(),
            Value::Real(value) if value.is_nan() => String::new(),
            Value::Single(value) if value.is_nan() => String::new(),
            Value::Whole(value) => value.to_string(),
            Value::Real(value) => value.to_string(),
            Value::Single(value) => value.to_string(),
            Value::Text(value) => value.clone(),
        }
    }
}

macro_rules! value_of {
    ($($from:ty => $kind:ident),*) => {
        $(impl From<$from> for Value {
            fn from(value: $from) -> Self {
                Value::$kind(value.into())
            }
        })*
    };
}
value_of!(i64 => Whole, u32 => Whole, i8 => Whole, u8 => Whole, f64 => Real, f32 => Single, String => Text, &str => Text);

impl From<usize> for Value {
    fn from(value: usize) -> Self {
        // counts here never approach 2^63
        Value::Whole(i64::try_from(value).unwrap_or(i64::MAX))
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Value::Missing, Into::into)
    }
}

/// Rows under typed columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    columns: Vec<(String, Kind)>,
    rows: Vec<Vec<Value>>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: &[(&str, Kind)]) -> Self {
        let columns = columns.iter().map(|(name, kind)| ((*name).to_owned(), *kind)).collect();
        Self { columns, rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If the row does not have one value for each column: an error of the caller, not of the
    /// exported data.
    pub fn push(&mut self, row: Vec<Value>) {
        assert_eq!(row.len(), self.columns.len(), "one value for each of {:?}", self.columns);
        self.rows.push(row);
    }

    /// Names and kinds of the columns.
    pub fn columns(&self) -> &[(String, Kind)] {
        &self.columns
    }

    /// The rows.
    pub fn rows(&self) -> &[Vec<Value>] {
        &self.rows
    }

    /// Writes the table as comma-separated text, the column names first; a missing value is empty.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn write_csv(&self, path: &Path) -> Result<(), TableError> {
        let heading = self.columns.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        let rows = self.rows.iter().map(|row| row.iter().map(Value::text).collect::<Vec<_>>());
        write_rows_of(path, std::iter::once(heading).chain(rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_values_are_empty_and_numbers_come_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("table.csv");
        let mut table = Table::new(&[("a", Kind::Whole), ("b", Kind::Real), ("c", Kind::Text)]);
        table.push(vec![(-3_i64).into(), 0.1_f64.into(), "x, \"y\"".into()]);
        table.push(vec![Value::Missing, f64::NAN.into(), None::<String>.into()]);
        table.push(vec![7_u32.into(), 0.025_f32.into(), Value::Missing]);
        table.write_csv(&path).expect("written");
        let text = std::fs::read_to_string(&path).expect("a file");
        assert_eq!(text, "a,b,c\n-3,0.1,\"x, \"\"y\"\"\"\n,,\n7,0.025,\n");
    }
}

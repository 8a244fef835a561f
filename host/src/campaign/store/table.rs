//! Declaration of a table of the campaign file.
//!
//! [`table!`] takes the columns in the order of the table. A column with a field before it becomes
//! a field of the row's type; one without (a constraint, or a column that the type omits) is only
//! created. CREATE, INSERT, SELECT and the order of the row's seal (`row_seal.rs`) all follow from
//! this list: a new column is one new line.

use rusqlite::types::{FromSql, ToSql, Value, ValueRef};
use rusqlite::{Connection, params_from_iter};

/// The column that tables of samples have since version 3 of the file. Older tables lack it; a null
/// in it is the same as its absence, and contributes nothing to a row's seal or digest.
pub(super) const SINCE_3: &str = "sample_types";

/// A column of a table, or a constraint.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its table.
    pub table: &'static str,
    /// Its SQL, which starts with its name.
    pub declaration: &'static str,
    /// Whether the row's type contains it.
    pub in_row: bool,
}

impl Column {
    /// Its name.
    pub fn name(&self) -> &'static str {
        self.declaration.split(' ').next().unwrap_or_default()
    }
}

/// A type that holds one row, made by [`table!`].
pub trait Row: Sized {
    /// All columns of all its tables.
    const ALL: &'static [Column];

    /// Reads it from a row that starts with [`Row::columns`].
    fn read(row: &rusqlite::Row<'_>) -> rusqlite::Result<Self>;

    /// Its values, in the order of [`Row::columns`].
    fn into_values(self) -> rusqlite::Result<Vec<Value>>;

    /// The columns that the type contains.
    fn columns() -> impl Iterator<Item = &'static Column> {
        Self::ALL.iter().filter(|column| column.in_row)
    }

    /// The columns that the type contains, as a list for SELECT.
    fn list() -> String {
        let names: Vec<String> =
            Self::columns().map(|column| format!("{}.{}", column.table, column.name())).collect();
        names.join(", ")
    }

    /// As [`Row::list`], with null for a column that this file's table lacks.
    fn list_in(connection: &Connection) -> rusqlite::Result<String> {
        let name = |column: &Column| {
            let (table, name) = (column.table, column.name());
            let there = name != SINCE_3 || connection.column_exists(None, table, name)?;
            Ok(if there { format!("{table}.{name}") } else { format!("NULL AS {name}") })
        };
        Ok(Self::columns().map(name).collect::<rusqlite::Result<Vec<String>>>()?.join(", "))
    }

    /// Stores it in its only table, with the additional columns `beside` that the type does not
    /// contain.
    fn insert(self, connection: &Connection, beside: &[(&str, &dyn ToSql)]) -> rusqlite::Result<()> {
        insert::<Self>(connection, Self::ALL[0].table, &self.into_values()?, beside)
    }
}

/// Stores those of a row's `values` that belong to `table`, with the additional columns `beside`
/// that the type does not contain.
pub(super) fn insert<R: Row>(
    connection: &Connection,
    table: &str,
    values: &[Value],
    beside: &[(&str, &dyn ToSql)],
) -> rusqlite::Result<()> {
    let own = R::columns().zip(values).filter(|(column, _)| column.table == table);
    let own = own.map(|(column, value)| (column.name(), value as &dyn ToSql));
    let (names, values): (Vec<&str>, Vec<&dyn ToSql>) = own.chain(beside.iter().copied()).unzip();
    let (names, places) = (names.join(", "), vec!["?"; names.len()].join(", "));
    let sql = format!("INSERT INTO {table} ({names}) VALUES ({places})");
    connection.prepare_cached(&sql)?.execute(params_from_iter(values)).map(|_| ())
}

/// The SQL that creates the tables of a row.
pub(super) fn create<R: Row>() -> String {
    let tables = R::ALL.chunk_by(|one, other| one.table == other.table);
    let one = |columns: &[Column]| {
        let lines: Vec<&str> = columns.iter().map(|column| column.declaration).collect();
        format!("CREATE TABLE {} (\n    {}\n) STRICT;\n", columns[0].table, lines.join(",\n    "))
    };
    tables.map(one).collect()
}

/// The triggers that prevent changes to the rows of a table.
pub(super) fn stay((table, row): (&str, &str)) -> String {
    let one = |(name, event, done): (&str, &str, &str)| {
        format!(
            "CREATE TRIGGER {table}_{name} BEFORE {event} ON {table}\n\
             BEGIN SELECT RAISE(ABORT, '{row} never {done}'); END;\n"
        )
    };
    [("stay", "UPDATE", "changed"), ("remain", "DELETE", "deleted")].map(one).concat()
}

/// A type that can be stored in a column.
pub trait Stored: Sized {
    /// The value to be stored.
    fn store(self) -> rusqlite::Result<Value>;

    /// The value read back; `None` if the column holds another type.
    fn load(value: ValueRef<'_>) -> Option<Self>;
}

/// Types that SQLite supports directly.
macro_rules! plain {
    ($($type:ty),+) => {
        $(impl Stored for $type {
            fn store(self) -> rusqlite::Result<Value> {
                Ok(Value::from(self))
            }

            fn load(value: ValueRef<'_>) -> Option<Self> {
                FromSql::column_result(value).ok()
            }
        })+
    };
}
plain!(i64, u32, u8, f64, f32, String, Vec<u8>, Option<f64>, Option<i64>, Option<String>, Option<Vec<u8>>);

/// Unsigned integers, which SQLite stores as signed.
macro_rules! unsigned {
    ($($type:ty),+) => {
        $(impl Stored for $type {
            fn store(self) -> rusqlite::Result<Value> {
                let failed = |error| rusqlite::Error::ToSqlConversionFailure(Box::new(error));
                i64::try_from(self).map(Value::Integer).map_err(failed)
            }

            fn load(value: ValueRef<'_>) -> Option<Self> {
                FromSql::column_result(value).ok()
            }
        })+
    };
}
unsigned!(u64, usize);

/// The value at `place`, which is advanced.
pub(super) fn next<T: Stored>(row: &rusqlite::Row<'_>, place: &mut usize, name: &str) -> rusqlite::Result<T> {
    let (at, value) = (*place, row.get_ref(*place)?);
    *place += 1;
    T::load(value).ok_or_else(|| rusqlite::Error::InvalidColumnType(at, name.into(), value.data_type()))
}

/// Defines a row's type and its tables. Fields in `beside` have no column: they are read as their
/// default.
macro_rules! table {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
            $($table:literal {
                $( $( $(#[$about:meta])* $field:ident: $type:ty = )? $declaration:literal, )+
            })+
        }
        $(beside { $( $(#[$beside_about:meta])* $beside:ident: $beside_type:ty, )+ })?
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $( $( $( $(#[$about])* pub $field: $type, )? )+ )+
            $( $( $(#[$beside_about])* pub $beside: $beside_type, )+ )?
        }

        impl $crate::campaign::store::table::Row for $name {
            const ALL: &'static [$crate::campaign::store::table::Column] = &[
                $( $( $crate::campaign::store::table::Column {
                    table: $table,
                    declaration: $declaration,
                    in_row: {
                        let fields: &[&str] = &[$(stringify!($field))?];
                        !fields.is_empty()
                    },
                }, )+ )+
            ];

            fn read(row: &rusqlite::Row<'_>) -> rusqlite::Result<Self> {
                let mut place = 0;
                let read = Self {
                    $( $( $( $field: $crate::campaign::store::table::next(row, &mut place, stringify!($field))?, )? )+ )+
                    $( $( $beside: Default::default(), )+ )?
                };
                Ok(read)
            }

            fn into_values(self) -> rusqlite::Result<Vec<rusqlite::types::Value>> {
                Ok(vec![ $( $( $( $crate::campaign::store::table::Stored::store(self.$field)?, )? )+ )+ ])
            }
        }
    };
}
pub(super) use table;

//! Representation of the program's types in a column: a name, JSON, or hexadecimal digits.

use std::ops::Range;

use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::Shot;
use rusqlite::types::{Value, ValueRef};

use super::table::Stored;
use crate::campaign::plan::level::{Held, Moment};
use crate::campaign::plan::{configuration_name, configuration_named};
use crate::campaign::verdict::Verdict;

macro_rules! named {
    ($($type:ty: $name:expr, $named:expr;)+) => {
        $(impl Stored for $type {
            fn store(self) -> rusqlite::Result<Value> {
                Ok(Value::Text($name(self).into()))
            }

            fn load(value: ValueRef<'_>) -> Option<Self> {
                value.as_str().ok().and_then($named)
            }
        })+
    };
}
named! {
    Verdict: Verdict::name, Verdict::named;
    Held: Held::name, |name| name.parse().ok();
    Moment: Moment::name, |name| name.parse().ok();
    Configuration: configuration_name, configuration_named;
}

macro_rules! json {
    ($($type:ty),+) => {
        $(impl Stored for $type {
            fn store(self) -> rusqlite::Result<Value> {
                let failed = |error| rusqlite::Error::ToSqlConversionFailure(Box::new(error));
                serde_json::to_string(&self).map(Value::Text).map_err(failed)
            }

            fn load(value: ValueRef<'_>) -> Option<Self> {
                serde_json::from_str(value.as_str().ok()?).ok()
            }
        })+
    };
}
json!(Shot, Role, Quantity, Vec<Range<usize>>);

/// A 64-bit identifier: 16 hexadecimal digits in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hex(pub u64);

impl Stored for Hex {
    fn store(self) -> rusqlite::Result<Value> {
        Ok(Value::Text(self.to_string()))
    }

    fn load(value: ValueRef<'_>) -> Option<Self> {
        u64::from_str_radix(value.as_str().ok()?, 16).ok().map(Self)
    }
}

impl std::fmt::Display for Hex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

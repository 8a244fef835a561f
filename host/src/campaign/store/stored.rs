//! Representation of the program's types in a column: a name, JSON, or hexadecimal digits.

use std::ops::Range;

use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::Shot;
use rusqlite::types::{Value, ValueRef};

use super::codec::CodecError;
use super::table::Stored;
use crate::campaign::plan::level::{Held, Moment};
use crate::campaign::plan::{configuration_name, configuration_named};
use crate::campaign::verdict::Verdict;
use crate::device::samples::{SampleType, Samples};

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

/// The types of a record's channels: their names, separated by spaces; null if all are i16, as in
/// every record of a file of version 2.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampleTypes(Option<Vec<SampleType>>);

/// Most channels of a record whose row names no types: more is damage.
const MOST_CHANNELS: usize = 1 << 12;

impl SampleTypes {
    /// Those of these samples.
    pub fn of(samples: &Samples) -> Self {
        let types = samples.types();
        Self(types.iter().any(|of| *of != SampleType::I16).then_some(types))
    }

    /// The type of each of `channels` channels.
    ///
    /// # Errors
    /// There are more or fewer, or an impossible number.
    pub(super) fn each(&self, channels: usize) -> Result<Vec<SampleType>, CodecError> {
        match &self.0 {
            Some(types) if types.len() == channels => Ok(types.clone()),
            None if channels <= MOST_CHANNELS => Ok(vec![SampleType::I16; channels]),
            _ => Err(CodecError::Types { channels, named: self.0.as_ref().map_or(0, Vec::len) }),
        }
    }

    /// The type of the channel at `place`.
    pub fn channel(&self, place: usize) -> SampleType {
        self.0.as_ref().and_then(|types| types.get(place)).copied().unwrap_or_default()
    }
}

impl Stored for SampleTypes {
    fn store(self) -> rusqlite::Result<Value> {
        let names = |types: Vec<SampleType>| types.into_iter().map(SampleType::name).collect::<Vec<_>>();
        Ok(self.0.map_or(Value::Null, |types| Value::Text(names(types).join(" "))))
    }

    fn load(value: ValueRef<'_>) -> Option<Self> {
        if value == ValueRef::Null {
            return Some(Self(None));
        }
        let types: Option<Vec<_>> = value.as_str().ok()?.split(' ').map(SampleType::named).collect();
        types.map(|types| Self(Some(types)))
    }
}

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

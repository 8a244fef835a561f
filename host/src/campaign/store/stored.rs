//! Representation of the program's types in a column: a name, JSON, or hexadecimal digits.

use std::ops::Range;

use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::Shot;
use rusqlite::types::{Value, ValueRef};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

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
    pub fn each(&self, channels: usize) -> Result<Vec<SampleType>, CodecError> {
        match &self.0 {
            Some(types) if types.len() == channels => Ok(types.clone()),
            None if channels <= MOST_CHANNELS => Ok(vec![SampleType::I16; channels]),
            _ => Err(CodecError::Types { channels, named: self.0.as_ref().map_or(0, Vec::len) }),
        }
    }

    /// Their names, separated by spaces; empty if all are i16.
    fn names(&self) -> String {
        let types = self.0.iter().flatten();
        types.map(|of| of.name()).collect::<Vec<_>>().join(" ")
    }

    /// The types with these names.
    fn named(names: &str) -> Option<Self> {
        if names.is_empty() {
            return Some(Self(None));
        }
        let types: Option<Vec<_>> = names.split(' ').map(SampleType::named).collect();
        types.map(|types| Self(Some(types)))
    }

    /// The type of the channel at `place`.
    pub fn channel(&self, place: usize) -> SampleType {
        self.0.as_ref().and_then(|types| types.get(place)).copied().unwrap_or_default()
    }
}

impl Stored for SampleTypes {
    fn store(self) -> rusqlite::Result<Value> {
        Ok(if self.0.is_none() { Value::Null } else { Value::Text(self.names()) })
    }

    fn load(value: ValueRef<'_>) -> Option<Self> {
        match value {
            ValueRef::Null => Some(Self(None)),
            // null stands for i16 alone: no names at all are damage
            other => Self::named(other.as_str().ok().filter(|names| !names.is_empty())?),
        }
    }
}

/// The same forms in JSON.
macro_rules! text_in_json {
    ($($type:ty: $write:expr, $read:expr;)+) => {
        $(impl Serialize for $type {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                $write(self).serialize(to)
            }
        }

        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                let text = String::deserialize(from)?;
                $read(&text).ok_or_else(|| de::Error::custom(format!("`{text}` is not known here")))
            }
        })+
    };
}
text_in_json! {
    Held: |held: &Held| held.name(), |text: &str| text.parse().ok();
    Moment: |moment: &Moment| moment.name(), |text: &str| text.parse().ok();
    Hex: Hex::to_string, |text: &str| u64::from_str_radix(text, 16).ok().map(Hex);
    SampleTypes: SampleTypes::names, SampleTypes::named;
}

/// Numbers in JSON, which has none that are infinite or undefined: these are written as text.
pub(crate) mod number {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
    use serde_json::Value;

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { value.serialize(to) } else { value.to_string().serialize(to) }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        // whichever way the JSON library holds its numbers
        let written = Value::deserialize(from)?;
        let number = match &written {
            Value::Number(number) => number.as_f64(),
            Value::String(text) => text.parse().ok(),
            _ => None,
        };
        number.ok_or_else(|| de::Error::custom(format!("`{written}` is not a number")))
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

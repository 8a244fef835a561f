//! The first line of the stream: the recorder and its channels.
//!
//! ```json
//! {"jointrig_bridge": 1, "board": "NI cDAQ-9178", "serial": "1A2B3C", "rate_hz": 25600,
//!  "sample": "f32", "channels": [
//!   {"name": "force", "role": "hammer_force", "unit": "N",
//!    "sensitivity_v": 0.00225, "full_scale": 5},
//!   {"name": "vib_z", "role": "response_z", "unit": "m/s",
//!    "sensitivity_v": 200, "full_scale": 10}]}
//! ```
//!
//! (In the stream it is one line.)
//!
//! | field | meaning |
//! |---|---|
//! | `jointrig_bridge` | version of the format: 1 |
//! | `board`, `serial` | name and serial number of the recorder, the same in every run |
//! | `rate_hz` | scans per second; need not be an integer |
//! | `sample` | `i16`, `i32`, `f32` or `f64` |
//! | `bits` | for `i32`: bits that a full scale has, e.g. 24 for codes of ±2²³; 32 if absent |
//! | `held` | the source can wait (a file, a simulation); a recorder cannot; `false` if absent |
//! | `name` | of the channel, up to 24 bytes |
//! | `role` | what the channel is for ([`ROLES`]); `auxiliary` if absent |
//! | `unit` | of what it measures ([`UNITS`]) |
//! | `sensitivity_v` | V per unit, negative for a reversed sensor; optional |
//! | `full_scale` | largest value of a sample, above 0; the largest code of integer samples |
//! | `delay_s` | how late its samples are, s; 0 if absent |
//!
//! With `sensitivity_v`, samples and `full_scale` are in volts, otherwise in `unit`. A campaign is
//! continued only with the recorder that it was begun with.

use std::io::{BufRead, Read};

use jointrig_protocol::channel::{Axis, Channel, Name, Quantity, Role};
use jointrig_protocol::limits::{CHANNEL_CAPACITY, NAME_BYTES};
use serde::Deserialize;

/// Version of the format.
pub const VERSION: u32 = 1;

/// Longest header, bytes.
pub const MOST_BYTES: u64 = 1 << 16;

/// Scans per second, Hz: the bounds of any device.
const RATE_HZ: std::ops::RangeInclusive<f64> = 100.0..=2e6;

/// Longest delay, s.
const DELAY_S: f64 = 1.0;

/// Names of the channels' roles.
pub const ROLES: [(&str, Role); 9] = [
    ("hammer_force", Role::HammerForce),
    ("response_x", Role::Response(Axis::X)),
    ("response_y", Role::Response(Axis::Y)),
    ("response_z", Role::Response(Axis::Z)),
    ("specimen_a", Role::SpecimenA),
    ("specimen_b", Role::SpecimenB),
    ("load_cell", Role::LoadCell),
    ("excitation", Role::Excitation),
    ("auxiliary", Role::Auxiliary),
];

/// Units, their quantities, and the SI value of one unit.
pub const UNITS: [(&str, Quantity, f64); 13] = [
    ("N", Quantity::Force, 1.0),
    ("kN", Quantity::Force, 1e3),
    ("lbf", Quantity::Force, 4.448_221_615_260_5),
    ("m/s", Quantity::Velocity, 1.0),
    ("mm/s", Quantity::Velocity, 1e-3),
    ("m", Quantity::Displacement, 1.0),
    ("mm", Quantity::Displacement, 1e-3),
    ("um", Quantity::Displacement, 1e-6),
    ("m/s^2", Quantity::Acceleration, 1.0),
    ("m/s2", Quantity::Acceleration, 1.0),
    ("g", Quantity::Acceleration, 9.806_65),
    ("V", Quantity::Voltage, 1.0),
    ("mV", Quantity::Voltage, 1e-3),
];

/// Type of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sample {
    /// 16-bit integers.
    I16,
    /// 32-bit integers.
    I32,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl Sample {
    /// Size in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::I16 => 2,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A checked header.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Name of the recorder.
    pub board: Name,
    /// Its serial number.
    pub serial: Name,
    /// Scans per second, Hz.
    pub rate_hz: f64,
    /// Type of the samples.
    pub sample: Sample,
    /// Bits of a full scale of integer samples.
    pub bits: u8,
    /// The source can wait.
    pub held: bool,
    /// The channels in the order of a scan. A channel's range is its full scale.
    pub channels: Vec<Channel>,
}

/// Why a stream has no valid header.
#[derive(Debug, thiserror::Error)]
pub enum HeaderError {
    /// It could not be read.
    #[error("its header could not be read: {0}")]
    Read(#[from] std::io::Error),
    /// The stream ended before the header did.
    #[error("it ended before its header, one line of JSON, was complete")]
    Ended,
    /// The header never ends.
    #[error(
        "its first line has more than {MOST_BYTES} bytes: it must be one line of JSON, ended by a line feed"
    )]
    TooLong,
    /// It is not JSON, or a field is missing, unknown or of another type.
    #[error("its first line is not a header: {0}; it begins with `{1}`")]
    Json(serde_json::Error, String),
    /// A field has an impossible value.
    #[error("its header is refused: {0}")]
    Field(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    jointrig_bridge: u32,
    board: String,
    serial: String,
    rate_hz: f64,
    sample: Sample,
    bits: Option<u8>,
    #[serde(default)]
    held: bool,
    channels: Vec<ChannelLine>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChannelLine {
    name: String,
    role: Option<String>,
    unit: String,
    sensitivity_v: Option<f64>,
    full_scale: f64,
    #[serde(default)]
    delay_s: f64,
}

fn refuse(holds: bool, why: impl FnOnce() -> String) -> Result<(), HeaderError> {
    if holds { Ok(()) } else { Err(HeaderError::Field(why())) }
}

/// A name of at most [`NAME_BYTES`] printable bytes.
fn name(what: &str, text: &str) -> Result<Name, HeaderError> {
    let fits = !text.trim().is_empty() && !text.chars().any(char::is_control);
    Name::try_from(text).ok().filter(|_| fits).ok_or_else(|| {
        HeaderError::Field(format!("{what} {text:?} must have 1 to {NAME_BYTES} printable bytes"))
    })
}

impl Header {
    /// Reads the first line.
    ///
    /// # Errors
    /// [`HeaderError`].
    pub fn read(source: &mut impl BufRead) -> Result<Self, HeaderError> {
        let mut line = Vec::new();
        source.by_ref().take(MOST_BYTES).read_until(b'\n', &mut line)?;
        if line.pop_if(|last| *last == b'\n').is_none() {
            return Err(if line.len() as u64 == MOST_BYTES {
                HeaderError::TooLong
            } else {
                HeaderError::Ended
            });
        }
        Self::parse(&line)
    }

    /// Checks a header.
    ///
    /// # Errors
    /// [`HeaderError::Json`] or [`HeaderError::Field`].
    pub fn parse(line: &[u8]) -> Result<Self, HeaderError> {
        let start = || String::from_utf8_lossy(&line[..line.len().min(40)]).escape_debug().collect();
        let line: Line = serde_json::from_slice(line).map_err(|error| HeaderError::Json(error, start()))?;
        refuse(line.jointrig_bridge == VERSION, || {
            format!(
                "jointrig_bridge is {}, and this program reads version {VERSION}: update the older of the two",
                line.jointrig_bridge
            )
        })?;
        refuse(RATE_HZ.contains(&line.rate_hz), || {
            format!("rate_hz is {}: {} to {} are possible", line.rate_hz, RATE_HZ.start(), RATE_HZ.end())
        })?;
        refuse((1..=CHANNEL_CAPACITY).contains(&line.channels.len()), || {
            format!("channels: {} are given, 1 to {CHANNEL_CAPACITY} are possible", line.channels.len())
        })?;
        refuse(line.bits.is_none() || line.sample == Sample::I32, || {
            "bits is for samples of i32 only".into()
        })?;
        let bits = match line.sample {
            Sample::I16 => 16,
            Sample::I32 | Sample::F32 | Sample::F64 => line.bits.unwrap_or(32),
        };
        refuse((8..=32).contains(&bits), || format!("bits is {bits}: 8 to 32 are possible"))?;
        let mut channels: Vec<Channel> = Vec::with_capacity(line.channels.len());
        for own in &line.channels {
            let channel = channel(own, bits)?;
            refuse(channels.iter().all(|other| other.name != channel.name), || {
                format!("two channels are named `{}`: each needs its own name", own.name)
            })?;
            channels.push(channel);
        }
        Ok(Self {
            board: name("board", &line.board)?,
            serial: name("serial", &line.serial)?,
            rate_hz: line.rate_hz,
            sample: line.sample,
            bits,
            held: line.held,
            channels,
        })
    }

    /// Bytes of a scan in the stream.
    #[must_use]
    pub fn scan_bytes(&self) -> usize {
        self.channels.len() * self.sample.bytes()
    }
}

fn channel(own: &ChannelLine, bits: u8) -> Result<Channel, HeaderError> {
    let called = name("the channel's name", &own.name)?;
    let given = own.role.as_deref().unwrap_or("auxiliary");
    let role = ROLES.iter().find(|(word, _)| *word == given).map(|(_, role)| *role);
    let role = role.ok_or_else(|| {
        let words = ROLES.map(|(word, _)| word).join(", ");
        HeaderError::Field(format!("channel `{called}`: role `{given}` is unknown: write one of {words}"))
    })?;
    let unit = UNITS.iter().find(|(word, ..)| *word == own.unit);
    let (_, quantity, si) = *unit.ok_or_else(|| {
        let words = UNITS.map(|(word, ..)| word).join(", ");
        HeaderError::Field(format!(
            "channel `{called}`: unit `{}` is unknown: write one of {words}",
            own.unit
        ))
    })?;
    let units_per_volt = own.sensitivity_v.map_or(si, |volts| si / volts) as f32;
    refuse(units_per_volt.is_normal(), || {
        format!(
            "channel `{called}`: sensitivity_v is {}: a number of volts per {} that is not 0 is needed",
            own.sensitivity_v.unwrap_or(1.0),
            own.unit
        )
    })?;
    let range_v = own.full_scale as f32;
    refuse(range_v.is_normal() && range_v > 0.0 && (units_per_volt * range_v).is_normal(), || {
        format!("channel `{called}`: full_scale is {}: a number above 0 is needed", own.full_scale)
    })?;
    refuse((0.0..=DELAY_S).contains(&own.delay_s), || {
        format!("channel `{called}`: delay_s is {}: 0 to {DELAY_S} s are possible", own.delay_s)
    })?;
    Ok(Channel {
        name: called,
        role,
        quantity,
        units_per_volt,
        range_v,
        delay_ns: (own.delay_s * 1e9).round() as u32,
        // the width in which samples reach the host
        bits: bits.min(16),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"{"jointrig_bridge":1,"board":"NI cDAQ","serial":"1A2B","rate_hz":17066.666666666668,"sample":"f32","channels":[{"name":"force","role":"hammer_force","unit":"lbf","sensitivity_v":-0.01,"full_scale":5},{"name":"acc","unit":"g","full_scale":50,"delay_s":2e-5}]}"#;

    fn refused(from: &str, to: &str) -> String {
        let changed = GOOD.replacen(from, to, 1);
        assert_ne!(changed, GOOD, "{from}");
        Header::parse(changed.as_bytes()).expect_err(to).to_string()
    }

    #[test]
    fn volts_and_engineering_units_become_si() {
        let header = Header::read(&mut format!("{GOOD}\nJRBK").as_bytes()).expect("good");
        assert!((header.rate_hz - 51_200.0 / 3.0).abs() < 1e-9 && !header.held);
        let [force, acc] = &header.channels[..] else { panic!("two channels") };
        // −0.01 V per lbf: one volt is −100 lbf
        assert_eq!((force.role, force.quantity), (Role::HammerForce, Quantity::Force));
        assert!((force.units_per_volt + 444.822_16).abs() < 1e-3 && force.range_v == 5.0);
        // in g: a full scale of 50 g is 490 m/s²
        assert_eq!((acc.role, acc.quantity), (Role::Auxiliary, Quantity::Acceleration));
        assert!((f64::from(acc.units_per_volt * acc.range_v) - 490.3325).abs() < 1e-3);
        assert_eq!(acc.delay_ns, 20_000);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (from, to, word) in [
            ("\"rate_hz\":17066.666666666668", "\"rate_hz\":50", "rate_hz is 50"),
            ("hammer_force", "hammer", "role `hammer` is unknown: write one of hammer_force"),
            ("lbf", "pound", "unit `pound` is unknown"),
            ("\"full_scale\":50", "\"full_scale\":0", "`acc`: full_scale is 0"),
            ("-0.01", "0", "`force`: sensitivity_v is 0"),
            ("\"name\":\"acc\"", "\"name\":\"force\"", "two channels are named `force`"),
            ("2e-5", "-2e-5", "delay_s"),
            ("\"serial\":\"1A2B\",", "", "missing field `serial`"),
            ("sensitivity_v", "sensitivity", "unknown field `sensitivity`"),
            ("\"sample\":\"f32\"", "\"sample\":\"f32\",\"bits\":24", "bits is for samples of i32 only"),
            ("bridge\":1", "bridge\":2", "reads version 1"),
            ("1A2B", "a serial number that is too long", "1 to 24 printable bytes"),
        ] {
            let said = refused(from, to);
            assert!(said.contains(word), "{said}");
        }
    }

    #[test]
    fn a_stream_that_is_no_bridge_is_told_with_its_beginning() {
        let said = Header::read(&mut &b"Opening device ...\nready\n"[..]).expect_err("text").to_string();
        assert!(said.contains("begins with `Opening device ...`"), "{said}");
        assert!(matches!(Header::read(&mut &b"{\"jointrig"[..]), Err(HeaderError::Ended)));
        let endless = vec![b' '; 1 << 17];
        assert!(matches!(Header::read(&mut &endless[..]), Err(HeaderError::TooLong)));
    }
}

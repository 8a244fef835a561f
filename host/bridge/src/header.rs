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
//! | `bits` | of a full scale of `i32` (32 if absent); of the resolution of `f32`, `f64` (24) |
//! | `held` | the source can wait (a file, a simulation); a recorder cannot; `false` if absent |
//! | `hammer` | an output of the program may fire a hammer ([`Hammer`]); absent if none may |
//! | `name` | of the channel, up to 24 bytes |
//! | `role` | what the channel is for ([`ROLES`]); `auxiliary` if absent |
//! | `unit` | of what it measures ([`UNITS`]) |
//! | `sensitivity_v` | V per unit, negative for a reversed sensor; optional |
//! | `full_scale` | largest value of a sample, above 0; the largest code of integer samples |
//! | `delay_s` | how late its samples are, s; 0 if absent |
//! | `bits` | of this channel alone, instead of the header's |
//!
//! With `sensitivity_v`, samples and `full_scale` are in volts, otherwise in `unit`. A campaign is
//! continued only with the recorder that it was begun with.

use std::io::{BufRead, Read};

use jointrig_protocol::channel::{Axis, Channel, NARROW_BITS, Name, Quantity, Role, WIDE_BITS};
use jointrig_protocol::limits::{CHANNEL_CAPACITY, COIL_PULSE_CAP_US, NAME_BYTES};
use serde::Deserialize;

/// Version of the format.
pub const VERSION: u32 = 1;

/// Longest header, bytes.
pub const MOST_BYTES: u64 = 1 << 16;

/// Scans per second, Hz: the bounds of any device.
const RATE_HZ: std::ops::RangeInclusive<f64> = 100.0..=2e6;

/// Resolution of a recorder whose samples are floating-point numbers, if it states none: that of
/// delta-sigma converters, and of single precision.
const FLOAT_BITS: u8 = 24;

/// Bits of a full scale that can be stated.
const BITS: std::ops::RangeInclusive<u8> = 8..=32;

/// Longest delay, s.
const DELAY_S: f64 = 1.0;

/// Longest pulse that a hammer's output can state, µs: below the shortest, no coil moves a bolt.
const LONGEST_US: std::ops::RangeInclusive<u32> = 100..=COIL_PULSE_CAP_US;

/// Shortest pause between two pulses that a hammer's output can state, s.
const PAUSE_S: std::ops::RangeInclusive<f64> = 0.6..=60.0;

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

/// An output of the program that may fire a hammer ([`crate::orders`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hammer {
    /// Longest pulse, µs, which the program's hardware times and bounds.
    pub longest_us: u32,
    /// Shortest pause from the end of one pulse to the next, ms.
    pub pause_ms: u32,
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
    /// The source can wait.
    pub held: bool,
    /// An output may fire a hammer.
    pub hammer: Option<Hammer>,
    /// The channels in the order of a scan. A channel's range is its full scale; its bits are those
    /// of the codes that reach the host.
    pub channels: Vec<Channel>,
    /// For each channel, bits of a full scale of integer samples, or the resolution of
    /// floating-point samples.
    pub bits: Vec<u8>,
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
    hammer: Option<HammerLine>,
    channels: Vec<ChannelLine>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HammerLine {
    longest_us: u32,
    shortest_pause_s: Option<f64>,
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
    bits: Option<u8>,
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
        let mut channels: Vec<Channel> = Vec::with_capacity(line.channels.len());
        let mut bits = Vec::with_capacity(line.channels.len());
        for own in &line.channels {
            let stated = own.bits.or(line.bits);
            let own_bits = match line.sample {
                Sample::I16 => {
                    refuse(stated.is_none_or(|bits| bits == 16), || "bits is 16 for samples of i16".into())?;
                    16
                }
                Sample::I32 => stated.unwrap_or(32),
                Sample::F32 | Sample::F64 => stated.unwrap_or(FLOAT_BITS),
            };
            refuse(BITS.contains(&own_bits), || {
                format!("bits is {own_bits}: {} to {} are possible", BITS.start(), BITS.end())
            })?;
            let channel = channel(own, sent_bits(own_bits))?;
            refuse(channels.iter().all(|other| other.name != channel.name), || {
                format!("two channels are named `{}`: each needs its own name", own.name)
            })?;
            channels.push(channel);
            bits.push(own_bits);
        }
        let hammer = line.hammer.map(|own| hammer(&own, &channels)).transpose()?;
        Ok(Self {
            board: name("board", &line.board)?,
            serial: name("serial", &line.serial)?,
            rate_hz: line.rate_hz,
            sample: line.sample,
            held: line.held,
            hammer,
            channels,
            bits,
        })
    }

    /// Bytes of a scan in the stream.
    #[must_use]
    pub fn scan_bytes(&self) -> usize {
        self.channels.len() * self.sample.bytes()
    }
}

/// Bits of the codes in which samples of so many bits are sent: a recorder of 17 or 18 bits would
/// lose some in codes of 16, and no code has more than [`WIDE_BITS`].
fn sent_bits(bits: u8) -> u8 {
    if bits <= 16 { bits } else { bits.clamp(NARROW_BITS + 1, WIDE_BITS) }
}

/// The output that fires a hammer, whose strikes these channels must show.
fn hammer(own: &HammerLine, channels: &[Channel]) -> Result<Hammer, HeaderError> {
    refuse(LONGEST_US.contains(&own.longest_us), || {
        let (from, to) = (LONGEST_US.start(), LONGEST_US.end());
        format!("hammer: longest_us is {}: {from} to {to} µs are possible", own.longest_us)
    })?;
    let pause_s = own.shortest_pause_s.unwrap_or(*PAUSE_S.start());
    refuse(PAUSE_S.contains(&pause_s), || {
        let (from, to) = (PAUSE_S.start(), PAUSE_S.end());
        format!("hammer: shortest_pause_s is {pause_s}: {from} to {to} s are possible")
    })?;
    refuse(channels.iter().any(|channel| channel.role == Role::HammerForce), || {
        "hammer: a channel with the role hammer_force is needed, or no strike would be seen".into()
    })?;
    Ok(Hammer { longest_us: own.longest_us, pause_ms: (pause_s * 1e3).ceil() as u32 })
}

/// A channel that is sent in codes of `bits`.
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
        bits,
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
    fn more_than_16_bits_are_sent_as_wide_codes() {
        let widths = |fields: &str, own: &str| {
            let line = GOOD
                .replace("\"sample\":\"f32\"", fields)
                .replace("\"full_scale\":50", &format!("\"full_scale\":50{own}"));
            let header = Header::parse(line.as_bytes()).expect("good");
            (header.bits, header.channels.iter().map(|channel| channel.bits).collect::<Vec<_>>())
        };
        for (fields, stated, sent) in [
            (r#""sample":"i16""#, 16, 16),
            (r#""sample":"i32""#, 32, 30),
            (r#""sample":"i32","bits":24"#, 24, 24),
            (r#""sample":"i32","bits":18"#, 18, 19),
            (r#""sample":"i32","bits":12"#, 12, 12),
            (r#""sample":"f64""#, 24, 24),
            (r#""sample":"f32","bits":16"#, 16, 16),
        ] {
            assert_eq!(widths(fields, ""), (vec![stated; 2], vec![sent; 2]), "{fields}");
        }
        assert_eq!(widths(r#""sample":"f32""#, ",\"bits\":16"), (vec![24, 16], vec![24, 16]));
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
            ("\"sample\":\"f32\"", "\"sample\":\"i16\",\"bits\":24", "bits is 16 for samples of i16"),
            ("\"full_scale\":50", "\"full_scale\":50,\"bits\":33", "bits is 33: 8 to 32"),
            ("bridge\":1", "bridge\":2", "reads version 1"),
            ("1A2B", "a serial number that is too long", "1 to 24 printable bytes"),
        ] {
            let said = refused(from, to);
            assert!(said.contains(word), "{said}");
        }
    }

    #[test]
    fn a_hammer_is_bounded_and_needs_its_force() {
        let with = |fields: &str| {
            let line = GOOD.replacen("\"sample\"", &format!("\"hammer\":{{{fields}}},\"sample\""), 1);
            Header::parse(line.as_bytes()).map(|header| header.hammer).map_err(|error| error.to_string())
        };
        let hammer = |longest_us, pause_ms| Ok(Some(Hammer { longest_us, pause_ms }));
        assert_eq!(Header::parse(GOOD.as_bytes()).expect("good").hammer, None);
        assert_eq!(with(r#""longest_us":8000"#), hammer(8000, 600));
        assert_eq!(with(r#""longest_us":100,"shortest_pause_s":2.5"#), hammer(100, 2500));
        for (fields, word) in [
            (r#""longest_us":8001"#, "longest_us is 8001: 100 to 8000 µs"),
            (r#""longest_us":0"#, "longest_us is 0"),
            (r#""longest_us":-1"#, "integer `-1`"),
            (r#""shortest_pause_s":1"#, "missing field `longest_us`"),
            (r#""longest_us":5000,"shortest_pause_s":0.1"#, "shortest_pause_s is 0.1: 0.6 to 60 s"),
            (r#""longest_us":5000,"shortest_pause_s":61"#, "shortest_pause_s is 61"),
            (r#""longest_us":5000,"pause":1"#, "unknown field `pause`"),
        ] {
            let said = with(fields).expect_err(fields);
            assert!(said.contains(word), "{said}");
        }
        let without = GOOD.replacen("hammer_force", "auxiliary", 1);
        let line = without.replacen("\"sample\"", "\"hammer\":{\"longest_us\":5000},\"sample\"", 1);
        let said = Header::parse(line.as_bytes()).expect_err("no force").to_string();
        assert!(said.contains("role hammer_force"), "{said}");
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

//! Plays the rig as a recorder: its voltages as blocks of samples on standard output, in the format
//! of docs/bridge.md. The host measures it with `--device "bridge:jointrig-hil-sim play …"`.
//!
//! The rig's operator strikes by hand and walks through a list of cells: in each, hammer and laser
//! are put in place, the structure is at rest, and the given number of hits follow. Codes and cells
//! are those of `sim:`; only the way to the host differs.

use std::io::{ErrorKind, Write};
use std::time::{Duration, Instant};

use jointrig_protocol::answer::Info;
use jointrig_protocol::channel::{Axis, Channel, Role, joined_code, words_per_scan};

use crate::board::describe;
use crate::rig::{Configuration, Rig, RigConfig, RigError};

/// One cell of the operator's list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Visit {
    /// The configuration on the rig.
    pub configuration: Configuration,
    /// Impact point.
    pub impact: String,
    /// Response point.
    pub response: String,
    /// Hits, if not those of [`Play::hits`].
    pub hits: Option<u32>,
}

impl std::str::FromStr for Visit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (cell, hits) = match text.split_once(':') {
            None => (text, None),
            Some((cell, hits)) => {
                let hits = hits.parse().map_err(|_| format!("`{text}`: `{hits}` is no number of hits"))?;
                (cell, Some(hits))
            }
        };
        let [configuration, impact, response] = cell.split('/').collect::<Vec<_>>()[..] else {
            return Err(format!("`{text}` is no cell: write e.g. AJB/AZ3/A3, or AJB/AZ3/A3:5 for five hits"));
        };
        let configuration = match configuration {
            "A" => Configuration::A,
            "B" => Configuration::B,
            "AJB" => Configuration::Ajb,
            other => return Err(format!("`{other}` is no configuration: write A, B or AJB")),
        };
        Ok(Self { configuration, impact: impact.into(), response: response.into(), hits })
    }
}

/// The type of the samples written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// The converters' codes: 16-bit integers, or 32-bit ones of converters of more than 16 bits.
    Codes,
    /// Volts: in single precision, or in double precision for converters of more than 24 bits.
    Volts,
}

/// What is played, and how.
#[derive(Clone, Debug)]
pub struct Play {
    /// Seed of noise, scatter and every position error.
    pub seed: u64,
    /// The cells, in order; after the last hit of the last one, the operator goes on there.
    pub visits: Vec<Visit>,
    /// Hits in each cell that states no number of its own.
    pub hits: u32,
    /// Type of the samples.
    pub samples: Samples,
    /// Scans of a block.
    pub block: usize,
    /// Blocks come at the times at which a recorder delivers them, and do not wait; otherwise the
    /// source can be held.
    pub paced: bool,
}

/// Why the rig cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// The rig's description, or a cell's name.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The rig has no hammer by hand.
    #[error("this rig is not hit by hand: its description needs [hammer.hand] with every_s and pulse_s")]
    NoHand,
    /// The samples cannot be written.
    #[error("the samples could not be written: {0}")]
    Write(#[from] std::io::Error),
}

/// Plays until the reader closes the stream.
///
/// # Errors
/// [`PlayError`].
pub fn play(config: &RigConfig, play: &Play, mut to: impl Write) -> Result<(), PlayError> {
    let every_s = config.hammer.hand.ok_or(PlayError::NoHand)?.every_s;
    let mut rig = Rig::new(config, play.seed)?;
    let channels = describe(rig.channels());
    let rate_hz = f64::from(rig.scan_rate_hz());
    // until shortly before the next hit would follow, so that a long record of the last one is
    // whole
    let stay = |hits: u32| ((f64::from(hits) + 0.9) * every_s * rate_hz) as u64;
    let form = Form::of(play.samples, config.sensors.bits);
    let mut blocks = Blocks { play, form, rate_hz, scans: 0, begun: Instant::now(), bytes: Vec::new() };
    let outcome = (|| {
        to.write_all(header(play, form, rate_hz, channels).as_bytes())?;
        for visit in &play.visits {
            rig.stage(visit.configuration, &visit.impact, &visit.response, 0)?;
            let until = blocks.scans + stay(visit.hits.unwrap_or(play.hits));
            while blocks.scans < until {
                let scans = (until - blocks.scans).min(play.block as u64) as usize;
                blocks.write(&mut rig, channels, scans, &mut to)?;
            }
        }
        loop {
            blocks.write(&mut rig, channels, play.block, &mut to)?;
        }
    })();
    match outcome {
        // the reader has closed the stream: this is how a play ends
        Err(PlayError::Write(error)) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// The form of a sample in the stream, of converters of so many bits.
#[derive(Clone, Copy, Debug)]
enum Form {
    I16,
    I32(u8),
    F32(u8),
    F64(u8),
}

impl Form {
    fn of(samples: Samples, bits: u8) -> Self {
        match samples {
            Samples::Codes if bits == 16 => Self::I16,
            Samples::Codes => Self::I32(bits),
            Samples::Volts if bits <= 24 => Self::F32(bits),
            Samples::Volts => Self::F64(bits),
        }
    }

    /// The fields of the header.
    fn fields(self) -> String {
        match self {
            Self::I16 => "\"sample\":\"i16\"".into(),
            Self::I32(bits) => format!("\"sample\":\"i32\",\"bits\":{bits}"),
            Self::F32(bits) => format!("\"sample\":\"f32\",\"bits\":{bits}"),
            Self::F64(bits) => format!("\"sample\":\"f64\",\"bits\":{bits}"),
        }
    }

    /// Adds a code of the converter of this channel.
    fn write(self, code: i32, channel: &Channel, bytes: &mut Vec<u8>) {
        let volts = |bits: u8| f64::from(code) * f64::from(channel.range_v) / 2_f64.powi(i32::from(bits) - 1);
        match self {
            Self::I16 => bytes.extend((code as i16).to_le_bytes()),
            Self::I32(_) => bytes.extend(code.to_le_bytes()),
            Self::F32(bits) => bytes.extend((volts(bits) as f32).to_le_bytes()),
            Self::F64(bits) => bytes.extend(volts(bits).to_le_bytes()),
        }
    }
}

/// The first line.
fn header(play: &Play, form: Form, rate_hz: f64, channels: &[Channel]) -> String {
    let described: Vec<String> = channels
        .iter()
        .map(|channel| {
            // one over the factor is exact to the last digit of single precision
            let sensitivity_v = 1.0 / f64::from(channel.units_per_volt);
            format!(
                r#"{{"name":"{}","role":"{}","unit":"{}","sensitivity_v":{sensitivity_v:?},"full_scale":{},"delay_s":{:?}}}"#,
                channel.name,
                word(channel.role),
                channel.quantity.unit(),
                channel.range_v,
                f64::from(channel.delay_ns) * 1e-9
            )
        })
        .collect();
    format!(
        "{{\"jointrig_bridge\":1,\"board\":\"{}\",\"serial\":\"play-{:016x}\",\"rate_hz\":{rate_hz},{},\
         \"held\":{},\"channels\":[{}]}}\n",
        Info::VIRTUAL_BOARD,
        play.seed,
        form.fields(),
        !play.paced,
        described.join(",")
    )
}

/// A role in the words of the format.
fn word(role: Role) -> &'static str {
    match role {
        Role::HammerForce => "hammer_force",
        Role::Response(Axis::X) => "response_x",
        Role::Response(Axis::Y) => "response_y",
        Role::Response(Axis::Z) => "response_z",
        Role::SpecimenA => "specimen_a",
        Role::SpecimenB => "specimen_b",
        Role::LoadCell => "load_cell",
        Role::Excitation => "excitation",
        Role::Auxiliary => "auxiliary",
    }
}

/// The blocks written so far.
struct Blocks<'a> {
    play: &'a Play,
    form: Form,
    rate_hz: f64,
    scans: u64,
    begun: Instant,
    bytes: Vec<u8>,
}

impl Blocks<'_> {
    /// Advances the rig by `scans` and writes them as one block.
    fn write(
        &mut self,
        rig: &mut Rig,
        channels: &[Channel],
        scans: usize,
        to: &mut impl Write,
    ) -> Result<(), PlayError> {
        self.bytes.clear();
        self.bytes.extend(b"JRBK");
        self.bytes.extend((scans as u32).to_le_bytes());
        // nothing lost before it, no flags
        self.bytes.extend([0; 16]);
        let mut words = vec![0; words_per_scan(channels)];
        for _ in 0..scans {
            rig.scan(&mut words);
            let (upper, lower) = words.split_at(channels.len());
            let mut lower = lower.iter().peekable();
            for (upper, channel) in upper.iter().zip(channels) {
                let code = match lower.next_if(|_| channel.is_wide()) {
                    Some(lower) => joined_code([*upper, *lower], channel.bits),
                    None => (*upper).into(),
                };
                self.form.write(code, channel, &mut self.bytes);
            }
        }
        self.scans += scans as u64;
        if self.play.paced {
            let due = Duration::from_secs_f64(self.scans as f64 / self.rate_hz);
            std::thread::sleep(due.saturating_sub(self.begun.elapsed()));
        }
        to.write_all(&self.bytes)?;
        Ok(to.flush()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BY_HAND: &str = include_str!("../rigs/by-hand.toml");

    /// Takes so many bytes, then closes the stream.
    struct Reader(Vec<u8>, usize);

    impl Write for Reader {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if self.0.len() + bytes.len() > self.1 {
                return Err(ErrorKind::BrokenPipe.into());
            }
            self.0.extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn played(bits: u8, samples: Samples) -> (String, Vec<u8>) {
        let config = RigConfig::from_toml(&format!("{BY_HAND}\n[sensors]\nbits = {bits}\n")).expect("good");
        let visits = vec!["AJB/AZ3/A3".parse().expect("a cell")];
        let options = Play { seed: 7, visits, hits: 1, samples, block: 100, paced: false };
        let mut reader = Reader(Vec::new(), 30_000);
        play(&config, &options, &mut reader).expect("until the stream is closed");
        let end = reader.0.iter().position(|byte| *byte == b'\n').expect("a line");
        (String::from_utf8(reader.0[..end].to_vec()).expect("text"), reader.0[end + 1..].to_vec())
    }

    #[test]
    fn the_codes_are_the_rigs_and_the_volts_are_the_codes() {
        let (header, codes) = played(16, Samples::Codes);
        assert!(header.contains(r#"{"name":"vib_z","role":"response_z","unit":"m/s""#), "{header}");
        let mut rig = Rig::new(&RigConfig::from_toml(BY_HAND).expect("good"), 7).expect("good");
        rig.stage(Configuration::Ajb, "AZ3", "A3", 0).expect("known");
        assert_eq!(&codes[..8], b"JRBK\x64\0\0\0");
        assert_eq!(codes[8..24], [0; 16]);
        let mut wanted = [0; 16];
        for scan in codes[24..24 + 3200].chunks_exact(32) {
            rig.scan(&mut wanted);
            let got: Vec<i16> =
                scan.chunks_exact(2).map(|code| i16::from_le_bytes([code[0], code[1]])).collect();
            assert_eq!(got, wanted);
        }
        let (_, volts) = played(16, Samples::Volts);
        for (code, volt) in codes[24..3224].chunks_exact(2).zip(volts[24..6424].chunks_exact(4)) {
            let code = f64::from(i16::from_le_bytes([code[0], code[1]]));
            let volt = f64::from(f32::from_le_bytes([volt[0], volt[1], volt[2], volt[3]]));
            assert_eq!(code * 10.0 / 32_768.0, volt);
        }
    }

    #[test]
    fn wide_converters_keep_their_bits() {
        for (bits, sample, size) in [(24, "f32", 4), (30, "f64", 8)] {
            let (header, codes) = played(bits, Samples::Codes);
            assert!(header.contains(&format!("\"sample\":\"i32\",\"bits\":{bits}")), "{header}");
            let (header, volts) = played(bits, Samples::Volts);
            assert!(header.contains(&format!("\"sample\":\"{sample}\",\"bits\":{bits}")), "{header}");
            let mut fine = 0;
            for (code, volt) in codes[24..6424].chunks_exact(4).zip(volts[24..].chunks_exact(size)) {
                let code = i32::from_le_bytes([code[0], code[1], code[2], code[3]]);
                let volt = match *volt {
                    [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
                    [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
                    _ => panic!("{size} bytes"),
                };
                assert_eq!(f64::from(code) * 10.0 / 2_f64.powi(i32::from(bits) - 1), volt);
                fine += u32::from(code % (1 << (bits - 16)) != 0);
            }
            assert!(fine > 1000, "the lower bits are used: {fine}");
        }
    }
}

//! From samples to codes at the stated full scale, and what is wrong with the statement.
//!
//! A channel of more than 16 bits is sent as wide codes, two words of a scan
//! ([`jointrig_protocol::block`]), so that a 24-bit recorder loses nothing; one of 16 bits or fewer
//! as codes of 16 bits.
//!
//! A full scale that is too small clips: those hits get the verdict of a clipped record. One that
//! is too large wastes codes: below one code of noise, rounding errors no longer average out. Both
//! are reported once per channel.

use jointrig_protocol::channel::{Channel, split_code};

use crate::header::{Header, Sample};

/// Noise below which a full scale is too large, rms in codes.
const NOISE_CODES: f64 = 1.0;

/// Duration over which noise is measured, s.
const NOISE_S: f64 = 1.0;

/// Converts the scans of one stream.
#[derive(Debug)]
pub struct Converter {
    sample: Sample,
    channels: Vec<Watched>,
    /// Scans over which noise is still to be measured.
    noise_scans: u64,
    /// Words of the converted scans.
    codes: Vec<i16>,
    /// Lower words of the scan that is being converted.
    lower: Vec<i16>,
    told_invalid: bool,
}

/// A channel, and what was seen of it.
#[derive(Debug)]
struct Watched {
    name: String,
    /// Full scale, in V or in the unit of the samples.
    full_scale: f64,
    /// Bits of a wide code; `None` for codes of 16 bits.
    wide: Option<u8>,
    /// Codes from 0 to full scale.
    half: f64,
    codes_per_sample: f64,
    /// The largest sample that the recorder can deliver. It becomes the largest code, so that a
    /// clipped record is recognised although the codes are finer than the recorder's.
    top: f64,
    told_beyond: bool,
    last: Option<f64>,
    squares: f64,
    differences: u64,
}

impl Watched {
    /// Notes a sample, in codes before rounding.
    fn note(&mut self, exact: f64) {
        if let Some(last) = self.last.replace(exact) {
            self.squares += (exact - last).powi(2);
            self.differences += 1;
        }
    }

    /// A sentence about its noise, if the full scale is too large for it. Neighbouring samples of
    /// white noise differ by √2 times its rms; slow signals hardly differ.
    fn noise(&self) -> Option<String> {
        let rms = (self.squares / (2.0 * self.differences.max(1) as f64)).sqrt();
        let (name, full_scale, bits) = (&self.name, self.full_scale, self.wide.unwrap_or(16));
        if rms == 0.0 {
            return Some(format!("channel `{name}` does not change at all: is it connected?"));
        }
        (rms < NOISE_CODES).then(|| {
            format!(
                "channel `{name}`: its noise is {rms:.2} codes of {bits} bits at the stated full scale of {full_scale}; below \
                 one code, rounding adds errors that do not average out: use a smaller range of the recorder, or state \
                 the largest value that really occurs as full_scale"
            )
        })
    }
}

/// A run of scans after conversion.
#[derive(Debug, PartialEq, Eq)]
pub enum Run<'a> {
    /// Codes as words, scan by scan: one word of each channel, then the lower words of the wide
    /// ones.
    Codes(&'a [i16]),
    /// Scans with a sample that is not a number.
    Invalid(u64),
}

impl Converter {
    /// For the streams of this header.
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let watched = |(channel, bits): (&Channel, &u8)| {
            let full_scale = f64::from(channel.range_v);
            let wide = channel.is_wide().then_some(channel.bits);
            let half = half_range(wide.unwrap_or(16));
            let (full, top) = match header.sample {
                Sample::I16 | Sample::I32 => (half_range(*bits), half_range(*bits) - 1.0),
                Sample::F32 | Sample::F64 => (full_scale, f64::INFINITY),
            };
            Watched {
                name: channel.name.to_string(),
                full_scale,
                wide,
                half,
                codes_per_sample: half / full,
                top,
                told_beyond: false,
                last: None,
                squares: 0.0,
                differences: 0,
            }
        };
        Self {
            sample: header.sample,
            channels: header.channels.iter().zip(&header.bits).map(watched).collect(),
            noise_scans: (NOISE_S * header.rate_hz) as u64,
            codes: Vec::new(),
            lower: Vec::new(),
            told_invalid: false,
        }
    }

    /// Converts the scans of a block, and gives them to `take` in runs; returns sentences about
    /// the recorder, each of which is returned once.
    pub fn convert(&mut self, bytes: &[u8], mut take: impl FnMut(Run<'_>)) -> Vec<String> {
        let mut remarks = Vec::new();
        let scan_bytes = self.channels.len() * self.sample.bytes();
        let mut codes = std::mem::take(&mut self.codes);
        codes.clear();
        let mut invalid = 0;
        for scan in bytes.chunks_exact(scan_bytes) {
            let whole = codes.len();
            if self.scan(scan, &mut codes, &mut remarks) {
                if invalid > 0 {
                    take(Run::Invalid(std::mem::take(&mut invalid)));
                }
            } else {
                codes.truncate(whole);
                if !codes.is_empty() {
                    take(Run::Codes(&codes));
                    codes.clear();
                }
                invalid += 1;
            }
            if self.noise_scans > 0 {
                self.noise_scans -= 1;
                if self.noise_scans == 0 {
                    remarks.extend(self.channels.iter().filter_map(Watched::noise));
                }
            }
        }
        if !codes.is_empty() {
            take(Run::Codes(&codes));
        }
        if invalid > 0 {
            take(Run::Invalid(invalid));
        }
        self.codes = codes;
        remarks
    }

    /// Converts one scan; false when one of its samples is not a number, which leaves the words of an
    /// incomplete scan in `codes`.
    fn scan(&mut self, bytes: &[u8], codes: &mut Vec<i16>, remarks: &mut Vec<String>) -> bool {
        let measures = self.noise_scans > 0;
        let samples = bytes.chunks_exact(self.sample.bytes());
        self.lower.clear();
        for (channel, sample) in self.channels.iter_mut().zip(samples) {
            let value = match *sample {
                [a, b] => f64::from(i16::from_le_bytes([a, b])),
                [a, b, c, d] if self.sample == Sample::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
                [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
                [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
                _ => f64::NAN,
            };
            if !value.is_finite() {
                if !std::mem::replace(&mut self.told_invalid, true) {
                    remarks.push(format!(
                        "channel `{}`: a sample is not a number; scans with such a sample count as lost",
                        channel.name
                    ));
                }
                return false;
            }
            let exact = value * channel.codes_per_sample;
            if exact.abs() > channel.half + 0.5 && !std::mem::replace(&mut channel.told_beyond, true) {
                remarks.push(format!(
                    "channel `{}`: a sample is {:.3} times its stated full scale of {}; samples beyond it are clipped, \
                     and such hits are refused: state the recorder's real range as full_scale",
                    channel.name,
                    exact.abs() / channel.half,
                    channel.full_scale
                ));
            }
            if measures {
                channel.note(exact);
            }
            let half = channel.half;
            let code = if value >= channel.top { half - 1.0 } else { exact.round().clamp(-half, half - 1.0) };
            match channel.wide {
                None => codes.push(code as i16),
                Some(bits) => {
                    let [upper, lower] = split_code(code as i32, bits);
                    codes.push(upper);
                    self.lower.push(lower);
                }
            }
        }
        codes.extend(&self.lower);
        true
    }
}

/// Codes of so many bits from 0 to full scale.
fn half_range(bits: u8) -> f64 {
    2_f64.powi(i32::from(bits) - 1)
}

#[cfg(test)]
mod tests {
    use jointrig_protocol::channel::joined_code;

    use super::*;

    /// Two channels, with this text of the header's fields after `sample`.
    fn header_with(sample: &str, fields: &str, full_scale: f64) -> Header {
        let channel = |name: &str| format!(r#"{{"name":"{name}","unit":"V","full_scale":{full_scale}}}"#);
        let (a, b) = (channel("a"), channel("b"));
        let line = format!(
            r#"{{"jointrig_bridge":1,"board":"b","serial":"s","rate_hz":1000,"sample":"{sample}",{fields}"channels":[{a},{b}]}}"#
        );
        Header::parse(line.as_bytes()).expect("good")
    }

    /// Codes of 16 bits.
    fn header(sample: &str, full_scale: f64) -> Header {
        header_with(sample, if sample == "i16" { "" } else { r#""bits":16,"# }, full_scale)
    }

    fn wide_codes(words: &[i16], bits: u8) -> Vec<i32> {
        let scan = |scan: &[i16]| [[scan[0], scan[2]], [scan[1], scan[3]]];
        words.chunks_exact(4).flat_map(scan).map(|words| joined_code(words, bits)).collect()
    }

    fn runs(header: &Header, bytes: &[u8]) -> (Vec<Result<Vec<i16>, u64>>, Vec<String>) {
        let mut got = Vec::new();
        let remarks = Converter::new(header).convert(bytes, |run| {
            got.push(match run {
                Run::Codes(codes) => Ok(codes.to_vec()),
                Run::Invalid(scans) => Err(scans),
            });
        });
        (got, remarks)
    }

    #[test]
    fn every_type_becomes_the_code_of_its_part_of_full_scale() {
        let wanted = vec![Ok(vec![16_384, -32_768, 0, 1])];
        let i16s: Vec<u8> = [16_384_i16, i16::MIN, 0, 1].into_iter().flat_map(i16::to_le_bytes).collect();
        assert_eq!(runs(&header("i16", 5.0), &i16s).0, wanted);
        let i32s: Vec<u8> = [1 << 14, -(1 << 15), 0, 1].into_iter().flat_map(i32::to_le_bytes).collect();
        assert_eq!(runs(&header("i32", 5.0), &i32s).0, wanted);
        let volts = [2.5, -5.0, 7e-5, 5.0 / 32_768.0];
        let f32s: Vec<u8> = volts.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect();
        assert_eq!(runs(&header("f32", 5.0), &f32s).0, wanted);
        let f64s: Vec<u8> = volts.into_iter().flat_map(f64::to_le_bytes).collect();
        assert_eq!(runs(&header("f64", 5.0), &f64s).0, wanted);
    }

    #[test]
    fn a_24_bit_recorder_loses_nothing() {
        let codes = [1, -(1 << 23), (1 << 23) - 1, 0x12_3457];
        let i32s: Vec<u8> = codes.into_iter().flat_map(i32::to_le_bytes).collect();
        let (got, _) = runs(&header_with("i32", r#""bits":24,"#, 5.0), &i32s);
        assert_eq!(wide_codes(got[0].as_ref().expect("codes"), 24), codes);
        // a recorder's volts in floating point are 24 bits if nothing else is stated
        let volts = codes.map(|code| f64::from(code) * 5.0 / 8_388_608.0);
        let f64s: Vec<u8> = volts.iter().flat_map(|volts| volts.to_le_bytes()).collect();
        assert_eq!(
            wide_codes(runs(&header_with("f64", "", 5.0), &f64s).0[0].as_ref().expect("codes"), 24),
            codes
        );
        // single precision has 24 bits too
        let f32s: Vec<u8> = volts.iter().flat_map(|volts| (*volts as f32).to_le_bytes()).collect();
        assert_eq!(
            wide_codes(runs(&header_with("f32", "", 5.0), &f32s).0[0].as_ref().expect("codes"), 24),
            codes
        );
        // 18 bits are sent with one more
        let codes = [1, -(1 << 17), (1 << 17) - 2, 77];
        let i32s: Vec<u8> = codes.into_iter().flat_map(i32::to_le_bytes).collect();
        let header = header_with("i32", r#""bits":18,"#, 5.0);
        assert_eq!(header.channels[0].bits, 19);
        assert_eq!(
            wide_codes(runs(&header, &i32s).0[0].as_ref().expect("codes"), 19),
            codes.map(|code| 2 * code)
        );
    }

    #[test]
    fn the_largest_code_of_the_recorder_is_the_largest_code() {
        // otherwise a clipped record would not be recognised
        let top: Vec<u8> = [(1 << 17) - 1_i32, -(1 << 17)].into_iter().flat_map(i32::to_le_bytes).collect();
        let (got, remarks) = runs(&header_with("i32", r#""bits":18,"#, 5.0), &top);
        assert_eq!(wide_codes(got[0].as_ref().expect("codes"), 19), [(1 << 18) - 1, -(1 << 18)]);
        assert!(remarks.is_empty(), "{remarks:?}");
        let top: Vec<u8> = [2047_i32, -2048].into_iter().flat_map(i32::to_le_bytes).collect();
        assert_eq!(runs(&header_with("i32", r#""bits":12,"#, 5.0), &top).0, [Ok(vec![i16::MAX, i16::MIN])]);
    }

    #[test]
    fn channels_of_different_widths_share_a_scan() {
        let mut header = header_with("f32", "", 32.768);
        let line = r#"{"jointrig_bridge":1,"board":"b","serial":"s","rate_hz":1000,"sample":"f32","channels":[{"name":"a","unit":"V","full_scale":32.768,"bits":16},{"name":"b","unit":"V","full_scale":32.768}]}"#;
        header = Header { channels: Header::parse(line.as_bytes()).expect("good").channels, ..header };
        let samples: Vec<u8> =
            [1.0_f32, 1.0, f32::NAN, 0.0, -1.0, 1e-3].into_iter().flat_map(f32::to_le_bytes).collect();
        let (got, _) = runs(&header, &samples);
        // 1 V is 256000 codes of 24 bits: 1000 · 256 + 0
        assert_eq!(got, [Ok(vec![1000, 1000, 0]), Err(1), Ok(vec![-1000, 1, 0])]);
    }

    #[test]
    fn codes_of_16_bits_are_unchanged_and_return_from_volts() {
        let all: Vec<i16> = (i16::MIN..=i16::MAX).collect();
        let i16s: Vec<u8> = all.iter().flat_map(|code| code.to_le_bytes()).collect();
        assert_eq!(runs(&header("i16", 10.0), &i16s).0, vec![Ok(all.clone())]);
        let volts = all.iter().map(|code| f32::from(*code) * 10.0 / 32_768.0);
        let f32s: Vec<u8> = volts.flat_map(f32::to_le_bytes).collect();
        let (got, remarks) = runs(&header("f32", 10.0), &f32s);
        assert_eq!(got, vec![Ok(all)]);
        assert!(
            remarks.iter().all(|remark| !remark.contains("full scale of 10; samples beyond")),
            "{remarks:?}"
        );
    }

    #[test]
    fn scans_that_are_no_numbers_split_the_block() {
        let nan = f32::NAN;
        let samples = [nan, 0.0, 1.0, 1.0, 2.0, 2.0, 0.0, f32::INFINITY, nan, nan];
        let bytes: Vec<u8> = samples.into_iter().flat_map(f32::to_le_bytes).collect();
        let (got, remarks) = runs(&header("f32", 32.768), &bytes);
        assert_eq!(got, vec![Err(1), Ok(vec![1000, 1000, 2000, 2000]), Err(2)]);
        assert_eq!(remarks.len(), 1, "{remarks:?}");
        assert!(remarks[0].contains("`a`") && remarks[0].contains("not a number"), "{remarks:?}");
    }

    #[test]
    fn a_wrong_full_scale_is_told_once_in_both_directions() {
        // b exceeds its full scale by half; a alternates by a fifth of a code
        let scans = (0..3_000).map(|i| if i % 2 == 0 { [0.0, 7.5] } else { [3e-5, -7.5] });
        let bytes: Vec<u8> = scans.flatten().flat_map(f64::to_le_bytes).collect();
        let (got, remarks) = runs(&header("f64", 5.0), &bytes);
        assert_eq!(got[0].as_ref().map(|codes| codes[..4].to_vec()), Ok(vec![0, 32_767, 0, -32_768]));
        assert_eq!(remarks.len(), 2, "{remarks:?}");
        assert!(
            remarks[0].contains("`b`: a sample is 1.500 times its stated full scale of 5"),
            "{remarks:?}"
        );
        assert!(remarks[1].contains("`a`: its noise is 0.14 codes"), "{remarks:?}");
    }
}

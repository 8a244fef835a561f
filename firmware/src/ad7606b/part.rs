//! Differences between the parts that fit the same footprint; input ranges, and the conversion
//! between codes and volts.
//!
//! A code is two's complement, and code 0 is 0 V: one step is `2 × full scale / 2^bits` (AD7606B
//! Rev. 0, "ADC Transfer Function").

/// Full scale of a channel, single-ended and bipolar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Range {
    /// ± 2.5 V.
    Volts2_5,
    /// ± 5 V.
    Volts5,
    /// ± 6.25 V (AD7606C only).
    Volts6_25,
    /// ± 10 V.
    Volts10,
    /// ± 12.5 V (AD7606C only).
    Volts12_5,
}

impl Range {
    /// Its code in the RANGE registers. The AD7606B interprets every code above 1 as ± 10 V and has
    /// 3 after a reset; on the AD7606C, 3 means ± 10 V; so 3 is correct for both.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Full scale, V.
    #[must_use]
    pub const fn full_scale_v(self) -> f32 {
        match self {
            Self::Volts2_5 => 2.5,
            Self::Volts5 => 5.0,
            Self::Volts6_25 => 6.25,
            Self::Volts10 => 10.0,
            Self::Volts12_5 => 12.5,
        }
    }

    /// The range with this full scale, if there is one.
    #[must_use]
    pub fn from_full_scale_v(full_scale_v: f32) -> Option<Self> {
        [Self::Volts2_5, Self::Volts5, Self::Volts6_25, Self::Volts10, Self::Volts12_5]
            .into_iter()
            .find(|range| (range.full_scale_v() - full_scale_v).abs() < 1e-3)
    }

    /// The voltage of a code of `bits` bits, V.
    #[must_use]
    pub fn volts(self, code: i32, bits: u8) -> f32 {
        code as f32 * self.full_scale_v() / half_span(bits)
    }

    /// The code of `bits` bits for a voltage; saturates at the ends of the range.
    #[must_use]
    pub fn code_of(self, volts: f32, bits: u8) -> i32 {
        let half = half_span(bits);
        let steps = volts / self.full_scale_v() * half;
        // rounding without std: add half a step away from zero, then truncate
        let rounded = (steps + if steps < 0.0 { -0.5 } else { 0.5 }).clamp(-half, half - 1.0);
        rounded as i32
    }
}

/// Half of the number of codes.
fn half_span(bits: u8) -> f32 {
    (1_u32 << (bits - 1)) as f32
}

/// Number of conversions that the chip averages into one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Oversampling {
    /// One: no oversampling.
    X1,
    /// Two.
    X2,
    /// Four.
    X4,
    /// Eight.
    X8,
    /// Sixteen.
    X16,
    /// Thirty-two.
    X32,
    /// Sixty-four.
    X64,
    /// A hundred and twenty-eight.
    X128,
    /// Two hundred and fifty-six.
    X256,
}

impl Oversampling {
    /// Code in OS_RATIO of the OVERSAMPLING register.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Conversions per sample.
    #[must_use]
    pub const fn ratio(self) -> u16 {
        1 << self as u8
    }
}

/// DOUT lines used simultaneously.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Lines {
    /// DOUTA.
    One,
    /// DOUTA and DOUTB.
    Two,
    /// DOUTA to DOUTD.
    Four,
    /// DOUTA to DOUTH (AD7606C only).
    Eight,
}

impl Lines {
    /// Its code in the CONFIG register.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Number of lines.
    #[must_use]
    pub const fn count(self) -> usize {
        1 << self as u8
    }
}

/// One part: the data that the driver needs to identify and read it.
#[derive(Debug, PartialEq)]
pub struct Part {
    /// Its name.
    pub name: &'static str,
    /// DEVICE_ID, the upper half of the ID register. The AD7606C's data sheet states 3; chips that
    /// return 2 exist, so both are accepted.
    pub device_ids: &'static [u8],
    /// Bits of a conversion.
    pub bits: u8,
    /// Supported input ranges, single-ended and bipolar.
    pub ranges: &'static [Range],
    /// Largest number of DOUT lines used simultaneously.
    pub most_lines: Lines,
    /// Whether each channel's filter can be set to 220 kHz instead of 25 kHz (BANDWIDTH register).
    pub has_bandwidth: bool,
    /// Longest time from CONVST to the end of BUSY, µs, by [`Oversampling`].
    conversion_us: [u16; 9],
}

/// tCONV, maximum, rounded up to whole µs: AD7606B Rev. 0, "Timing Specifications"; the
/// manufacturer's own driver waits as long.
const CONVERSION_US: [u16; 9] = [1, 3, 5, 10, 20, 41, 81, 162, 324];

/// Eight channels of 16 bits, 800 kSPS, 5 MΩ inputs; filter 11.5 to 23 kHz, depending on the range.
pub const AD7606B: Part = Part {
    name: "AD7606B",
    device_ids: &[1],
    bits: 16,
    ranges: &[Range::Volts2_5, Range::Volts5, Range::Volts10],
    most_lines: Lines::Four,
    has_bandwidth: false,
    conversion_us: CONVERSION_US,
};

/// Ranges of the AD7606C that this driver uses: the single-ended bipolar ones.
const C_RANGES: &[Range] =
    &[Range::Volts2_5, Range::Volts5, Range::Volts6_25, Range::Volts10, Range::Volts12_5];

/// Eight channels of 16 bits, 1 MSPS, 1 MΩ inputs; filter 25 or 220 kHz.
pub const AD7606C_16: Part = Part {
    name: "AD7606C-16",
    device_ids: &[3, 2],
    bits: 16,
    ranges: C_RANGES,
    most_lines: Lines::Eight,
    has_bandwidth: true,
    conversion_us: CONVERSION_US,
};

/// Eight channels of 18 bits, otherwise like the AD7606C-16.
pub const AD7606C_18: Part = Part { name: "AD7606C-18", bits: 18, ..AD7606C_16 };

impl Part {
    /// Longest time from CONVST to the end of BUSY, µs.
    #[must_use]
    pub const fn conversion_us(&self, oversampling: Oversampling) -> u32 {
        self.conversion_us[oversampling as usize] as u32
    }

    /// Delay of a sample relative to CONVST, ns: half of the averaging time.
    #[must_use]
    pub const fn averaging_delay_ns(&self, oversampling: Oversampling) -> u32 {
        match oversampling {
            Oversampling::X1 => 0,
            _ => self.conversion_us(oversampling) * 500,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_conversions_do_not_fit_a_scan_at_51_2_khz_but_eight_do() {
        let scan_us = 1e6 / 51_200.0;
        assert!(f64::from(AD7606B.conversion_us(Oversampling::X8)) < scan_us);
        assert!(f64::from(AD7606B.conversion_us(Oversampling::X16)) > scan_us);
        assert_eq!(AD7606B.averaging_delay_ns(Oversampling::X8), 5_000);
        assert_eq!((Oversampling::X8.code(), Oversampling::X8.ratio()), (3, 8));
    }

    #[test]
    fn codes_are_the_data_sheets() {
        // AD7606B Rev. 0, "ADC Transfer Function": one step is 305 µV, 152 µV and 76 µV
        for (range, step_uv) in [(Range::Volts10, 305.0), (Range::Volts5, 152.0), (Range::Volts2_5, 76.0)] {
            assert!((range.volts(1, 16) * 1e6 - step_uv).abs() < 0.6, "{range:?}");
            assert!((range.volts(-32_768, 16) + range.full_scale_v()).abs() < 1e-6);
        }
    }

    #[test]
    fn volts_and_codes_go_both_ways_and_end_at_the_ends() {
        for bits in [16, 18] {
            for code in [-32_768, -1, 0, 1, 12_345, 32_767] {
                assert_eq!(Range::Volts5.code_of(Range::Volts5.volts(code, bits), bits), code);
            }
        }
        assert_eq!(Range::Volts10.code_of(11.0, 16), 32_767);
        assert_eq!(Range::Volts10.code_of(-11.0, 16), -32_768);
        assert_eq!(Range::from_full_scale_v(10.0), Some(Range::Volts10));
        assert_eq!(Range::from_full_scale_v(7.0), None);
    }
}

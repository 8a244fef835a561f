//! Input ranges; conversion between codes and volts.
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

#[cfg(test)]
mod tests {
    use super::*;

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

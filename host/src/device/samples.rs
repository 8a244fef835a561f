//! Samples of a record as they came: 16- or 32-bit codes of a converter, or floating-point values.
//!
//! Each channel has its own type; nothing is converted or rounded on the way into the campaign
//! file and out of it. The type belongs to the record, the sensor's scale to the session's channel
//! map; the factor from a sample to SI units follows from both ([`SampleType::units`]).

use std::ops::Range;

use jointrig_protocol::channel::Channel;

/// The type of a channel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum SampleType {
    /// Codes of 16 bits; full scale is ±2¹⁵, whatever the converter's resolution.
    #[default]
    I16,
    /// Codes of 32 bits; full scale is ±2ᵇⁱᵗˢ⁻¹ of the channel's `bits`.
    I32,
    /// Values in V, or in SI units with a scale of 1.
    F32,
    /// As `F32`, in double precision.
    F64,
}

impl SampleType {
    /// All types.
    pub const ALL: [Self; 4] = [Self::I16, Self::I32, Self::F32, Self::F64];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::I16 => "i16",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|of| of.name() == name)
    }

    /// Size of a sample, bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::I16 => 2,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Whether samples are codes of a converter.
    pub const fn is_code(self) -> bool {
        matches!(self, Self::I16 | Self::I32)
    }

    /// SI units per sample of this type on `channel`; exactly 1 for floating-point samples in SI
    /// units, whose channels have one unit per volt.
    pub fn units(self, channel: &Channel) -> f64 {
        match self {
            Self::I16 => channel.units_per_code(),
            Self::I32 => {
                f64::from(channel.units_per_volt) * f64::from(channel.range_v) / half_range(channel.bits)
            }
            Self::F32 | Self::F64 => f64::from(channel.units_per_volt),
        }
    }

    /// SI value of the channel's full scale, always positive; `None` if the range is unknown, as
    /// for imported records.
    pub fn full_scale(self, channel: &Channel) -> Option<f64> {
        let known = channel.range_v > 0.0;
        known.then(|| f64::from(channel.range_v) * f64::from(channel.units_per_volt).abs())
    }

    /// The smallest and the largest code of the converter; `None` for values that are no codes.
    pub fn extremes(self, bits: u8) -> Option<[i32; 2]> {
        match self {
            Self::I16 => Some([i16::MIN.into(), i16::MAX.into()]),
            Self::I32 => {
                let half = half_range(bits);
                Some([-half as i32, (half - 1.0) as i32])
            }
            Self::F32 | Self::F64 => None,
        }
    }
}

/// Half the number of codes of a converter of up to 32 bits.
fn half_range(bits: u8) -> f64 {
    f64::from(1_u32 << (bits.clamp(1, 32) - 1))
}

/// The samples of one channel.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelSamples {
    /// Codes of 16 bits.
    I16(Vec<i16>),
    /// Codes of 32 bits.
    I32(Vec<i32>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

/// The samples of one channel, or a part of them, borrowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChannelView<'a> {
    /// Codes of 16 bits.
    I16(&'a [i16]),
    /// Codes of 32 bits.
    I32(&'a [i32]),
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

/// Evaluates an expression with the samples of either enum, whatever their type.
macro_rules! each_type {
    ($enum:ident, $of:expr, $samples:ident => $do:expr) => {
        match $of {
            $enum::I16($samples) => $do,
            $enum::I32($samples) => $do,
            $enum::F32($samples) => $do,
            $enum::F64($samples) => $do,
        }
    };
}
pub(crate) use each_type;

impl ChannelSamples {
    /// No samples of this type.
    pub const fn empty(of: SampleType) -> Self {
        match of {
            SampleType::I16 => Self::I16(Vec::new()),
            SampleType::I32 => Self::I32(Vec::new()),
            SampleType::F32 => Self::F32(Vec::new()),
            SampleType::F64 => Self::F64(Vec::new()),
        }
    }

    /// The samples whose values in SI units are these, with `units` per sample; the index of the
    /// first value that no sample of this type has.
    ///
    /// A value is a sample times `units`, rounded to double precision. Division gives the sample
    /// back but for the last digits: a code is the nearest whole number, and a floating-point
    /// sample is looked for among its neighbours until its product is the value.
    ///
    /// # Errors
    /// The index of that value.
    pub fn from_si(of: SampleType, units: f64, si: &[f64]) -> Result<Self, usize> {
        fn all<T>(si: &[f64], one: impl Fn(f64) -> Option<T>) -> Result<Vec<T>, usize> {
            si.iter().enumerate().map(|(at, value)| one(*value).ok_or(at)).collect()
        }
        let code = |value: f64, [low, high]: [i32; 2]| {
            let code = (value / units).round();
            (code * units == value && (f64::from(low)..=f64::from(high)).contains(&code)).then_some(code)
        };
        Ok(match of {
            SampleType::I16 => {
                let range = [i16::MIN.into(), i16::MAX.into()];
                Self::I16(all(si, |value| code(value, range).map(|code| code as i16))?)
            }
            SampleType::I32 => {
                let range = [i32::MIN, i32::MAX];
                Self::I32(all(si, |value| code(value, range).map(|code| code as i32))?)
            }
            SampleType::F32 => Self::F32(all(si, |value| {
                let near = (value / units) as f32;
                let same = |sample: &f32| (f64::from(*sample) * units).to_bits() == value.to_bits();
                [near, near.next_up(), near.next_down()].into_iter().find(same)
            })?),
            SampleType::F64 => Self::F64(all(si, |value| {
                let near = value / units;
                let same = |sample: &f64| (sample * units).to_bits() == value.to_bits();
                [near, near.next_up(), near.next_down()].into_iter().find(same)
            })?),
        })
    }

    /// A borrowed view.
    pub fn view(&self) -> ChannelView<'_> {
        match self {
            Self::I16(samples) => ChannelView::I16(samples),
            Self::I32(samples) => ChannelView::I32(samples),
            Self::F32(samples) => ChannelView::F32(samples),
            Self::F64(samples) => ChannelView::F64(samples),
        }
    }
}

impl<'a> ChannelView<'a> {
    /// Their type.
    pub const fn of(self) -> SampleType {
        match self {
            Self::I16(_) => SampleType::I16,
            Self::I32(_) => SampleType::I32,
            Self::F32(_) => SampleType::F32,
            Self::F64(_) => SampleType::F64,
        }
    }

    /// Number of samples.
    pub const fn len(self) -> usize {
        each_type!(ChannelView, self, samples => samples.len())
    }

    /// Whether there are none.
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The samples from `from` to before `to`, as far as they exist.
    #[must_use]
    pub fn part(self, from: usize, to: usize) -> ChannelView<'a> {
        let (from, to) = (from.min(self.len()), to.min(self.len()));
        let range = from..to.max(from);
        match self {
            Self::I16(samples) => Self::I16(&samples[range]),
            Self::I32(samples) => Self::I32(&samples[range]),
            Self::F32(samples) => Self::F32(&samples[range]),
            Self::F64(samples) => Self::F64(&samples[range]),
        }
    }

    /// A copy of the samples.
    pub fn to_owned(self) -> ChannelSamples {
        match self {
            Self::I16(samples) => ChannelSamples::I16(samples.to_vec()),
            Self::I32(samples) => ChannelSamples::I32(samples.to_vec()),
            Self::F32(samples) => ChannelSamples::F32(samples.to_vec()),
            Self::F64(samples) => ChannelSamples::F64(samples.to_vec()),
        }
    }

    /// Appends the samples times `factor` to `out`.
    pub fn scaled(self, factor: f64, out: &mut Vec<f64>) {
        fn of<T: Copy + Into<f64>>(samples: &[T], factor: f64, out: &mut Vec<f64>) {
            out.extend(samples.iter().map(|sample| (*sample).into() * factor));
        }
        each_type!(ChannelView, self, samples => of(samples, factor, out));
    }

    /// Mean of the samples; `None` if there are none.
    pub fn mean(self) -> Option<f64> {
        fn of<T: Copy + Into<f64>>(samples: &[T]) -> f64 {
            samples.iter().map(|sample| (*sample).into()).sum()
        }
        let sum = each_type!(ChannelView, self, samples => of(samples));
        (!self.is_empty()).then(|| sum / self.len() as f64)
    }

    /// Passes each sample to `put` with the value in the same place of `targets`.
    pub fn put(self, targets: &mut [f64], put: impl Fn(&mut f64, f64)) {
        fn of<T: Copy + Into<f64>>(samples: &[T], targets: &mut [f64], put: impl Fn(&mut f64, f64)) {
            targets.iter_mut().zip(samples).for_each(|(target, sample)| put(target, (*sample).into()));
        }
        each_type!(ChannelView, self, samples => of(samples, targets, put));
    }

    /// Number of codes at an end of the converter's range of `bits`; 0 for values that are not
    /// codes.
    pub fn at_the_ends(self, bits: u8) -> usize {
        let Some([low, high]) = self.of().extremes(bits) else { return 0 };
        match self {
            // the comparison of 16-bit codes is kept in 16 bits, which is twice as fast
            Self::I16(codes) => codes.iter().filter(|code| matches!(**code, i16::MIN | i16::MAX)).count(),
            Self::I32(codes) => codes.iter().filter(|code| **code <= low || **code >= high).count(),
            Self::F32(_) | Self::F64(_) => 0,
        }
    }

    /// Index of the first sample that is not a number or infinite.
    pub fn not_finite(self) -> Option<usize> {
        match self {
            Self::I16(_) | Self::I32(_) => None,
            Self::F32(samples) => samples.iter().position(|value| !value.is_finite()),
            Self::F64(samples) => samples.iter().position(|value| !value.is_finite()),
        }
    }
}

/// The samples of a record: channels of equal length, each of its own type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    channels: Vec<ChannelSamples>,
}

impl Samples {
    /// The samples of these channels; `None` if they differ in length.
    pub fn new(channels: Vec<ChannelSamples>) -> Option<Self> {
        let alike = channels.windows(2).all(|two| two[0].view().len() == two[1].view().len());
        alike.then_some(Self { channels })
    }

    /// 16-bit codes, one channel after another; codes beyond a whole number of scans are left out.
    pub fn of_codes(codes: &[i16], channels: usize) -> Self {
        let scans = codes.len().checked_div(channels).unwrap_or(0);
        let of = |place: usize| ChannelSamples::I16(codes[place * scans..(place + 1) * scans].to_vec());
        Self { channels: (0..channels).map(of).collect() }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Samples per channel.
    pub fn scans(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.view().len())
    }

    /// A copy of these scans of every channel, as far as they exist.
    #[must_use]
    pub fn part(&self, scans: Range<usize>) -> Self {
        Self { channels: self.each().map(|own| own.part(scans.start, scans.end).to_owned()).collect() }
    }

    /// The type of each channel.
    pub fn types(&self) -> Vec<SampleType> {
        self.each().map(ChannelView::of).collect()
    }

    /// The samples of one channel; empty for an index beyond the last one.
    pub fn channel(&self, place: usize) -> ChannelView<'_> {
        self.channels.get(place).map_or(ChannelView::I16(&[]), ChannelSamples::view)
    }

    /// The samples of every channel, in order.
    pub fn each(&self) -> impl ExactSizeIterator<Item = ChannelView<'_>> {
        self.channels.iter().map(ChannelSamples::view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Quantity, Role};

    fn channel(bits: u8) -> Channel {
        Channel {
            name: "a".parse().expect("short"),
            role: Role::HammerForce,
            quantity: Quantity::Force,
            units_per_volt: -44.5,
            range_v: 10.0,
            delay_ns: 0,
            bits,
        }
    }

    #[test]
    fn full_scale_is_the_same_number_in_every_type() {
        // an 18-bit converter's 16-bit codes have the full scale of 16 bits
        assert_eq!(SampleType::I16.units(&channel(18)) * 32_768.0, -445.0);
        assert_eq!(SampleType::I32.units(&channel(24)) * 8_388_608.0, -445.0);
        assert_eq!(SampleType::I32.units(&channel(32)) * 2_147_483_648.0, -445.0);
        assert_eq!(SampleType::F64.units(&channel(24)) * 10.0, -445.0);
        let si = Channel { units_per_volt: 1.0, range_v: 0.0, ..channel(24) };
        assert_eq!((SampleType::F32.units(&si), SampleType::F64.units(&si)), (1.0, 1.0));
        for of in SampleType::ALL {
            assert_eq!(of.full_scale(&channel(24)), Some(445.0));
            assert_eq!(of.full_scale(&si), None);
            assert_eq!(SampleType::named(of.name()), Some(of));
        }
        assert_eq!(SampleType::I32.extremes(24), Some([-8_388_608, 8_388_607]));
        assert_eq!(SampleType::I32.extremes(32), Some([i32::MIN, i32::MAX]));
        assert_eq!(SampleType::F32.extremes(24), None);
    }

    #[test]
    fn samples_come_back_from_si_units_and_other_values_are_told() {
        // a scale with all digits, and a negative one
        for units_per_volt in [44.643_21_f32, -0.001_25, 1.0 / 3.0] {
            let channel = Channel { units_per_volt, ..channel(24) };
            let all = [
                ChannelSamples::I16((i16::MIN..=i16::MAX).collect()),
                ChannelSamples::I32((-8_388_608..8_388_607).step_by(977).collect()),
                ChannelSamples::F32((1..2_000_u16).map(|i| f32::from(i).sqrt() - 20.0).collect()),
            ];
            for samples in all {
                let of = samples.view().of();
                let mut si = Vec::new();
                samples.view().scaled(of.units(&channel), &mut si);
                assert_eq!(ChannelSamples::from_si(of, of.units(&channel), &si), Ok(samples));
            }
            // several samples may have one value in SI units: its own value is what comes back
            let samples: Vec<f64> = (1..2_000_u16).map(|i| f64::from(i).sqrt() - 20.0).collect();
            let (mut si, mut again) = (Vec::new(), Vec::new());
            let units = SampleType::F64.units(&channel);
            ChannelView::F64(&samples).scaled(units, &mut si);
            ChannelSamples::from_si(SampleType::F64, units, &si)
                .expect("there")
                .view()
                .scaled(units, &mut again);
            assert_eq!(si, again);
        }
        assert_eq!(ChannelSamples::from_si(SampleType::I16, 0.5, &[1.0, 1.25]), Err(1));
        assert_eq!(ChannelSamples::from_si(SampleType::I16, 0.5, &[16_384.0]), Err(0));
        assert_eq!(ChannelSamples::from_si(SampleType::F32, 1.0, &[0.1]), Err(0));
        assert_eq!(ChannelSamples::from_si(SampleType::I16, 0.5, &[f64::NAN]), Err(0));
    }

    #[test]
    fn channels_keep_their_type_and_have_one_length() {
        let samples = Samples::new(vec![
            ChannelSamples::I16(vec![i16::MIN, 3, i16::MAX]),
            ChannelSamples::I32(vec![-8_388_608, 8_388_606, 8_388_607]),
            ChannelSamples::F32(vec![0.5, -0.0, f32::MIN_POSITIVE]),
            ChannelSamples::F64(vec![0.1, -0.2, f64::MAX]),
        ])
        .expect("equally long");
        assert_eq!((samples.channels(), samples.scans()), (4, 3));
        assert_eq!(samples.types(), SampleType::ALL);
        assert_eq!([0, 1, 2, 3].map(|place| samples.channel(place).at_the_ends(24)), [2, 2, 0, 0]);
        assert_eq!(samples.channel(3).part(1, 9), ChannelView::F64(&[-0.2, f64::MAX]));
        assert!(samples.channel(3).part(5, 2).is_empty() && samples.channel(4).is_empty());
        let mut sum = vec![1.0; 3];
        samples.channel(0).put(&mut sum, |sum, code| *sum += 2.0 * code);
        assert_eq!(sum, [-65_535.0, 7.0, 65_535.0]);
        let unequal = vec![ChannelSamples::I16(vec![1]), ChannelSamples::F64(vec![])];
        assert_eq!(Samples::new(unequal), None);
        let codes = Samples::of_codes(&[1, 2, 3, 4], 2);
        assert_eq!(codes.channel(1), ChannelView::I16(&[3, 4]));
        assert_eq!(Samples::of_codes(&[], 3).channels(), 3);
        assert_eq!(ChannelView::F64(&[1.0, f64::INFINITY]).not_finite(), Some(1));
        assert_eq!(ChannelView::F32(&[f32::NAN]).not_finite(), Some(0));
    }
}

//! Statistics of a cell's good records, for judging the next one: the usual noise of each channel,
//! and the uncertainty of the FRFs so far.

use jointrig_protocol::channel::{Quantity, Role};

use crate::campaign::plan::{Enough, Plan};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelView, Samples};
use crate::spectra::{CrossSpectra, Pulse, Summing, Windowing};

/// Number of good records needed for a usual noise.
const FEW: usize = 3;

/// Block whose rms is one estimate of the noise, samples.
const BLOCK: usize = 64;

/// Rms of a converter's rounding alone, codes: lower noise cannot be measured.
const ROUNDING: f64 = 0.29;

/// The good records of one cell so far.
#[derive(Default)]
pub struct Others {
    /// Indices of the channels whose FRFs are tracked.
    responses: Vec<usize>,
    noise: Vec<Vec<f64>>,
    sums: Option<Summing>,
}

impl Others {
    /// No records yet; the FRFs of the channels with these indices will be tracked.
    pub fn of(responses: Vec<usize>) -> Self {
        Self { responses, ..Self::default() }
    }

    /// Adds a good record. The FRFs are tracked only if the plan defines when they are good enough.
    pub fn learn(&mut self, plan: &Plan, channels: &ChannelMap, samples: &Samples) {
        self.noise.push(channel_noise(channels, samples));
        if let Some(enough) = &plan.enough {
            self.add_to_sums(plan, enough.get_ref(), channels, samples);
        }
    }

    /// Number of records.
    pub fn hits(&self) -> usize {
        self.noise.len()
    }

    /// Usual noise of the channel at `place`, in its unit: the median; `None` with too few records.
    pub fn usual_noise(&self, place: usize) -> Option<f64> {
        if self.noise.len() < FEW {
            return None;
        }
        let mut of_channel: Vec<f64> =
            self.noise.iter().filter_map(|record| record.get(place)).copied().collect();
        let middle = of_channel.len() / 2;
        (middle < of_channel.len()).then(|| *of_channel.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Relative random error of the averaged FRFs, √(Σ var H1 / Σ |H1|²) over lines and axes of the
    /// band; `None` with fewer than two hits.
    pub fn random_error(&self, enough: &Enough) -> Option<f64> {
        let found = self.sums.as_ref()?.finish(&[]).ok().filter(|found| found.hits() > 1)?;
        let [low_hz, high_hz] = enough.band_hz;
        let band = found.band(low_hz, high_hz);
        // `variance` is that of the real part; the imaginary part has the same
        let variance: f64 =
            band.rows(CrossSpectra::variance).into_iter().flatten().map(|variance| 2.0 * variance).sum();
        let power: f64 =
            band.rows(CrossSpectra::h1).iter().flatten().map(num_complex::Complex::norm_sqr).sum();
        (power > 0.0).then(|| (variance / power).sqrt())
    }

    fn add_to_sums(&mut self, plan: &Plan, enough: &Enough, channels: &ChannelMap, samples: &Samples) {
        let Some(force) = channels.place(Role::HammerForce) else { return };
        let fs_hz = channels.fs_hz();
        let si = |place: usize| channels.to_si(place, samples.channel(place));
        let force_n = si(force);
        let Some(pulse) = Pulse::locate(&force_n) else { return };
        let window =
            Windowing { sigma_per_s: plan.window.get_ref().exponential_per_s, ..Windowing::default() };
        let responses: Vec<Vec<f64>> = self.responses.iter().copied().map(si).collect();
        let responses: Vec<&[f64]> = responses.iter().map(Vec::as_slice).collect();
        let sums = self.sums.get_or_insert_with(|| {
            Summing::new(fs_hz, force_n.len(), responses.len(), window, enough.band_hz)
        });
        if let Err(error) = sums.add(&force_n, &responses, &pulse) {
            log::warn!("a good record is left out of the cell's FRFs: {error}");
        }
    }
}

/// Noise of every channel in its unit; 0 for channels that measure neither velocity nor
/// acceleration.
pub fn channel_noise(channels: &ChannelMap, samples: &Samples) -> Vec<f64> {
    let of = |(place, channel): (usize, &jointrig_protocol::channel::Channel)| {
        if matches!(channel.quantity, Quantity::Velocity | Quantity::Acceleration) {
            let own = samples.channel(place);
            noise(own) * own.of().units(channel).abs()
        } else {
            0.0
        }
    };
    channels.channels.iter().enumerate().map(of).collect()
}

/// Rms of the broadband noise, in units of the samples: third differences (which remove smooth
/// motion) over the second half of the record, where the motion has decayed; the median over
/// blocks, so that a single spike, which has a separate check, does not count. Never below what
/// can be measured: rounding for codes, and for other values the rounding of a 16-bit converter
/// with the record's largest value as its full scale, because less changes no result, and would
/// be compared with nothing in records without noise.
fn noise(samples: ChannelView<'_>) -> f64 {
    let mut late = Vec::new();
    samples.part(samples.len() / 2, samples.len()).scaled(1.0, &mut late);
    let floor = if samples.of().is_code() {
        ROUNDING
    } else {
        let mut all = Vec::new();
        samples.scaled(1.0, &mut all);
        ROUNDING * all.iter().fold(0.0f64, |most, v| most.max(v.abs())) / 32_768.0
    };
    // third differences of white noise have 1 + 9 + 9 + 1 times its power
    let squared = |w: &[f64]| (w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3]).powi(2) / 20.0;
    let blocks = late.len().saturating_sub(3) / BLOCK;
    let of_block = |n: usize| late[n * BLOCK..(n + 1) * BLOCK + 3].windows(4).map(squared).sum::<f64>();
    let mut power: Vec<f64> = (0..blocks).map(|n| of_block(n) / BLOCK as f64).collect();
    let middle = power.len() / 2;
    if power.is_empty() {
        return floor;
    }
    power.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt().max(floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_told_from_motion() {
        let mut seed = 1_u64;
        let mut dice = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        // uniform in ±17.3: rms 10
        let codes: Vec<i16> = (0..20_000)
            .map(|i| (3_000.0 * (f64::from(i) * 0.02).sin() + 34.64 * dice()).round() as i16)
            .collect();
        let wide: Vec<i32> = codes.iter().map(|code| 256 * i32::from(*code)).collect();
        let single: Vec<f32> = codes.iter().map(|code| f32::from(*code) / 1024.0).collect();
        let double: Vec<f64> = codes.iter().map(|code| f64::from(*code) / 1e9).collect();
        for (found, rms) in [
            (noise(ChannelView::I16(&codes)), 10.0),
            (noise(ChannelView::I32(&wide)), 2560.0),
            (noise(ChannelView::F32(&single)), 10.0 / 1024.0),
            (noise(ChannelView::F64(&double)), 1e-8),
        ] {
            assert!((found / rms - 1.0).abs() < 0.05, "{found} for {rms}");
        }
        assert_eq!(noise(ChannelView::I16(&[0; 1_000])), ROUNDING);
        assert_eq!(noise(ChannelView::I16(&[])), ROUNDING);
        assert_eq!(noise(ChannelView::I32(&[0; 1_000])), ROUNDING);
        // without noise and without codes, nothing below a 16-bit converter's rounding counts
        let quiet: Vec<f64> = (0..20_000).map(|i| 1e-3 * (-1e-3 * f64::from(i)).exp()).collect();
        let found = noise(ChannelView::F64(&quiet));
        assert!((found / (1e-3 * ROUNDING / 32_768.0) - 1.0).abs() < 1e-3, "{found}");
        assert_eq!(noise(ChannelView::F64(&[0.0; 1_000])), 0.0);
    }
}

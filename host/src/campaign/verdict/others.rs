//! What a cell's good records have in common, for judging the next one: how noisy each channel usually is, and how well the
//! FRFs are known already.

use jointrig_protocol::channel::{Quantity, Role};

use crate::campaign::plan::{Enough, Plan};
use crate::device::channels::ChannelMap;
use crate::device::recording::Codes;
use crate::spectra::{CrossSpectra, Pulse, Summing, Windowing};

/// Good records from which on there is something usual.
const FEW: usize = 3;

/// Block whose rms is one estimate of the noise, samples.
const BLOCK: usize = 64;

/// A converter's rounding alone has this rms, codes: less noise than that cannot be told.
const ROUNDING: f64 = 0.29;

/// The good records of one cell so far.
#[derive(Default)]
pub struct Others {
    /// Places of the channels whose FRFs are followed.
    responses: Vec<usize>,
    noise: Vec<Vec<f64>>,
    sums: Option<Summing>,
}

impl Others {
    /// None yet; the FRFs of the channels at these places will be followed.
    pub fn of(responses: Vec<usize>) -> Self {
        Self { responses, ..Self::default() }
    }

    /// Learns from a good record. The FRFs are followed only where the plan asks when they are good enough.
    pub fn learn(&mut self, plan: &Plan, channels: &ChannelMap, codes: Codes<'_>) {
        self.noise.push(channel_noise(channels, codes));
        if let Some(enough) = &plan.enough {
            self.add_to_sums(plan, enough.get_ref(), channels, codes);
        }
    }

    /// How many there are.
    pub fn hits(&self) -> usize {
        self.noise.len()
    }

    /// How noisy the channel at `place` usually is, in its unit: the median; none of a few records.
    pub fn usual_noise(&self, place: usize) -> Option<f64> {
        if self.noise.len() < FEW {
            return None;
        }
        let mut of_channel: Vec<f64> =
            self.noise.iter().filter_map(|record| record.get(place)).copied().collect();
        let middle = of_channel.len() / 2;
        (middle < of_channel.len()).then(|| *of_channel.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Random error of the averaged FRFs as a part of them, √(Σ var H1 / Σ |H1|²) over lines and axes of the band; none of
    /// fewer than two hits.
    pub fn random_error(&self, enough: &Enough) -> Option<f64> {
        let found = self.sums.as_ref()?.finish(&[]).ok().filter(|found| found.hits() > 1)?;
        let [low_hz, high_hz] = enough.band_hz;
        let band = found.band(low_hz, high_hz);
        // `variance` is the real part's; the imaginary part has as much
        let variance: f64 =
            band.rows(CrossSpectra::variance).into_iter().flatten().map(|variance| 2.0 * variance).sum();
        let power: f64 =
            band.rows(CrossSpectra::h1).iter().flatten().map(num_complex::Complex::norm_sqr).sum();
        (power > 0.0).then(|| (variance / power).sqrt())
    }

    fn add_to_sums(&mut self, plan: &Plan, enough: &Enough, channels: &ChannelMap, codes: Codes<'_>) {
        let Some(force) = channels.place(Role::HammerForce) else { return };
        let fs_hz = channels.fs_hz();
        let si = |place: usize| channels.to_si(place, codes.channel(place));
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
            log::warn!("a good record does not enter the cell's FRFs: {error}");
        }
    }
}

/// Noise of every channel in its unit; 0 for those that measure neither velocity nor acceleration.
pub fn channel_noise(channels: &ChannelMap, codes: Codes<'_>) -> Vec<f64> {
    let of = |(place, channel): (usize, &jointrig_protocol::channel::Channel)| {
        if matches!(channel.quantity, Quantity::Velocity | Quantity::Acceleration) {
            noise_codes(codes.channel(place)) * channel.units_per_code().abs()
        } else {
            0.0
        }
    };
    channels.channels.iter().enumerate().map(of).collect()
}

/// Rms of the broadband noise, codes: third differences (which remove smooth motion) over the second half of the record, where
/// it has decayed; the median over blocks, so that a single spike, which has a check of its own, does not count.
fn noise_codes(codes: &[i16]) -> f64 {
    let late = &codes[codes.len() / 2..];
    // third differences of white noise have 1 + 9 + 9 + 1 times its power
    let squared = |w: &[i16]| {
        let [a, b, c, d] = [w[0], w[1], w[2], w[3]].map(f64::from);
        (a - 3.0 * b + 3.0 * c - d).powi(2) / 20.0
    };
    let blocks = late.len().saturating_sub(3) / BLOCK;
    let of_block = |n: usize| late[n * BLOCK..(n + 1) * BLOCK + 3].windows(4).map(squared).sum::<f64>();
    let mut power: Vec<f64> = (0..blocks).map(|n| of_block(n) / BLOCK as f64).collect();
    let middle = power.len() / 2;
    if power.is_empty() {
        return ROUNDING;
    }
    power.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt().max(ROUNDING)
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
        // even in ±17.3: rms 10
        let codes: Vec<i16> = (0..20_000)
            .map(|i| (3_000.0 * (f64::from(i) * 0.02).sin() + 34.64 * dice()).round() as i16)
            .collect();
        let found = noise_codes(&codes);
        assert!((found / 10.0 - 1.0).abs() < 0.05, "{found}");
        assert_eq!(noise_codes(&[0; 1_000]), ROUNDING);
        assert_eq!(noise_codes(&[]), ROUNDING);
    }
}

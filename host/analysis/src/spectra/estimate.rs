//! From impact records to spectra: takes the raw signals of the hammer and the sensors, finds the
//! start of each hit, applies windows, averages spectra, and finds the band in which the hammer
//! effectively excited the structure.

use super::SpectraError;
use super::average::SpectraAverage;
use super::cross_spectra::CrossSpectra;
use super::fft::Windowed;
use super::pulse::Pulse;
use super::window::{Decay, PulseSamples, ResponseWeighting, Windowing};
use crate::band::Band;
use crate::frf::MotionQuantity;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The origin t₀ of the windows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The start of each hit's main pulse, found in its force.
    PulseStart,
    /// This long after every record's start, s (a fixed pre-trigger).
    At(f64),
}

/// Settings for converting records to FRFs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrfSettings {
    /// The windows.
    pub windowing: Windowing,
    /// Their origin.
    pub origin: Origin,
    /// Delay of each response channel relative to the force, s; empty means 0.
    pub delay_s: Vec<f64>,
    /// Length of the transform, samples. If it exceeds that of the records, they are zero-padded
    /// after windowing. `None` is the records' length.
    #[serde(default)]
    pub transform_samples: Option<usize>,
    /// The lines to compute, Hz, ends included; `None` for all of them.
    #[serde(default)]
    pub band_hz: Option<[f64; 2]>,
    /// Whether to compute the jackknife variance as well, which requires keeping the spectra of all
    /// hits.
    #[serde(default)]
    pub jackknife: bool,
    /// Ratio of noise powers for Hv, response over force, (SI/N)²; `None` for noise in proportion
    /// to the signals.
    #[serde(default)]
    pub noise_ratio: Option<f64>,
}

impl Default for FrfSettings {
    fn default() -> Self {
        FrfSettings {
            windowing: Windowing::default(),
            origin: Origin::PulseStart,
            delay_s: Vec::new(),
            transform_samples: None,
            band_hz: None,
            jackknife: false,
            noise_ratio: None,
        }
    }
}

/// Average of hits of one rate and length that arrive one at a time: each is windowed and summed,
/// and need not be kept.
pub struct Summing {
    fs_hz: f64,
    windowing: Windowing,
    decay: Arc<Decay>,
    average: SpectraAverage,
    samples: usize,
    outputs: usize,
}

impl Summing {
    /// For records of `samples` samples and `outputs` responses, which are summed only at the lines
    /// of `band_hz` (ends included).
    pub fn new(fs_hz: f64, samples: usize, outputs: usize, windowing: Windowing, band_hz: [f64; 2]) -> Self {
        let average = SpectraAverage::of_band(fs_hz, samples, outputs, band_hz);
        let decay = windowing.kept_decay(fs_hz, samples);
        Summing { fs_hz, windowing, decay, average, samples, outputs }
    }

    /// Adds a hit: its force, N, and its responses, SI, as recorded, and the pulse of its force,
    /// whose start is the origin of the windows.
    ///
    /// # Errors
    /// A length or number of responses that differs from that of the other hits, or a value that is
    /// not finite.
    pub fn add(&mut self, force_n: &[f64], responses: &[&[f64]], pulse: &Pulse) -> Result<(), SpectraError> {
        if responses.len() != self.outputs {
            return Err(SpectraError::Responses { found: responses.len(), expected: self.outputs });
        }
        if let Some(odd) = responses.iter().chain([&force_n]).find(|x| x.len() != self.samples) {
            return Err(SpectraError::Samples { found: odd.len(), expected: self.samples });
        }
        let (window, decay) = (&self.windowing, &self.decay);
        let origin_s = pulse.start as f64 / self.fs_hz;
        let pulse = PulseSamples::of(pulse, force_n);
        let weighting = window.of_response(decay, origin_s);
        self.average.add_with(
            |out| window.force_into(force_n, decay, origin_s, &pulse, out),
            |o| Windowed::response(responses[o], &weighting),
        )
    }

    /// The spectra so far, corrected for the delay `delay_s[output]` of each response.
    ///
    /// # Errors
    /// As for [`SpectraAverage::finish`].
    pub fn finish(&self, delay_s: &[f64]) -> Result<CrossSpectra, SpectraError> {
        self.average.finish(self.windowing.sigma_per_s, delay_s)
    }

    /// The force only, at all lines.
    ///
    /// # Errors
    /// As for [`SpectraAverage::finish`].
    pub fn force(&self) -> Result<CrossSpectra, SpectraError> {
        self.average.force(self.windowing.sigma_per_s)
    }
}

/// A hit that is included in the average.
struct AveragedHit<'r> {
    force: &'r [f64],
    responses: &'r [Vec<f64>],
    origin_s: f64,
    pulse: PulseSamples,
    weighting: ResponseWeighting<'r>,
}

/// Auto- and cross-spectra over the hits of `records` for which `used` is true.
///
/// # Errors
/// When no hit is used, hits differ in length or channels, or a used hit has no pulse or contains
/// values that are not finite.
pub fn estimate(
    records: &ImpactRecords,
    used: &[bool],
    settings: &FrfSettings,
) -> Result<CrossSpectra, SpectraError> {
    summed(records, used, settings)?.finish(settings.windowing.sigma_per_s, &settings.delay_s)
}

/// The sums from which [`estimate`] computes its spectra.
pub(super) fn summed(
    records: &ImpactRecords,
    used: &[bool],
    settings: &FrfSettings,
) -> Result<SpectraAverage, SpectraError> {
    let first = used.iter().position(|u| *u).ok_or(SpectraError::NoHits)?;
    let samples = records.force_n.get(first).ok_or(SpectraError::NoHits)?.len();
    let outputs = records.response.get(first).ok_or(SpectraError::NoHits)?.len();
    let transform = settings.transform_samples.unwrap_or(samples);
    if transform < samples {
        return Err(SpectraError::Padding { transform, samples });
    }
    let window = &settings.windowing;
    let decay = window.kept_decay(records.fs_hz, samples);
    let mut average = match settings.band_hz {
        None => SpectraAverage::new(records.fs_hz, transform, outputs),
        Some(band_hz) => SpectraAverage::of_band(records.fs_hz, transform, outputs, band_hz),
    };
    if settings.jackknife {
        average = average.with_jackknife();
    }
    let mut hits = Vec::new();
    for (hit, (force, responses)) in records.force_n.iter().zip(&records.response).enumerate() {
        if !used.get(hit).copied().unwrap_or(false) {
            continue;
        }
        if responses.len() != outputs {
            return Err(SpectraError::Responses { found: responses.len(), expected: outputs });
        }
        if let Some(odd) = responses.iter().chain([force]).find(|x| x.len() != samples) {
            return Err(SpectraError::Samples { found: odd.len(), expected: samples });
        }
        let found = Pulse::locate(force);
        let origin_s = match settings.origin {
            Origin::At(seconds) => seconds,
            Origin::PulseStart => found.ok_or(SpectraError::NoPulse { hit })?.start as f64 / records.fs_hz,
        };
        let pulse = found.map_or_else(PulseSamples::none, |pulse| PulseSamples::of(&pulse, force));
        let weighting = window.of_response(&decay, origin_s);
        hits.push(AveragedHit { force, responses, origin_s, pulse, weighting });
    }
    average.add_hits(
        hits.len(),
        &|hit, out| {
            let AveragedHit { force, origin_s, pulse, .. } = &hits[hit];
            window.force_into(force, &decay, *origin_s, pulse, out);
        },
        &|hit, o| {
            let AveragedHit { responses, weighting, .. } = &hits[hit];
            Windowed::response(&responses[o], weighting)
        },
    )?;
    Ok(average)
}

/// Hits of one impact position with the same response channels.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactRecords {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Hammer force \[hit\]\[sample\], N.
    pub force_n: Vec<Vec<f64>>,
    /// Responses \[hit\]\[channel\]\[sample\], SI.
    pub response: Vec<Vec<Vec<f64>>>,
    /// Quantity of the responses.
    pub quantity: MotionQuantity,
}

/// The band around the maximum of the force auto-spectrum in which the spectrum stays within
/// `drop_db` (conventionally 6 dB) of it.
///
/// `s_ff` is a power: −6 dB is a factor of four. `None` when there is no line above 0 Hz or no
/// force.
pub fn usable_band(frequency_hz: &[f64], s_ff: &[f64], drop_db: f64) -> Option<Band> {
    let first = frequency_hz.iter().position(|f| *f > 0.0)?;
    let n = frequency_hz.len().min(s_ff.len());
    let top = (first..n).max_by(|&a, &b| s_ff[a].total_cmp(&s_ff[b]))?;
    let limit = s_ff[top] * 10f64.powf(-drop_db / 10.0);
    if !limit.is_finite() || limit <= 0.0 {
        return None;
    }
    let low = (first..=top).rev().take_while(|&l| s_ff[l] >= limit).last()?;
    let high = (top..n).take_while(|&l| s_ff[l] >= limit).last()?;
    Some(Band { low_hz: frequency_hz[low], high_hz: frequency_hz[high] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_sine_of_0_41_ms_reaches_2_khz() {
        let f: Vec<f64> = (0..1000).map(|i| 5.0 * i as f64).collect();
        // |F| of a half sine of width T: cos(π f T) / (1 − (2 f T)²)
        let s: Vec<f64> = f
            .iter()
            .map(|f| {
                let x = f * 0.41e-3;
                if (x - 0.5).abs() < 1e-9 {
                    std::f64::consts::FRAC_PI_4.powi(2)
                } else {
                    ((std::f64::consts::PI * x).cos() / (1.0 - 4.0 * x * x)).powi(2)
                }
            })
            .collect();
        let band = usable_band(&f, &s, 6.0).expect("a band");
        assert_eq!(band.low_hz, 5.0);
        // −6 dB of a half sine lies at 0.82 / T = 2.0 kHz
        assert!((band.high_hz - 2000.0).abs() < 30.0, "{band:?}");
        assert_eq!(usable_band(&f, &vec![0.0; 1000], 6.0), None);
    }
}

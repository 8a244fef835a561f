//! The contact in the frequency domain: Δx per newton of T, and how a hidden resonance shows in it.
//!
//! A contact alone is a real, constant compliance. A resonance that moves only one of the measured
//! points (a specimen that rotates in its clamp) gives it an imaginary part near its frequency:
//! loops there become ellipses. From hits, the compliance is found with the hammer's force as the
//! instrumental variable.
//!
//! A peak of Im Δx/T may also be noise. Of several hundred lines one is always the largest. Where T
//! is weak the noise of Δx/T is also largest, so in a noisy measurement the largest line lies there
//! and looks like a resonance. Independent groups of hits, which share only the structure,
//! distinguish the two: a resonance is present in every hit.

use super::record::{HysteresisRecord, Relative};
use crate::spectra::CrossSpectra;
use crate::spectra::fft::forward;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Range in which a resonance of a specimen is searched, Hz: below it, the loops are quasi-static;
/// above it, Δx is buried in noise.
pub const SEARCH_HZ: [f64; 2] = [100.0, 400.0];

/// Lines are averaged to this spacing, Hz: narrow compared with a resonance of 1 % damping at 192
/// Hz.
const STEP_HZ: f64 = 0.5;

/// Width of the moving average applied before the peak search, Hz.
const SMOOTH_HZ: f64 = 1.5;

/// With fewer lines there is neither a peak nor a level to compare it with.
const FEWEST_LINES: usize = 30;

/// D(s) = Δx / T over frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactCompliance {
    /// The lines, Hz, equally spaced.
    pub frequency_hz: Vec<f64>,
    /// D, m/N.
    pub compliance_m_per_n: Vec<Complex<f64>>,
}

/// Where the imaginary part of Δx/T is largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImaginaryPeak {
    /// Frequency of the peak, Hz.
    pub frequency_hz: f64,
    /// |Im D| there over the level of |Re D|.
    pub over_level: f64,
    /// |Im D| there over the median of |Im D|.
    pub over_median: f64,
}

impl ImaginaryPeak {
    /// Whether the peak is clearly a resonance.
    pub fn stands_out(&self) -> bool {
        self.over_level > 0.5 && self.over_median > 5.0
    }
}

impl ContactCompliance {
    /// From one record that begins and ends at rest (a sweep, a decay), over `band_hz`. The spectra
    /// are those of the whole record, so the order in which frequencies were excited does not
    /// matter. `None` if the band holds no line.
    pub fn of_record(record: &HysteresisRecord, band_hz: [f64; 2]) -> Option<Self> {
        let step_hz = record.fs_hz / record.force_n.len() as f64;
        let (relative, per_velocity) = match record.relative() {
            Relative::Velocity(v) => (v, true),
            Relative::Displacement(x) => (x, false),
        };
        let (x, t) = (spectrum(relative)?, spectrum(record.force_n.clone())?);
        let group = (STEP_HZ / step_hz).round().max(1.0) as usize;
        let line = |f: f64| (f / step_hz).round() as usize;
        let mut found = Self { frequency_hz: Vec::new(), compliance_m_per_n: Vec::new() };
        let mut from = line(band_hz[0]).max(1);
        while from + group <= (line(band_hz[1]) + 1).min(x.len()) {
            let (mut cross, mut auto) = (Complex::default(), 0.0);
            for (l, (moved, force)) in x.iter().zip(&t).enumerate().skip(from).take(group) {
                let s = Complex::new(0.0, TAU * step_hz * l as f64);
                let displacement = if per_velocity { moved / s } else { *moved };
                cross += displacement * force.conj();
                auto += force.norm_sqr();
            }
            found.frequency_hz.push(step_hz * (from as f64 + 0.5 * (group - 1) as f64));
            found.compliance_m_per_n.push(cross / auto);
            from += group;
        }
        (!found.frequency_hz.is_empty()).then_some(found)
    }

    /// The lines between 100 and 400 Hz, averaged over 1.5 Hz.
    pub(super) fn smoothed(&self) -> Vec<(f64, Complex<f64>)> {
        let [Some(first), Some(second)] = [0, 1].map(|l| self.frequency_hz.get(l)) else { return Vec::new() };
        let width = ((SMOOTH_HZ / (second - first)).round() as usize).clamp(1, self.frequency_hz.len());
        let inside = |f: f64| (SEARCH_HZ[0]..=SEARCH_HZ[1]).contains(&f);
        self.compliance_m_per_n
            .windows(width)
            .zip(self.frequency_hz.windows(width))
            .map(|(d, f)| (f[width / 2], d.iter().sum::<Complex<f64>>() / width as f64))
            .filter(|(f, d)| inside(*f) && d.re.is_finite() && d.im.is_finite())
            .collect()
    }

    /// The largest imaginary part between 100 and 400 Hz, averaged over 1.5 Hz; `None` with too few
    /// lines there.
    pub fn imaginary_peak(&self) -> Option<ImaginaryPeak> {
        let smooth = self.smoothed();
        if smooth.len() < FEWEST_LINES {
            return None;
        }
        let level = median(smooth.iter().map(|(_, d)| d.re.abs()).collect());
        let usual = median(smooth.iter().map(|(_, d)| d.im.abs()).collect());
        let (frequency_hz, top) =
            smooth.iter().map(|(f, d)| (*f, d.im.abs())).max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(ImaginaryPeak { frequency_hz, over_level: top / level, over_median: top / usual })
    }
}

fn spectrum(mut x: Vec<f64>) -> Option<Vec<Complex<f64>>> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    for v in &mut x {
        *v -= mean;
    }
    let fft = forward(x.len());
    let mut out = fft.make_output_vec();
    fft.process(&mut x, &mut out).ok()?;
    Some(out)
}

/// The median of a list that is not empty.
fn median(mut values: Vec<f64>) -> f64 {
    let at = values.len() / 2;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

impl ContactCompliance {
    /// From the spectra of v_A, v_B (m/s) and T (N) after the hits at each place, all on the lines
    /// of the first; `None` without any.
    ///
    /// T and Δx are both noisy, so the auto-spectrum of neither may be the denominator. The
    /// hammer's force is the instrumental variable: D = Σ S_ΔF S_TF* / Σ |S_TF|² over the impacts.
    pub fn of_impacts(impacts: &[&CrossSpectra]) -> Option<Self> {
        let first = impacts.first()?;
        let compliance_m_per_n = (0..first.lines())
            .map(|l| {
                let (mut numerator, mut denominator) = (Complex::default(), 0.0);
                for impact in impacts {
                    // normalised by force, so that a position with more hits does not weigh more
                    let relative = (impact.h1(l, 0) - impact.h1(l, 1)) / first.s(l);
                    let tangential = impact.h1(l, 2);
                    numerator += relative * tangential.conj();
                    denominator += tangential.norm_sqr();
                }
                numerator / denominator
            })
            .collect();
        Some(Self { frequency_hz: first.frequency_hz().to_vec(), compliance_m_per_n })
    }
}

/// Fewest groups of hits needed to estimate their scatter.
pub const FEWEST_GROUPS: usize = 3;
/// Standard errors by which a peak must exceed the noise: the largest of 600 lines of noise reaches
/// 4 in one of thirty measurements.
pub const CLEAR: f64 = 5.0;
/// The noise is averaged over lines within this distance, Hz: a few groups at a single line give a
/// poor estimate of the scatter.
const NEAR_HZ: f64 = 5.0;

/// |Im D| at `peak_hz` over its standard error, from independent groups of hits on the same lines.
/// `None` with fewer than [`FEWEST_GROUPS`].
pub fn over_noise(groups: &[ContactCompliance], peak_hz: f64) -> Option<f64> {
    if groups.len() < FEWEST_GROUPS {
        return None;
    }
    let smooth: Vec<Vec<(f64, f64)>> = groups.iter().map(|own| near(own, peak_hz)).collect();
    let lines = smooth.iter().map(Vec::len).min()?;
    let n = groups.len() as f64;
    // mean and its variance, line by line
    let at = |l: usize| {
        let mean = smooth.iter().map(|own| own[l].1).sum::<f64>() / n;
        let scatter: f64 = smooth.iter().map(|own| (own[l].1 - mean).powi(2)).sum();
        (smooth[0][l].0, mean, scatter / (n * (n - 1.0)))
    };
    let told: Vec<(f64, f64, f64)> = (0..lines).map(at).collect();
    let peak = told.iter().min_by(|a, b| (a.0 - peak_hz).abs().total_cmp(&(b.0 - peak_hz).abs()))?;
    let around = told.iter().map(|(_, _, variance)| variance).sum::<f64>() / lines as f64;
    let variance = around.max(peak.2);
    (variance > 0.0).then(|| peak.1.abs() / variance.sqrt())
}

/// Frequency and smoothed imaginary part of the lines around `peak_hz`.
fn near(compliance: &ContactCompliance, peak_hz: f64) -> Vec<(f64, f64)> {
    let lines = compliance.smoothed();
    lines.into_iter().filter(|(f, _)| (f - peak_hz).abs() <= NEAR_HZ).map(|(f, d)| (f, d.im)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hysteresis::RelativeMotion;

    const FS: f64 = 8_192.0;

    /// A force sweep from rest to rest over a contact of 180 N/µm, with an oscillator of strength
    /// `share` at 192 Hz in series.
    fn swept(share: f64) -> HysteresisRecord {
        let n = 16 * 8_192;
        let (low, high) = (100.0, 400.0);
        let time = |i: usize| i as f64 / FS;
        let end = time(n) - 3.0;
        let force_n: Vec<f64> = (0..n)
            .map(|i| {
                let t = time(i);
                let gate = (t.min(end - t) * 4.0).clamp(0.0, 1.0);
                if t > end {
                    0.0
                } else {
                    20.0 * gate * (TAU * (low + 0.5 * (high - low) * t / end) * t).sin()
                }
            })
            .collect();
        let w = TAU * 192.0;
        let (mut x, mut v) = (0.0, 0.0);
        let moved: Vec<f64> = force_n
            .iter()
            .map(|f| {
                // the oscillator of share / 180 N/µm, integrated with a symplectic step
                v += (w * w * (share * f / 180e6 - x) - 0.02 * w * v) / FS;
                x += v / FS;
                f / 180e6 + x
            })
            .collect();
        HysteresisRecord {
            fs_hz: FS,
            motion: RelativeMotion::Displacement { b_m: vec![0.0; n], a_m: moved },
            force_n,
            excitation_hz: None,
            normal_load_n: None,
        }
    }

    #[test]
    fn a_hidden_resonance_is_found_in_a_sweep_and_none_where_there_is_none() {
        let hidden = ContactCompliance::of_record(&swept(0.05), SEARCH_HZ).expect("lines");
        let peak = hidden.imaginary_peak().expect("lines enough");
        assert!((peak.frequency_hz - 192.0).abs() < 1.5 && peak.stands_out(), "{peak:?}");
        let plain = ContactCompliance::of_record(&swept(0.0), SEARCH_HZ).expect("lines");
        let peak = plain.imaginary_peak().expect("lines enough");
        assert!(!peak.stands_out() && peak.over_level < 1e-6, "{peak:?}");
        let worst = plain.compliance_m_per_n.iter().map(|d| (d.re * 180e6 - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
    }

    #[test]
    fn too_few_lines_give_no_peak() {
        let record = swept(0.05);
        let narrow = ContactCompliance::of_record(&record, [190.0, 195.0]).expect("lines");
        assert_eq!(narrow.imaginary_peak(), None);
        assert_eq!(ContactCompliance::of_record(&record, [5_000.0, 6_000.0]), None);
    }
}

#[cfg(test)]
mod repeated_peak_tests {
    use super::*;
    use num_complex::Complex;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Four groups of hits on a contact of compliance 1, with large noise near 120 Hz, and
    /// optionally a mode at 200 Hz.
    fn groups(mode: f64, seed: u64) -> Vec<ContactCompliance> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let frequency_hz: Vec<f64> = (0..=700).map(|l| 80.0 + 0.5 * f64::from(l)).collect();
        let mut group = || {
            let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
            let line = |f: &f64| {
                let loud = 0.02 + 2.0 / (1.0 + (f - 120.0).powi(2) / 9.0);
                let resonance = mode / Complex::new(1.0 - (f / 200.0).powi(2), 0.03);
                Complex::new(1.0 + loud * noise(), loud * noise()) + resonance
            };
            frequency_hz.iter().map(line).collect()
        };
        (0..4)
            .map(|_| ContactCompliance { frequency_hz: frequency_hz.clone(), compliance_m_per_n: group() })
            .collect()
    }

    fn mean(groups: &[ContactCompliance]) -> ContactCompliance {
        let sum = |l: usize| groups.iter().map(|g| g.compliance_m_per_n[l]).sum::<Complex<f64>>() / 4.0;
        let frequency_hz = groups[0].frequency_hz.clone();
        ContactCompliance { compliance_m_per_n: (0..frequency_hz.len()).map(sum).collect(), frequency_hz }
    }

    #[test]
    fn noise_does_not_repeat_and_a_mode_does() {
        let mut looked_like_one = 0;
        for seed in 0..200 {
            let quiet = groups(0.0, seed);
            let peak = mean(&quiet).imaginary_peak().expect("lines enough");
            looked_like_one += u32::from(peak.stands_out());
            let clear = over_noise(&quiet, peak.frequency_hz).expect("four groups");
            assert!(clear < CLEAR, "noise of seed {seed}: {clear}");
            let ringing = groups(0.1, seed);
            assert!(over_noise(&ringing, 200.0).expect("four groups") > CLEAR);
        }
        assert!(looked_like_one > 150, "the noise is loud enough to mislead: {looked_like_one}");
    }

    #[test]
    fn two_groups_tell_no_scatter() {
        assert_eq!(over_noise(&groups(0.1, 1)[..2], 200.0), None);
    }
}

//! The contact in the frequency domain: Δx per newton of T, and how a hidden resonance shows in it.
//!
//! A contact alone is a real, constant compliance. A resonance that moves only one of the measured
//! points (a specimen that rotates in its clamp) gives it an imaginary part near its frequency:
//! loops there become ellipses.

use super::record::{HysteresisRecord, Relative};
use crate::transforms::forward;
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

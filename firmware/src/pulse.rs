//! The force pulse, evaluated sample by sample: trigger, peak, width, rebounds.
//!
//! A pulse of half a millisecond has only about twenty samples at 51.2 kHz, so the largest sample
//! is up to one or two per cent below the peak. The peak is therefore taken from a parabola through
//! the three largest neighbouring samples. The host evaluates a record with better methods; the
//! values here are for the operator and for stopping a campaign that goes wrong.

use heapless::Vec;
#[allow(unused_imports, reason = "core has no square root; where std is linked its own is taken")]
use micromath::F32Ext;

/// Longest contact recorded sample by sample: 2.5 ms at 51.2 kHz.
const CONTACT: usize = 128;

/// The first contact ends when the force falls below this fraction of its peak.
const END_RATIO: f32 = 0.05;

/// Rebounds are detected from 1 ms after the end of the contact on: by then the force cell's
/// ringing has decayed to a thousandth of the peak.
const DEAD_S: f32 = 1e-3;

/// Results so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// Peak of the first contact, N.
    pub peak_n: f32,
    /// Time above half of the peak, s.
    pub width_s: f32,
    /// Largest later force as a fraction of the peak.
    pub rebound_ratio: f32,
    /// Scans from the trigger to that force.
    pub rebound_after: u32,
}

/// Evaluates one pulse from its trigger on.
#[derive(Clone, Debug)]
pub struct Pulse {
    scan_s: f32,
    contact: Vec<f32, CONTACT>,
    largest: f32,
    over: bool,
    scans: u32,
    dead_until: u32,
    felt: Felt,
}

impl Pulse {
    /// Prepares for a pulse whose scans are `scan_s` seconds apart.
    pub fn new(scan_s: f32) -> Self {
        Self {
            scan_s,
            contact: Vec::new(),
            largest: 0.0,
            over: false,
            scans: 0,
            dead_until: 0,
            felt: Felt::default(),
        }
    }

    /// Adds one sample of the force, N, from the trigger on.
    pub fn feed(&mut self, force_n: f32) {
        if self.over {
            let ratio = force_n / self.felt.peak_n;
            if self.scans >= self.dead_until && ratio > self.felt.rebound_ratio {
                self.felt.rebound_ratio = ratio;
                self.felt.rebound_after = self.scans;
            }
        } else {
            self.largest = self.largest.max(force_n);
            let full = self.contact.push(force_n).is_err();
            if full || force_n < END_RATIO * self.largest {
                self.end_contact();
            }
        }
        self.scans += 1;
    }

    fn end_contact(&mut self) {
        self.over = true;
        self.dead_until = self.scans + (DEAD_S / self.scan_s) as u32;
        self.felt.peak_n = parabola_peak(&self.contact);
        self.felt.width_s = width(&self.contact, self.felt.peak_n / 2.0) * self.scan_s;
    }

    /// The results; for a contact that still lasts, the largest sample.
    pub fn felt(&self) -> Felt {
        if self.over { self.felt } else { Felt { peak_n: self.largest, ..self.felt } }
    }
}

/// The vertex of the parabola through the largest sample and its neighbours.
fn parabola_peak(samples: &[f32]) -> f32 {
    let Some((at, top)) = samples.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return 0.0;
    };
    let (Some(before), Some(after)) = (at.checked_sub(1).map(|i| samples[i]), samples.get(at + 1)) else {
        return top;
    };
    let bend = before - 2.0 * top + after;
    if bend >= 0.0 { top } else { top - (before - after) * (before - after) / (8.0 * bend) }
}

/// Samples between the first rise through `level` and the last fall through it, interpolated.
fn width(samples: &[f32], level: f32) -> f32 {
    let crossing = |i: usize| {
        let (a, b) = (samples[i], samples[i + 1]);
        i as f32 + (level - a) / (b - a)
    };
    let rise = (0..samples.len().saturating_sub(1)).find(|i| samples[*i] < level && samples[i + 1] >= level);
    let fall =
        (0..samples.len().saturating_sub(1)).rev().find(|i| samples[*i] >= level && samples[i + 1] < level);
    match (rise, fall) {
        (Some(rise), Some(fall)) if fall >= rise => crossing(fall) - crossing(rise),
        // the trigger was above half of the peak: count from the first sample
        (None, Some(fall)) => crossing(fall),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A half sine of `peak` N and `width_s` s, starting a fraction `phase` of a sample late, as
    /// seen from the trigger.
    fn half_sine(peak: f32, width_s: f32, phase: f32, scan_s: f32) -> impl Iterator<Item = f32> {
        (0..400).map(move |i| {
            let t = (i as f32 + phase) * scan_s;
            if t < width_s { peak * (core::f32::consts::PI * t / width_s).sin() } else { 0.0 }
        })
    }

    #[test]
    fn peak_and_width_do_not_depend_on_where_the_samples_fall() {
        let scan_s = 1.0 / 51_200.0;
        for phase in [0.05, 0.3, 0.5, 0.8] {
            let mut pulse = Pulse::new(scan_s);
            half_sine(50.0, 0.41e-3, phase, scan_s).for_each(|f| pulse.feed(f));
            let felt = pulse.felt();
            // a half sine over 21 samples matches a parabola to 1e-4 near its top
            assert!((felt.peak_n - 50.0).abs() < 0.02, "{felt:?}");
            // above half of its peak for two thirds of its length
            assert!((felt.width_s - 0.41e-3 * 2.0 / 3.0).abs() < 3e-6, "{felt:?}");
            assert!(felt.rebound_ratio.abs() < 1e-6);
        }
    }

    #[test]
    fn a_rebound_is_felt_with_its_size_and_time() {
        let scan_s = 1.0 / 51_200.0;
        let mut pulse = Pulse::new(scan_s);
        half_sine(50.0, 0.41e-3, 0.5, scan_s).take(300).for_each(|f| pulse.feed(f));
        half_sine(9.0, 0.41e-3, 0.5, scan_s).take(300).for_each(|f| pulse.feed(f));
        let felt = pulse.felt();
        assert!((felt.rebound_ratio - 0.18).abs() < 2e-3, "{felt:?}");
        assert!(felt.rebound_after.abs_diff(310) <= 1, "{felt:?}");
    }

    #[test]
    fn a_contact_that_never_ends_is_bounded() {
        let mut pulse = Pulse::new(1.0 / 51_200.0);
        for _ in 0..100_000 {
            pulse.feed(3.0);
        }
        assert!((pulse.felt().peak_n - 3.0).abs() < 1e-6);
    }
}

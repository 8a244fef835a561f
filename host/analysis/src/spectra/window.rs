//! Time windows: rectangular around the force pulse, exponential on the response.
//!
//! Multiplying every signal by e^(−σ(t − t₀)) turns the Fourier transform into the Laplace
//! transform on s = σ + iω: with both force and response weighted, X(s) = H(s) F(s) holds
//! *exactly*, and FRFs on one common s can be used in every method of substructuring unchanged.
//! Weighting only the response is common practice; over a pulse of half a millisecond the result
//! differs by a factor of about 1 + σ·0.2 ms, and the offset of t₀ from the pulse adds to it. Both
//! are implemented, because records processed elsewhere must be reproducible.

use super::pulse::Pulse;
use crate::vectors::wide;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Whether the force is weighted exponentially as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForceWeighting {
    /// e^(−σ(t − t₀)) on force and response, over the whole record: exactly H(σ + iω).
    Exponential,
    /// The force only rectangularly; the response from t₀ on, with a weight of 1 before.
    Rectangular,
}

/// Windows of one measurement. Times are relative to the origin t₀ of a hit (its trigger or the
/// start of its pulse).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Windowing {
    /// The force is kept from this long before the origin, s, or from the start of its pulse if
    /// that is earlier.
    pub force_before_s: f64,
    /// The force is kept until this long after the origin, s (ends included), or until the end of
    /// its pulse if that is later.
    pub force_after_s: f64,
    /// After that it falls to zero along half a cosine of this length, s; 0 cuts it off.
    #[serde(default)]
    pub force_taper_s: f64,
    /// Damping σ of the exponential window, 1/s; 0 means no window.
    pub sigma_per_s: f64,
    /// Whether the force is weighted as well.
    pub force_weighting: ForceWeighting,
}

/// The samples of a hit that its force window must contain.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PulseSamples(Range<usize>);

impl PulseSamples {
    /// The force window contains the whole of `pulse`, which was found in `force_n`, however long
    /// it is.
    pub fn of(pulse: &Pulse, force_n: &[f64]) -> Self {
        PulseSamples(pulse.whole(force_n))
    }

    /// The force window is determined by its times only.
    pub fn none() -> Self {
        PulseSamples(0..0)
    }
}

impl Default for Windowing {
    /// 1 ms before to 3 ms after the pulse's start contains the longest pulse of the automatic
    /// hammer; σ = 2.3 /s keeps the truncation error of the slowest mode (0.57 /s, 2 s records)
    /// under 0.3 %.
    fn default() -> Self {
        Windowing {
            force_before_s: 1e-3,
            force_after_s: 3e-3,
            force_taper_s: 0.0,
            sigma_per_s: 2.3,
            force_weighting: ForceWeighting::Exponential,
        }
    }
}

/// e^(−σ i/fs) for every sample i, computed once for all channels and hits of one rate and length.
///
/// A weight is the product of that of its run and that of its place in the run, so that both tables
/// fit into the first-level cache.
#[derive(Debug, Clone)]
pub struct Decay {
    fs_hz: f64,
    samples: usize,
    /// Weight of the first sample of every run.
    runs: Vec<f64>,
    /// Weights of the samples of a run from its first on, for two run lengths, so that one run
    /// length from any place on is contiguous.
    places: Vec<f64>,
}

/// Number of samples in a run.
pub(super) const RUN: usize = 512;

impl Decay {
    fn of(sigma_per_s: f64, fs_hz: f64, samples: usize) -> Decay {
        let weight = |i: usize| (-sigma_per_s * (i as f64 / fs_hz)).exp();
        let runs = (0..samples.div_ceil(RUN)).map(|run| weight(run * RUN)).collect();
        Decay { fs_hz, samples, runs, places: (0..2 * RUN).map(weight).collect() }
    }

    fn weight(&self, i: usize) -> f64 {
        self.runs[i / RUN] * self.places[i % RUN]
    }

    /// Writes the samples `x`, which begin at index `first`, times their weights and `scale`.
    fn weigh(&self, x: &[f64], first: usize, scale: f64, out: &mut [f64]) {
        let (mut x, mut out, mut first) = (x, out, first);
        while !x.is_empty() {
            let (run, place) = (first / RUN, first % RUN);
            let count = x.len().min(RUN - place);
            let (own, rest) = x.split_at(count);
            let (to, rest_of_out) = out.split_at_mut(count);
            let (scale, places) = (scale * self.runs[run], &self.places[place..place + count]);
            let weighted = own.iter().zip(places).map(|(x, place)| x * (scale * place));
            wide(|| to.iter_mut().zip(weighted).for_each(|(out, x)| *out = x));
            (x, out, first) = (rest, rest_of_out, first + count);
        }
    }
}

/// Computed weights, by their damping: for one rate, length and damping they are the same for every
/// cell of a campaign.
static KEPT: Mutex<Vec<(f64, Arc<Decay>)>> = Mutex::new(Vec::new());

/// Number of weight tables kept.
const KEPT_AT_MOST: usize = 8;

impl Windowing {
    /// As [`Windowing::decay`], but computed only once for repeated requests.
    pub(super) fn kept_decay(&self, fs_hz: f64, samples: usize) -> Arc<Decay> {
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |(sigma_per_s, decay): &&(f64, Arc<Decay>)| {
            *sigma_per_s == self.sigma_per_s && decay.fs_hz == fs_hz && decay.samples == samples
        };
        if let Some((_, decay)) = kept.iter().find(fits) {
            return decay.clone();
        }
        if kept.len() == KEPT_AT_MOST {
            kept.remove(0);
        }
        let decay = Arc::new(self.decay(fs_hz, samples));
        kept.push((self.sigma_per_s, decay.clone()));
        decay
    }

    /// The weights for records of `samples` samples.
    pub fn decay(&self, fs_hz: f64, samples: usize) -> Decay {
        Decay::of(self.sigma_per_s, fs_hz, samples)
    }

    /// Start and end of the part of the force that is kept, s from the record's start: the
    /// configured times, extended to include `pulse`.
    pub fn kept_s(&self, fs_hz: f64, origin_s: f64, pulse: &PulseSamples) -> [f64; 2] {
        let asked = [origin_s - self.force_before_s, origin_s + self.force_after_s];
        let Range { start, end } = pulse.0;
        if start >= end {
            return asked;
        }
        [asked[0].min(start as f64 / fs_hz), asked[1].max((end - 1) as f64 / fs_hz)]
    }

    /// The samples of a hit's force that the window keeps at full weight.
    pub fn kept(&self, fs_hz: f64, samples: usize, origin_s: f64, pulse: &PulseSamples) -> Range<usize> {
        let [from, to] = self.kept_s(fs_hz, origin_s, pulse);
        let first = ((from * fs_hz).ceil().max(0.0) as usize).min(samples);
        first..((to * fs_hz).floor().max(-1.0) + 1.0).min(samples as f64).max(first as f64) as usize
    }

    /// Writes the windowed force (N) of a hit with its origin at `origin_s` from the record's start
    /// into `out`; the part of `out` beyond the record (zero padding) becomes 0. The window
    /// contains all of `pulse`.
    pub fn force_into(
        &self,
        force_n: &[f64],
        decay: &Decay,
        origin_s: f64,
        pulse: &PulseSamples,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let [from, to] = self.kept_s(decay.fs_hz, origin_s, pulse);
        let first = ((from * decay.fs_hz).floor().max(0.0) as usize).min(force_n.len());
        let last = (((to + self.force_taper_s) * decay.fs_hz).ceil().max(-1.0) + 1.0) as usize;
        let scale = match self.force_weighting {
            ForceWeighting::Exponential => (self.sigma_per_s * origin_s).exp(),
            ForceWeighting::Rectangular => 1.0,
        };
        let last = last.min(force_n.len()).min(out.len()).max(first);
        let weight = |i: usize| match self.force_weighting {
            ForceWeighting::Exponential => scale * decay.weight(i),
            ForceWeighting::Rectangular => scale,
        };
        let time = |i: &usize| *i as f64 / decay.fs_hz;
        // sample times increase, so the part kept at full weight is contiguous
        let begin = (first..last).find(|i| time(i) >= from).unwrap_or(last);
        let guess = ((to * decay.fs_hz).max(0.0) as usize).saturating_sub(1).clamp(begin, last);
        let end = (guess..last).find(|i| time(i) > to).unwrap_or(last);
        match self.force_weighting {
            ForceWeighting::Exponential => {
                decay.weigh(&force_n[begin..end], begin, scale, &mut out[begin..end]);
            }
            ForceWeighting::Rectangular => {
                out[begin..end].iter_mut().zip(&force_n[begin..end]).for_each(|(out, f)| *out = scale * f);
            }
        }
        for i in (end..last).take_while(|i| time(i) <= to + self.force_taper_s) {
            let kept = 0.5 + 0.5 * (PI * (time(&i) - to) / self.force_taper_s).cos();
            out[i] = kept * weight(i) * force_n[i];
        }
    }

    /// The weights for the responses of the same hit.
    pub fn of_response<'d>(&self, decay: &'d Decay, origin_s: f64) -> ResponseWeighting<'d> {
        // if only the response is weighted, samples before the origin remain unchanged
        let plain = if self.force_weighting == ForceWeighting::Rectangular && self.sigma_per_s != 0.0 {
            let samples = decay.samples;
            (0..samples).position(|i| i as f64 / decay.fs_hz > origin_s).unwrap_or(samples)
        } else {
            0
        };
        ResponseWeighting { decay, plain, scale: (self.sigma_per_s * origin_s).exp() }
    }
}

/// The window of a hit's responses.
pub struct ResponseWeighting<'d> {
    decay: &'d Decay,
    /// Number of samples from the record's start that remain unchanged.
    plain: usize,
    scale: f64,
}

impl ResponseWeighting<'_> {
    /// The weights of the samples of a run, from its first on.
    pub(super) fn places(&self) -> &[f64] {
        &self.decay.places
    }

    /// The weights of up to [`RUN`] samples from `first` on: a factor, and the index from which on
    /// it multiplies the [places](ResponseWeighting::places). `None` if any of the samples remains
    /// unchanged.
    pub(super) fn weights(&self, first: usize) -> Option<(f64, usize)> {
        (first >= self.plain).then(|| (self.scale * self.decay.runs[first / RUN], first % RUN))
    }

    /// Writes a windowed response (SI) from its sample `first` on into `out`; the part of `out`
    /// beyond the record (zero padding) becomes 0.
    pub fn response_into(&self, response: &[f64], first: usize, out: &mut [f64]) {
        let kept = response.len().saturating_sub(first).min(out.len());
        let plain = self.plain.saturating_sub(first).min(kept);
        let (out, beyond) = out.split_at_mut(kept);
        beyond.fill(0.0);
        let (whole, weighted) = out.split_at_mut(plain);
        let Some(response) = response.get(first..first + kept) else { return };
        whole.copy_from_slice(&response[..plain]);
        self.decay.weigh(&response[plain..], first + plain, self.scale, weighted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_window_follows_a_pulse_that_is_longer_than_its_times() {
        let w = Windowing { sigma_per_s: 0.0, ..Windowing::default() };
        let hann = |i: i32| {
            let t = (f64::from(i) - 40.0) / 60.0;
            if (0.0..1.0).contains(&t) { 1.0 - (2.0 * PI * t).cos() } else { 0.0 }
        };
        let force: Vec<f64> = (0..400).map(hann).collect();
        let pulse = Pulse::locate(&force).expect("a pulse");
        let origin_s = pulse.start as f64 / 2000.0;
        let mut kept = [9.0; 400];
        w.force_into(&force, &w.decay(2000.0, 400), origin_s, &PulseSamples::of(&pulse, &force), &mut kept);
        assert_eq!(kept[..], force[..], "a pulse of 30 ms");
        w.force_into(&force, &w.decay(2000.0, 400), origin_s, &PulseSamples::none(), &mut kept);
        assert!(kept[50..].iter().all(|f| *f == 0.0), "3 ms are six samples");
        // a short pulse does not change the window
        let range = w.kept(2000.0, 400, 0.1, &PulseSamples(199..205));
        assert_eq!(range, w.kept(2000.0, 400, 0.1, &PulseSamples::none()));
        assert_eq!(w.kept(2000.0, 400, 0.1, &PulseSamples(190..240)), 190..240);
    }

    #[test]
    fn the_force_window_includes_its_ends() {
        let w = Windowing {
            force_before_s: 0.001,
            force_after_s: 0.002,
            sigma_per_s: 0.0,
            ..Windowing::default()
        };
        let mut kept = [9.0; 12];
        w.force_into(&[1.0; 10], &w.decay(1000.0, 10), 0.004, &PulseSamples::none(), &mut kept);
        assert_eq!(kept, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn the_taper_is_half_a_cosine_after_the_window() {
        let w = Windowing {
            force_before_s: 0.001,
            force_after_s: 0.002,
            force_taper_s: 0.004,
            sigma_per_s: 0.0,
            ..Windowing::default()
        };
        let mut kept = [9.0; 14];
        w.force_into(&[1.0; 14], &w.decay(1000.0, 14), 0.004, &PulseSamples::none(), &mut kept);
        // full at 6 ms, half at 8 ms, none at 10 ms
        assert!((kept[8] - 0.5).abs() < 1e-12 && kept[6] == 1.0 && kept[10].abs() < 1e-12, "{kept:?}");
        assert!(kept[7] > kept[8] && kept[8] > kept[9] && kept[11..] == [0.0; 3], "{kept:?}");
        // a window beyond the record is not an error
        w.force_into(&[1.0; 3], &w.decay(1000.0, 3), 9.0, &PulseSamples::none(), &mut kept);
        assert_eq!(kept, [0.0; 14]);
    }

    #[test]
    fn the_rectangular_habit_leaves_what_is_before_the_origin() {
        let w = Windowing {
            sigma_per_s: 10.0,
            force_weighting: ForceWeighting::Rectangular,
            ..Windowing::default()
        };
        let mut x = [9.0; 4];
        let decay = w.decay(10.0, 3);
        let weighting = w.of_response(&decay, 0.1);
        weighting.response_into(&[1.0; 3], 0, &mut x);
        assert_eq!((x[0], x[1], x[3]), (1.0, 1.0, 0.0));
        assert!((x[2] - (-1.0f64).exp()).abs() < 1e-15);
        // any part of it is the same
        for (first, end) in (0..=4).flat_map(|first| (first..=4).map(move |end| (first, end))) {
            let mut part = vec![9.0; end - first];
            weighting.response_into(&[1.0; 3], first, &mut part);
            assert_eq!(part, x[first..end]);
        }
    }

    #[test]
    fn every_sample_has_its_weight() {
        let w = Windowing { sigma_per_s: 40.0, ..Windowing::default() };
        let decay = w.decay(1000.0, 1300);
        for (first, end) in [(0, 1300), (511, 1025), (1299, 1300), (600, 600)] {
            let mut out = vec![9.0; end - first];
            decay.weigh(&vec![2.0; end - first], first, 3.0, &mut out);
            for (i, out) in (first..end).zip(out) {
                let exact = 6.0 * (-40.0 * i as f64 / 1000.0).exp();
                // rounding of the exponents, and of three products
                assert!(
                    (out - exact).abs() < 1e-14 * exact && decay.weight(i) > 0.0,
                    "{i}: {out} for {exact}"
                );
            }
        }
    }
}

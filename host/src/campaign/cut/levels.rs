//! Finds the steady parts of a shaker's recording: one part for each level, without the transitions.
//!
//! The reference channel (the excitation's force or a specimen's velocity) is divided into blocks.
//! In each, the strongest line of the spectrum gives a first value of the frequency and the
//! amplitude; the advance of its phase from block to block gives the frequency a thousand times more
//! exactly. A part is steady as long as the amplitude stays within a tolerance of the part's first
//! block and the phase advances evenly. Its first and last blocks are left out, because they may
//! contain the end of a transition.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

/// Length of a block, s.
const BLOCK_S: f64 = 0.125;
/// A block has a level if the strongest line and its neighbours have this part of its power.
const DOMINANT: f64 = 0.7;
/// Largest deviation of the phase's advance from the first one of its part, turns per block.
const TURNS: f64 = 0.02;
/// Lines beside the strongest one that a Hann window puts a sine into.
const BESIDE: usize = 2;

/// What counts as steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyCriteria {
    /// Largest relative deviation of a block's amplitude from the part's.
    pub tolerance: f64,
    /// Shortest steady part, s.
    pub least_s: f64,
    /// Fewest cycles of a steady part.
    pub cycles: f64,
}

impl Default for SteadyCriteria {
    /// 2 %, a second, and the twenty cycles of a measured level.
    fn default() -> Self {
        Self { tolerance: 0.02, least_s: 1.0, cycles: 20.0 }
    }
}

/// A steady part.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyPart {
    /// Its scans.
    pub scans: Range<u64>,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the reference channel, in its unit.
    pub amplitude: f64,
}

/// The strongest line of a block.
#[derive(Clone, Copy, Debug)]
struct BlockLine {
    frequency_hz: f64,
    amplitude: f64,
    /// Phase at the block's start, turns.
    phase: f64,
}

/// Finds steady parts in a signal that is passed in pieces.
pub struct SteadyFinder {
    fs_hz: f64,
    criteria: SteadyCriteria,
    window: Vec<f64>,
    transform: Arc<dyn RealToComplex<f64>>,
    open: Vec<f64>,
    blocks: Vec<Option<BlockLine>>,
}

impl SteadyFinder {
    /// For a signal with this rate.
    pub fn new(fs_hz: f64, criteria: SteadyCriteria) -> Self {
        let length = ((BLOCK_S * fs_hz) as usize).max(64) / 2 * 2;
        Self {
            fs_hz,
            criteria,
            window: (0..length).map(|i| 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos()).collect(),
            transform: RealFftPlanner::new().plan_fft_forward(length),
            open: Vec::with_capacity(length),
            blocks: Vec::new(),
        }
    }

    /// Takes the next samples of the reference channel.
    pub fn push(&mut self, mut signal: &[f64]) {
        let length = self.window.len();
        while !signal.is_empty() {
            let (now, rest) = signal.split_at(signal.len().min(length - self.open.len()));
            self.open.extend_from_slice(now);
            signal = rest;
            if self.open.len() == length {
                let line = self.line();
                self.blocks.push(line);
                self.open.clear();
            }
        }
    }

    /// The strongest line of the open block; `None` if none dominates.
    fn line(&mut self) -> Option<BlockLine> {
        let length = self.window.len();
        let mean = self.open.iter().sum::<f64>() / length as f64;
        let mut windowed: Vec<f64> =
            self.open.iter().zip(&self.window).map(|(v, w)| (v - mean) * w).collect();
        let mut spectrum = self.transform.make_output_vec();
        self.transform.process(&mut windowed, &mut spectrum).ok()?;
        let power: Vec<f64> = spectrum.iter().map(Complex::norm_sqr).collect();
        let within = 2..power.len().saturating_sub(2);
        let top = within.max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
        let own: f64 = power[top - BESIDE..=top + BESIDE].iter().sum();
        if own <= DOMINANT * power.iter().sum::<f64>() {
            return None;
        }
        // of a sine between two lines, a Hann window gives neighbours whose ratio is (1 + d)/(2 - d)
        let (low, high) = (power[top - 1].sqrt(), power[top + 1].sqrt());
        let (side, sign) = if high > low { (high, 1.0) } else { (low, -1.0) };
        let ratio = side / power[top].sqrt();
        let apart = ((2.0 * ratio - 1.0) / (1.0 + ratio)).clamp(0.0, 1.0);
        let offset = sign * apart;
        // the window's response at this distance from the line, relative to its height of N/2
        let response =
            if apart < 1e-9 { 1.0 } else { (PI * apart).sin() / (PI * apart * (1.0 - apart * apart)) };
        // a window of this symmetry turns the phase by half a turn over the block per line
        let phase = spectrum[top].arg() / TAU - 0.5 * offset;
        Some(BlockLine {
            frequency_hz: (top as f64 + offset) * self.fs_hz / length as f64,
            amplitude: 4.0 * power[top].sqrt() / (length as f64 * response),
            phase,
        })
    }

    /// The steady parts, in order.
    pub fn finish(self) -> Vec<SteadyPart> {
        let length = self.window.len();
        let block_s = length as f64 / self.fs_hz;
        let mut parts = Vec::new();
        let mut begin = 0;
        while begin < self.blocks.len() {
            let Some(first) = self.blocks[begin] else {
                begin += 1;
                continue;
            };
            // turns from the start of a block to that of the next
            let advance = |at: usize| -> Option<f64> {
                let (one, other) = (self.blocks[at]?, self.blocks.get(at + 1).copied().flatten()?);
                let expected = first.frequency_hz * block_s;
                let turns = other.phase - one.phase;
                Some(turns + (expected - turns).round())
            };
            let mut end = begin + 1;
            let mut turns = Vec::new();
            while let (Some(Some(block)), Some(next)) = (self.blocks.get(end), advance(end - 1)) {
                let even = turns.first().is_none_or(|usual: &f64| (next - usual).abs() <= TURNS);
                let alike = (block.amplitude / first.amplitude - 1.0).abs() <= self.criteria.tolerance;
                if !even || !alike {
                    break;
                }
                turns.push(next);
                end += 1;
            }
            // without the blocks at both ends
            if end - begin > 4 {
                let kept = &turns[1..turns.len() - 1];
                let frequency_hz = kept.iter().sum::<f64>() / (kept.len() as f64 * block_s);
                let inner = begin + 1..end - 1;
                let amplitude =
                    self.blocks[inner.clone()].iter().flatten().map(|block| block.amplitude).sum::<f64>()
                        / inner.len() as f64;
                let seconds = inner.len() as f64 * block_s;
                if seconds >= self.criteria.least_s && seconds * frequency_hz >= self.criteria.cycles {
                    let scans = (inner.start * length) as u64..(inner.end * length) as u64;
                    parts.push(SteadyPart { scans, frequency_hz, amplitude });
                }
            }
            begin = if end > begin + 1 { end - 1 } else { end };
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FS_HZ: f64 = 5120.0;

    /// Levels (frequency, amplitude, s), with ramps of the amplitude of half a second before each, noise
    /// and offset.
    fn signal(levels: &[(f64, f64, f64)]) -> Vec<f64> {
        let mut dice = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut out = Vec::new();
        let (mut phase, mut amplitude) = (0.0_f64, 0.0_f64);
        let mut add = |hz: f64, target: f64, seconds: f64, amplitude: &mut f64, ramp: bool| {
            let count = (seconds * FS_HZ) as usize;
            let from = *amplitude;
            for i in 0..count {
                *amplitude = if ramp { from + (target - from) * i as f64 / count as f64 } else { target };
                phase += TAU * hz / FS_HZ;
                let noise: f64 = StandardNormal.sample(&mut dice);
                out.push(3.0 + *amplitude * phase.cos() + 0.01 * noise);
            }
        };
        add(50.0, 0.0, 2.0, &mut amplitude, false);
        for (hz, target, seconds) in levels {
            add(*hz, *target, 0.5, &mut amplitude, true);
            add(*hz, *target, *seconds, &mut amplitude, false);
        }
        add(50.0, 0.0, 0.5, &mut amplitude, true);
        add(50.0, 0.0, 2.0, &mut amplitude, false);
        out
    }

    fn find(signal: &[f64]) -> Vec<SteadyPart> {
        let mut finder = SteadyFinder::new(FS_HZ, SteadyCriteria::default());
        signal.chunks(1000).for_each(|piece| finder.push(piece));
        finder.finish()
    }

    #[test]
    fn each_level_is_one_part_with_its_frequency_and_amplitude() {
        let levels = [(83.37, 1.0, 4.0), (83.37, 2.5, 3.0), (120.0, 2.0, 5.0), (251.9, 0.7, 2.0)];
        let parts = find(&signal(&levels));
        assert_eq!(parts.len(), levels.len(), "{parts:?}");
        let mut start_s = 2.0;
        for (part, (hz, amplitude, seconds)) in parts.iter().zip(levels) {
            // the noise of 1 % changes the phase of a block by less than a thousandth of a turn
            assert!((part.frequency_hz - hz).abs() < 5e-3, "{part:?}");
            assert!((part.amplitude / amplitude - 1.0).abs() < 3e-3, "{part:?}");
            let (from, to) = (part.scans.start as f64 / FS_HZ, part.scans.end as f64 / FS_HZ);
            // no part of the ramp, and all but two blocks at each end
            let steady = start_s + 0.5..start_s + 0.5 + seconds;
            assert!(from >= steady.start && to <= steady.end, "{from} to {to} s in {steady:?}");
            assert!(to - from >= seconds - 4.0 * BLOCK_S, "{from} to {to} s");
            start_s = steady.end;
        }
    }

    #[test]
    fn rest_noise_and_slow_ramps_have_no_steady_part() {
        assert_eq!(find(&signal(&[])), []);
        let ramp: Vec<f64> = (0..50_000)
            .map(|i| (0.1 + f64::from(i) / 20_000.0) * (TAU * 90.0 * f64::from(i) / FS_HZ).cos())
            .collect();
        assert_eq!(find(&ramp), []);
        let sweep: Vec<f64> = (0..50_000)
            .map(|i| {
                let t = f64::from(i) / FS_HZ;
                (TAU * (60.0 * t + 4.0 * t * t)).cos()
            })
            .collect();
        assert_eq!(find(&sweep), []);
        assert_eq!(find(&[]), []);
    }
}

//! Verdicts on synthetic hits: a ringing force cell, noise, a 16-bit converter, rebounds of every size and delay.

use super::*;
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use std::f64::consts::{PI, TAU};

const FS: f64 = 51_200.0;
/// 50 N range over 16 bits of ±10 V at 22.4 mV/N.
const STEP_N: f64 = 0.0136;
const NOISE_N: f64 = 0.01;

struct Dice(TestRng);

impl Dice {
    fn new() -> Self {
        Dice(TestRng::deterministic_rng(RngAlgorithm::ChaCha))
    }
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.next_u32() as f64 / u32::MAX as f64
    }
    fn gauss(&mut self) -> f64 {
        (0..12).map(|_| self.uniform(0.0, 1.0)).sum::<f64>() - 6.0
    }
}

/// Half sines (start s, peak N, width s), each exciting the cell's ringing: 3 %, 6 kHz, 0.3 ms.
fn force(pulses: &[(f64, f64, f64)], n: usize, dice: &mut Dice) -> Vec<f64> {
    let phase = dice.uniform(0.0, TAU);
    (0..n)
        .map(|i| {
            let t = i as f64 / FS;
            let mut f = NOISE_N * dice.gauss();
            for &(start, peak, width) in pulses {
                let u = t - start;
                if (0.0..width).contains(&u) {
                    f += peak * (PI * u / width).sin();
                }
                if u >= 0.0 {
                    // counted from the pulse's middle, where the cell is loaded most: the harder case
                    let since = (u - width / 2.0).max(0.0);
                    f += 0.03 * peak * (-since / 0.3e-3).exp() * (TAU * 6000.0 * u + phase).sin();
                }
            }
            (f / STEP_N).round() * STEP_N
        })
        .collect()
}

/// A decaying 208 Hz response (m/s) with a vibrometer's white floor.
fn response(start: f64, n: usize, dice: &mut Dice) -> Vec<f64> {
    (0..n)
        .map(|i| {
            let t = i as f64 / FS - start;
            let motion = if t > 0.0 { 2.6e-3 * (-13.0 * t).exp() * (TAU * 208.0 * t).sin() } else { 0.0 };
            ((motion + 8e-6 * dice.gauss()) / 0.31e-6).round() * 0.31e-6
        })
        .collect()
}

fn verdict(force_n: &[f64], responses: &[Vec<f64>], limits: &Limits) -> Verdict {
    judge(RawHit { fs_hz: FS, force_n, responses, missing_samples: 0 }, limits, Some(50.0))
}

fn clean(dice: &mut Dice) -> (f64, f64, f64) {
    (dice.uniform(4.9e-3, 5.1e-3), dice.uniform(40.0, 60.0), dice.uniform(0.36e-3, 0.46e-3))
}

#[test]
fn every_rebound_from_two_per_cent_on_is_found() {
    let mut dice = Dice::new();
    let mut smallest = f64::INFINITY;
    for _ in 0..44 {
        let (start, peak, width) = clean(&mut dice);
        for after_ms in [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0] {
            let fraction = if dice.uniform(0.0, 1.0) < 0.5 { 0.02 } else { dice.uniform(0.02, 0.6) };
            // a rebound is slower, and its contact somewhat longer
            let second = (start + after_ms * 1e-3, fraction * peak, width * dice.uniform(0.9, 1.2));
            let force = force(&[(start, peak, width), second], 8192, &mut dice);
            let v = verdict(&force, &[], &Limits::default());
            assert_eq!(v.kind, Kind::DoubleHit, "{fraction} after {after_ms} ms: {v:?}");
            smallest = smallest.min(v.measure / fraction);
        }
    }
    // what the matched filter makes of a 2 % rebound stays well above its limit of 1.2 %
    assert!(smallest > 0.8, "{smallest}");
}

#[test]
fn ringing_and_noise_raise_no_alarm() {
    let mut dice = Dice::new();
    for _ in 0..240 {
        let pulse = clean(&mut dice);
        let force = force(&[pulse], 12_800, &mut dice);
        let responses = [response(pulse.0, 12_800, &mut dice)];
        let v = verdict(&force, &responses, &Limits::default());
        assert_eq!(v.kind, Kind::Good, "{v:?}");
        // 1 % of ringing under the peak and half a per cent of interpolation
        assert!((v.peak_n / pulse.1 - 1.0).abs() < 0.04, "{} for {}", v.peak_n, pulse.1);
    }
}

#[test]
fn a_flat_top_is_an_overload_wherever_the_range_is() {
    let mut dice = Dice::new();
    for range in [30.0, 45.0, 49.0, 100.0] {
        let (start, _, width) = clean(&mut dice);
        let mut force = force(&[(start, 1.08 * range, width)], 4096, &mut dice);
        for f in &mut force {
            *f = f.min(range);
        }
        assert_eq!(verdict(&force, &[], &Limits::default()).kind, Kind::Overload, "{range} N");
        let limits = Limits { force_range_n: Some(range), ..Limits::default() };
        assert_eq!(verdict(&force, &[], &limits).kind, Kind::Overload);
    }
    let limits = Limits { response_range: Some(1e-3), ..Limits::default() };
    let pulse = clean(&mut dice);
    let (force, responses) = (force(&[pulse], 4096, &mut dice), [response(pulse.0, 4096, &mut dice)]);
    assert_eq!(verdict(&force, &responses, &limits).kind, Kind::Overload);
}

#[test]
fn dropouts_and_spikes_are_noisy_but_plain_noise_is_not() {
    let mut dice = Dice::new();
    for case in 0..40 {
        let pulse = clean(&mut dice);
        let force = force(&[pulse], 12_800, &mut dice);
        let mut x = response(pulse.0, 12_800, &mut dice);
        let at = dice.uniform(2000.0, 12_000.0) as usize;
        match case % 4 {
            // a spike; a lost beam (the signal stays at zero, then jumps back); a step of milliseconds; plain noise
            0 => x[at] += 3e-4,
            1 => x[at - 1500..at - 1000].fill(1.5e-3),
            2 => x[at..(at + 150).min(12_800)].iter_mut().for_each(|v| *v += 1e-3),
            _ => x.iter_mut().for_each(|v| *v += 3e-4 * dice.gauss()),
        }
        let wanted = if case % 4 == 3 { Kind::Good } else { Kind::Noisy };
        let v = verdict(&force, &[x], &Limits::default());
        assert_eq!(v.kind, wanted, "case {case}: {v:?}");
    }
}

#[test]
fn the_other_kinds() {
    let mut dice = Dice::new();
    let plain = |peak: f64, dice: &mut Dice| force(&[(5e-3, peak, 0.41e-3)], 4096, dice);
    assert_eq!(verdict(&plain(15.0, &mut dice), &[], &Limits::default()).kind, Kind::Weak);
    assert_eq!(verdict(&plain(0.0, &mut dice), &[], &Limits::default()).kind, Kind::Weak);
    assert_eq!(verdict(&[0.0; 1024], &[], &Limits::default()).kind, Kind::Weak);
    assert_eq!(verdict(&plain(120.0, &mut dice), &[], &Limits::default()).kind, Kind::Strong);
    let timed = Limits { expected_start_s: Some(8e-3), ..Limits::default() };
    let v = verdict(&plain(50.0, &mut dice), &[], &timed);
    assert_eq!(v.kind, Kind::Mistimed);
    assert!((v.measure - 3e-3).abs() < 1e-4 && v.limit == 2e-3);
    let force = plain(50.0, &mut dice);
    let hit = RawHit { fs_hz: FS, force_n: &force, responses: &[], missing_samples: 3 };
    assert_eq!(judge(hit, &Limits::default(), None).kind, Kind::Gap);
    // two humps of one long contact
    let merged: Vec<f64> = (0..4096)
        .map(|i| {
            let u = i as f64 / FS - 5e-3;
            if (0.0..1.2e-3).contains(&u) {
                50.0 * (PI * u / 1.2e-3).sin() * (0.55 - 0.45 * (TAU * u / 0.6e-3).cos())
            } else {
                0.0
            }
        })
        .collect();
    assert_eq!(verdict(&merged, &[], &Limits::default()).kind, Kind::DoubleHit);
}

#[test]
fn a_saturated_amplifier_below_full_scale_is_an_overload_and_a_round_top_is_not() {
    let mut dice = Dice::new();
    for case in 0..60 {
        let pulse = clean(&mut dice);
        let force = force(&[pulse], 12_800, &mut dice);
        let noise = [0.0, 1e-6, 8e-6][case % 3];
        // slow modes have flat tops too
        let hz = dice.uniform(20.0, 900.0);
        let motion: Vec<f64> = (0..12_800)
            .map(|i| {
                let t = i as f64 / FS - pulse.0;
                let ring = if t > 0.0 { 6e-3 * (-8.0 * t).exp() * (TAU * hz * t).sin() } else { 0.0 };
                ring + noise * dice.gauss()
            })
            .collect();
        let rounded = |x: f64| (x / 0.31e-6).round() * 0.31e-6;
        let round: Vec<f64> = motion.iter().copied().map(rounded).collect();
        let v = verdict(&force, &[round], &Limits::default());
        // without noise even the corner at the hit counts as a jump
        assert_ne!(v.kind, Kind::Overload, "case {case}, {hz} Hz: {v:?}");
        let top = motion.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let flat = motion.iter().map(|x| rounded(x.clamp(-0.85 * top, 0.85 * top))).collect();
        let v = verdict(&force, &[flat], &Limits::default());
        assert_eq!(v.kind, Kind::Overload, "case {case}, {hz} Hz: {v:?}");
        assert!((v.measure.abs() / (0.85 * top) - 1.0).abs() < 0.01, "{v:?}");
    }
}

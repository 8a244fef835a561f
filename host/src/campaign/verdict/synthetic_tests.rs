//! Verdicts on synthetic hits: a ringing force cell, noise, a 16-bit converter, rebounds of various
//! sizes and delays.

use super::judge::{ByRecord, Judge};
use super::others::Others;
use super::*;
use crate::campaign::plan::{Plan, SMALL};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, SampleType, Samples};
use crate::device::stream::Recording;
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::shot::{Phase, Shot};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use std::f64::consts::{PI, TAU};

const FS: f64 = 51_200.0;
/// 50 N range over 16 bits of ±10 V at 22.4 mV/N, N per code.
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
                    // from the pulse's middle, where the cell's load is highest: the harder case
                    let since = (u - width / 2.0).max(0.0);
                    f += 0.03 * peak * (-since / 0.3e-3).exp() * (TAU * 6000.0 * u + phase).sin();
                }
            }
            (f / STEP_N).round() * STEP_N
        })
        .collect()
}

/// A decaying 208 Hz response (m/s) with a vibrometer's white noise.
fn response(start: f64, n: usize, dice: &mut Dice) -> Vec<f64> {
    (0..n)
        .map(|i| {
            let t = i as f64 / FS - start;
            let motion = if t > 0.0 { 2.6e-3 * (-13.0 * t).exp() * (TAU * 208.0 * t).sin() } else { 0.0 };
            ((motion + 8e-6 * dice.gauss()) / 0.31e-6).round() * 0.31e-6
        })
        .collect()
}

fn verdict(force_n: &[f64], responses: &[Vec<f64>], limits: &Limits) -> Judgement {
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
            // a rebound is slower, and its contact lasts somewhat longer
            let second = (start + after_ms * 1e-3, fraction * peak, width * dice.uniform(0.9, 1.2));
            let force = force(&[(start, peak, width), second], 8192, &mut dice);
            let v = verdict(&force, &[], &Limits::default());
            assert_eq!(v.kind, Verdict::DoubleHit, "{fraction} after {after_ms} ms: {v:?}");
            smallest = smallest.min(v.measure / fraction);
        }
    }
    // with a 2 % rebound, the matched filter's output stays well above its limit of 1.2 %
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
        assert_eq!(v.kind, Verdict::Good, "{v:?}");
        // 1 % of ringing under the peak and 0.5 % of interpolation
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
        assert_eq!(verdict(&force, &[], &Limits::default()).kind, Verdict::Overload, "{range} N");
        let limits = Limits { force_range_n: Some(range), ..Limits::default() };
        assert_eq!(verdict(&force, &[], &limits).kind, Verdict::Overload);
    }
    let limits = Limits { response_range: Some(1e-3), ..Limits::default() };
    let pulse = clean(&mut dice);
    let (force, responses) = (force(&[pulse], 4096, &mut dice), [response(pulse.0, 4096, &mut dice)]);
    assert_eq!(verdict(&force, &responses, &limits).kind, Verdict::Overload);
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
            // a spike; a lost beam (the signal stays constant, then jumps back); a step of
            // milliseconds; plain noise
            0 => x[at] += 3e-4,
            1 => x[at - 1500..at - 1000].fill(1.5e-3),
            2 => x[at..(at + 150).min(12_800)].iter_mut().for_each(|v| *v += 1e-3),
            _ => x.iter_mut().for_each(|v| *v += 3e-4 * dice.gauss()),
        }
        let wanted = if case % 4 == 3 { Verdict::Good } else { Verdict::Noisy };
        let v = verdict(&force, &[x], &Limits::default());
        assert_eq!(v.kind, wanted, "case {case}: {v:?}");
    }
}

#[test]
fn the_other_kinds() {
    let mut dice = Dice::new();
    let plain = |peak: f64, dice: &mut Dice| force(&[(5e-3, peak, 0.41e-3)], 4096, dice);
    assert_eq!(verdict(&plain(15.0, &mut dice), &[], &Limits::default()).kind, Verdict::Weak);
    assert_eq!(verdict(&plain(0.0, &mut dice), &[], &Limits::default()).kind, Verdict::Weak);
    assert_eq!(verdict(&[0.0; 1024], &[], &Limits::default()).kind, Verdict::Weak);
    assert_eq!(verdict(&plain(120.0, &mut dice), &[], &Limits::default()).kind, Verdict::Strong);
    let timed = Limits { expected_start_s: Some(8e-3), ..Limits::default() };
    let v = verdict(&plain(50.0, &mut dice), &[], &timed);
    assert_eq!(v.kind, Verdict::Mistimed);
    assert!((v.measure - 3e-3).abs() < 1e-4 && v.limit == 2e-3);
    let force = plain(50.0, &mut dice);
    let hit = RawHit { fs_hz: FS, force_n: &force, responses: &[], missing_samples: 3 };
    assert_eq!(judge(hit, &Limits::default(), None).kind, Verdict::Gap);
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
    assert_eq!(verdict(&merged, &[], &Limits::default()).kind, Verdict::DoubleHit);
}

#[test]
fn a_saturated_amplifier_below_full_scale_is_an_overload_and_a_round_top_is_not() {
    let mut dice = Dice::new();
    for case in 0..60 {
        let pulse = clean(&mut dice);
        let force = force(&[pulse], 12_800, &mut dice);
        let noise = [0.0, 1e-6, 8e-6][case % 3];
        // slow modes have flat peaks too
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
        assert_ne!(v.kind, Verdict::Overload, "case {case}, {hz} Hz: {v:?}");
        let top = motion.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let flat = motion.iter().map(|x| rounded(x.clamp(-0.85 * top, 0.85 * top))).collect();
        let v = verdict(&force, &[flat], &Limits::default());
        assert_eq!(v.kind, Verdict::Overload, "case {case}, {hz} Hz: {v:?}");
        assert!((v.measure.abs() / (0.85 * top) - 1.0).abs() < 0.01, "{v:?}");
    }
}

/// A Hann pulse, 25 N high and `width_s` long, that starts at `start_s`, and the response of a 1 kg
/// oscillator to it: velocity and acceleration, exact, as the sum of the responses to the pulse's
/// three exponentials.
fn hann_hit(fs_hz: f64, n: usize, start_s: f64, width_s: f64, f0_hz: f64) -> [Vec<f64>; 3] {
    type C = num_complex::Complex<f64>;
    let (w, zeta) = (TAU * f0_hz, 0.02);
    let pole = C::new(-zeta * w, w * (1.0f64 - zeta * zeta).sqrt());
    let terms = [(12.5, 0.0), (-6.25, TAU / width_s), (-6.25, -TAU / width_s)];
    let mut all = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    #[allow(clippy::needless_range_loop, reason = "three signals are written at one place")]
    for i in 0..n {
        let t = i as f64 / fs_hz - start_s;
        if t <= 0.0 {
            continue;
        }
        let during = t.min(width_s);
        let force = if t < width_s { 12.5 * (1.0 - (TAU * t / width_s).cos()) } else { 0.0 };
        let answer: C = terms
            .iter()
            .map(|(c, turn)| {
                let m = C::new(0.0, *turn);
                ((m * during).exp() - (pole * during).exp()) * *c / (m - pole)
            })
            .sum();
        let answer = answer * (pole * (t - during)).exp() / pole.im;
        let (x, v) = (answer.im, (pole * answer).im);
        all[0][i] = force;
        all[1][i] = v;
        all[2][i] = force - 2.0 * zeta * w * v - w * w * x;
    }
    all
}

fn judged(fs_hz: f64, force_n: &[f64], responses: &[Vec<f64>]) -> Judgement {
    judge(RawHit { fs_hz, force_n, responses, missing_samples: 0 }, &Limits::default(), None)
}

#[test]
fn a_clean_record_is_good_however_quiet_and_slow_it_is_and_a_spike_in_it_is_found() {
    let mut dice = Dice::new();
    for fs_hz in [2048.0, 5120.0, 25_600.0, 102_400.0] {
        for samples_of_pulse in [4.3, 12.0, 80.0] {
            for noise in [0.0, 1e-6, 1e-4] {
                let width_s = samples_of_pulse / fs_hz;
                let (f0_hz, n) = (0.6 / width_s / dice.uniform(1.0, 4.0), 16_384);
                let start_s = 0.01 + dice.uniform(0.0, 1.0) / fs_hz;
                let [force, v, a] = hann_hit(fs_hz, n, start_s, width_s, f0_hz);
                for x in [v, a] {
                    let most = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
                    let force: Vec<f64> = force.iter().map(|f| f + noise * 25.0 * dice.gauss()).collect();
                    let mut x: Vec<f64> = x.iter().map(|x| x + noise * most * dice.gauss()).collect();
                    let found = judged(fs_hz, &force, &[x.clone()]);
                    let what = format!("{fs_hz} Hz, {samples_of_pulse} samples, noise {noise}: {found:?}");
                    assert_eq!(found.kind, Verdict::Good, "{what}");
                    x[n / 2] += 0.3 * most;
                    let found = judged(fs_hz, &force, &[x]);
                    assert_eq!(found.kind, Verdict::Noisy, "a spike, {what}");
                }
            }
        }
    }
}

#[test]
fn a_pulse_that_the_record_holds_only_in_part_is_mistimed() {
    let n = 8192;
    for part in [0.2, 0.33, 0.5, 0.8] {
        let [force, v, _] = hann_hit(10_240.0, n, -part * 1.5e-3, 1.5e-3, 200.0);
        let found = judged(10_240.0, &force, &[v]);
        assert_eq!(found.kind, Verdict::Mistimed, "{part}: {found:?}");
        assert!(found.sentence.contains("begins within the pulse"), "{found:?}");
        let [force, v, _] = hann_hit(10_240.0, n, n as f64 / 10_240.0 - part * 1.5e-3, 1.5e-3, 200.0);
        let found = judged(10_240.0, &force, &[v]);
        assert!(found.kind == Verdict::Mistimed && found.sentence.contains("ends within"), "{found:?}");
    }
    // a record that starts with the pulse contains all of it
    let [force, v, _] = hann_hit(10_240.0, n, 0.0, 1.5e-3, 200.0);
    assert_eq!(judged(10_240.0, &force, &[v]).kind, Verdict::Good);
}

#[test]
fn a_force_of_the_wrong_sign_is_named() {
    for offset in [0.0, 2.0, -2.0] {
        let [force, v, _] = hann_hit(10_240.0, 4096, 5e-3, 1.5e-3, 200.0);
        let mut force: Vec<f64> = force.iter().map(|f| offset - f).collect();
        // ringing of the force cell after the pulse
        for (i, f) in force.iter_mut().enumerate().skip(70) {
            *f += 1.2 * (-((i - 70) as f64) / 30.0).exp();
        }
        let found = judged(10_240.0, &force, &[v]);
        assert!(
            found.kind == Verdict::Mistimed && found.sentence.contains("sign is the wrong way round"),
            "{found:?}"
        );
        assert!(found.sentence.contains("peak -2"), "{found:?}");
    }
}

#[test]
fn hits_in_one_row_are_counted_and_a_bounce_is_a_double_hit() {
    let (fs_hz, n) = (5120.0, 25_600);
    let mut row = vec![0.0; n];
    for start_s in [0.3, 1.3, 2.4] {
        let [force, ..] = hann_hit(fs_hz, n, start_s, 1.5e-3, 200.0);
        row.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
    }
    let found = judged(fs_hz, &row, &[]);
    assert_eq!(found.kind, Verdict::DoubleHit);
    assert!(
        found.sentence.contains("holds 3 hits, at 0.30") && found.sentence.contains("cut it"),
        "{found:?}"
    );
    for after_s in [0.01, 0.03, 0.1] {
        let [mut force, ..] = hann_hit(fs_hz, n, 0.3, 1.5e-3, 200.0);
        let [second, ..] = hann_hit(fs_hz, n, 0.3 + after_s, 1.6e-3, 200.0);
        force.iter_mut().zip(second).for_each(|(sum, f)| *sum += 0.6 * f);
        let found = judged(fs_hz, &force, &[]);
        assert!(found.kind == Verdict::DoubleHit && found.sentence.contains("second pulse"), "{found:?}");
    }
}

#[test]
fn a_soft_pulse_is_one_hit_at_any_rate() {
    let mut dice = Dice::new();
    for fs_hz in [2048.0, 10_240.0, 51_200.0] {
        for width_s in [4e-3, 10e-3, 30e-3] {
            let n = (1.5 * fs_hz) as usize;
            let [force, v, _] = hann_hit(fs_hz, n, 0.1, width_s, 20.0);
            for noise in [0.0, 1e-3] {
                let force: Vec<f64> = force.iter().map(|f| f + 25.0 * noise * dice.gauss()).collect();
                let found = judged(fs_hz, &force, std::slice::from_ref(&v));
                assert_eq!(found.kind, Verdict::Good, "{fs_hz} Hz, {width_s} s: {found:?}");
            }
        }
    }
}

/// These signals (force first, then velocities) as a record of one type; integer types have these
/// full scales and 24 bits.
fn typed(of: SampleType, signals: &[Vec<f64>], full: &[f64]) -> (ChannelMap, Recording) {
    let code = of.is_code();
    let channel = |(place, full): (usize, &f64)| Channel {
        name: ["force", "x", "y", "z"][place].try_into().expect("short"),
        role: [Role::HammerForce, Role::Response(Axis::X), Role::Response(Axis::Y), Role::Response(Axis::Z)]
            [place],
        quantity: if place == 0 { Quantity::Force } else { Quantity::Velocity },
        units_per_volt: if code { (full / 10.0) as f32 } else { 1.0 },
        range_v: if code { 10.0 } else { 0.0 },
        delay_ns: 0,
        bits: if code { 24 } else { 0 },
    };
    let channels: Vec<Channel> = full.iter().enumerate().map(channel).collect();
    let channels = ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels };
    let samples = signals.iter().enumerate().map(|(place, own)| {
        let codes = own.iter().map(|v| (v / of.units(&channels.channels[place])).round());
        match of {
            SampleType::I16 => ChannelSamples::I16(codes.map(|v| v as i16).collect()),
            SampleType::I32 => {
                ChannelSamples::I32(codes.map(|v| v.clamp(-8_388_608.0, 8_388_607.0) as i32).collect())
            }
            SampleType::F32 => ChannelSamples::F32(own.iter().map(|v| *v as f32).collect()),
            SampleType::F64 => ChannelSamples::F64(own.clone()),
        }
    });
    let samples = Samples::new(samples.collect()).expect("equally long");
    let shot = Shot {
        number: 1,
        phase: Phase::Done,
        fired_at: 0,
        trigger: 512,
        pulse_us: 3_000,
        peak_n: 50.0,
        width_us: 410.0,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    };
    (channels, Recording { epoch: 0, first_scan: 0, trigger_index: 512, samples, gaps: Vec::new(), shot })
}

fn by_record((channels, recording): &(ChannelMap, Recording), others: &Others) -> Judgement {
    let plan = Plan::parse(SMALL, "small").expect("a plan");
    ByRecord.judge(&plan.cells()[0], &plan, channels, recording, others)
}

/// A clean hit of 50 N without any noise: the force, a velocity, a one-sided motion that is exactly
/// zero before the hit, and a channel that is zero throughout.
fn noise_free(f0_hz: f64) -> Vec<Vec<f64>> {
    let [force, v, _] = hann_hit(FS, 16_384, 512.3 / FS, 1.2e-3, f0_hz);
    let force = force.iter().map(|f| 2.0 * f).collect();
    let squared = v.iter().map(|v| v * v).collect();
    vec![force, v, squared, vec![0.0; 16_384]]
}

fn most(x: &[f64]) -> f64 {
    x.iter().fold(0.0f64, |most, v| most.max(v.abs()))
}

#[test]
fn clean_records_without_noise_are_good_in_every_type() {
    for of in SampleType::ALL {
        for f0_hz in [3.0, 30.0, 90.0, 250.0, 700.0] {
            let signals = noise_free(f0_hz);
            let full: Vec<f64> = signals.iter().map(|x| 1.2 * most(x).max(1e-3)).collect();
            let typed = typed(of, &signals, &full);
            let mut others = Others::of(Vec::new());
            let plan = Plan::parse(SMALL, "small").expect("a plan");
            for hit in 0..5 {
                let found = by_record(&typed, &others);
                assert_eq!(found.kind, Verdict::Good, "{of:?}, {f0_hz} Hz, hit {hit}: {found:?}");
                others.learn(&plan, &typed.0, &typed.1.samples);
            }
        }
    }
}

#[test]
fn an_integer_channel_at_the_end_of_its_range_is_an_overload() {
    let signals = noise_free(250.0);
    for place in 0..3 {
        let mut full: Vec<f64> = signals.iter().map(|x| 1.2 * most(x).max(1e-3)).collect();
        // the largest values reach the extreme code of 24 bits, and stay there
        full[place] = 0.98 * most(&signals[place]);
        let found = by_record(&typed(SampleType::I32, &signals, &full), &Others::of(Vec::new()));
        assert_eq!(found.kind, Verdict::Overload, "channel {place}: {found:?}");
        assert!(found.sentence.contains("end of its range"), "{found:?}");
    }
    // 24-bit codes are far from the ends of 32 bits
    let (mut map, recording) = typed(SampleType::I32, &signals, &[49.0, 1.0, 1.0, 1.0]);
    assert!(recording.channel(0).at_the_ends(24) > 1);
    assert_eq!(recording.channel(0).at_the_ends(32), 0);
    map.channels[0].bits = 32;
    assert!(recording.channel(0).at_the_ends(map.channels[0].bits) == 0);
}

#[test]
fn a_clipped_channel_of_unknown_range_is_an_overload_by_its_plateaus() {
    for of in [SampleType::F32, SampleType::F64] {
        for place in [0, 1] {
            for part in [0.6, 0.8, 0.9] {
                let mut signals = noise_free(250.0);
                let limit = part * most(&signals[place]);
                signals[place].iter_mut().for_each(|v| *v = v.clamp(-limit, limit));
                let found = by_record(&typed(of, &signals, &[1.0; 4]), &Others::of(Vec::new()));
                assert_eq!(found.kind, Verdict::Overload, "{of:?}, channel {place}, {part}: {found:?}");
                assert!((found.measure.abs() / limit - 1.0).abs() < 1e-6, "{found:?}");
            }
        }
    }
}

#[test]
fn noise_is_compared_in_every_type() {
    let mut dice = Dice::new();
    let plan = Plan::parse(SMALL, "small").expect("a plan");
    for of in SampleType::ALL {
        let mut hit = |noise: f64| {
            let mut signals = noise_free(250.0);
            let rms = noise * most(&signals[1]);
            signals[1].iter_mut().for_each(|v| *v += rms * dice.gauss());
            let full: Vec<f64> = signals.iter().map(|x| 1.2 * most(x).max(1e-3)).collect();
            typed(of, &signals, &full)
        };
        let mut others = Others::of(Vec::new());
        for _ in 0..4 {
            let typed = hit(1e-4);
            assert_eq!(by_record(&typed, &others).kind, Verdict::Good, "{of:?}");
            others.learn(&plan, &typed.0, &typed.1.samples);
        }
        let found = by_record(&hit(1e-3), &others);
        assert!(found.kind == Verdict::Noisy && found.sentence.contains("channel x is"), "{of:?}: {found:?}");
    }
}

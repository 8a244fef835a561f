//! Converters of 24 bits: nothing is rounded on the way into the file, and FRFs far below their
//! peak are right where 16 bits are not enough.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;

use jointrig::device::address::Address;
use jointrig::device::samples::{ChannelView, SampleType};
use jointrig_hil_sim::rig::{Configuration, Quantity, RigConfig, exact_frf};
use jointrig_tests::campaign::{plan, run, second_hit_on_a};
use num_complex::Complex;

/// Window's decay, 1/s, as in the plan.
const SIGMA: f64 = 2.3;

/// A rig without errors of position and gain, whose converters have a range of ±10 V and noise this
/// many dB below a sine of full scale; the vibrometer has `m_per_s_per_v`.
fn rig(bits: u8, noise_db: f64, m_per_s_per_v: f64) -> String {
    let noise_v = 10.0 / 2_f64.sqrt() * 10_f64.powf(-noise_db / 20.0);
    let (force_n, white) = (44.64 * noise_v, (51_200.0_f64 / 2.0).sqrt());
    let floor = m_per_s_per_v * noise_v / white;
    let mut text = String::from("[errors]\nnone = true\n[hammer.mishaps]\n");
    text.push_str("double_hit = 0.0\nweak = 0.0\noverload = 0.0\n");
    writeln!(text, "[sensors]\nbits = {bits}\n[sensors.force]\nnoise_n = {force_n:e}").unwrap();
    writeln!(text, "[sensors.vibrometer]\nunits_per_volt = {m_per_s_per_v:e}\nfloor = {floor:e}").unwrap();
    text
}

/// Relative error (rms) of the receptance of A at its lines 90 to 110 dB below the largest one,
/// from the second hit of a campaign on this rig, and the type of its samples.
fn error_far_below_the_peak(rig: &str) -> (f64, SampleType) {
    let config = RigConfig::from_toml(rig).unwrap();
    let hit = second_hit_on_a(rig);
    let line = |i: i32| Complex::new(SIGMA, std::f64::consts::TAU * 2.0 * f64::from(i));
    let s: Vec<Complex<f64>> = (5..=500).map(line).collect();
    let impact = config.impact(Configuration::A, "AZ3").unwrap().probe();
    let response = config.response(Configuration::A, "A3").unwrap().probes()[2];
    let exact =
        exact_frf(&config, Configuration::A, Quantity::Receptance, &s, &[response], &[impact]).unwrap();
    let peak = exact.iter().map(|line| line[(0, 0)].norm()).fold(0.0, f64::max);
    let (mut sum, mut count) = (0.0, 0);
    for (s, exact) in s.iter().zip(&exact) {
        let exact = exact[(0, 0)];
        if (-110.0..-90.0).contains(&(20.0 * (exact.norm() / peak).log10())) {
            sum += (hit.mobility(*s) / s / exact - 1.0).norm_sqr();
            count += 1;
        }
    }
    assert!(count > 50, "{count} lines");
    ((sum / f64::from(count)).sqrt(), hit.of)
}

/// Noise of 120 dB: at a tenth of the range an FRF 100 dB below its peak is right to 1 %; with 16
/// bits the rounding is the larger part of the error.
#[test]
fn an_frf_100_db_below_its_peak_is_right_with_24_bits() {
    let (wide, of) = error_far_below_the_peak(&rig(24, 120.0, 5e-3));
    assert_eq!(of, SampleType::I32);
    assert!(wide < 0.01, "{wide}");
    let (narrow, of) = error_far_below_the_peak(&rig(16, 120.0, 5e-3));
    assert_eq!(of, SampleType::I16);
    assert!(narrow > 2.0 * wide, "{narrow}, and {wide} with 24 bits");
}

/// A range that is ten times as large leaves 16 bits with an error over 20 %; converters of 24 bits
/// whose noise is 132 dB below full scale still give 1 %.
#[test]
fn a_range_that_is_too_large_costs_little_with_24_bits() {
    let (wide, _) = error_far_below_the_peak(&rig(24, 132.0, 5e-2));
    assert!(wide < 0.01, "{wide}");
    let (narrow, _) = error_far_below_the_peak(&rig(16, 132.0, 5e-2));
    assert!(narrow > 0.2, "{narrow}, and {wide} with 24 bits");
}

/// The codes in the file are those of the converter: the same rig with 30 bits gives, rounded to
/// 24, the same codes.
#[test]
fn wide_codes_arrive_without_a_loss() {
    let measured = |bits: u8| {
        let folder = tempfile::tempdir().unwrap();
        let (description, file) = (folder.path().join("rig.toml"), folder.path().join("c.jrig"));
        std::fs::write(&description, rig(bits, 120.0, 5e-3)).unwrap();
        let address: Address = format!("sim:{}", description.display()).parse().unwrap();
        run(&file, &plan(2, &[("B", &["BY1"], &["B4"])]), address.open(7).unwrap()).1
    };
    let (finer, coarser) = (measured(30), measured(24));
    assert!(!finer.is_empty() && finer.len() == coarser.len());
    for (finer, coarser) in finer.iter().zip(&coarser) {
        assert_eq!((finer.place, finer.verdict), (coarser.place, coarser.verdict));
        for (finer, coarser) in finer.samples.each().zip(coarser.samples.each()) {
            let (ChannelView::I32(finer), ChannelView::I32(coarser)) = (finer, coarser) else {
                panic!("{:?} and {:?}", finer.of(), coarser.of());
            };
            assert!(finer.iter().any(|code| code % 64 != 0), "the lower bits are used");
            for (finer, coarser) in finer.iter().zip(coarser) {
                // two roundings, of which the first may turn a half up or down
                assert!((f64::from(*finer) / 64.0 - f64::from(*coarser)).abs() <= 0.5 + 1.0 / 64.0);
            }
        }
    }
}

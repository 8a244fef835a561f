//! Noise per range, and aliasing into the band: docs/front-end.md contains the same tables.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Sensitivity of a force cell, V/N (`channels.rs` of the nucleo: 44.643 N/V).
const FORCE_V_PER_N: f64 = 1.0 / 44.643;
/// Peak force of the hammer, N.
const PEAK_N: f64 = 50.0;
/// Number of 16-bit codes.
const CODES: f64 = 65_536.0;

/// Part, range in V, and typical signal-to-noise ratio at full scale in dB without averaging: from
/// memory of AD7606B Rev. 0 and AD7606C-16 Rev. 0, "Specifications", not checked against them.
const CONVERTERS: [(&str, f64, f64); 6] = [
    ("AD7606B", 10.0, 90.0),
    ("AD7606B", 5.0, 89.0),
    ("AD7606B", 2.5, 86.5),
    ("AD7606C-16", 10.0, 91.0),
    ("AD7606C-16", 5.0, 90.0),
    ("AD7606C-16", 2.5, 88.0),
];

/// Sensors and their own noise in codes of ± 10 V (`hil-sim/rigs/default.toml`, over the whole
/// band).
const SENSORS: [(&str, f64); 4] = [
    ("hammer's force cell", 0.7),
    ("load cell", 1.6),
    ("3-D vibrometer", 5.0),
    ("single-point vibrometer", 26.0),
];

fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// Noise of a converter, V rms, including its quantisation.
fn noise_v(range_v: f64, snr_db: f64) -> f64 {
    range_v * FRAC_1_SQRT_2 / 10_f64.powf(snr_db / 20.0)
}

fn quantisation_v(range_v: f64) -> f64 {
    2.0 * range_v / CODES / 12_f64.sqrt()
}

/// Gain of a Butterworth low-pass.
fn low_pass(frequency_hz: f64, corner_hz: f64, order: i32) -> f64 {
    (1.0 + (frequency_hz / corner_hz).powi(2 * order)).sqrt().recip()
}

/// Gain of the mean of `count` conversions, 1.25 µs apart.
fn mean_of(frequency_hz: f64, count: f64) -> f64 {
    let half = PI * frequency_hz * 1.25e-6;
    ((count * half).sin() / (count * half.sin())).abs()
}

/// Gain of the half-band filter of `jointrig_hot::half_band`, at 102.4 kHz.
fn half_band(frequency_hz: f64) -> f64 {
    let (s, c) = (PI * frequency_hz / 102_400.0).sin_cos();
    c.powi(6) * (1.0 + 3.0 * s.powi(2) + 6.0 * s.powi(4))
}

/// Gain of the chip's own filter at ± 10 V with 1 kΩ and 1 nF before it.
fn analogue(frequency_hz: f64) -> f64 {
    low_pass(frequency_hz, 23_000.0, 2) * low_pass(frequency_hz, 159_155.0, 1)
}

fn page() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/front-end.md")).expect("the page")
}

fn expect(page: &str, row: &str) {
    assert!(page.contains(row), "docs/front-end.md lacks the row\n{row}");
}

#[test]
fn the_page_shows_the_noise_of_each_range() {
    let page = page();
    for (part, range_v, snr_db) in CONVERTERS {
        let noise = noise_v(range_v, snr_db);
        let peak_v = PEAK_N * FORCE_V_PER_N;
        expect(
            &page,
            &format!(
                "| {part} | ± {range_v} V | {snr_db:.1} | {:.0} | {:.0} | {:.1} | {:.1} | {:.0} |",
                1e6 * quantisation_v(range_v),
                1e6 * noise,
                1e3 * noise / FORCE_V_PER_N,
                snr_db + decibels(peak_v / range_v),
                range_v / FORCE_V_PER_N
            ),
        );
    }
}

#[test]
fn the_page_shows_what_a_smaller_range_brings_each_sensor() {
    let page = page();
    let code_v = 20.0 / CODES;
    let [wide, narrow] = [0, 2].map(|place| noise_v(CONVERTERS[place].1, CONVERTERS[place].2) / code_v);
    for (sensor, own) in SENSORS {
        let [with_wide, with_narrow] = [wide, narrow].map(|converter| own.hypot(converter));
        let gain = decibels(with_wide / with_narrow);
        expect(&page, &format!("| {sensor} | {own:.1} | {with_wide:.2} | {with_narrow:.2} | {gain:.1} |"));
    }
}

#[test]
fn the_page_shows_what_aliases() {
    let page = page();
    // the frequency that aliases to 5 kHz
    let at = 46_200.0;
    let now = analogue(at) * mean_of(at, 8.0);
    let twice = analogue(at) * mean_of(at, 4.0);
    // and from the other side of twice the rate
    let beyond = analogue(97_400.0) * mean_of(97_400.0, 4.0);
    for (what, ratio) in [
        ("51.2 kHz, mean of 8, as it is", now),
        ("51.2 kHz, mean of 8, as it is: from 97.4 kHz", analogue(97_400.0) * mean_of(97_400.0, 8.0)),
        ("the same behind a decoder's low-pass of 20 kHz, 4th order", now * low_pass(at, 20_000.0, 4)),
        ("102.4 kHz, mean of 4, every second scan left out", twice),
        ("102.4 kHz, mean of 4, half-band filter: from 46.2 kHz", twice * half_band(at)),
        ("102.4 kHz, mean of 4, half-band filter: from 97.4 kHz", beyond),
    ] {
        expect(&page, &format!("| {what} | {:.1} |", -decibels(ratio)));
    }
    let droop =
        |mean: f64, frequency_hz: f64| -decibels(mean_of(frequency_hz, mean) * analogue(frequency_hz));
    assert!(droop(8.0, 5_000.0) < 0.1, "flat below 5 kHz");
}

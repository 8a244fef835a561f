//! Loops and all their quantities from 60 s of ten channels at 51.2 kHz, compared with numpy, which
//! must find the same numbers, and with one pass over the samples of the five channels that are
//! needed.

use super::peers::{self, Peers};
use super::row::{RUNS, Row, quickest};
use jointrig::campaign::plan::level::{Held, Level};
use jointrig::campaign::run::shaking::record;
use jointrig::device::channels::ChannelMap;
use jointrig::device::samples::{ChannelView, Samples};
use jointrig::hysteresis::{Correction, LoopAnalysis, analyse_both};
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::path::Path;

const RATE_HZ: u32 = 51_200;
const SECONDS: usize = 60;
/// A cycle is 204.8 samples, not a whole number.
const FREQUENCY_HZ: f64 = 250.0;
const MASS_KG: f64 = 1.56;
const PATH: f64 = 0.0133;
/// Relative tolerance between both results: they interpolate between samples in different ways.
const ALIKE: f64 = 2e-3;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The single row of this part.
pub fn rows(all: &Peers) -> Outcome<Vec<Row>> {
    let map = channels()?;
    let samples = Samples::of_codes(&codes(&map), map.len());
    let level =
        Level { frequency_hz: FREQUENCY_HZ, end_hz: None, held: Held::Displacement, amplitude: 1.5e-7 };
    let mut found = both(&map, &samples, &level)?;
    let [ours, least] = quickest(
        RUNS,
        [
            &mut || {
                found = black_box(both(black_box(&map), black_box(&samples), &level).expect("it did before"));
            },
            &mut || {
                black_box(one_pass(&map, black_box(&samples)));
            },
        ],
    );
    let folder = tempfile::tempdir()?;
    let theirs = numpy(all, folder.path(), &samples, &map)?;
    if let Some(theirs) = &theirs {
        for (name, mine) in figures(&found) {
            let other = theirs["figures"][name].as_f64().ok_or(format!("loops.py gave no {name}"))?;
            if (mine / other - 1.0).abs() > ALIKE {
                return Err(format!("{name}: {mine} here, {other} by numpy").into());
            }
        }
    }
    let peer = theirs.as_ref().and_then(|t| peers::quickest(&t["seconds"]));
    let megabytes = (2 * samples.scans() * samples.channels()) as f64 / 1e6;
    Ok(vec![
        Row::of(format!("loops, {SECONDS} s of {} channels ({megabytes:.0} MB of codes)", map.len()), ours)
            .beside("numpy", peer, 6.0)
            .against("one pass over the five channels' samples", least, None),
    ])
}

/// Sums of the samples of the five channels.
fn one_pass(map: &ChannelMap, samples: &Samples) -> f64 {
    let wanted = |role| matches!(role, Role::SpecimenA | Role::SpecimenB | Role::LoadCell);
    let places: Vec<usize> = (0..map.len()).filter(|place| wanted(map.channels[*place].role)).collect();
    places
        .par_iter()
        .map(|place| codes_of(samples.channel(*place)).iter().map(|code| f64::from(*code)).sum::<f64>())
        .sum()
}

/// The codes of a channel that has 16-bit codes.
fn codes_of(channel: ChannelView<'_>) -> &[i16] {
    let ChannelView::I16(codes) = channel else { return &[] };
    codes
}

/// Loops with the raw and with the corrected force.
fn both(map: &ChannelMap, samples: &Samples, level: &Level) -> Outcome<[LoopAnalysis; 2]> {
    let cells: Vec<(usize, f64)> = map.places(Role::LoadCell).into_iter().map(|place| (place, 1.0)).collect();
    let raw = record(map, &cells, samples, level)?;
    let correction = Correction { effective_mass_kg: MASS_KG, parallel_path: PATH };
    Ok(analyse_both(&raw, &correction)?)
}

/// The quantities in which both must agree.
fn figures(found: &[LoopAnalysis; 2]) -> Vec<(&'static str, f64)> {
    let [raw, corrected] = found;
    vec![
        ("k_eq", raw.k_eq_n_per_m.mean),
        ("secant", raw.k_secant_n_per_m.unwrap_or(f64::NAN)),
        ("fundamental", raw.k_fundamental_n_per_m.map_or(f64::NAN, num_complex::Complex::norm)),
        ("energy", raw.energy_j.map_or(f64::NAN, |e| e.mean)),
        ("amplitude", raw.amplitude_m),
        ("corrected_k_eq", corrected.k_eq_n_per_m.mean),
    ]
}

fn channels() -> Outcome<ChannelMap> {
    let roles = [
        ("force", Role::HammerForce, Quantity::Force, 44.6),
        ("x", Role::Response(Axis::X), Quantity::Velocity, 5e-3),
        ("y", Role::Response(Axis::Y), Quantity::Velocity, 5e-3),
        ("z", Role::Response(Axis::Z), Quantity::Velocity, 5e-3),
        ("ldv_a", Role::SpecimenA, Quantity::Velocity, 1e-3),
        ("ldv_b", Role::SpecimenB, Quantity::Velocity, 1e-3),
        ("cell_1", Role::LoadCell, Quantity::Force, 20.0),
        ("cell_2", Role::LoadCell, Quantity::Force, 20.0),
        ("cell_3", Role::LoadCell, Quantity::Force, 20.0),
        ("excitation", Role::Excitation, Quantity::Force, 44.6),
    ];
    let channel = |(name, role, quantity, scale): (&str, Role, Quantity, f32)| -> Outcome<Channel> {
        let name = name.try_into().map_err(|_| "a channel's name is too long")?;
        Ok(Channel { name, role, quantity, units_per_volt: scale, range_v: 10.0, delay_ns: 0, bits: 16 })
    };
    let channels = roles.into_iter().map(channel).collect::<Outcome<Vec<Channel>>>()?;
    Ok(ChannelMap { id: 0, rate_hz: RATE_HZ, exact_hz: None, channels })
}

/// x_A, x_B and T of a contact of 180 N/µm with some energy dissipation, with noise on all signals.
fn codes(map: &ChannelMap) -> Vec<i16> {
    let n = SECONDS * RATE_HZ as usize;
    let w = TAU * FREQUENCY_HZ;
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut codes = Vec::with_capacity(n * map.len());
    for (place, channel) in map.channels.iter().enumerate() {
        let (amplitude, phase) = match channel.role {
            Role::SpecimenA => (4.0e-7 * w, TAU / 4.0),
            Role::SpecimenB => (2.5e-7 * w, TAU / 4.0),
            Role::LoadCell => (9.0, 0.06),
            _ => (0.0, 0.0),
        };
        let units = map.channels[place].units_per_code();
        codes.extend((0..n).map(|i| {
            let t = i as f64 / f64::from(RATE_HZ);
            (amplitude * (w * t + phase).sin() / units + 3.0 * noise()).round() as i16
        }));
    }
    codes
}

fn numpy(all: &Peers, folder: &Path, samples: &Samples, map: &ChannelMap) -> Outcome<Option<Value>> {
    if !all.are_there() {
        return Ok(None);
    }
    let path = folder.join("codes.bin");
    std::fs::write(
        &path,
        samples.each().flat_map(codes_of).flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>(),
    )?;
    let place = |role| map.place(role).ok_or("no such channel");
    let job = json!({
        "path": path, "channels": map.len(), "rate": RATE_HZ, "frequency": FREQUENCY_HZ,
        "mass": MASS_KG, "parallel": PATH, "a": place(Role::SpecimenA)?, "b": place(Role::SpecimenB)?,
        "cells": map.places(Role::LoadCell),
        "units": map.channels.iter().map(Channel::units_per_code).collect::<Vec<_>>(),
    });
    all.run("loops.py", &job.to_string())
}

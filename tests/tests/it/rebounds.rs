//! Double hits on simulated records: every rebound from 2 % on is found, and clean hits raise no
//! alarm.
#![allow(clippy::unwrap_used)]

use std::fmt::Write;

use jointrig::campaign::plan::{Cell, DEMO, Plan};
use jointrig::campaign::verdict::judge::{ByRecord, Judge};
use jointrig::campaign::verdict::others::Others;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::device::channels::ChannelMap;
use jointrig::device::samples::Samples;
use jointrig::device::stream::Recording;
use jointrig_hil_sim::rig::{self, Measured, Rig, RigConfig};
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::{Phase, Shot};

const RATE: f64 = 51_200.0;
const PRE: usize = 256;
/// Half a second: no rebound comes later.
const POST: usize = 25_600;

/// A rig whose hammer has no mishaps, at `seed`.
fn rig(seed: u64) -> Rig {
    let clean = "[hammer.mishaps]\ndouble_hit = 0.0\nweak = 0.0\noverload = 0.0\n";
    Rig::new(&RigConfig::from_toml(clean).unwrap(), seed).unwrap()
}

fn map(channels: &[rig::Channel]) -> ChannelMap {
    let role = |name: &str| match name {
        "force" => Role::HammerForce,
        "vib_x" => Role::Response(Axis::X),
        "vib_y" => Role::Response(Axis::Y),
        "vib_z" => Role::Response(Axis::Z),
        "ldv_a" => Role::SpecimenA,
        "ldv_b" => Role::SpecimenB,
        _ => Role::LoadCell,
    };
    let channels = channels.iter().map(|channel| Channel {
        name: channel.name.as_str().try_into().unwrap(),
        role: role(&channel.name),
        quantity: match channel.quantity {
            Measured::Force => Quantity::Force,
            Measured::Velocity => Quantity::Velocity,
            Measured::Acceleration => Quantity::Acceleration,
        },
        units_per_volt: (channel.units_per_volt * f64::from(channel.polarity)) as f32,
        range_v: channel.range_v as f32,
        delay_ns: 0,
        bits: 16,
    });
    ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels: channels.collect() }
}

/// One hit as it would be recorded: 5 ms before the trigger, then half a second; channel by
/// channel.
fn hit(rig: &mut Rig, map: &ChannelMap, pulse_s: f64) -> Vec<Vec<i16>> {
    let count = map.len();
    let force = map.place(Role::HammerForce).unwrap();
    let level = (3.0 / map.channels[force].units_per_code()) as i16;
    let mut channels = vec![Vec::new(); count];
    let mut codes = vec![0; count];
    let mut trigger = None;
    for scan in 0.. {
        if scan == 512 {
            rig.fire(pulse_s);
        }
        rig.scan(&mut codes);
        for (channel, code) in channels.iter_mut().zip(&codes) {
            channel.push(*code);
        }
        if scan > 512 && trigger.is_none() && codes[force].abs() >= level.abs() {
            trigger = Some(scan);
        }
        assert!(trigger.is_some() || scan < 10_000, "the bolt did not arrive");
        if trigger.is_some_and(|at| scan + 1 == at + POST) {
            break;
        }
    }
    let from = trigger.unwrap() - PRE;
    channels.iter().map(|channel| channel[from..].to_vec()).collect()
}

fn judge(plan: &Plan, map: &ChannelMap, channels: &[Vec<i16>]) -> Judgement {
    let recording = Recording {
        epoch: 0,
        first_scan: 0,
        trigger_index: PRE,
        samples: Samples::of_codes(&channels.concat(), map.len()),
        gaps: Vec::new(),
        shot: Shot {
            number: 1,
            phase: Phase::Done,
            fired_at: 0,
            trigger: PRE as u64,
            pulse_us: 3_500,
            peak_n: 0.0,
            width_us: 0.0,
            rebound_ratio: 0.0,
            rebound_after: 0,
            friction_peak_n: 0.0,
            quiet_ratio: 0.0,
        },
    };
    let cell =
        Cell { configuration: Configuration::Ajb, impact: "-".into(), response: "-".into(), wanted: 1 };
    ByRecord.judge(&cell, plan, map, &recording, &Others::default())
}

/// Clean hits over all configurations, impacts and responses, a new one each (without A4, whose
/// speckle is another fault).
fn clean(count: usize, seed: u64) -> (ChannelMap, Vec<Vec<Vec<i16>>>) {
    let mut rig = rig(seed);
    let map = map(rig.channels());
    let plan = Plan::parse(DEMO, "demo.toml").unwrap();
    let cells: Vec<Cell> = plan.cells().into_iter().filter(|cell| cell.response != "A4").collect();
    let hits = (0..count).map(|n| {
        let cell = &cells[n * 37 % cells.len()];
        let configuration = match cell.configuration {
            Configuration::A => rig::Configuration::A,
            Configuration::B => rig::Configuration::B,
            Configuration::Ajb => rig::Configuration::Ajb,
        };
        rig.stage(configuration, &cell.impact, &cell.response, n as u32 % 8).unwrap();
        hit(&mut rig, &map, 3.5e-3)
    });
    let hits = hits.collect();
    (map, hits)
}

#[test]
fn every_rebound_from_two_per_cent_on_is_found_in_simulated_hits() {
    let plan = Plan::parse(DEMO, "demo.toml").unwrap();
    let (map, hits) = clean(44, 5);
    let mut table = String::new();
    for fraction in [0.02, 0.05, 0.10, 0.20, 0.50] {
        let (mut found, mut cases) = (0, 0);
        for after_ms in [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0] {
            let delay = (after_ms * 1e-3 * RATE).round() as usize;
            for channels in &hits {
                // the rebound's force, and the structure's response to it: the hit repeated, later
                // and smaller
                let spoilt: Vec<Vec<i16>> = channels
                    .iter()
                    .map(|codes| {
                        let rest: f64 = codes[..200].iter().map(|code| f64::from(*code)).sum::<f64>() / 200.0;
                        let again = |i: usize| {
                            let before = i.checked_sub(delay).filter(|at| *at >= PRE - 20);
                            before.map_or(0.0, |at| fraction * (f64::from(codes[at]) - rest))
                        };
                        (0..codes.len()).map(|i| (f64::from(codes[i]) + again(i)).round() as i16).collect()
                    })
                    .collect();
                let judgement = judge(&plan, &map, &spoilt);
                cases += 1;
                if judgement.kind == Verdict::DoubleHit {
                    found += 1;
                } else {
                    println!("{fraction} after {after_ms} ms: {judgement:?}");
                }
            }
        }
        // writing to a string cannot fail
        writeln!(table, "{:.0} %: {found} of {cases}", 100.0 * fraction).unwrap();
        assert!(found * 100 >= cases * 95, "{table}");
    }
    println!("{table}");
}

#[test]
fn clean_hits_raise_no_alarm() {
    let plan = Plan::parse(DEMO, "demo.toml").unwrap();
    let (map, hits) = clean(500, 6);
    let refused: Vec<_> = hits
        .iter()
        .map(|channels| judge(&plan, &map, channels))
        .filter(|judgement| judgement.kind != Verdict::Good)
        .collect();
    let double = refused.iter().filter(|judgement| judgement.kind == Verdict::DoubleHit).count();
    println!(
        "{double} double hits and {} other refusals among 500 clean hits: {refused:?}",
        refused.len() - double
    );
    assert!(double <= 5 && refused.len() <= 5, "{refused:?}");
}

use super::*;
use crate::campaign::plan::SMALL;
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::record_table::NewRecord;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use jointrig_protocol::channel::Channel;
use jointrig_protocol::shot::{Phase, Shot};
use std::f64::consts::PI;

const RATE: f64 = 51_200.0;
const TRIGGER: usize = 256;
const MASS_KG: f64 = 0.9;

/// Hammer and vibrometer; the channels' scales contain the errors to be found.
fn map(force_error: f64, z_sign: f32) -> ChannelMap {
    let channel = |name: &str, role, quantity, units_per_volt| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity,
        units_per_volt,
        range_v: 10.0,
        delay_ns: if quantity == Quantity::Velocity { 100_000 } else { 0 },
        bits: 16,
    };
    let velocity =
        |name, axis, sign: f32| channel(name, Role::Response(axis), Quantity::Velocity, 0.005 * sign);
    ChannelMap {
        id: 0,
        rate_hz: RATE as u32,
        exact_hz: None,
        channels: vec![
            channel("force", Role::HammerForce, Quantity::Force, (44.6 * force_error) as f32),
            velocity("vib_x", Axis::X, 1.0),
            velocity("vib_y", Axis::Y, 1.0),
            velocity("vib_z", Axis::Z, z_sign),
        ],
    }
}

/// A free mass struck along −z: the codes of sensors without error.
fn recording(peak_n: f64) -> Recording {
    let true_map = map(1.0, 1.0);
    let width = 0.41e-3;
    let scans = TRIGGER + 4_096;
    let t = |scan: usize, late: f64| (scan as f64 - TRIGGER as f64) / RATE - late;
    let force = |t: f64| if (0.0..width).contains(&t) { peak_n * (PI * t / width).sin() } else { 0.0 };
    // the impulse up to t over the mass
    let velocity = |t: f64| {
        let share = (t / width).clamp(0.0, 1.0);
        -peak_n * width / PI * (1.0 - (PI * share).cos()) / MASS_KG
    };
    let code = |place: usize, value: f64| (value / true_map.channels[place].units_per_code()).round() as i16;
    let mut codes: Vec<i16> = (0..scans).map(|scan| code(0, force(t(scan, 0.0)))).collect();
    codes.extend(vec![0; 2 * scans]);
    codes.extend((0..scans).map(|scan| code(3, velocity(t(scan, 1e-4)))));
    let shot = Shot {
        number: 1,
        phase: Phase::Done,
        fired_at: 0,
        trigger: TRIGGER as u64,
        pulse_us: 3_000,
        peak_n: peak_n as f32,
        width_us: 410.0,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    };
    let samples = Samples::of_codes(&codes, 4);
    Recording { epoch: 1, first_scan: 0, trigger_index: TRIGGER, samples, gaps: vec![], shot }
}

fn campaign(folder: &tempfile::TempDir, map: &ChannelMap) -> Store {
    let mut store = Store::create(&folder.path().join("a.jrig"), SMALL, "small.toml").expect("created");
    let info = SessionInfo {
        address: "x".into(),
        board: "x".into(),
        serial: "x".into(),
        firmware_version: "0".into(),
        target: "x".into(),
        build: Hex(0),
        schema_hash: Hex(0),
    };
    let session = store.begin_session(&info, map).expect("session");
    for (attempt, peak) in [45.0, 50.0, 55.0].into_iter().enumerate() {
        let verdict =
            Judgement { peak_n: peak, ..Judgement::without_pulse(Verdict::Good, 0.0, 0.0, "made up".into()) };
        let record = NewRecord {
            cell: 1,
            attempt: attempt as u32,
            session,
            utc: utc_now(),
            utc_error_s: None,
            recording: recording(peak),
            verdict,
        };
        store.insert(&record, &Counters::new()).expect("stored");
    }
    store
}

#[test]
fn a_wrong_sensitivity_shows_as_the_ratio_of_momentum() {
    for error in [1.0, 0.93, 1.08] {
        let folder = tempfile::tempdir().expect("a folder");
        let store = campaign(&folder, &map(error, 1.0));
        let found = ratio(&store, 1, MASS_KG).expect("readable").expect("three hits");
        assert!((found.mean / error - 1.0).abs() < 5e-3, "{error}: {found:?}");
        assert!(found.deviation < 5e-3 && found.records.len() == 3, "{found:?}");
        assert_eq!(ratio(&store, 2, MASS_KG).expect("readable"), None);
    }
}

#[test]
fn a_turned_head_shows_as_a_negative_sign() {
    for (sign, right) in [(1.0, true), (-1.0, false)] {
        let folder = tempfile::tempdir().expect("a folder");
        let store = campaign(&folder, &map(1.0, sign));
        let found = polarity(&store).expect("readable");
        let of = |name: &str| found.iter().find(|found| found.channel == name).expect("listed").right();
        assert_eq!((of("force"), of("vib_z")), (Some(true), Some(right)), "{found:?}");
        assert_eq!((of("vib_x"), of("vib_y")), (None, None), "no hit along x or y");
    }
}

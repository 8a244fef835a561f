//! A record depends only on its own key.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig_hil_sim::rig::{CHANNELS, Configuration, Rig, RigConfig};

type Record = Vec<[i16; CHANNELS]>;

fn rig(seed: u64) -> Rig {
    Rig::new(&RigConfig::default(), seed).unwrap()
}

fn run(rig: &mut Rig, scans: usize) -> Record {
    (0..scans)
        .map(|_| {
            let mut codes = [0; CHANNELS];
            rig.scan(&mut codes);
            codes
        })
        .collect()
}

/// Stages a cell, idles, fires and records.
fn visit(rig: &mut Rig, cell: (Configuration, &str, &str), attempt: u32, idle: usize) -> Record {
    rig.stage(cell.0, cell.1, cell.2, attempt).unwrap();
    run(rig, idle);
    rig.fire(3.5e-3);
    run(rig, 1500)
}

const CELLS: [(Configuration, &str, &str); 4] = [
    (Configuration::Ajb, "AZ1", "A1"),
    (Configuration::A, "AZ1", "A4"),
    (Configuration::B, "BY2", "B4"),
    (Configuration::Ajb, "BX3", "A4"),
];

#[test]
fn the_same_key_gives_the_same_codes() {
    for cell in CELLS {
        assert_eq!(visit(&mut rig(9), cell, 0, 100), visit(&mut rig(9), cell, 0, 100));
    }
}

#[test]
fn order_of_visits_and_idle_time_change_nothing() {
    let mut forward = rig(9);
    let first: Vec<Record> = CELLS.iter().map(|cell| visit(&mut forward, *cell, 2, 100)).collect();
    let mut backward = rig(9);
    run(&mut backward, 77);
    let mut second: Vec<Record> =
        CELLS.iter().rev().enumerate().map(|(at, cell)| visit(&mut backward, *cell, 2, 333 * at)).collect();
    second.reverse();
    assert_eq!(first, second);
}

#[test]
fn attempts_may_be_fired_in_a_row_or_staged_one_by_one() {
    // The shaker is off and B settles within 2 s (27 /s at its slowest): only noise and scatter can
    // differ.
    let cell = (Configuration::B, "BZ1", "B1");
    let mut row = rig(4);
    let _ = visit(&mut row, cell, 0, 10);
    run(&mut row, 102_400);
    row.fire(3.5e-3);
    assert_eq!(row.attempt(), 2);
    let in_a_row = run(&mut row, 1500);
    let staged = visit(&mut rig(4), cell, 1, 10);
    assert_eq!(in_a_row, staged);
}

#[test]
fn another_seed_cell_or_attempt_gives_another_record() {
    let base = visit(&mut rig(9), CELLS[0], 0, 0);
    assert_ne!(base, visit(&mut rig(10), CELLS[0], 0, 0));
    assert_ne!(base, visit(&mut rig(9), CELLS[0], 1, 0));
    assert_ne!(base, visit(&mut rig(9), (Configuration::Ajb, "AZ1", "A2"), 0, 0));
}

#[test]
fn staging_puts_the_structure_at_rest() {
    let mut rig = rig(1);
    visit(&mut rig, CELLS[0], 0, 0);
    rig.drive(1.0);
    run(&mut rig, 10);
    assert!(rig.energy_j() > 0.0);
    rig.stage(Configuration::A, "AZ1", "A1", 0).unwrap();
    assert_eq!(rig.energy_j(), 0.0);
    run(&mut rig, 10);
    assert_eq!(rig.truth(), &[0.0; CHANNELS]);
    assert!(rig.last_hit().is_none() && rig.coil_pulses_s().is_empty());
}

#[test]
fn points_err_as_the_key_says() {
    let mut rig = rig(21);
    let nominal = rig.config().response(Configuration::Ajb, "A1").unwrap().position_m;
    let mut seen = Vec::new();
    for impact in ["AZ1", "AZ2", "AZ3", "AY1", "AY2"] {
        rig.stage(Configuration::Ajb, impact, "A1", 0).unwrap();
        seen.push(rig.aim().response[2].position_m);
        let hit = rig.aim().impact;
        let straight = rig.config().impact(Configuration::Ajb, impact).unwrap().probe();
        let cosine: f64 = (0..3).map(|i| hit.direction[i] * straight.direction[i]).sum();
        // Two tilts of 2° each: five standard deviations.
        assert!(cosine < 1.0 && cosine.acos() < 5.0 * 2.0_f64.to_radians());
    }
    for axis in 0..3 {
        let mean = seen.iter().map(|p| p[axis]).sum::<f64>() / 5.0;
        // The point's own error is shared (0.5 mm), the aiming error is not (0.2 mm): five standard
        // deviations of each.
        assert!((mean - nominal[axis]).abs() < 5.0 * 5.4e-4);
        assert!(seen.iter().all(|p| (p[axis] - mean).abs() < 5.0 * 2e-4 && p[axis] != mean));
    }
}

#[test]
fn wrong_points_are_refused_with_the_right_ones() {
    let mut rig = rig(1);
    let before = rig.configuration();
    let error = rig.stage(Configuration::A, "BZ1", "A1", 0).unwrap_err().to_string();
    assert!(error.contains("\"BZ1\"") && error.contains("AZ1") && !error.contains("BZ2"), "{error}");
    let error = rig.stage(Configuration::B, "BZ1", "A1", 0).unwrap_err().to_string();
    assert!(error.contains("response") && error.contains("B1, B2, B3, B4"), "{error}");
    assert_eq!(rig.configuration(), before);
}

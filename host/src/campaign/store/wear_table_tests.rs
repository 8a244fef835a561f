use super::*;
use crate::campaign::plan::SMALL;
use crate::campaign::store::session_table::SessionInfo;
use crate::campaign::store::stored::Hex;
use crate::device::channels::ChannelMap;

fn session(store: &mut Store) -> i64 {
    let text = || "x".to_owned();
    let info = SessionInfo {
        address: text(),
        board: text(),
        serial: text(),
        firmware_version: text(),
        target: text(),
        build: Hex(1),
        schema_hash: Hex(2),
    };
    let map = ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels: vec![] };
    store.begin_session(&info, &map).expect("noted")
}

fn cycle(number: u64) -> WearCycle {
    let reading = CycleReading {
        amplitude_m: 2e-6,
        energy_j: 1e-3 * number as f64,
        stiffness_n_per_m: (!number.is_multiple_of(3)).then_some(6e7),
        friction_n: (!number.is_multiple_of(2)).then_some(60.5),
    };
    WearCycle {
        reading: (number != 4).then_some(reading),
        energy_j: reading.energy_j,
        normal_load_n: Some(150.0),
    }
}

fn block(session: i64, before: WearTotal, cycles: &[WearCycle]) -> NewWearBlock<'_> {
    NewWearBlock {
        session,
        frequency_hz: 100.0,
        ordered_m: 2e-6,
        drive_v: 1.5,
        celsius: None,
        epoch: 7,
        begin_scan: 1000.5 + 512.0 * before.cycles as f64,
        period_scans: 512.0,
        before,
        cycles,
    }
}

fn raw_loop(cycle: u64) -> NewWearLoop {
    let codes: Vec<i16> = (0..1_040).map(|i| (i * 31 % 500) as i16).collect();
    NewWearLoop {
        cycle,
        why: "spaced",
        energy_before_j: 0.0,
        first_scan: 998,
        begin_scan: 1000.5,
        samples: Samples::of_codes(&codes, 2),
        gaps: vec![],
    }
}

/// A file with two blocks, of cycles 1 to 6, and its folder.
fn file() -> (tempfile::TempDir, Store, i64) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut store = Store::create(&folder.path().join("a.jrig"), SMALL, "small").expect("created");
    assert_eq!(store.wear_total().expect("read"), WearTotal::default());
    let id = session(&mut store);
    let cycles: Vec<WearCycle> = (1..=6).map(cycle).collect();
    let first = block(id, WearTotal::default(), &cycles[..2]);
    store.insert_wear(&first, &[raw_loop(1)]).expect("stored");
    store.insert_wear(&block(id, first.after(), &cycles[2..]), &[]).expect("stored");
    (folder, store, id)
}

#[test]
fn cycles_come_back_as_they_were_stored() {
    let (_folder, store, _) = file();
    let mut number = 0;
    store
        .each_wear_cycle(|row, found, read, energy_j| {
            number += 1;
            assert_eq!((found, row.frequency_hz), (number, 100.0));
            let stored = cycle(number);
            assert_eq!(read.reading.is_some(), stored.reading.is_some());
            if let (Some(read), Some(stored)) = (read.reading, stored.reading) {
                assert_eq!(
                    (read.stiffness_n_per_m, read.friction_n),
                    (stored.stiffness_n_per_m, stored.friction_n)
                );
                assert!((read.energy_j / stored.energy_j - 1.0).abs() < 1e-7);
            }
            let sum = (1..=number).map(|n| 1e-3 * n as f64).sum::<f64>();
            assert!((energy_j / sum - 1.0).abs() < 1e-6, "{energy_j} {sum}");
        })
        .expect("read");
    assert_eq!(number, 6);
    let total = store.wear_total().expect("read");
    assert!(total.cycles == 6 && (total.energy_j / 21e-3 - 1.0).abs() < 1e-12, "{total:?}");
    let loops = store.wear_loops().expect("read");
    let row = loops[0].as_ref().expect("whole");
    assert_eq!(store.wear_loop_samples(row).expect("whole"), raw_loop(1).samples);
    assert!(store.verify().expect("verified").is_empty());
}

#[test]
fn the_block_of_a_cycle_is_found() {
    let (_folder, store, _) = file();
    for (cycle, block) in [(1, Some(0)), (2, Some(0)), (3, Some(2)), (6, Some(2)), (7, None), (0, None)] {
        let found = store.wear_block_with(cycle).expect("read").map(|(row, cycles)| {
            assert_eq!(row.count, cycles.len() as u64);
            row.cycles_before
        });
        assert_eq!(found, block, "cycle {cycle}");
    }
    store.connection.execute_batch("DROP TRIGGER wear_blocks_stay").expect("dropped");
    let broken = "UPDATE wear_blocks SET cycles = zeroblob(length(cycles)) WHERE id = 2";
    store.connection.execute(broken, []).expect("changed");
    let error = store.wear_block_with(4).expect_err("damaged").to_string();
    assert!(error.contains("block of wear cycles 2") && error.contains("verify"), "{error}");
    assert!(store.wear_block_with(1).expect("read").is_some());
}

#[test]
fn a_block_that_does_not_follow_is_refused_and_nothing_is_stored() {
    let (_folder, store, id) = file();
    let total = store.wear_total().expect("read");
    let cycles = [cycle(7)];
    for cycles_before in [0, 2, 5, 7] {
        let before = WearTotal { cycles: cycles_before, ..total };
        let error = store.insert_wear(&block(id, before, &cycles), &[raw_loop(7)]).expect_err("refused");
        assert!(error.to_string().contains("the file has 6 cycles"), "{error}");
    }
    assert!(store.insert_wear(&block(id, total, &[]), &[]).is_err());
    assert_eq!(store.wear_total().expect("read"), total);
    assert_eq!(store.wear_loops().expect("read").len(), 1);
}

#[test]
fn nothing_of_a_block_can_be_changed_unseen() {
    let (_folder, store, _) = file();
    let change = |sql: &str| store.connection.execute(sql, []);
    assert!(change("UPDATE wear_blocks SET energy_j = 1.0").is_err());
    assert!(change("DELETE FROM wear_loops").is_err());
    // by a program that removes the triggers first
    store.connection.execute_batch("DROP TRIGGER wear_blocks_stay").expect("dropped");
    change("UPDATE wear_blocks SET cycles = zeroblob(length(cycles)) WHERE id = 2").expect("changed");
    let found = store.verify().expect("verified");
    assert!(found.iter().any(|damage| damage.what.contains("block of wear cycles 2")), "{found:?}");
    let error = store.each_wear_cycle(|_, _, _, _| {}).expect_err("damaged");
    assert!(error.to_string().contains("block of wear cycles 2"), "{error}");
}

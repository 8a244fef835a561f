use super::*;
use crate::campaign::plan::{Plan, SMALL};
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::NewRecord;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, Samples};
use crate::device::stream::Recording;
use crate::frf::{Frf, MotionQuantity};
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::{Phase, Shot};
use nalgebra::DMatrix;
use num_complex::Complex;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::path::Path;

fn map() -> ChannelMap {
    let channel = |name: &str, role, units_per_volt| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity: Quantity::Velocity,
        units_per_volt,
        range_v: 10.0,
        delay_ns: 5,
        bits: 16,
    };
    let channels =
        vec![channel("force", Role::HammerForce, 44.64), channel("z", Role::Response(Axis::Z), -0.005)];
    ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels }
}

fn record(cell: i64, attempt: u32, session: i64, kind: Verdict) -> NewRecord {
    let shot = Shot {
        number: attempt + 1,
        phase: Phase::Done,
        fired_at: 10,
        trigger: 400,
        pulse_us: 3_000,
        peak_n: 49.3,
        width_us: 270.1,
        rebound_ratio: 0.1,
        rebound_after: 3,
        friction_peak_n: 17.0,
        quiet_ratio: 0.3,
    };
    let code = |i: i32| ((i * 31 + attempt.cast_signed()) % 2_000 - 1_000) as i16;
    // every second record has wider samples
    let samples = match attempt % 2 {
        0 => Samples::of_codes(&(0..400).map(code).collect::<Vec<_>>(), 2),
        _ => Samples::new(vec![
            ChannelSamples::I32((0..200).map(|i| 70_000 * i32::from(code(i))).collect()),
            ChannelSamples::F64((0..200).map(|i| 0.1 * f64::from(code(i))).collect()),
        ])
        .expect("equally long"),
    };
    let recording = Recording { epoch: 3, first_scan: 144, trigger_index: 25, samples, gaps: vec![], shot };
    let verdict = Judgement { peak_n: 49.5, ..Judgement::without_pulse(kind, 0.1, 0.02, "because".into()) };
    NewRecord {
        cell,
        attempt,
        session,
        utc: "2026-01-01T00:00:00Z".into(),
        utc_error_s: None,
        recording,
        verdict,
    }
}

fn begin_session(store: &mut Store) -> i64 {
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
    store.begin_session(&info, &map()).expect("noted")
}

/// A campaign that contains every kind of event.
fn eventful(path: &Path) -> Store {
    let mut store = Store::create(path, SMALL, "small.toml").expect("created");
    let session = begin_session(&mut store);
    for attempt in 0..4 {
        let kind = if attempt == 2 { Verdict::Noisy } else { Verdict::Good };
        let counters = Counters::from([("scans_received".into(), u64::from(attempt))]);
        store.insert(&record(1, attempt, session, kind), &counters).expect("stored");
    }
    store.overrule(1, Verdict::Dropped, "a lorry").expect("dropped");
    store.overrule(1, Verdict::Good, "no lorry").expect("kept");
    store.settle(2, "enough").expect("settled");
    store.give_up(3, "out of reach").expect("given up");
    store.redo(1, "again").expect("again");
    store.log("a note").expect("noted");
    store.note_temperature(session, 21.5).expect("noted");
    store.note_link(session, &Counters::new()).expect("noted");
    store.set_meta("who", "one").expect("noted");
    store.set_meta("who", "another").expect("noted");
    let sensors = "[[channel]]\nname = \"force\"\nsensitivity_v = 0.0224\n";
    let plan = Plan::parse(&format!("{SMALL}\n{sensors}"), "p").expect("a plan");
    let own: Vec<_> = plan.channel.into_iter().map(toml::Spanned::into_inner).collect();
    store.calibrate(&own, 1, "certificate").expect("calibrated");
    let more = SMALL.replace("impacts = [\"BZ1\"]", "impacts = [\"BZ1\", \"AZ1\"]");
    store
        .take_over(
            &more.replace("\"AZ1\"]\nresponses = [\"B1\"]", "\"AZ1\"]\nresponses = [\"B2\"]"),
            "b.toml",
        )
        .ok();
    store
}

fn said(store: &Store) -> String {
    store.verify().expect("checked").into_iter().map(|damage| damage.what + "\n").collect()
}

#[test]
fn an_honest_history_raises_no_alarm() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    for round in 0..3 {
        let store = if round == 0 { eventful(&path) } else { Store::open(&path).expect("again") };
        store.log("once more").expect("noted");
        assert_eq!(said(&store), "", "while it is written");
        store.close().expect("closed");
        let reader = Store::open_read_only(&path).expect("open");
        assert_eq!(said(&reader), "");
        let copy = folder.path().join(format!("copy{round}.jrig"));
        reader.back_up(&copy).expect("copied");
        assert_eq!(said(&Store::open_read_only(&copy).expect("open")), "");
    }
    // interrupted: accepted rows are chained, and a failed write leaves nothing
    let store = Store::open(&path).expect("again");
    assert!(
        store
            .change("trying", |connection| connection
                .execute("INSERT INTO log VALUES (NULL, 'x', 'y')", [])
                .and(connection.execute("INSERT INTO log VALUES (1, 'x', 'y')", [])))
            .is_err()
    );
    store.log("after a transaction that failed").expect("noted");
    assert_eq!(said(&store), "");
}

/// One random modification by the program itself; a modification that fails leaves no trace either.
fn deed(store: &mut Store, dice: &mut Xoshiro256PlusPlus) {
    let number = |dice: &mut Xoshiro256PlusPlus, below: u32| dice.next_u32() % below;
    let sessions = store.sessions().expect("sessions");
    let session = sessions.last().map(|(id, _)| *id);
    let cells = store.cells().expect("cells");
    let cell = cells[number(dice, cells.len() as u32) as usize].id;
    let records = store.places().expect("records");
    let measured = records.get(number(dice, 64) as usize % records.len().max(1)).map(|place| place.id);
    match (number(dice, 15), session, measured) {
        (0, ..) | (_, None, _) => drop(begin_session(store)),
        (1..=5, Some(session), _) => {
            let attempt = store.records_of(cell).expect("records").len() as u32;
            let kind = Verdict::ALL[number(dice, Verdict::ALL.len() as u32) as usize];
            let counters = Counters::from([("scans_received".into(), u64::from(attempt))]);
            store.insert(&record(cell, attempt, session, kind), &counters).expect("stored");
        }
        (6, _, Some(id)) => store.overrule(id, Verdict::Dropped, "a lorry").expect("dropped"),
        (7, _, Some(id)) => store.overrule(id, Verdict::Good, "no lorry").expect("kept"),
        (8, ..) => drop(store.redo(cell, "again").expect("opened")),
        (9, ..) => store.settle(cell, "enough").expect("settled"),
        (10, ..) => store.give_up(cell, "out of reach").expect("given up"),
        (11, Some(session), _) => {
            store.note_temperature(session, 20.0 + f64::from(number(dice, 5))).expect("noted");
            store.set_meta("who", &number(dice, 3).to_string()).expect("noted");
        }
        (12, ..) => {
            let y = Complex::new(1.0, f64::from(number(dice, 9)));
            let lines = vec![DMatrix::from_element(1, 1, y)];
            let names = |name: &str| vec![name.to_owned()];
            let frf = Frf::new(vec![100.0], 0.0, MotionQuantity::Velocity, names("A1x"), names("AZ1"), lines);
            store.insert_frf(Configuration::A, "a.npz", &frf.expect("an FRF")).expect("stored");
        }
        (13, ..) => {
            let sensors = "[[channel]]\nname = \"force\"\nsensitivity_v = 0.0224\n";
            let plan = Plan::parse(&format!("{SMALL}\n{sensors}"), "p").expect("a plan");
            let own: Vec<_> = plan.channel.into_iter().map(toml::Spanned::into_inner).collect();
            store.calibrate(&own, 1, "certificate").expect("calibrated");
        }
        // with one cell more or less; refused if that cell has hits
        _ => drop(store.take_over(
            &SMALL.replace(
                "impacts = [\"BZ1\"]",
                ["impacts = [\"BZ1\"]", "impacts = [\"BZ1\", \"AZ1\"]"][number(dice, 2) as usize],
            ),
            "b.toml",
        )),
    }
}

#[test]
fn two_hundred_honest_histories_raise_no_alarm() {
    // in memory if there is such a folder: otherwise thousands of transactions wait for a disk
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).expect("a folder");
    for history in 0..200 {
        let mut dice = Xoshiro256PlusPlus::seed_from_u64(history);
        let path = folder.path().join(format!("{history}.jrig"));
        let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
        for _ in 0..dice.next_u32() % 4 {
            for _ in 0..dice.next_u32() % 12 {
                deed(&mut store, &mut dice);
            }
            match dice.next_u32() % 3 {
                // as if the process was killed: nothing is closed properly
                0 => drop(store),
                _ => store.close().expect("closed"),
            }
            store = Store::open(&path).expect("open");
        }
        assert_eq!(said(&store), "", "history {history}, while it is written");
        let copy = folder.path().join(format!("{history}-copy.jrig"));
        store.back_up(&copy).expect("copied");
        store.close().expect("closed");
        for file in [&path, &copy] {
            assert_eq!(said(&Store::open_read_only(file).expect("open")), "", "history {history}");
            std::fs::remove_file(file).expect("removed");
        }
    }
}

#[test]
fn what_is_done_behind_its_back_is_named_by_table_and_row() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = folder.path().join("a.jrig");
    eventful(&original).close().expect("closed");
    for (sql, names) in [
        (
            "UPDATE channels SET units_per_volt = units_per_volt * 1.02 WHERE place = 0",
            "row 1/0 of `channels` was changed",
        ),
        ("UPDATE sessions SET rate_hz = 25600", "row 1 of `sessions` was changed"),
        (
            "UPDATE plan SET text = replace(text, 'weak_n = 30.0', 'weak_n = 3.0') WHERE id = 1",
            "row 1 of `plan` was changed",
        ),
        ("INSERT INTO overrules VALUES (NULL, 2, 'now', 'dropped', 'no')", "of `overrules` was added"),
        ("DELETE FROM overrules WHERE id = 1", "row 1 of `overrules` was removed"),
        (
            "PRAGMA foreign_keys=OFF; DROP TRIGGER records_remain; DELETE FROM records WHERE id = 4",
            "row 4 of `records` was removed",
        ),
        ("DELETE FROM log", "row 1 of `log` was removed"),
        ("UPDATE cells SET wanted = 1 WHERE id = 1", "row 1 of `cells` was changed"),
        ("UPDATE temperatures SET celsius = 60", "row 1 of `temperatures` was changed"),
        (
            "DROP TRIGGER calibrations_stay; UPDATE calibrations SET sensitivity_v = 0.0228",
            "row 1 of `calibrations` was changed",
        ),
        ("INSERT INTO meta VALUES ('simulated_truth', '{}')", "row simulated_truth of `meta` was added"),
        ("UPDATE meta SET value = 'third' WHERE key = 'who'", "row who of `meta` was changed"),
        ("DROP TRIGGER chain_stay; UPDATE chain SET digest = zeroblob(32) WHERE id = 5", "broken at entry 5"),
        ("DROP TRIGGER chain_remain; DELETE FROM chain WHERE id > 7", "does not end where it did"),
        ("DROP TABLE chain_head", "it lacks `chain_head`"),
        ("DROP TABLE chain", "the chain of rows cannot be read"),
        ("DROP TRIGGER seals_stay", "it lacks `seals_stay`"),
    ] {
        let path = folder.path().join("b.jrig");
        std::fs::copy(&original, &path).expect("copied");
        Connection::open(&path).expect("open").execute_batch(sql).expect(sql);
        let told = said(&Store::open_read_only(&path).expect("open"));
        assert!(told.contains(names), "{sql}: {told}");
    }
    // random rows and columns
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(20);
    let store = Store::open(&original).expect("open");
    let vandals = "PRAGMA foreign_keys = OFF; DROP TRIGGER records_stay; DROP TRIGGER seals_stay; DROP TRIGGER frfs_stay; \
                   DROP TRIGGER levels_stay; DROP TRIGGER calibrations_stay";
    store.connection.execute_batch(vandals).expect("open to everything");
    let before = said(&store);
    let names = tables(&store.connection).expect("tables");
    let mut edits = 0;
    while edits < 500 {
        let table = &names[dice.next_u32() as usize % names.len()];
        let pick = |sql: &str, dice: &mut Xoshiro256PlusPlus| -> Option<String> {
            let mut all = store.connection.prepare(sql).expect("a query");
            let all: Vec<String> = all.query_map([], |row| row.get(0)).expect("rows").flatten().collect();
            (!all.is_empty()).then(|| all[dice.next_u32() as usize % all.len()].clone())
        };
        let Some(row) = pick(&format!("SELECT CAST(rowid AS TEXT) FROM {table}"), &mut dice) else {
            continue;
        };
        let column =
            pick(&format!("SELECT name FROM pragma_table_info('{table}')"), &mut dice).expect("columns");
        store.connection.execute_batch("SAVEPOINT edit").expect("begun");
        let value = format!(
            "CASE typeof({column}) WHEN 'text' THEN {column} || ' ' WHEN 'null' THEN '1' WHEN 'blob' THEN zeroblob(3) ELSE {column} * 2 + 1 END"
        );
        let sql = match dice.next_u32() % 4 {
            0 => format!("DELETE FROM {table} WHERE rowid = {row}"),
            _ => format!("UPDATE {table} SET {column} = {value} WHERE rowid = {row}"),
        };
        // the note that the file is being written is not chained
        let noted = table == "meta"
            && row
                == pick("SELECT CAST(rowid AS TEXT) FROM meta WHERE key = 'written_since'", &mut dice)
                    .unwrap_or_default();
        if store.connection.execute(&sql, []).is_ok() && !noted {
            edits += 1;
            let told = store.verify();
            assert!(
                !matches!(&told, Ok(damage) if damage.iter().map(|one| one.what.clone() + "\n").collect::<String>() == before),
                "{sql}: not named"
            );
        }
        store.connection.execute_batch("ROLLBACK TO edit; RELEASE edit").expect("undone");
    }
}

#[test]
fn five_hundred_damaged_bytes_are_named_or_change_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = folder.path().join("a.jrig");
    eventful(&original).close().expect("closed");
    let bytes = std::fs::read(&original).expect("read");
    let whole = |path: &Path| -> Result<Vec<(String, String, [u8; 32])>, String> {
        let store = Store::open_read_only(path).map_err(|error| error.to_string())?;
        let damage = store.verify().map_err(|error| error.to_string())?;
        if let Some(damage) = damage.into_iter().next() {
            return Err(damage.what);
        }
        let mut all = Vec::new();
        for table in tables(&store.connection).expect("tables") {
            let own = rows(&store.connection, &table).expect("rows");
            all.extend(own.into_iter().map(|(key, digest)| (table.clone(), key, digest)));
        }
        Ok(all)
    };
    let undamaged = whole(&original).expect("whole");
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(21);
    let mut named = 0;
    for _ in 0..500 {
        let mut damaged = bytes.clone();
        let at = dice.next_u64() as usize % damaged.len();
        damaged[at] ^= 1 << (dice.next_u32() % 8);
        let path = folder.path().join("b.jrig");
        std::fs::write(&path, &damaged).expect("written");
        match whole(&path) {
            Err(what) => {
                named += 1;
                assert!(!what.is_empty());
            }
            // an unused byte
            Ok(rows) => assert!(rows == undamaged, "byte {at} was silent"),
        }
    }
    // most of a small file is free space
    assert!(named > 40, "{named}");
}

#[test]
fn a_file_without_a_chain_is_read_and_gets_one_when_it_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    eventful(&path).close().expect("closed");
    let old = "DROP TABLE chain; DROP TABLE chain_head; DROP TABLE temperatures; PRAGMA user_version = 1";
    Connection::open(&path).expect("open").execute_batch(old).expect("as it was before");
    let reader = Store::open_read_only(&path).expect("still read");
    assert_eq!((said(&reader), reader.has_chain().expect("read")), (String::new(), false));
    drop(reader);
    Store::open(&path).expect("brought up").close().expect("closed");
    let reader = Store::open_read_only(&path).expect("read");
    assert_eq!((said(&reader), reader.has_chain().expect("read")), (String::new(), true));
    assert!(
        reader.log_lines(0).expect("log").iter().any(|(_, _, text)| text.contains("chained from here on"))
    );
    drop(reader);
    // resetting the version does not hide the chain
    Connection::open(&path)
        .expect("open")
        .execute_batch("PRAGMA user_version = 1; DELETE FROM log")
        .expect("done");
    assert!(said(&Store::open_read_only(&path).expect("read")).contains("of `log` was removed"));
}

#[test]
fn nothing_is_read_of_a_file_with_a_schema_of_somebody_elses() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    for (sql, names) in [
        (
            "PRAGMA foreign_keys=OFF; DROP TABLE cells; CREATE VIEW cells AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) \
             SELECT id, 'A' AS configuration, 'x' AS impact, 'y' AS response, 1 AS wanted, NULL AS given_up, NULL AS settled FROM n",
            "its view `cells` is not as jointrig makes it",
        ),
        ("CREATE TRIGGER mine AFTER INSERT ON log BEGIN DELETE FROM records; END", "it has a trigger `mine`"),
        ("CREATE TABLE mine (a)", "DROP TABLE mine"),
        ("ALTER TABLE log ADD COLUMN more TEXT", "its table `log` is not as jointrig makes it"),
    ] {
        Store::create(&path, SMALL, "small.toml").expect("created").close().expect("closed");
        Connection::open(&path).expect("open").execute_batch(sql).expect(sql);
        for opened in [Store::open(&path), Store::open_read_only(&path)] {
            let error = opened.expect_err(sql);
            assert!(
                matches!(&error, StoreError::Content { .. }) && error.to_string().contains(names),
                "{error}"
            );
        }
        std::fs::remove_file(&path).expect("removed");
    }
}

use super::*;
use crate::campaign::plan::{PAPER, SMALL};
use crate::campaign::store::VERSION;
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::session_table::SessionInfo;
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::Judgement;
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use jointrig_protocol::channel::Channel;
use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::shot::{Phase, Shot};

fn map() -> ChannelMap {
    let channel = |name: &str, role, scale| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity: Quantity::Velocity,
        units_per_volt: scale,
        range_v: 10.0,
        delay_ns: 5,
        bits: 16,
    };
    ChannelMap {
        id: 0,
        rate_hz: 51_200,
        exact_hz: None,
        channels: vec![
            channel("force", Role::HammerForce, 44.642_857),
            channel("z", Role::Response(jointrig_protocol::channel::Axis::Z), -0.005),
        ],
    }
}

pub(crate) fn info() -> SessionInfo {
    SessionInfo {
        address: "sim:".into(),
        board: "virtual".into(),
        serial: "1".into(),
        firmware_version: "0.1.0".into(),
        target: "x".into(),
        build: Hex(1 << 63),
        schema_hash: Hex(u64::MAX),
    }
}

pub(crate) fn record(cell: i64, attempt: u32, session: i64, kind: Verdict) -> NewRecord {
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
    let codes: Vec<i16> =
        (0..4_000_i32).map(|i| ((i * 31 + attempt.cast_signed()) % 2_000 - 1_000) as i16).collect();
    let recording = Recording {
        epoch: 3,
        first_scan: 144,
        trigger_index: 256,
        samples: Samples::of_codes(&codes, 2),
        gaps: vec![3..7, 9..10],
        shot,
    };
    let verdict = Judgement { peak_n: 49.5, ..Judgement::without_pulse(kind, 0.1, 0.02, "because".into()) };
    NewRecord { cell, attempt, session, utc: utc_now(), utc_error_s: Some(0.003), recording, verdict }
}

/// The rows of all records, which must be undamaged.
pub(crate) fn rows(store: &Store) -> Vec<RecordRow> {
    store.records().expect("rows").into_iter().collect::<Result<_, _>>().expect("whole")
}

#[test]
fn records_come_back_bit_for_bit_and_can_be_read_while_another_writes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let reader = Store::open_read_only(&path).expect("readable at once");
    let session = store.begin_session(&info(), &map()).expect("session");
    let cells = store.cells().expect("cells");
    assert_eq!(cells.len(), store.plan().expect("plan").cells().len());
    for attempt in 0..3 {
        let kind = if attempt == 1 { Verdict::DoubleHit } else { Verdict::Good };
        store.insert(&record(cells[0].id, attempt, session, kind), &Counters::new()).expect("stored");
    }
    let stored = rows(&reader);
    assert_eq!(stored.iter().map(RecordRow::kept).collect::<Vec<_>>(), [true, false, true]);
    assert_eq!(reader.channels(session).expect("channels"), map());
    assert_eq!(reader.sessions().expect("sessions"), [(session, info())]);
    for (row, attempt) in stored.iter().zip(0..) {
        let new = record(cells[0].id, attempt, session, row.verdict).recording;
        assert_eq!(reader.samples(row).expect("samples"), new.samples);
        assert_eq!((row.shot, &row.gaps, row.first_scan), (new.shot, &new.gaps, 144));
    }
    store.overrule(stored[1].id, Verdict::Good, "looked at it").expect("overruled");
    assert!(rows(&reader)[1].kept());
    assert_eq!(reader.verify().expect("checked"), []);
    assert!(
        store.insert(&record(cells[0].id, 0, session, Verdict::Good), &Counters::new()).is_err(),
        "an attempt is stored once"
    );
    store.close().expect("closed");
}

#[test]
fn raw_records_cannot_be_changed_and_damage_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let session = store.begin_session(&info(), &map()).expect("session");
    let ids: Vec<i64> = (0..4)
        .map(|attempt| {
            store.insert(&record(1, attempt, session, Verdict::Good), &Counters::new()).expect("stored")
        })
        .collect();
    let change = |sql: &str| store.connection.execute(sql, []);
    assert!(change("UPDATE records SET measure = 0").is_err());
    assert!(change("DELETE FROM records").is_err());
    store.connection.execute_batch("DROP TRIGGER records_stay").expect("as vandals do");
    let change = |sql: String| assert_eq!(store.connection.execute(&sql, []).expect("changed"), 1);
    change(format!(
        "UPDATE records SET samples = CAST(substr(samples, 1, 40) || x'5a' || substr(samples, 42) AS BLOB) WHERE id = {}",
        ids[1]
    ));
    change(format!("UPDATE records SET verdict = 'weak' WHERE id = {}", ids[2]));
    change(format!("UPDATE records SET shot = replace(shot, '49.3', 'x') WHERE id = {}", ids[3]));
    let named: Vec<_> =
        store.verify().expect("checked").into_iter().filter_map(|damage| damage.record).collect();
    assert_eq!(named, ids[1..]);
    let row = RecordRow { id: ids[1], ..store.record(ids[0]).expect("there") };
    let said = store.samples(&row).expect_err("damaged").to_string();
    assert!(said.contains(&format!("record {}", ids[1])), "{said}");
}

#[test]
fn wrong_files_are_refused_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    assert!(matches!(Store::open(&at("none.jrig")), Err(StoreError::Missing { .. })));
    std::fs::write(at("text.jrig"), "no database, but long enough to be looked at").expect("written");
    assert!(matches!(Store::open_read_only(&at("text.jrig")), Err(StoreError::Foreign { .. })));
    let store = Store::create(&at("a.jrig"), PAPER, "paper.toml").expect("created");
    assert_eq!(store.cells().expect("cells").len(), 252);
    store.connection.pragma_update(None, "user_version", 99).expect("changed");
    store.close().expect("closed");
    assert!(matches!(Store::open(&at("a.jrig")), Err(StoreError::Newer { found: 99, .. })));
    assert!(matches!(Store::create(&at("a.jrig"), PAPER, "p"), Err(StoreError::Exists { .. })));
    assert!(matches!(Store::create(&at("no/b.jrig"), PAPER, "p"), Err(StoreError::Lock { .. })));
    assert!(!at("a.jrig-wal").exists(), "one file only");
}

#[test]
fn files_of_another_version_are_refused_in_words_and_stay_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    for (version, advice) in [(VERSION + 1, "use a newer jointrig"), (0, "use the jointrig that wrote it")] {
        let store = Store::create(&path, SMALL, "small.toml").expect("created");
        store.connection.pragma_update(None, "user_version", version).expect("changed");
        store.close().expect("closed");
        let before = std::fs::read(&path).expect("read");
        for opened in [Store::open(&path), Store::open_read_only(&path)] {
            let said = opened.expect_err("another version").to_string();
            assert!(
                said.contains(&format!("schema version {version}, this program reads versions")),
                "{said}"
            );
            assert!(said.contains(advice), "{said}");
        }
        assert!(std::fs::read(&path).expect("read") == before);
        std::fs::remove_file(&path).expect("removed");
    }
    let store = Store::create(&path, SMALL, "small.toml").expect("created");
    store.connection.pragma_update(None, "application_id", 1).expect("changed");
    store.close().expect("closed");
    assert!(matches!(Store::open_read_only(&path), Err(StoreError::Foreign { .. })), "of another program");
}

#[test]
fn every_column_of_a_record_is_under_its_seal() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut store = Store::create(&folder.path().join("a.jrig"), SMALL, "small.toml").expect("created");
    let session = store.begin_session(&info(), &map()).expect("session");
    let id = store.insert(&record(1, 0, session, Verdict::Good), &Counters::new()).expect("stored");
    let before = store.record(id).expect("whole");
    let vandals = "DROP TRIGGER records_stay; DROP TRIGGER seals_stay; PRAGMA foreign_keys = OFF";
    store.connection.execute_batch(vandals).expect("changed");
    let columns: Vec<_> = RecordRow::columns().filter(|column| column.name() != "id").collect();
    assert_eq!(columns.len(), 23);
    for column in columns {
        let (table, name) = (column.table, column.name());
        store
            .connection
            .execute_batch(&format!(
                "CREATE TEMP TABLE kept AS SELECT {name} AS value FROM {table}; UPDATE {table} SET {name} = \
             CASE typeof({name}) WHEN 'text' THEN {name} || ' ' WHEN 'null' THEN 1.0 ELSE {name} + 1 END"
            ))
            .expect("changed behind its back");
        let damage = store.verify().expect("checked");
        // except the triggers that had to be dropped
        let damage: Vec<_> = damage.into_iter().filter(|one| !one.what.starts_with("it lacks")).collect();
        assert!(damage.len() == 1 && damage[0].record == Some(id), "{table}.{name}: {damage:?}");
        let back = format!("UPDATE {table} SET {name} = (SELECT value FROM kept); DROP TABLE kept");
        store.connection.execute_batch(&back).expect("changed back");
        assert_eq!(store.record(id).expect("whole again"), before, "{table}.{name}");
    }
    store.connection.execute_batch("DROP TRIGGER seals_remain; DELETE FROM seals").expect("changed");
    let damage = store.verify().expect("checked");
    assert!(damage.iter().any(|one| one.what == "its seal is missing"), "{damage:?}");
}

#[test]
fn a_full_disk_is_told_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let session = store.begin_session(&info(), &map()).expect("session");
    let pages: i64 =
        store.connection.pragma_query_value(None, "page_count", |row| row.get(0)).expect("counted");
    store.connection.pragma_update(None, "max_page_count", pages + 3).expect("set");
    let results: Vec<_> = (0..300)
        .map(|attempt| store.insert(&record(1, attempt, session, Verdict::Good), &Counters::new()))
        .collect();
    let stored = results.iter().take_while(|result| result.is_ok()).count();
    let said = results[stored].as_ref().expect_err("full").to_string();
    assert!(said.contains("free some space"), "{said}");
    assert_eq!(store.records().expect("rows").len(), stored, "all of a record or nothing");
    assert_eq!(store.verify().expect("checked"), []);
}

#[test]
fn a_rate_that_is_no_whole_number_comes_back_with_all_its_digits() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("c.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let whole = store.begin_session(&info(), &map()).expect("a session");
    let own = ChannelMap { rate_hz: 17_067, exact_hz: Some(51_200.0 / 3.0), ..map() };
    let third = store.begin_session(&info(), &own).expect("a session");
    store.close().expect("closed");
    let store = Store::open_read_only(&path).expect("opened");
    let rate = |session| store.channels(session).expect("channels").fs_hz();
    assert_eq!((rate(whole), rate(third)), (51_200.0, 51_200.0 / 3.0));
    assert_eq!(store.channels(third).expect("channels"), own);
    assert!(store.verify().expect("read").is_empty());
}

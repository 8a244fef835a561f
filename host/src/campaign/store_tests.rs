use super::super::rows::SessionInfo;
use super::*;
use crate::campaign::judge::Judgement;
use crate::campaign::plan::{PAPER, SMALL};
use crate::device::channels::ChannelMap;
use jointrig_protocol::channel::Channel;
use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::shot::{Phase, Shot};
use std::path::Path;

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
        channels: vec![
            channel("force", Role::HammerForce, 44.642_857),
            channel("z", Role::Response(jointrig_protocol::channel::Axis::Z), -0.005),
        ],
    }
}

fn info() -> SessionInfo {
    SessionInfo {
        address: "sim:".into(),
        board: "virtual".into(),
        serial: "1".into(),
        firmware_version: "0.1.0".into(),
        target: "x".into(),
        build: 1 << 63,
        schema_hash: u64::MAX,
    }
}

fn record(cell: i64, attempt: u32, session: i64, kind: Kind) -> NewRecord {
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
    let codes = (0..4_000_i32).map(|i| ((i * 31 + attempt.cast_signed()) % 2_000 - 1_000) as i16).collect();
    let recording = Recording {
        epoch: 3,
        first_scan: 144,
        trigger_index: 256,
        channels: 2,
        codes,
        gaps: vec![3..7, 9..10],
        shot,
    };
    let judgement = Judgement { kind, measure: 0.1, limit: 0.02, sentence: "because".into(), peak_n: 49.5 };
    NewRecord { cell, attempt, session, utc: utc_now(), utc_error_s: Some(0.003), recording, judgement }
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
        let kind = if attempt == 1 { Kind::DoubleHit } else { Kind::Good };
        store.insert(&record(cells[0].id, attempt, session, kind), &Counters::new()).expect("stored");
    }
    let rows = reader.records().expect("rows");
    assert_eq!(rows.iter().map(RecordRow::kept).collect::<Vec<_>>(), [true, false, true]);
    assert_eq!(reader.channels(session).expect("channels"), map());
    assert_eq!(reader.sessions().expect("sessions"), [(session, info())]);
    for (row, attempt) in rows.iter().zip(0..) {
        let stored = record(cells[0].id, attempt, session, row.verdict).recording;
        assert_eq!(reader.samples(row).expect("samples").codes, stored.codes);
        assert_eq!((row.shot, &row.gaps, row.first_scan), (stored.shot, &stored.gaps, 144));
    }
    store.overrule(rows[1].id, Kind::Good, "looked at it").expect("overruled");
    assert!(reader.records().expect("rows")[1].kept());
    assert_eq!(reader.verify().expect("checked"), []);
    assert!(
        store.insert(&record(cells[0].id, 0, session, Kind::Good), &Counters::new()).is_err(),
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
            store.insert(&record(1, attempt, session, Kind::Good), &Counters::new()).expect("stored")
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

/// A file of version 1 with two records, the second one's verdict changed behind its seal's back.
fn first_version(path: &Path) {
    let connection = rusqlite::Connection::open(path).expect("opens");
    connection.execute_batch(super::super::schema::STEPS[0]).expect("tables");
    connection.pragma_update(None, "application_id", super::super::schema::APPLICATION_ID).expect("set");
    connection.pragma_update(None, "user_version", 1).expect("set");
    let row = |attempt: u32| {
        let NewRecord { recording, judgement, utc, .. } = record(1, attempt, 1, Kind::Good);
        let bytes = codec::encode(&recording.codes, 2).expect("compressed");
        let shot = serde_json::to_string(&recording.shot).expect("json");
        let gaps = serde_json::to_string(&recording.gaps).expect("json");
        let described = RecordRow {
            session: 1,
            utc: utc.clone(),
            epoch: recording.epoch,
            first_scan: recording.first_scan,
            trigger_index: recording.trigger_index,
            scans: recording.scans(),
            channels: 2,
            shot: recording.shot,
            gaps: recording.gaps.clone(),
            verdict: Kind::Good,
            measure: judgement.measure,
            limit: judgement.limit,
            sentence: judgement.sentence.clone(),
            crc: codec::checksum(&recording.codes),
            ..RecordRow::unreadable(0, 1, attempt, String::new())
        };
        let seal = super::super::rows::first_seal(&described);
        connection
            .execute(
                "INSERT INTO records (cell, attempt, session, utc, epoch, first_scan, trigger_index, scans, channels, \
                 pulse_us, peak_n, shot, gaps, verdict, measure, limit_value, sentence, crc32, seal, samples) \
                 VALUES (1, ?1, 1, ?2, 3, 144, 256, 2000, 2, 3000, 49.3, ?3, ?4, ?5, 0.1, 0.02, 'because', ?6, ?7, ?8)",
                params![
                    attempt,
                    utc,
                    shot,
                    gaps,
                    if attempt == 1 { "weak" } else { "good" },
                    described.crc,
                    seal,
                    bytes
                ],
            )
            .expect("stored");
    };
    let plan = params![utc_now(), SMALL];
    connection
        .execute("INSERT INTO plan (utc, source, text) VALUES (?1, 'small.toml', ?2)", plan)
        .expect("plan");
    connection
        .execute_batch(
            "INSERT INTO sessions VALUES (1, '', 'sim:', 'b', 's', '0', 't', '0', '0', '0', 51200); \
             INSERT INTO cells (configuration, impact, response, wanted) VALUES ('A', 'AZ1', 'A1', 2);",
        )
        .expect("rows");
    row(0);
    row(1);
}

#[test]
fn a_file_of_the_first_version_is_read_as_it_is_and_brought_up_when_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.jrig");
    first_version(&path);
    let before = std::fs::read(&path).expect("read");
    let damaged = |store: &Store| {
        let damage = store.verify().expect("checked");
        damage.iter().filter_map(|damage| damage.record).collect::<Vec<_>>()
    };
    let old = Store::open_read_only(&path).expect("readable");
    assert_eq!(damaged(&old), [2]);
    let samples = old.samples(&old.record(1).expect("there")).expect("whole");
    assert!(old.link_counters().expect("none yet").is_empty() && old.cells().expect("cells").len() == 1);
    drop(old);
    assert!(std::fs::read(&path).expect("read") == before, "reading changes nothing");

    let store = Store::open(&path).expect("brought up");
    assert_eq!(damaged(&store), [2], "what was damaged is not made good");
    assert_eq!(store.samples(&store.record(1).expect("there")).expect("whole"), samples);
    store.insert(&record(1, 2, 1, Kind::Good), &Counters::new()).expect("goes on");
    store.close().expect("closed");
    let again = Store::open_read_only(&path).expect("readable");
    assert_eq!(damaged(&again), [2]);
    assert_eq!(again.records().expect("rows").iter().filter(|row| row.kept()).count(), 2);
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
        .map(|attempt| store.insert(&record(1, attempt, session, Kind::Good), &Counters::new()))
        .collect();
    let stored = results.iter().take_while(|result| result.is_ok()).count();
    let said = results[stored].as_ref().expect_err("full").to_string();
    assert!(said.contains("free some space"), "{said}");
    assert_eq!(store.records().expect("rows").len(), stored, "all of a record or nothing");
    assert_eq!(store.verify().expect("checked"), []);
}

use super::*;
use crate::campaign::plan::SMALL;
use crate::campaign::plan::level::Held;
use crate::campaign::store::session_table::SessionInfo;
use crate::campaign::store::stored::Hex;
use crate::campaign::store::table::Column;
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;

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

fn level(session: i64, moment: Moment, end_hz: Option<f64>) -> NewLevel {
    let codes: Vec<i16> = (0..4_000_i32).map(|i| (i * 31 % 2_000 - 1_000) as i16).collect();
    NewLevel {
        session,
        moment,
        level: Level { frequency_hz: 250.0, end_hz, held: Held::Displacement, amplitude: 1.5e-7 },
        settled: Settled { reached: 1.49e-7, overshoot: 1.04, after_s: 3.2, drive_v: 0.4 },
        epoch: 3,
        first_scan: 144_000,
        samples: Samples::of_codes(&codes, 2),
        gaps: vec![],
    }
}

#[test]
fn a_level_comes_back_as_it_was_stored() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small").expect("created");
    let id = session(&mut store);
    let new = [level(id, Moment::Before, None), level(id, Moment::After, Some(400.0))];
    for one in &new {
        store.insert_level(one).expect("stored");
    }
    store.close().expect("closed");
    let store = Store::open_read_only(&path).expect("open");
    let rows = store.levels().expect("read");
    assert_eq!(rows.len(), 2);
    for (row, new) in rows.iter().zip(&new) {
        let row = row.as_ref().expect("whole");
        assert!(row.whole(), "{row:?}");
        assert_eq!((row.level(), row.settled(), row.moment), (new.level, new.settled, new.moment));
        assert_eq!(store.level_samples(row).expect("whole"), new.samples);
    }
    assert!(store.verify().expect("verified").is_empty());
}

#[test]
fn nothing_of_a_level_can_be_changed_unseen() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small").expect("created");
    let id = session(&mut store);
    store.insert_level(&level(id, Moment::Before, None)).expect("stored");
    let change = |store: &Store, sql: &str| store.connection.execute(sql, []);
    assert!(change(&store, "UPDATE levels SET amplitude = 2e-7").is_err());
    assert!(change(&store, "DELETE FROM levels").is_err());
    change(&store, "DROP TRIGGER levels_stay").expect("dropped");
    for sql in [
        "UPDATE levels SET amplitude = 2e-7",
        "UPDATE levels SET moment = 'after', amplitude = 1.5e-7",
        "UPDATE levels SET moment = 'before', samples = zeroblob(length(samples))",
    ] {
        change(&store, sql).expect("changed behind its back");
        let damage = store.verify().expect("verified");
        // except the triggers that had to be dropped
        let damage: Vec<_> = damage.into_iter().filter(|one| !one.what.starts_with("it lacks")).collect();
        assert_eq!(damage.len(), 1, "{sql}: {damage:?}");
        assert!(damage[0].what.contains("level 1"), "{damage:?}");
    }
}

#[test]
fn every_column_of_a_level_is_under_its_seal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut store = Store::create(&folder.path().join("a.jrig"), SMALL, "small").expect("created");
    let id = session(&mut store);
    store.insert_level(&level(id, Moment::Before, None)).expect("stored");
    let before = store.levels().expect("read");
    store.connection.execute_batch("DROP TRIGGER levels_stay; PRAGMA foreign_keys = OFF").expect("changed");
    assert_eq!(LevelRow::columns().count(), 20);
    for name in LevelRow::columns().map(Column::name) {
        store
            .connection
            .execute_batch(&format!(
                "CREATE TEMP TABLE kept AS SELECT {name} AS value FROM levels; UPDATE levels SET {name} = \
                 CASE typeof({name}) WHEN 'text' THEN {name} || ' ' WHEN 'null' THEN 1.0 ELSE {name} + 1 END"
            ))
            .expect("changed behind its back");
        let damage = store.verify().expect("verified");
        // except the triggers that had to be dropped
        let damage: Vec<_> = damage.into_iter().filter(|one| !one.what.starts_with("it lacks")).collect();
        let told = damage.iter().filter(|damage| damage.what.contains("description was changed")).count();
        // another id is another row: the original row is missing from the chain
        assert_eq!((told, damage.len()), (1, if name == "id" { 2 } else { 1 }), "{name}: {damage:?}");
        let back = format!("UPDATE levels SET {name} = (SELECT value FROM kept); DROP TABLE kept");
        store.connection.execute_batch(&back).expect("changed back");
        assert_eq!(store.levels().expect("read"), before, "{name}");
    }
}

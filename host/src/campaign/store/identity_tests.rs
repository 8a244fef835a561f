use crate::campaign::plan::SMALL;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use std::path::Path;

fn rescued(folder: &Path) -> Store {
    Store::open_read_only(&folder.join("a-rescued-1.jrig")).expect("copied beside it")
}

// on Windows an open file cannot be removed or replaced: see below
#[cfg(not(windows))]
#[test]
fn a_file_that_goes_away_is_missed_at_once_and_what_it_held_is_saved() {
    for (what, says) in [
        ("removed", "removed or renamed"),
        ("replaced", "another file has its name"),
        ("its log", "removed or emptied"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jrig");
        let store = Store::create(&path, SMALL, "small.toml").expect("created");
        store.log("before").expect("noted");
        match what {
            "removed" => std::fs::remove_file(&path).expect("removed"),
            "replaced" => {
                std::fs::write(folder.path().join("other"), "another").expect("written");
                std::fs::rename(folder.path().join("other"), &path).expect("moved");
            }
            _ => std::fs::remove_file(folder.path().join("a.jrig-wal")).expect("removed"),
        }
        let error = store.log("after").expect_err(what);
        assert!(matches!(&error, StoreError::Gone { .. }), "{error}");
        let said = error.to_string();
        assert!(said.contains(says) && said.contains("a-rescued-1.jrig"), "{said}");
        let saved = rescued(folder.path());
        assert_eq!(saved.verify().expect("checked"), []);
        let lines = saved.log_lines(0).expect("log");
        assert!(
            lines.iter().any(|(_, _, text)| text == "before")
                && lines.iter().any(|(_, _, text)| text == "after")
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn another_name_or_a_lock_file_that_is_gone_lets_nobody_in() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    Store::create(&at("a.jrig"), SMALL, "small.toml").expect("created").close().expect("closed");
    let store = Store::open(&at("a.jrig")).expect("open");
    std::os::unix::fs::symlink(at("a.jrig"), at("link.jrig")).expect("linked");
    assert!(matches!(Store::open(&at("link.jrig")), Err(StoreError::Busy { .. })), "a symbolic link");
    std::fs::remove_file(at("a.jrig-lock")).expect("removed");
    assert!(matches!(Store::open(&at("a.jrig")), Err(StoreError::Busy { .. })), "a lock file that is gone");
    store.close().expect("closed");
    std::fs::hard_link(at("a.jrig"), at("second.jrig")).expect("linked");
    for name in ["a.jrig", "second.jrig"] {
        let error = Store::open(&at(name)).expect_err("two names");
        assert!(matches!(error, StoreError::Links { links: 2, .. }), "{error}");
    }
    assert!(Store::open_read_only(&at("second.jrig")).is_ok(), "reading is always possible");
    std::fs::remove_file(at("second.jrig")).expect("removed");
    Store::open(&at("link.jrig")).expect("through a link, if nobody else writes").close().expect("closed");
}

#[cfg(windows)]
#[test]
fn an_open_file_its_log_and_its_lock_can_be_neither_removed_nor_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let store = Store::create(&at("a.jrig"), SMALL, "small.toml").expect("created");
    store.log("before").expect("noted");
    std::fs::write(at("other"), "another").expect("written");
    for name in ["a.jrig", "a.jrig-wal", "a.jrig-lock"] {
        std::fs::remove_file(at(name)).expect_err("removed an open file");
        std::fs::rename(at(name), at("moved")).expect_err("renamed an open file");
        std::fs::rename(at("other"), at(name)).expect_err("replaced an open file");
    }
    assert!(matches!(Store::open(&at("a.jrig")), Err(StoreError::Busy { .. })), "a second writer");
    store.log("after").expect("noted");
    store.close().expect("closed");
    assert!(!at("a.jrig-lock").exists());
    std::fs::hard_link(at("a.jrig"), at("second.jrig")).expect("linked");
    for name in ["a.jrig", "second.jrig"] {
        let error = Store::open(&at(name)).expect_err("two names");
        assert!(matches!(error, StoreError::Links { links: 2, .. }), "{error}");
    }
    std::fs::remove_file(at("second.jrig")).expect("removed");
    Store::open(&at("a.jrig")).expect("one name again").close().expect("closed");
}

#[test]
fn a_path_may_be_longer_than_260_characters_and_in_any_language() {
    let folder = tempfile::tempdir().expect("a folder");
    let deep =
        folder.path().join("Jürgen").join("Пётр").join("測定").join("x".repeat(120)).join("y".repeat(120));
    std::fs::create_dir_all(&deep).expect("a deep folder");
    let (path, copy) = (deep.join("Messung №1 50%.jrig"), deep.join("copy.jrig"));
    assert!(path.as_os_str().len() > 260);
    let store = Store::create(&path, SMALL, "small.toml").expect("created");
    store.log("before").expect("noted");
    let reader = Store::open_read_only(&path).expect("read while it is written");
    assert!(reader.log_lines(0).expect("log").iter().any(|(_, _, text)| text == "before"));
    drop(reader);
    store.back_up(&copy).expect("copied");
    store.close().expect("closed");
    Store::open(&path).expect("continued").close().expect("closed");
    assert_eq!(Store::open_read_only(&copy).expect("read").verify().expect("checked"), []);
    let left: Vec<_> =
        std::fs::read_dir(&deep).expect("listed").map(|entry| entry.expect("it").file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn a_log_that_is_emptied_takes_nothing_and_under_a_reader_it_is_missed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jrig");
    let empty = || {
        let log =
            std::fs::File::options().write(true).open(folder.path().join("a.jrig-wal")).expect("its log");
        log.set_len(0).expect("emptied");
    };
    let store = Store::create(&path, SMALL, "small.toml").expect("created");
    for line in 0..5 {
        store.log(&format!("line {line}")).expect("noted");
        empty();
    }
    store.close().expect("closed");
    let store = Store::open_read_only(&path).expect("read");
    let lines = |store: &Store| {
        store.log_lines(0).expect("log").iter().filter(|line| line.2.starts_with("line")).count()
    };
    assert_eq!((lines(&store), store.verify().expect("checked")), (5, vec![]));
    drop(store);
    // a reader keeps the log in use: its content is not yet in the file, and is lost
    let store = Store::open(&path).expect("again");
    store.log("line 5").expect("noted");
    let reader = rusqlite::Connection::open(&path).expect("a reader");
    reader.execute_batch("BEGIN; SELECT count(*) FROM log").expect("begun");
    let _: i64 = reader.query_row("SELECT count(*) FROM log", [], |row| row.get(0)).expect("read");
    store.log("line 6").expect("noted");
    empty();
    let said = store.log("line 7").expect_err("its log is gone").to_string();
    drop(reader);
    drop(store);
    assert!(said.contains("removed or emptied") && said.contains("a-rescued-1.jrig"), "{said}");
    let saved = rescued(folder.path());
    assert!(lines(&saved) >= 6 && saved.verify().expect("checked").is_empty(), "{}", lines(&saved));
}

//! The live page: a campaign viewed in a browser while it is measured, and all requests that the
//! server must refuse.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::{NewRecord, RecordRow};
use jointrig::campaign::store::session_table::Counters;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::device::stream::Recording;
use jointrig_tests::browser::{Browser, Look, Page};
use jointrig_tests::campaign::{origins, rows, short_contact_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{self, Served, done, picture};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A new campaign of a few cells on B and the assembly.
fn campaign() -> (TempDir, PathBuf) {
    live::campaign(&short_contact_plan())
}

/// The same with every number as a float: a browser writes 100.0 as 100.
fn as_real(value: Value) -> Value {
    match value {
        Value::Number(number) => number.as_f64().into(),
        Value::Array(all) => all.into_iter().map(as_real).collect(),
        Value::Object(all) => all.into_iter().map(|(key, value)| (key, as_real(value))).collect(),
        other => other,
    }
}

const COMPLETE: &str = "!!live.state.whole && live.state.whole.progress.complete";

#[test]
fn a_campaign_is_seen_while_it_is_measured() {
    let (folder, file) = campaign();
    let server = Served::of(&file);
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until(
        "!!live.state.whole && document.getElementById('next')?.textContent.startsWith('Next: B BZ1')",
    );
    assert_eq!(page.eval("location.hash"), "", "the token stays out of the address");
    let mut run = jointrig()
        .args(["campaign", "run"])
        .arg(&file)
        .args(["--device", "sim:", "--yes"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    page.until("live.state.whole.hits.length > 8");
    page.until("document.querySelectorAll('#main tbody tr').length > 0");
    // only the position of the next cell is highlighted
    page.until("!!live.alive.get('place')");
    let lit = page.eval("live.alive.get('place')[0].scene.spots.filter(s => s.name).map(s => s.name).sort()");
    assert_eq!(lit.as_array().map(Vec::len), Some(2), "{lit}");
    picture(&mut page, "now-running");
    page.key("2");
    page.until("document.querySelectorAll('.matrix .done').length > 2 && document.querySelectorAll('.matrix .coming').length === 1");
    picture(&mut page, "matrix-running");
    assert!(run.wait().unwrap().success());
    page.until(COMPLETE);

    // when the last hit is in, the estimate equals that of `analyse`, digit for digit
    page.until("live.state.whole.estimate?.after_record === live.state.whole.hits.at(-1).record");
    let shown = page.eval("live.state.whole.estimate.answer");
    done(jointrig().arg("analyse").arg(&file).arg("--out").arg(folder.path()));
    let results = std::fs::read_to_string(folder.path().join("results.json")).unwrap();
    let mut results: Value = serde_json::from_str(&results).unwrap();
    assert!(results["answer"]["contact"]["k_t_n_per_m"]["mean"].is_f64());
    assert_eq!(as_real(shown), as_real(results["answer"].take()));

    let wide = |page: &mut Page<'_>| page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
    for (key, name, there) in [
        ("1", "now", "document.querySelectorAll('figure.ready').length === 4"),
        (
            "2",
            "matrix",
            "document.querySelectorAll('.matrix .done').length === live.state.whole.cells.length",
        ),
        ("3", "cell", "document.querySelectorAll('figure.ready').length === 1"),
        ("4", "stiffness", "document.querySelectorAll('figure.ready').length >= 2"),
        ("5", "frfs", "document.querySelectorAll('figure.ready').length >= 2"),
        ("6", "channels", "document.querySelectorAll('figure.ready').length === 1"),
        ("7", "log", "document.querySelectorAll('tbody tr').length > 0"),
    ] {
        page.key(key);
        page.until(there);
        picture(&mut page, name);
        assert!(wide(&mut page) <= 1440, "{name}: {} px wide", wide(&mut page));
    }
    // select a cell by keys, then return to the newest
    page.key("k");
    page.until(
        "live.looked() === live.state.whole.cells.at(-2).id && document.getElementById('cell-name') !== null",
    );
    page.key("f");
    page.until("live.looked() === live.state.whole.hits.at(-1).cell");
    assert_eq!(page.errors(), Vec::<String>::new());
    drop(page);

    let mut page = browser.open_url(&server.url, Look { dark: true, ..Look::HAND });
    page.until(COMPLETE);
    for (key, name) in [("1", "now-hand"), ("2", "matrix-hand"), ("4", "stiffness-hand"), ("7", "log-hand")] {
        page.key(key);
        page.until("document.querySelectorAll('#main *').length > 3");
        picture(&mut page, name);
        assert!(wide(&mut page) <= 400, "{name}: {} px wide", wide(&mut page));
    }
    assert_eq!(page.errors(), Vec::<String>::new());
}

/// The test passes to the page the message that the server would send about a hit with each
/// verdict.
#[test]
fn every_verdict_has_a_sign_a_pattern_and_its_reason() {
    let (_folder, file) = campaign();
    let server = Served::of(&file);
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("!!live.state.whole && document.getElementById('next') !== null");
    let mut looks = Vec::new();
    for (record, kind) in (1..).zip(Verdict::ALL) {
        let (name, kept) = (kind.name(), kind == Verdict::Good);
        let say = format!("something <b>odd</b> about record {record}");
        page.eval(&format!(
            "(() => {{ const w = live.state.whole, cell = {{...w.cells[0], attempts: {record}, kept: {}, refused: {{'{name}': 1}}}};
             live.takeIn({{kind: 'judged', seq: {record}, cell, progress: w.progress, hit: {{record: {record}, cell: cell.id, attempt: {record},
             utc: '2026-01-01T00:00:00Z', verdict: '{name}', judged: null, kept: {kept}, measure: 1, limit: 2, sentence: '{say}', peak_n: 50, pulse_us: 3000}}}}) }})()",
            u8::from(kept)
        ));
        let banner = page.eval(
            "(() => { const v = document.getElementById('verdict'), s = getComputedStyle(v);
             return [v.hidden, v.textContent, v.querySelector('.sign')?.textContent, s.backgroundImage + s.backgroundSize] })()",
        );
        assert_eq!(banner[0], kept, "{name}");
        if !kept {
            assert!(banner[1].as_str().unwrap().contains(&format!("{name}: {say}")), "{banner}");
            looks.push((banner[2].clone(), banner[3].clone()));
        }
        page.until(&format!(
            "document.querySelector('#main tbody')?.textContent.includes('record {record}')"
        ));
        page.key("2");
        let cell = format!(
            "document.querySelector('.matrix button').getAttribute('aria-label').includes('1 {name}')"
        );
        page.until(&cell);
        page.key("1");
    }
    for (i, one) in looks.iter().enumerate() {
        assert!(one.0.as_str().is_some_and(|sign| !sign.is_empty() && sign != "✕"), "{one:?}");
        for other in &looks[..i] {
            assert!(one.0 != other.0 && (one.1 != other.1), "{one:?} looks like {other:?}");
        }
    }
    // the only errors are that the file has no such records, and so no FRF of their cell
    let missing = |error: &String| error.contains("/api/records/") || error.contains("/api/cells/1/frf");
    let errors: Vec<String> = page.errors().into_iter().filter(|error| !missing(error)).collect();
    assert_eq!(errors, Vec::<String>::new());
}

/// Every verdict is written into the file as a measuring process does, and appears on the page
/// within moments.
#[test]
fn a_stored_verdict_is_on_the_page_at_once() {
    let (_folder, file) = live::campaign(include_str!("../../../docs/plans/small.toml"));
    done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
    let server = Served::of(&file);
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until(COMPLETE);
    page.key("2");
    page.until("document.querySelector('.matrix button') !== null");
    let store = Store::open(&file).unwrap();
    let row = store.record(1).unwrap();
    let samples = store.samples(&row).unwrap();
    let mut slowest = Duration::ZERO;
    for (n, kind) in (0..).zip(Verdict::ALL.into_iter().rev()) {
        let recording = Recording {
            epoch: 1,
            first_scan: 1_000_000 * u64::from(n),
            trigger_index: row.trigger_index,
            samples: samples.clone(),
            gaps: Vec::new(),
            shot: row.shot,
        };
        let sentence = format!("injected {}", kind.name());
        let verdict = Judgement { kind, measure: 1.0, limit: 2.0, sentence, peak_n: 50.0, start_s: 0.005 };
        let new = NewRecord {
            cell: row.cell,
            attempt: 50 + n,
            session: row.session,
            utc: row.utc.clone(),
            utc_error_s: None,
            recording,
            verdict,
        };
        store.insert(&new, &Counters::default()).unwrap();
        let stored = Instant::now();
        let (name, good) = (kind.name(), kind == Verdict::Good);
        let seen = format!(
            "live.state.whole.hits.at(-1).sentence === 'injected {name}' && document.getElementById('verdict').hidden === {good}
             && ({good} || document.getElementById('verdict').textContent.includes('{name}: injected'))
             && ({good} || document.querySelector('.matrix button').title.includes('{name}'))"
        );
        while page.eval(&seen) != Value::Bool(true) {
            assert!(stored.elapsed() < Duration::from_secs(2), "{name}: not on the page");
            std::thread::sleep(Duration::from_millis(4));
        }
        slowest = slowest.max(stored.elapsed());
        if kind == Verdict::DoubleHit {
            picture(&mut page, "verdict-double-hit");
        }
    }
    println!("banner and matrix at most {} ms after the record was stored", slowest.as_millis());
    assert_eq!(page.errors(), Vec::<String>::new());
}

/// What a run stored, with its scans counted from each cell's first record: the start of a stream
/// depends on when the process starts.
fn stored(file: &Path) -> Vec<(i64, u64, u32, f64, String)> {
    let records = rows(&Store::open_read_only(file).unwrap());
    let since = origins(&records);
    let told = |(r, from): (RecordRow, u64)| (r.cell, r.first_scan - from, r.crc, r.measure, r.sentence);
    records.into_iter().zip(since).map(told).collect()
}

#[test]
fn looking_changes_no_record() {
    let new = || live::campaign(include_str!("../../../docs/plans/small.toml"));
    let run = |file: &Path| {
        let mut command = jointrig();
        command.args(["campaign", "run"]).arg(file).args(["--device", "sim:", "--yes"]);
        command
    };
    let (_alone, unseen) = new();
    done(&mut run(&unseen));
    let (_watched, seen) = new();
    // before the run, which a browser that starts slowly would otherwise miss
    let mut browser = Browser::start();
    let mut server = Served::beside(run(&seen).arg("--serve"));
    // ten pages that show everything, two that never read, and others that repeatedly request the
    // most expensive response
    let listeners: Vec<_> = (0..9)
        .map(|_| server.listener())
        .map(|listener| std::thread::spawn(|| listener.to_the_end()))
        .collect();
    let deaf = server.listener();
    let mut page = browser.open_url(&server.url, Look::DESK);
    let host = format!("127.0.0.1:{}", server.port());
    let mut silent = TcpStream::connect(("127.0.0.1", server.port())).unwrap();
    write!(silent, "GET /live.js HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    page.until("!!live.state.whole && live.state.whole.hits.length > 0");
    page.key("6");
    let token = format!("Bearer {}", server.token());
    let mut asked = 0;
    let headers = [("Host", host.as_str()), ("Authorization", token.as_str())];
    while server.try_asking("GET", "/api/records/1/channels", &headers, "").is_ok() {
        asked += 1;
    }
    assert!(asked > 3, "the run ended before anybody could look");
    drop((page, deaf));
    for listener in listeners {
        let heard = listener.join().unwrap();
        assert!(heard.frames > 3 && heard.words.len() > 3, "{} frames", heard.frames);
    }
    let (status, rest) = server.wait();
    assert!(status.success(), "{rest}");
    assert_eq!(stored(&seen), stored(&unseen), "{rest}");
    assert!(!rest.contains("unexplained"), "{rest}");
}

#[test]
fn strangers_are_turned_away() {
    let (_folder, file) = campaign();
    let server = Served::of(&file);
    let host = format!("127.0.0.1:{}", server.port());
    let token = format!("Bearer {}", server.token());
    let status = |path: &str, headers: &[(&str, &str)]| server.asked(path, headers).0;
    let (code, state) = server.asked("/api/state", &[("Host", &host), ("Authorization", &token)]);
    assert!(code == 200 && state.contains("\"kind\":\"snapshot\""), "{code}: {state}");
    assert_eq!(status("/", &[("Host", "rig.example")]), 421);
    assert_eq!(status("/", &[("Host", &host), ("Origin", "http://rig.example")]), 403);
    assert_eq!(status("/api/state", &[("Host", &host)]), 401);
    assert_eq!(status("/api/state", &[("Host", &host), ("Authorization", "Bearer 0")]), 401);
    assert_eq!(status("/api/records/99/hit", &[("Host", &host), ("Authorization", &token)]), 404);
    assert_eq!(status("/nowhere", &[("Host", &host)]), 404);
    // a request head without an end, and one that is too long
    let mut stream = TcpStream::connect(("127.0.0.1", server.port())).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    write!(stream, "GET / HTTP/1.1\r\nHost: ").unwrap();
    let mut rest = Vec::new();
    // the server disconnects it; a response before that is acceptable too
    let _ = stream.read_to_end(&mut rest);
    let mut stream = TcpStream::connect(("127.0.0.1", server.port())).unwrap();
    let written = write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\nX-Long: {}\r\n\r\n", "x".repeat(40_000));
    let mut answer = String::new();
    // it is refused, or disconnected in the middle
    let read = stream.read_to_string(&mut answer);
    assert!(written.is_err() || read.is_err() || answer.starts_with("HTTP/1.1 431"), "{answer}");
    // forty silent connections block others only until their time limit
    let silent: Vec<TcpStream> =
        (0..40).map(|_| TcpStream::connect(("127.0.0.1", server.port())).unwrap()).collect();
    let within = Instant::now() + Duration::from_secs(15);
    while server.try_asking("GET", "/", &[("Host", &host)], "").map_or(0, |(status, _)| status) != 200 {
        assert!(Instant::now() < within, "the silent ones still lock everyone out");
        std::thread::sleep(Duration::from_millis(100));
    }
    drop(silent);
}

//! The live page of a process that measures: the stream, the shaker's level, and changes requested
//! by a page.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::Verdict;
use jointrig_tests::browser::{Browser, Look};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{Served, campaign, picture};
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};

const SMALL: &str = include_str!("../../../docs/plans/small.toml");

#[test]
fn the_stream_is_seen_as_it_comes() {
    let server = Served::beside(jointrig().args(["serve", "--device", "sim:"]));
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("live.scope.drawn > 20 && live.state.whole.now.signals !== null");
    page.until(
        "document.querySelectorAll('.trace canvas').length === live.state.whole.now.stream.channels.length",
    );
    assert_eq!(page.eval("document.getElementById('doing').textContent"), "watching the channels");
    let what = page.eval("document.getElementById('what').textContent");
    assert!(what.as_str().unwrap().starts_with("SIMULATED rig"), "{what}");
    // every trace is drawn, and every number is shown
    let drawn = page.eval(
        "[...document.querySelectorAll('.trace')].map(t => { const c = t.querySelector('canvas'),
         d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;
         for (let i = 3; i < d.length; i += 4) n += d[i] > 200; return [n, t.textContent] })",
    );
    for trace in drawn.as_array().unwrap() {
        assert!(trace[0].as_u64().unwrap() > 200, "{trace}");
        assert!(
            trace[1].as_str().unwrap().contains("rms") && !trace[1].as_str().unwrap().contains("NaN"),
            "{trace}"
        );
    }
    picture(&mut page, "scope");
    // a page that is blocked misses frames, counts them, and continues
    let missed = page.eval("live.scope.missed");
    page.eval("(() => { const end = performance.now() + 2000; while (performance.now() < end); })()");
    page.until(&format!("live.scope.missed > {missed}"));
    let before = page.eval("live.scope.drawn").as_u64().unwrap();
    page.until(&format!("live.scope.drawn > {before} + 10"));
    assert!(
        page.eval("document.getElementById('link').textContent").as_str().unwrap().contains("frames missed")
    );
    picture(&mut page, "scope-missed");
    // behind another tab it draws nothing and requests nothing; in front again it continues at the
    // stream's current position
    page.hide(true);
    std::thread::sleep(Duration::from_millis(300));
    let (drawn, received) = (page.eval("live.scope.drawn"), page.eval("live.scope.received"));
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(page.eval("live.scope.drawn"), drawn, "drawn for nobody");
    let more = page.eval("live.scope.received").as_u64().unwrap() - received.as_u64().unwrap();
    assert!(more <= 3, "{more} frames came for nobody");
    page.hide(false);
    page.until(&format!("live.scope.drawn > {drawn} + 10"));
    assert_eq!(page.errors(), Vec::<String>::new());
    drop(page);
    let mut page = browser.open_url(&server.url, Look { dark: true, ..Look::HAND });
    page.until("live.scope.drawn > 20");
    picture(&mut page, "scope-hand");
    assert!(page.eval("document.documentElement.scrollWidth").as_u64().unwrap() <= 400);
    assert_eq!(page.errors(), Vec::<String>::new());
}

#[test]
fn the_shakers_level_is_seen_on_its_way() {
    let (_folder, file) = campaign(SMALL);
    let mut server = Served::beside(jointrig().arg("shaker").arg(&file).args([
        "--device",
        "sim:",
        "--freq",
        "150,187,230",
        "--amplitude",
        "2e-7,4e-7",
        "--seconds",
        "20",
        "--yes",
        "--serve",
    ]));
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("!!live.state.whole?.now.shaker?.windows.length");
    page.key("8");
    page.until("document.querySelector('figure[data-figure=shaker-now].ready') !== null && live.alive.get('shaker-now').length === 3");
    page.until("live.state.whole.levels.length > 0 && live.state.whole.now.shaker.windows.length > 8");
    page.until("document.querySelector('figure[data-figure=shaker-now].ready') !== null");
    // the loop is that of the level: as wide as the measured amplitude
    let turn = page.eval("[Math.max(...live.state.whole.now.shaker.turn[0]), live.state.whole.now.shaker.windows.at(-1)[1] * 1e6]");
    let [wide, amplitude] = [0, 1].map(|i| turn[i].as_f64().unwrap());
    assert!((wide / amplitude - 1.0).abs() < 0.25, "{turn}");
    picture(&mut page, "shaker");
    let (status, rest) = server.wait();
    assert!(status.success(), "{rest}");
    assert_eq!(Store::open_read_only(&file).unwrap().levels().unwrap().len(), 6);
    drop(page);
    // afterwards they come from the file alone
    let server = Served::of(&file);
    let mut page = browser.open_url(&server.url, Look { dark: true, ..Look::HAND });
    page.until("live.state.whole?.levels.length === 6");
    page.key("8");
    page.until("document.querySelectorAll('#main tbody tr').length === 6");
    picture(&mut page, "shaker-hand");
    assert!(page.eval("document.documentElement.scrollWidth").as_u64().unwrap() <= 400);
    assert_eq!(page.errors(), Vec::<String>::new());
}

/// A trip of the shaker is shown with its reason.
#[test]
fn a_limit_that_stops_the_shaker_is_told() {
    let (_folder, file) = campaign(SMALL);
    let mut server = Served::beside(jointrig().arg("shaker").arg(&file).args([
        "--device",
        "sim:",
        "--freq",
        "187",
        "--amplitude",
        "4e-7",
        "--limit",
        "ldv_a=5e-5",
        "--yes",
        "--serve",
    ]));
    let heard = server.listener().to_the_end();
    let told = heard.words.iter().any(|word| word.contains("went beyond its limit"));
    assert!(told, "{:?}", heard.words);
    let (status, rest) = server.wait();
    assert!(!status.success() && rest.contains("went beyond its limit"), "{rest}");
}

fn attempt_of(state: &Value) -> (i64, u64) {
    (state["cell"].as_i64().unwrap(), state["attempt"].as_u64().unwrap())
}

#[test]
fn a_person_answers_notes_keeps_and_drops_on_the_page() {
    let (_folder, file) = campaign(SMALL);
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(&file).args([
        "--device",
        "sim:",
        "--stage",
        "manual",
        "--serve",
        "--allow-control",
    ]);
    let mut server = Served::beside(&mut command);
    let mut browser = Browser::start();
    // the read-only page shows the question, and has no button
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("live.state.whole?.now.state?.what === 'move-by-hand'");
    page.until("document.getElementById('doing').textContent.startsWith('move hammer to')");
    assert_eq!(
        page.eval("document.getElementById('write').hidden && document.getElementById('hold') === null"),
        true
    );
    drop(page);

    let mut page = browser.open_url(server.edit.as_ref().unwrap(), Look::DESK);
    page.until("document.getElementById('hold') !== null");
    assert_eq!(page.eval("location.hash"), "", "the token stays out of the address");
    page.eval("document.getElementById('hold').click()");
    page.until("document.querySelector('.answers button:first-child:not([disabled])') !== null");
    picture(&mut page, "answers");
    // meanwhile no other page can answer, and an answer to another question is refused
    let state = page.eval("live.state.whole.now.state");
    let (cell, attempt) = attempt_of(&state);
    let say = |page: &str, attempt: u64| {
        format!("{{\"page\":\"{page}\",\"cell\":{cell},\"attempt\":{attempt},\"answer\":\"in place\"}}")
    };
    let edit = server.edit_token().to_owned();
    let status =
        |path: &str, token: &str, more: &[(&str, &str)], body: &str| server.wanted(path, token, more, body).0;
    assert_eq!(status("/api/stage", &edit, &[], &say("another", attempt)), 409);
    assert_eq!(status("/api/control", &edit, &[], "{\"page\":\"another\",\"hold\":true}"), 409);
    let me = page.eval("live.me").as_str().unwrap().to_owned();
    assert_eq!(status("/api/stage", &edit, &[], &say(&me, attempt + 1)), 409, "stale");
    assert_eq!(status("/api/stage", &edit, &[], &say(&me, attempt).replace("in place", "fire")), 422);
    // requests with the read-only token, from another origin, or as a form change nothing
    for path in ["notes", "keep", "drop", "undo", "stop", "control", "stage"] {
        let path = format!("/api/{path}");
        assert_eq!(status(&path, server.token(), &[], "{}"), 403, "{path}");
        assert_eq!(status(&path, "0", &[], "{}"), 401, "{path}");
        assert_eq!(status(&path, &edit, &[("Origin", "http://rig.example")], "{}"), 403, "{path}");
    }
    assert_eq!(status("/api/notes", &edit, &[], "{\"text\":\"  \"}"), 422);
    assert_eq!(status("/api/notes", &edit, &[], &format!("{{\"text\":\"{}\"}}", "x".repeat(9_000))), 413);
    assert_eq!(status("/api/drop", &edit, &[], "{\"record\":99}"), 409);

    // the stream runs all the time; traces that are not shown are not sent
    assert_eq!(page.eval("live.scope.end"), 0);
    page.key("6");
    page.until("live.scope.drawn > 3");
    page.key("1");
    page.until("document.querySelector('.answers button:first-child:not([disabled])') !== null");
    // frames in transit still arrive
    std::thread::sleep(Duration::from_millis(300));
    let end = page.eval("live.scope.end");
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(page.eval("live.scope.end"), end);

    // the first cell: confirm its position, and its hits arrive
    page.eval("document.querySelector('.answers button').click()");
    page.until(&format!(
        "live.state.whole.now.state.what === 'move-by-hand' && live.state.whole.now.state.cell !== {cell}"
    ));
    page.until(&format!("live.state.whole.cells.find(c => c.id === {cell}).kept === 2"));
    // drop the newest by a key, see it in the matrix, undo, keep it again
    let newest = page.eval("live.state.whole.hits.at(-1).record").as_i64().unwrap();
    page.key("D");
    page.until(&format!("live.state.whole.cells.find(c => c.id === {cell}).kept === 1"));
    assert_eq!(
        page.eval("live.state.whole.hits.at(-1).verdict + live.state.whole.hits.at(-1).judged"),
        "droppedgood"
    );
    page.until("document.getElementById('undo') !== null");
    page.until("document.querySelector('td.edits button') !== null");
    picture(&mut page, "dropped");
    page.key("2");
    page.until("document.querySelector('.matrix button').textContent === '1/2'");
    page.key("u");
    page.until("document.querySelector('.matrix button').textContent === '2/2'");
    page.key("D");
    page.until("document.querySelector('.matrix button').textContent === '1/2'");
    // a note entered by the keyboard
    page.key("n");
    page.until("document.getElementById('note').open");
    page.eval("document.getElementById('note-text').value = 'the clamp <b>creaked</b>'; document.querySelector('#note button[value=write]').click()");
    page.until("document.getElementById('said').textContent.includes('in the log')");
    page.key("7");
    page.until(
        "document.querySelector('.log, tbody').textContent.includes('note: the clamp <b>creaked</b>')",
    );
    picture(&mut page, "log-note");
    // all other cells; the one that lost a hit is repeated at the end
    page.key("1");
    let end = Instant::now() + Duration::from_secs(40);
    while page.eval("live.state.whole.progress.complete") != Value::Bool(true) {
        page.eval("document.querySelector('.answers button:first-child:not([disabled])')?.click()");
        std::thread::sleep(Duration::from_millis(100));
        if Instant::now() > end {
            picture(&mut page, "never-complete");
            panic!(
                "never complete: {}",
                page.eval("[live.state.connected, live.state.whole.now, live.state.whole.progress]")
            );
        }
    }
    let (status, rest) = server.wait();
    assert!(status.success(), "{rest}");
    // the lost server is reported as an error of the page's own requests
    drop(page);
    let store = Store::open_read_only(&file).unwrap();
    let overrules: Vec<String> =
        store.overrules().unwrap().into_iter().map(|o| format!("{} {}", o.record, o.verdict)).collect();
    assert_eq!(
        overrules,
        [format!("{newest} dropped"), format!("{newest} good"), format!("{newest} dropped")]
    );
    let records = store.records_of(cell).unwrap();
    let standing: Vec<Verdict> = records.into_iter().map(|record| record.unwrap().standing()).collect();
    assert_eq!(standing.iter().filter(|kind| **kind == Verdict::Good).count(), 2, "{standing:?}");
    assert!(standing.contains(&Verdict::Dropped));
}

#[test]
fn a_page_ends_measuring_after_the_shot_in_hand() {
    let (_folder, file) = campaign(include_str!("../../../docs/plans/contact.toml"));
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes", "--serve"]);
    let mut server = Served::beside(&mut command);
    std::thread::sleep(Duration::from_secs(1));
    let (code, said) = server.wanted("/api/stop", server.edit_token(), &[], "{}");
    assert!(code == 200 && said.contains("not an emergency stop"), "{code} {said}");
    let (status, rest) = server.wait();
    assert!(!status.success() && rest.contains("continues from here"), "{rest}");
    assert_eq!(Store::open_read_only(&file).unwrap().verify().unwrap(), []);
}

/// `serve FILE` is read-only, whatever is requested.
#[test]
fn a_file_alone_cannot_be_edited() {
    let (_folder, file) = campaign(SMALL);
    let server = Served::of(&file);
    assert_eq!(server.edit, None);
    assert_eq!(server.wanted("/api/notes", server.token(), &[], "{\"text\":\"x\"}").0, 403);
    assert_eq!(server.wanted("/api/stop", server.token(), &[], "{}").0, 403);
}

/// The browser is given the path of a file that only its owner can read, never the address.
#[cfg(unix)]
#[test]
fn the_browser_is_opened_without_the_secret_among_its_arguments() {
    use std::os::unix::fs::PermissionsExt;
    let (folder, file) = campaign(SMALL);
    let (opener, told) = (folder.path().join("xdg-open"), folder.path().join("told"));
    std::fs::write(
        &opener,
        format!("#!/bin/sh\necho \"$@\" > {0}.part && mv {0}.part {0}\n", told.display()),
    )
    .unwrap();
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
    let runtime = folder.path().join("runtime");
    std::fs::create_dir(&runtime).unwrap();
    let mut command = jointrig();
    command
        .arg("serve")
        .arg("--device")
        .arg("sim:")
        .arg("--open")
        .env("PATH", path)
        .env("XDG_RUNTIME_DIR", &runtime);
    let server = Served::beside(&mut command);
    let end = Instant::now() + Duration::from_secs(20);
    while !told.exists() {
        assert!(Instant::now() < end, "nobody opened anything");
        std::thread::sleep(Duration::from_millis(20));
    }
    let arguments = std::fs::read_to_string(&told).unwrap();
    assert!(!arguments.contains(server.token()), "{arguments}");
    let page = Path::new(arguments.trim());
    assert_eq!(page.parent(), Some(runtime.as_path()));
    assert_eq!(std::fs::metadata(page).unwrap().permissions().mode() & 0o777, 0o600);
    assert!(std::fs::read_to_string(page).unwrap().contains(&server.url));
    drop(file);
}

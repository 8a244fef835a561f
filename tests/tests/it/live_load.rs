//! Load of the live page, and its behaviour over hours. Both are run manually and print their
//! results:
//!
//!     cargo build --release -p jointrig
//!     JOINTRIG_BIN=target/release/jointrig cargo test --release -p jointrig-tests \
//!     --test it live_load -- --ignored --nocapture
//!
//! `JOINTRIG_SOAK_H` is the duration of the soak test in hours of the simulated rig [default: 0.5].
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig_tests::browser::{Browser, Look, Page};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{Served, campaign};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time over which processor loads are measured.
const SPAN: Duration = Duration::from_secs(8);

/// Processor time of the threads of a process whose names begin with `thread`, s.
fn used(process: u32, thread: &str) -> f64 {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let of = |task: PathBuf| -> Option<f64> {
        let stat = std::fs::read_to_string(task.join("stat")).ok()?;
        let (head, rest) = stat.rsplit_once(") ")?;
        let name = head.split_once('(')?.1;
        let numbers: Vec<f64> = rest.split(' ').skip(11).take(2).map(|n| n.parse().unwrap()).collect();
        // in hundredths of a second on every Linux target
        name.starts_with(thread).then(|| numbers.iter().sum::<f64>() / 100.0)
    };
    tasks.filter_map(|task| of(task.unwrap().path())).sum()
}

/// Memory of a process, MB; `None` once it has ended.
fn memory(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().unwrap() / 1e3)
}

fn share(server: &Served, page: &mut Page<'_>) -> [f64; 3] {
    let both = |page: &mut Page<'_>| {
        [used(server.id(), "page: server"), used(server.id(), "page: stream"), page.metric("TaskDuration")]
    };
    let before = both(page);
    std::thread::sleep(SPAN);
    let after = both(page);
    [0, 1, 2].map(|i| 100.0 * (after[i] - before[i]) / SPAN.as_secs_f64())
}

#[test]
#[ignore = "a measurement: see the head of this file"]
fn latency_shares_and_weight() {
    let server = Served::beside(jointrig().args(["serve", "--device", "sim:"]));
    let host = format!("127.0.0.1:{}", server.port());
    let weight: usize = ["/", "/live.css", "/live.js"]
        .iter()
        .map(|path| server.asked(path, &[("Host", &host)]).1.len())
        .sum();
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("live.scope.drawn > 20");
    let paint = page.eval("performance.getEntriesByType('paint').at(-1).startTime");
    println!("weight {:.0} kB, first sight {:.0} ms", weight as f64 / 1e3, paint.as_f64().unwrap());
    let mut listeners = Vec::new();
    for pages in [1, 10] {
        while listeners.len() + 1 < pages {
            let listener = server.listener();
            listeners.push(std::thread::spawn(|| listener.to_the_end()));
        }
        page.eval("live.scope.late.length = 0");
        let [serves, streams, draws] = share(&server, &mut page);
        let late = page.eval("(() => { const l = [...live.scope.late].sort((a, b) => a - b); return [l[l.length >> 1], l[Math.floor(.95 * l.length)], l.length] })()");
        println!(
            "{pages} pages: frame to pixel p50, p95 (ms), frames: {late}; share of a core: server {serves:.1} %, stream {streams:.1} %, page {draws:.1} %"
        );
    }
    assert_eq!((page.errors(), page.requests().len()), (Vec::new(), 2), "the style sheet and the script");
}

#[test]
#[ignore = "a measurement: see the head of this file"]
fn soak() {
    let hours: f64 = std::env::var("JOINTRIG_SOAK_H").map_or(0.5, |text| text.parse().unwrap());
    // the paper's campaign has eight good hits in a cell and takes less than four hours
    let plan = include_str!("../../../docs/plans/paper.toml")
        .replace("wanted = 8\n", "wanted = 40\n")
        .replace("most = 24\n", "most = 120\n");
    let (_folder, file) = campaign(&plan);
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes", "--serve"]);
    let mut server = Served::beside(&mut command);
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("live.state.whole?.hits.length > 3");
    page.key("6");
    let over = Arc::new(AtomicBool::new(false));
    let (port, hello) = (server.port(), format!("{{\"token\":\"{}\",\"stream\":true}}", server.token()));
    let ended = over.clone();
    // connects for ten seconds, reads only the first messages, and disconnects without closing the
    // protocol
    let restless = std::thread::spawn(move || {
        let mut came = 0;
        while !ended.load(Ordering::Relaxed) {
            let stream = std::net::TcpStream::connect(("127.0.0.1", port)).unwrap();
            let (mut socket, _) =
                tungstenite::client(format!("ws://127.0.0.1:{port}/socket"), stream).unwrap();
            socket.send(tungstenite::Message::Text(hello.clone().into())).unwrap();
            let _ = socket.read();
            came += 1;
            let until = Instant::now() + Duration::from_secs(10);
            while Instant::now() < until && !ended.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(50));
            }
        }
        came
    });
    let begun = Instant::now();
    let simulated_h = || {
        let store = Store::open_read_only(&file).unwrap();
        let scans = store.link_counters().unwrap().get("scans_received").copied().unwrap_or(0);
        scans as f64 / 51_200.0 / 3_600.0
    };
    // largest and smallest memory since the last printed line
    let (mut told, mut least, mut most) = (0.0, f64::INFINITY, 0.0_f64);
    loop {
        let now = memory(server.id()).unwrap();
        (least, most) = (least.min(now), most.max(now));
        std::thread::sleep(Duration::from_millis(500));
        let h = simulated_h();
        if h < told && h < hours {
            continue;
        }
        let heap = page.metric("JSHeapUsedSize") / 1e6;
        let hits = page.eval("live.state.whole.hits.length");
        let missed = page.eval("live.scope.missed");
        let at = begun.elapsed().as_secs();
        println!(
            "{h:.2} simulated hours in {at} s: process {least:.1} to {most:.1} MB, page's heap {heap:.1} MB, {hits} hits, {missed} frames missed"
        );
        if h >= hours {
            break;
        }
        (told, least, most) = (h + hours / 8.0, f64::INFINITY, 0.0);
    }
    over.store(true, Ordering::Relaxed);
    let came = restless.join().unwrap();
    assert_eq!(server.wanted("/api/stop", server.edit_token(), &[], "{}").0, 200);
    let (_, rest) = server.wait();
    let store = Store::open_read_only(&file).unwrap();
    println!("{:.2} simulated hours, {came} visits of the restless page", simulated_h());
    assert!(!rest.contains("unexplained, "), "{rest}");
    assert_eq!(store.verify().unwrap(), []);
}

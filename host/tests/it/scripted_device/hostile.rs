//! Broken or malicious devices: each is refused with a message, before anything moves or is stored.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use jointrig::campaign::store::Store;
use jointrig::device::error::DeviceError;
use jointrig::device::session::Session;
use jointrig::device::transport::Transport;
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::COIL_PULSE_CAP_US;

use crate::scripted_device::by_summary::ByShotSummary;
use crate::scripted_device::fake::Fake;
use crate::scripted_device::runner::{create, options, plan, run_on};

/// A change of the scripted device.
type Change = fn(&mut Fake);

fn open(fake: Fake) -> Result<Session, DeviceError> {
    Session::open(Box::new(fake), "fake:")
}

/// The final message of a campaign on this device, the number of ordered shots, and the number of
/// records in the file.
fn campaign(fake: Fake) -> (String, u32, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = create(&folder, "a.jrig", &plan());
    let orders = Arc::clone(&fake.orders);
    let said = run_on(&path, fake, &options(), &mut ByShotSummary).expect_err("refused").to_string();
    let records = Store::open_read_only(&path).unwrap().records().unwrap();
    assert!(records.iter().all(Result::is_ok), "{said}: {records:?}");
    (said, orders.load(Ordering::Relaxed), records.len())
}

#[test]
fn scales_that_are_no_numbers_cost_no_shot() {
    let cases: [(Change, &str); 8] = [
        (|fake| fake.channel = |channel| channel.units_per_volt = f32::NAN, "units per volt"),
        (|fake| fake.channel = |channel| channel.units_per_volt = 0.0, "units per volt"),
        (|fake| fake.channel = |channel| channel.units_per_volt = f32::INFINITY, "units per volt"),
        (|fake| fake.channel = |channel| channel.range_v = 0.0, "a range of"),
        (|fake| fake.channel = |channel| channel.range_v = f32::NAN, "a range of"),
        (|fake| fake.channel = |channel| channel.name = "one".parse().unwrap(), "its own name"),
        (|fake| fake.info = |info| info.scan_rate_hz = 0, "scans a second"),
        (|fake| fake.info = |info| info.coil_cap_us = COIL_PULSE_CAP_US + 1, "its coil"),
    ];
    for (change, part) in cases {
        let (said, orders, records) = campaign(Fake::scripted(change));
        assert!(said.starts_with("fake: says") || said.starts_with("fake: calls"), "{said}");
        assert!(said.contains(part) && said.contains("check its firmware"), "{said}");
        assert_eq!((orders, records), (0, 0), "{said}");
    }
}

#[test]
fn a_ring_that_no_controller_has_is_refused_at_the_handshake() {
    for ring in [u32::MAX, 1 << 21, 0] {
        let said =
            open(Fake::scripted(|fake| fake.hello = Hello::device(0, 5, ring))).err().unwrap().to_string();
        assert!(said.contains("keeps") && said.contains(&ring.to_string()), "{said}");
    }
}

#[test]
fn lost_scans_far_ahead_take_no_memory_and_no_time() {
    let begun = Instant::now();
    // the largest ring that is accepted, and the largest loss that one event can report
    let fake = Fake::scripted(|fake| {
        fake.hello = Hello::device(0, 5, 1 << 20);
        fake.loses = Some(0..u64::from(u32::MAX));
    });
    let mut session = open(fake).unwrap();
    let info = session.info().unwrap();
    let map = session.channels(&info).unwrap();
    session.start(map.len()).unwrap();
    session.wait_for(1_000_000).unwrap();
    let accounts = session.accounts();
    assert_eq!(accounts.lost, u64::from(u32::MAX), "{accounts:?}");
    assert!(begun.elapsed() < Duration::from_secs(5));
    // ranges whose turn never comes are not collected without limit
    let mut session = open(Fake::scripted(|fake| fake.loses = Some(1 << 40..(1 << 40) + 1))).unwrap();
    session.start(5).unwrap();
    let said = session.wait_for(1_000_000).expect_err("refused").to_string();
    assert!(said.contains("more losses"), "{said}");
}

#[test]
fn a_shot_at_no_scan_is_not_recorded() {
    let cases: [(Change, &str); 5] = [
        (
            |fake| fake.tells_shot = |shot| shot.trigger = u64::MAX,
            "the hammer hit at scan 18446744073709551615",
        ),
        (|fake| fake.tells_shot = |shot| shot.fired_at = u64::MAX - 5, "the coil went on"),
        (|fake| fake.tells_shot = |shot| shot.trigger = 1 << 52, "more than 1 h after"),
        (|fake| fake.tells_shot = |shot| shot.peak_n = f32::NAN, "the peak of shot 1 is NaN"),
        (|fake| fake.tells_shot = |shot| shot.width_us = f32::INFINITY, "the width of shot 1 is inf"),
    ];
    for (change, part) in cases {
        let (said, orders, records) = campaign(Fake::scripted(change));
        assert!(said.contains(part), "{said}");
        assert_eq!((orders, records), (1, 0), "{said}");
    }
}

#[test]
fn a_device_that_sends_next_to_nothing_holds_nobody() {
    // 48 scans every 0.4 s are slow but not a stall; 48 scans every 0.1 s at a nominal 1 MHz count
    // as a stall
    let mut session = open(Fake::scripted(|fake| fake.slow = Some(Duration::from_millis(400)))).unwrap();
    session.stalls_after(Duration::from_millis(300));
    session.start(5).unwrap();
    session.wait_for(100).expect("slow, and not stalled");
    let mut session = open(Fake::scripted(|fake| {
        fake.slow = Some(Duration::from_millis(100));
        fake.info = |info| info.scan_rate_hz = 1_000_000;
    }))
    .unwrap();
    session.info().unwrap();
    session.stalls_after(Duration::from_secs(1));
    session.start(5).unwrap();
    let said = session.wait_for(100_000).expect_err("stalled").to_string();
    assert!(said.contains("scans in 1 s") && said.contains("reset the controller"), "{said}");
}

/// Serves a device on a socket and returns its address.
fn serve(mut fake: Fake) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(2))).unwrap();
        let mut bytes = [0; 4096];
        loop {
            match stream.read(&mut bytes) {
                Ok(0) => return,
                Ok(count) => fake.write_all(&bytes[..count]).unwrap(),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(_) => return,
            }
            let count = fake.read(&mut bytes, Duration::from_millis(1)).unwrap();
            if stream.write_all(&bytes[..count]).is_err() {
                return;
            }
        }
    });
    address
}

#[test]
fn names_of_a_device_do_nothing_to_a_terminal() {
    let scripted = || {
        Fake::scripted(|fake| {
            fake.info = |info| info.board = "a\u{1b}[2J\u{202e}b".parse().unwrap();
            fake.channel =
                |channel| channel.name = format!("\u{1b}]0;{}\u{7}", channel.name).parse().unwrap();
        })
    };
    let run = |json: &[&str]| {
        let mut info = Command::new(env!("CARGO_BIN_EXE_jointrig"));
        let out = info.args(["info", "--device", &serve(scripted())]).args(json).output().unwrap();
        assert!(out.status.success(), "{out:?}");
        let said = String::from_utf8(out.stdout).unwrap();
        assert!(!said.contains(|c: char| (c.is_control() && c != '\n') || c == '\u{202e}'), "{said:?}");
        said
    };
    let said = run(&[]);
    assert!(said.contains("a\\u{1b}[2J\\u{202e}b") && said.contains("\\u{1b}]0;ch0\\u{7}"), "{said}");
    let document: serde_json::Value = serde_json::from_str(&run(&["--json"])).unwrap();
    assert_eq!(document["name"], "a\u{1b}[2J\u{202e}b");
}

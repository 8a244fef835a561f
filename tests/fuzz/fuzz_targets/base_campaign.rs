//! A small campaign with many kinds of entries, created once, and the requirements for a damaged
//! copy of it.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use jointrig::analyse::Wanted;
use jointrig::campaign::plan::SMALL;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::NewRecord;
use jointrig::campaign::store::session_table::{Counters, SessionInfo};
use jointrig::campaign::store::stored::Hex;
use jointrig::campaign::verdict::{Verdict, Judgement};
use jointrig::device::channels::ChannelMap;
use jointrig::device::samples::Samples;
use jointrig::device::stream::Recording;
use jointrig::report;
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::shot::{Phase, Shot};

/// The file, and its results.
pub struct Base {
    pub bytes: Vec<u8>,
    folder: tempfile::TempDir,
    results: String,
}

/// The base of this process, created once.
pub fn base() -> &'static Base {
    static BASE: OnceLock<Base> = OnceLock::new();
    BASE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jrig");
        eventful(&path);
        let bytes = std::fs::read(&path).expect("read");
        let Found::Whole(results) = found(&path) else { panic!("the base is whole") };
        Base { bytes, folder, results }
    })
}

impl Base {
    /// A new copy that will be damaged.
    pub fn copy(&self, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join("a.jrig");
        for name in ["a.jrig-wal", "a.jrig-shm", "a.jrig.lock"] {
            let _ = std::fs::remove_file(self.folder.path().join(name));
        }
        std::fs::write(&path, bytes).expect("written");
        path
    }

    /// A damaged file is refused, or `verify` names the damage, or its results equal those of the
    /// base.
    pub fn hold(&self, path: &Path, what: &dyn std::fmt::Debug) {
        if let Found::Whole(results) = found(path) {
            assert!(results == self.results, "`verify` is silent, and the results are others: {what:?}\n{results}\n{}", self.results);
        }
    }
}

enum Found {
    Refused,
    Named,
    Whole(String),
}

fn found(path: &Path) -> Found {
    let Ok(store) = Store::open_read_only(path) else { return Found::Refused };
    let Ok(damage) = store.verify() else { return Found::Refused };
    let wanted = Wanted::default();
    let results = report::analysed(&store, wanted, &|_| ()).ok().and_then(|found| found.to_json().ok());
    match results {
        Some(results) if damage.is_empty() => Found::Whole(results),
        Some(_) => Found::Named,
        None => Found::Refused,
    }
}

fn eventful(path: &Path) {
    let channel = |name: &str, role, quantity, units_per_volt| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity,
        units_per_volt,
        range_v: 10.0,
        delay_ns: 0,
        bits: 16,
    };
    let channels = vec![
        channel("force", Role::HammerForce, Quantity::Force, 44.64),
        channel("x", Role::Response(Axis::X), Quantity::Velocity, 0.005),
        channel("y", Role::Response(Axis::Y), Quantity::Velocity, 0.005),
        channel("z", Role::Response(Axis::Z), Quantity::Velocity, -0.005),
    ];
    let map = ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels };
    let mut store = Store::create(path, SMALL, "small.toml").expect("created");
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
    let session = store.begin_session(&info, &map).expect("noted");
    let cells = store.cells().expect("cells");
    for row in cells.iter().take(6) {
        for attempt in 0..2 {
            store.insert(&record(row.id, attempt, session), &Counters::default()).expect("stored");
        }
    }
    store.overrule(1, Verdict::Dropped, "a lorry").expect("dropped");
    store.overrule(1, Verdict::Good, "no lorry").expect("kept");
    store.log("a note").expect("noted");
    store.note_temperature(session, 21.5).expect("noted");
    store.set_meta("who", "one").expect("noted");
    store.close().expect("closed");
}

/// A pulse, and a motion that decays within 2048 samples.
fn record(cell: i64, attempt: u32, session: i64) -> NewRecord {
    let shot = Shot {
        number: attempt + 1,
        phase: Phase::Done,
        fired_at: 10,
        trigger: 400,
        pulse_us: 3_000,
        peak_n: 49.3,
        width_us: 270.1,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 17.0,
        quiet_ratio: 0.3,
    };
    let scans = 2048;
    let force = (0..scans).map(|i| {
        let at = f64::from(i - 256) / 14.0;
        if (0.0..1.0).contains(&at) { (3600.0 * (std::f64::consts::PI * at).sin()) as i16 } else { (i % 3) as i16 - 1 }
    });
    let motion = |hz: f64| {
        (0..scans).map(move |i| {
            let t = f64::from((i - 256).max(0)) / 51_200.0;
            (9000.0 * (-300.0 * t).exp() * (std::f64::consts::TAU * hz * t).sin()) as i16 + (i * 7 % 3) as i16 - 1
        })
    };
    let hz = 400.0 + 30.0 * cell as f64;
    let codes: Vec<i16> = force.chain(motion(hz)).chain(motion(1.3 * hz)).chain(motion(1.7 * hz)).collect();
    let recording =
        Recording { epoch: 3, first_scan: 144, trigger_index: 256, samples: Samples::of_codes(&codes, 4), gaps: vec![], shot };
    let verdict = Judgement { peak_n: 49.0, ..Judgement::without_pulse(Verdict::Good, 49.0, 30.0, "one clean pulse".into()) };
    NewRecord { cell, attempt, session, utc: "2026-01-01T00:00:00Z".into(), utc_error_s: None, recording, verdict }
}

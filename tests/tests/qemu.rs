//! A campaign over the emulated controller gives the records of the native virtual board, and its log is read.
//!
//! `cargo xtask test` builds the image and names it in `JOINTRIG_MPS2_IMAGE`; without it the tests say so.
#![allow(clippy::unwrap_used)]

use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use jointrig::device::address::Address;
use jointrig::device::logs::Tables;
use jointrig::device::session::Session;
use jointrig::device::transport::Transport;
use jointrig_tests::campaign::{Kept, plan, run};

fn over(address: &str) -> Vec<Kept> {
    let three_cells =
        plan(2, &[("A", &["AZ3"], &["A3"]), ("B", &["BY1"], &["B4"]), ("AJB", &["AZ3"], &["B3"])]);
    let folder = tempfile::tempdir().unwrap();
    let transport = address.parse::<Address>().unwrap().open(7).unwrap();
    let (summary, records) = run(&folder.path().join("c.jrig"), &three_cells, transport);
    assert_eq!((summary.kept, summary.accounts.unexplained()), (6, 0));
    records
}

fn image() -> Option<PathBuf> {
    let image = std::env::var_os("JOINTRIG_MPS2_IMAGE").map(PathBuf::from);
    if image.is_none() {
        eprintln!("left out: JOINTRIG_MPS2_IMAGE names no image; `cargo xtask test` builds one and sets it");
    }
    image
}

/// Held by each test: what a program logs is the whole program's.
static ALONE: Mutex<()> = Mutex::new(());

#[test]
fn a_campaign_over_the_emulated_controller_gives_the_same_records() {
    let _alone = ALONE.lock();
    if image().is_some() {
        assert_eq!(over("qemu:"), over("sim:"));
    }
}

/// What this program logs.
struct Heard(Mutex<Vec<String>>);

static HEARD: Heard = Heard(Mutex::new(Vec::new()));

impl log::Log for Heard {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        let line = format!("{} {}: {}", record.level(), record.target(), record.args());
        self.0.lock().unwrap().push(line);
    }

    fn flush(&self) {}
}

/// An emulator of which nobody knows what image it runs, as with a controller that somebody else has flashed.
struct Unknown(Box<dyn Transport>);

impl Transport for Unknown {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// Arms and disarms, and waits until `heard` says so.
fn disarm(transport: Box<dyn Transport>, tables: Tables, heard: impl Fn(&Session, &[String]) -> bool) -> u64 {
    let mut session = Session::open(transport, "qemu:").unwrap();
    session.look_for_log_tables(tables);
    let info = session.info().unwrap();
    session.start(usize::from(info.channels)).unwrap();
    session.arm(1_000).unwrap();
    session.disarm().unwrap();
    let (until, mut lines) = (Instant::now() + Duration::from_secs(20), Vec::new());
    while !heard(&session, &lines) {
        assert!(Instant::now() < until, "{lines:?}, {} bytes undecoded", session.undecoded_log_bytes());
        session.pump(Duration::from_millis(20)).unwrap();
        lines.extend(session.log_lines());
    }
    info.build
}

#[test]
fn what_the_emulated_controller_logs_is_read_by_its_table_or_said_to_have_none() {
    let Some(image) = image() else { return };
    let _alone = ALONE.lock();
    log::set_logger(&HEARD).unwrap();
    log::set_max_level(log::LevelFilter::Info);
    let open = || "qemu:".parse::<Address>().unwrap().open(7).unwrap();
    let disarmed = |_: &Session, lines: &[String]| {
        lines.iter().any(|line| line.starts_with("INFO ") && line.ends_with("hammer disarmed: Asked"))
    };
    let shown = || {
        let lines = std::mem::take(&mut *HEARD.0.lock().unwrap());
        lines.into_iter().filter(|line| line.contains("controller")).collect::<Vec<_>>()
    };

    // from the image that the emulator runs
    let build = disarm(open(), Tables::default(), disarmed);
    let lines = shown();
    assert!(lines[0].starts_with("INFO controller: ") && lines[0].contains("session "), "{lines:?}");

    // from a folder
    let folder = tempfile::tempdir().unwrap();
    let tables = || Tables::in_folders(vec![folder.path().into()]);
    std::fs::copy(image, folder.path().join(jointrig_logs::file_name(build))).unwrap();
    assert_eq!(disarm(Box::new(Unknown(open())), tables(), disarmed), build);
    assert!(shown().len() >= 2);

    // from nowhere
    std::fs::remove_file(folder.path().join(jointrig_logs::file_name(build))).unwrap();
    let counted =
        |session: &Session, lines: &[String]| lines.is_empty() && session.undecoded_log_bytes() > 10;
    disarm(Box::new(Unknown(open())), tables(), counted);
    let lines = shown();
    assert_eq!(lines.len(), 1, "it is said once: {lines:?}");
    assert!(lines[0].starts_with("WARN ") && lines[0].contains(&format!("{build:016x}")), "{lines:?}");
    assert!(lines[0].contains("--log-tables"), "{lines:?}");
}

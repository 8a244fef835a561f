//! A campaign over the emulated controller gives the records of the native virtual board, and its
//! log is decoded.
//!
//! `cargo xtask test` builds the image and sets its path in `JOINTRIG_MPS2_IMAGE`; without it the
//! tests print a message.
#![allow(clippy::unwrap_used)]

use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::device::address::Address;
use jointrig::device::channels::ChannelMap;
use jointrig::device::logs::Tables;
use jointrig::device::samples::{ChannelView, Samples};
use jointrig::device::session::Session;
use jointrig::device::transport::Transport;
use jointrig_tests::campaign::{origins, rows, run, small_plan};
use jointrig_tests::command::Served;

const SEED: u64 = 7;

/// A stored record: its row with all columns, the samples, and the channels' scales.
#[derive(Debug, PartialEq)]
struct Stored {
    row: RecordRow,
    samples: Samples,
    channels: ChannelMap,
}

/// Runs three cells, one of each configuration, with two good hits each.
fn over(address: &str, seed: u64) -> Vec<Stored> {
    let plan = small_plan(&[("A", &["AZ1"], &["A1"]), ("B", &["BZ1"], &["B1"]), ("AJB", &["AY1"], &["B1"])]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let transport = address.parse::<Address>().unwrap().open(seed).unwrap();
    let (summary, _) = run(&file, &plan, transport);
    assert_eq!((summary.kept, summary.given_up), (6, 0), "{address}");
    assert_eq!((summary.accounts.unexplained(), summary.accounts.lost), (0, 0), "{address}");
    let store = Store::open_read_only(&file).unwrap();
    let stored = |row: RecordRow| {
        let samples = store.samples(&row).unwrap();
        Stored { samples, channels: store.channels(row.session).unwrap(), row }
    };
    rows(&store).into_iter().map(stored).collect()
}

fn image() -> Option<PathBuf> {
    let image = std::env::var_os("JOINTRIG_MPS2_IMAGE").map(PathBuf::from);
    if image.is_none() {
        eprintln!("left out: JOINTRIG_MPS2_IMAGE names no image; `cargo xtask test` builds one and sets it");
    }
    image
}

/// Held by each test, because logging is global to the program.
static ALONE: Mutex<()> = Mutex::new(());

/// Removes from a record what legitimately differs between two runs with one seed.
///
/// Scans are counted from the start of the stream, and each cell is staged some scans later, which
/// depends on the computer's scheduler. From there on the runner orders by scan, so that, counted
/// from the cell's first record, all scans must be the same. The time of day and its error come
/// from the host's clock. All other columns are compared, including columns added later.
fn comparable(mut stored: Stored, origin: u64) -> Stored {
    let row = &mut stored.row;
    for scan in [&mut row.shot.fired_at, &mut row.shot.trigger] {
        // relative to the record, which may begin before or after either
        *scan = scan.wrapping_sub(row.first_scan);
    }
    row.first_scan -= origin;
    row.utc.clear();
    row.utc_error_s = None;
    stored
}

/// All records in comparable form; scans count from the first scan of each cell's first record.
fn comparables(stored: Vec<Stored>) -> Vec<Stored> {
    let origins = origins(stored.iter().map(|stored| &stored.row));
    stored.into_iter().zip(origins).map(|(stored, origin)| comparable(stored, origin)).collect()
}

/// Largest ratio of the controller's square root to the exact one: without `std` it is micromath's,
/// which halves the float's exponent and mantissa as one integer. For a mantissa 1 + m the ratio is
/// (1 + m/2)/√(1 + m), largest at m = 1.
const ROOT_TOO_LARGE: f32 = 1.5 / std::f32::consts::SQRT_2;

/// The quietness ratio at which the shot was released is the only value that the controller rounds
/// differently from this computer. It does not change a decision: that root is exact at 1, where
/// the decision is made. The other root in it, of 2/128 with the plan's window, is exact too.
fn take_quiet_ratios(emulated: &mut [Stored], native: &[Stored]) {
    let rounding = 8.0 * f32::EPSILON; // a few operations, each accurate to half of it
    for (emulated, native) in emulated.iter_mut().zip(native) {
        let (found, right) = (&mut emulated.row.shot.quiet_ratio, native.row.shot.quiet_ratio);
        let (least, most) = (right * (1.0 - rounding), right * ROOT_TOO_LARGE * (1.0 + rounding));
        assert!((least..=most).contains(found), "{found} is not {right}");
        *found = right;
    }
}

/// Asserts equality and reports what differs, without printing a million codes.
fn assert_same(address: &str, found: &[Stored], expected: &[Stored]) {
    assert_eq!(found.len(), expected.len(), "{address}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.row, expected.row, "{address}");
        assert_eq!(found.channels, expected.channels, "{address}");
        assert_eq!(found.samples.channels(), expected.samples.channels(), "{address}");
        for (channel, (found, expected)) in found.samples.each().zip(expected.samples.each()).enumerate() {
            assert!(found == expected, "{address}: channel {channel} differs");
        }
    }
}

#[test]
fn one_campaign_over_every_address_gives_the_same_records() {
    let _alone = ALONE.lock();
    if image().is_none() {
        return;
    }
    let native = comparables(over("sim:", SEED));
    // six records of about two seconds of all channels, in three cells; no channel is silent
    assert_eq!(native.iter().map(|stored| stored.row.cell).collect::<Vec<_>>(), [1, 1, 2, 2, 3, 3]);
    for Stored { row, samples, channels } in &native {
        assert!(row.scans > 100_000 && row.trigger_index > 0 && row.gaps.is_empty() && row.peak_n > 30.0);
        assert_eq!((samples.channels(), samples.scans()), (channels.len(), row.scans));
        assert!(
            samples.each().all(
                |own| matches!(own, ChannelView::I16(codes) if codes.iter().any(|code| *code != codes[0]))
            )
        );
    }

    let seed = SEED.to_string();
    let terminal = Served::start(&["--pty", "--seed", &seed]);
    let socket = Served::start(&["--tcp", "127.0.0.1:0", "--seed", &seed]);
    assert!(terminal.address.starts_with("serial:") && socket.address.starts_with("tcp:"));
    for served in [&terminal, &socket] {
        // the served board's seed counts; that of the address has no effect here
        assert_same(&served.address, &comparables(over(&served.address, SEED + 1)), &native);
    }

    let mut emulated = comparables(over("qemu:", SEED));
    take_quiet_ratios(&mut emulated, &native);
    assert_same("qemu:", &emulated, &native);

    let other = over("sim:", SEED + 1);
    assert!(other.iter().zip(&native).all(|(other, native)| other.samples != native.samples), "another seed");
}

/// Collects what this program logs.
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

/// An emulator whose image is unknown, as with a controller that was flashed elsewhere.
struct Unknown(Box<dyn Transport>);

impl Transport for Unknown {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// Arms and disarms, and waits until `heard` returns true.
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

    // without any source
    std::fs::remove_file(folder.path().join(jointrig_logs::file_name(build))).unwrap();
    let counted =
        |session: &Session, lines: &[String]| lines.is_empty() && session.undecoded_log_bytes() > 10;
    disarm(Box::new(Unknown(open())), tables(), counted);
    let lines = shown();
    assert_eq!(lines.len(), 1, "it is said once: {lines:?}");
    assert!(lines[0].starts_with("WARN ") && lines[0].contains(&format!("{build:016x}")), "{lines:?}");
    assert!(lines[0].contains("--log-tables"), "{lines:?}");
}

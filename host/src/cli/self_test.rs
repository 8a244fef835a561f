//! `self-test`: measures what works on this PC, before a rig is attached.
//!
//! It runs a short campaign on the simulated rig in a folder of its own, analyses it, stores its
//! records a second time with a clock beside it, serves it as a live page, and looks for a browser
//! and for controllers. Each check states what was measured, and what to do where it fails. The
//! folder is removed at the end, also after Ctrl-C.

use super::campaign::run;
use super::error::CliError;
use super::output;
use super::page::Onlooker;
use crate::analyse::Wanted;
use crate::campaign::plan;
use crate::campaign::run::runner::Summary;
use crate::campaign::run::stage::Stage;
use crate::campaign::store::Store;
use crate::campaign::store::record_table::RecordRow;
use crate::campaign::store::session_table::Counters;
use crate::campaign::verdict::judge::ByRecord;
use crate::device::address::Address;
use crate::device::error::permission_advice;
use crate::device::serial::{Serial, ports};
use crate::device::usb::{Usb, attached};
use crate::report;
use crate::untrusted_text::tell_line;
use clap::Args;
use jointrig_protocol::usb::{PRODUCT_ID, VENDOR_ID};
use serde::Serialize;
use serde_json::{Value, json};
use serialport::SerialPortType;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Seed of the simulated rig, so that two runs measure the same hits.
const SEED: u64 = 1;

/// Largest relative difference between the identified k_T and that of the simulated rig.
const K_T_TOLERANCE: f64 = 0.1;

/// Records that are stored a second time, and files that are synced.
const STORED: usize = 20;

/// Hits of the longest campaign for which the disk should have space: the paper's, of which one in
/// ten is refused.
const LONGEST_CAMPAIGN: u64 = 2016 * 11 / 10;

/// Test what works on this PC: measuring, analysis, speed, disk, live page, browser, controllers.
#[derive(Debug, Args)]
pub struct SelfTest {
    /// Test the disk of this folder: name the one for your campaigns. A new folder in it is used,
    /// and removed at the end.
    #[arg(long, value_name = "DIR", default_value = ".")]
    folder: PathBuf,
    /// Measure only a few hits, too few for a stiffness: seconds instead of about a minute.
    #[arg(long)]
    quick: bool,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

/// Outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// It works.
    Works,
    /// Nothing is broken, but something is missing or was not tested.
    Advice,
    /// It does not work.
    Failed,
}

/// One line of the answer.
#[derive(Debug, Serialize)]
struct Check {
    name: &'static str,
    state: State,
    /// What was found, with the measured numbers.
    what: String,
    /// What to do, unless it works.
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<String>,
    /// The measured numbers, in SI units.
    #[serde(skip_serializing_if = "Value::is_null")]
    measured: Value,
}

impl Check {
    fn works(name: &'static str, what: String) -> Self {
        Self { name, state: State::Works, what, advice: None, measured: Value::Null }
    }

    fn advises(name: &'static str, what: String, advice: impl Into<String>) -> Self {
        Self { state: State::Advice, advice: Some(advice.into()), ..Self::works(name, what) }
    }

    fn fails(name: &'static str, what: String, advice: impl Into<String>) -> Self {
        Self { state: State::Failed, advice: Some(advice.into()), ..Self::works(name, what) }
    }

    fn with(self, measured: Value) -> Self {
        Self { measured, ..self }
    }

    fn lines(&self) -> Vec<String> {
        let state = match self.state {
            State::Works => "works",
            State::Advice => "note",
            State::Failed => "FAILED",
        };
        let mut lines = vec![format!("{:<12} {state:<7} {}", self.name, self.what)];
        lines.extend(self.advice.iter().map(|advice| format!("{:20} do: {advice}", "")));
        lines
    }
}

/// The folder of a test. Dropping it removes it.
struct OwnFolder(PathBuf);

impl OwnFolder {
    fn new(within: &Path) -> Result<Self, CliError> {
        let path = within.join(format!("jointrig-self-test-{}", std::process::id()));
        let made = std::fs::create_dir(&path);
        made.map_err(|source| CliError::File {
            path: path.clone(),
            doing: "making the test's folder (`--folder DIR` chooses another place)",
            source,
        })?;
        Ok(Self(path))
    }
}

impl Drop for OwnFolder {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.0) {
            tell_line!("{} could not be removed ({error}): remove it yourself", self.0.display());
        }
    }
}

impl SelfTest {
    pub fn run(self) -> Result<(), CliError> {
        let begun = Instant::now();
        let folder = OwnFolder::new(&self.folder)?;
        let stop = output::flag();
        let checks = self.checks(&folder.0, &stop)?;
        drop(folder);
        let failed: Vec<_> = checks.iter().filter(|check| check.state == State::Failed).collect();
        if self.json {
            output::json(&json!({
                "version": env!("CARGO_PKG_VERSION"),
                "system": format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
                "processors": processors(),
                "seconds": begun.elapsed().as_secs_f64(),
                "ok": failed.is_empty(),
                "checks": checks,
            }))?;
        } else {
            output::lines(checks.iter().flat_map(Check::lines))?;
        }
        if failed.is_empty() {
            return Ok(());
        }
        let names: Vec<_> = failed.iter().map(|check| check.name).collect();
        Err(CliError::Bad(format!(
            "{} of {} checks failed: {}",
            failed.len(),
            checks.len(),
            names.join(", ")
        )))
    }

    fn checks(&self, folder: &Path, stop: &Arc<AtomicBool>) -> Result<Vec<Check>, CliError> {
        let file = folder.join("campaign.jrig");
        let begun = Instant::now();
        let summary = self.measure(&file, stop)?;
        let seconds = begun.elapsed().as_secs_f64();
        let go_on = || {
            if stop.load(Ordering::Relaxed) {
                return Err(CliError::Bad("stopped before the test was complete".into()));
            }
            Ok(())
        };
        go_on()?;
        let store = Store::open_read_only(&file)?;
        let mut checks = vec![campaign(&store, &summary, seconds)?, speed(&store, &summary, seconds)?];
        if !self.quick {
            checks.push(stiffness(&store)?);
            go_on()?;
        }
        checks.push(storing(&store, &folder.join("again.jrig"))?);
        go_on()?;
        checks.push(disk(&store, folder)?);
        drop(store);
        #[cfg(feature = "dashboard")]
        checks.push(live_page(&file));
        checks.push(browser());
        checks.extend(controllers());
        Ok(checks)
    }

    /// Measures the simulated rig.
    fn measure(&self, file: &Path, stop: &Arc<AtomicBool>) -> Result<Summary, CliError> {
        let (text, name) =
            if self.quick { (plan::SMALL, "small.toml") } else { (plan::CONTACT, "contact.toml") };
        let store = Store::create(file, text, name)?;
        let address = Address::Sim { rig: None };
        let device = run::Device { address: &address, seed: SEED, log_tables: None };
        let who = run::Who {
            stage: Stage::Device,
            yes: true,
            new_structure: false,
            further: None,
            stop: stop.clone(),
        };
        run::measure(store, device, who, &mut Onlooker::default(), None, &mut ByRecord)
    }
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Whether the campaign is complete, without a lost sample and with every checksum right.
fn campaign(store: &Store, summary: &Summary, seconds: f64) -> Result<Check, CliError> {
    let Summary { kept, wanted, hits, accounts, .. } = summary;
    let damage = store.verify()?;
    let measured = json!({
        "hits": hits, "kept": kept, "wanted": wanted, "seconds": seconds, "scans": accounts.received,
        "scans_lost": accounts.lost, "scans_unexplained": accounts.unexplained(), "damaged": damage.len(),
    });
    let what = format!(
        "simulated rig: {kept} of {wanted} good hits in {seconds:.1} s, {} samples lost, {} damaged records",
        accounts.lost + accounts.unexplained(),
        damage.len()
    );
    let good = kept >= wanted && accounts.lost + accounts.unexplained() == 0 && damage.is_empty();
    let check = if good {
        Check::works("measuring", what)
    } else {
        let advice = "run it again with -v and report what it prints: on the simulated rig every hit should \
                      be stored";
        Check::fails("measuring", what, advice)
    };
    Ok(check.with(measured))
}

/// Whether this PC is faster than a rig, which cannot wait.
fn speed(store: &Store, summary: &Summary, seconds: f64) -> Result<Check, CliError> {
    let (id, _) =
        store.sessions()?.pop().ok_or_else(|| CliError::Bad("the campaign has no session".into()))?;
    let map = store.channels(id)?;
    let rig_seconds = summary.accounts.received as f64 / f64::from(map.rate_hz);
    let factor = rig_seconds / seconds;
    let needed = f64::from(map.rate_hz) * map.len() as f64 * 2.0;
    let measured = json!({
        "times_real_time": factor, "bytes_per_s": needed * factor, "bytes_per_s_needed": needed,
        "rate_hz": map.rate_hz, "channels": map.len(),
    });
    let what = format!(
        "{rig_seconds:.0} s of {} channels at {} Hz were simulated, received and judged in {seconds:.1} s: \
         {factor:.1} times as fast as a rig ({:.1} MB/s; a rig sends {:.2} MB/s); {} processors",
        map.len(),
        map.rate_hz,
        needed * factor * 1e-6,
        needed * 1e-6,
        processors(),
    );
    let check = if factor >= 1.0 {
        Check::works("speed", what)
    } else {
        let advice = "end other programs and run it again. A rig does not need the simulator's part of this time, \
                      but below 1.0 samples may be lost; `campaign run` counts lost samples";
        Check::fails("speed", what, advice)
    };
    Ok(check.with(measured))
}

/// Whether the analysis finds the k_T of the simulated rig.
fn stiffness(store: &Store) -> Result<Check, CliError> {
    let begun = Instant::now();
    let waiting = output::Waiting::of("analysing");
    let found = report::analysed(store, Wanted::default(), &|part| waiting.at(part.done, part.total))?;
    drop(waiting);
    let seconds = begun.elapsed().as_secs_f64();
    let advice =
        "report this with the version and the processor: the numbers of this PC are not to be trusted";
    let answer = found.answer.as_ref();
    let k_t = answer.and_then(|answer| answer.contact.k_t_n_per_m.as_ref());
    let (Some(k_t), Some(truth)) = (k_t, answer.and_then(|answer| answer.truth.as_ref())) else {
        let why = answer.map_or("the campaign has no answer", |answer| answer.contact.why.as_str());
        return Ok(Check::fails("analysis", format!("k_T was not found: {why}"), advice));
    };
    let (k, [low, high], true_k) = (k_t.mean, k_t.ci95, truth.contact_k_t_n_per_m);
    let what = format!(
        "k_T = {:.1} N/µm ({:.1} to {:.1}) in {seconds:.1} s; the simulated contact has {:.1}",
        k * 1e-6,
        low * 1e-6,
        high * 1e-6,
        true_k * 1e-6
    );
    let check = if (k / true_k - 1.0).abs() <= K_T_TOLERANCE {
        Check::works("analysis", what)
    } else {
        Check::fails("analysis", what, advice)
    };
    Ok(check.with(json!({
        "k_t_n_per_m": k, "ci95": [low, high], "true_k_t_n_per_m": true_k, "seconds": seconds,
    })))
}

/// Seconds of one record.
fn record_seconds(store: &Store) -> Result<f64, CliError> {
    Ok(store.plan()?.record.get_ref().length_s)
}

/// Whether a record is compressed, stored and synced before the next one is complete.
fn storing(store: &Store, path: &Path) -> Result<Check, CliError> {
    let again = Store::create_with(path, &store.plan_sources()?)?;
    let mut session = None;
    for copy in store.session_copies()? {
        session = Some((copy.id, again.copy_session(&copy)?));
    }
    let Some((from, to)) = session else { return Err(CliError::Bad("the campaign has no session".into())) };
    let mut taken = Vec::new();
    let bytes = store.sample_bytes()?.1 / store.places()?.len().max(1) as u64;
    let measured = |row: &RecordRow| row.session == from && row.scans > 0;
    for row in store.records()?.into_iter().flatten().filter(measured).take(STORED) {
        let samples = store.samples(&row)?;
        let row = RecordRow { session: to, ..row };
        let begun = Instant::now();
        again.copy_record(&row, samples, &Counters::new())?;
        taken.push(begun.elapsed());
    }
    let stored = taken.len();
    again.close()?;
    let (median, slowest) = spread(taken);
    let available = record_seconds(store)?;
    let what = format!(
        "{stored} records of {:.1} MB were compressed, stored and synced in {:.0} ms each, the slowest in {:.0} ms; \
         a rig makes one in {available:.1} s at most",
        bytes as f64 * 1e-6,
        median * 1e3,
        slowest * 1e3
    );
    let check = if slowest < available {
        Check::works("storing", what)
    } else {
        let advice =
            "measure into a local disk (`--folder DIR` tests another one); end programs that write much";
        Check::fails("storing", what, advice)
    };
    Ok(check.with(json!({
        "records": stored, "record_bytes": bytes, "median_s": median, "slowest_s": slowest, "available_s": available,
    })))
}

/// Median and largest of these times, s.
fn spread(mut taken: Vec<Duration>) -> (f64, f64) {
    taken.sort();
    let at = |place: usize| taken.get(place).map_or(f64::NAN, Duration::as_secs_f64);
    (at(taken.len() / 2), at(taken.len().saturating_sub(1)))
}

/// Free space, and how long the disk takes until data are safe.
fn disk(store: &Store, folder: &Path) -> Result<Check, CliError> {
    let path = folder.join("sync");
    let failed = |source| CliError::File { path: path.clone(), doing: "writing to the disk", source };
    let (stored, _) = store.sample_bytes()?;
    let records = store.places()?.len().max(1) as u64;
    let each = stored / records;
    let block = vec![0xA5; usize::try_from(each).unwrap_or(0)];
    let mut file = File::create(&path).map_err(failed)?;
    let mut taken = Vec::new();
    for _ in 0..STORED {
        let begun = Instant::now();
        file.write_all(&block).and_then(|()| file.sync_all()).map_err(failed)?;
        taken.push(begun.elapsed());
    }
    let (median, slowest) = spread(taken);
    let needed = each * LONGEST_CAMPAIGN;
    let free = free_bytes(folder);
    let synced = format!(
        "{:.2} MB are written and synced in {:.1} ms, at most {:.1} ms",
        each as f64 * 1e-6,
        median * 1e3,
        slowest * 1e3
    );
    let measured = json!({
        "free_bytes": free, "longest_campaign_bytes": needed, "bytes_synced": each, "median_s": median,
        "slowest_s": slowest,
    });
    let gb = |bytes: u64| bytes as f64 * 1e-9;
    let check = match free {
        None => Check::advises(
            "disk",
            format!("{synced}; this system does not report the free space"),
            format!("look yourself: the paper's campaign takes {:.1} GB", gb(needed)),
        ),
        Some(free) => {
            let what = format!(
                "{synced}; {:.1} GB are free, the paper's campaign takes {:.1}",
                gb(free),
                gb(needed)
            );
            if free < needed {
                Check::fails("disk", what, "free some space, or measure into another disk")
            } else {
                Check::works("disk", what)
            }
        }
    };
    Ok(check.with(measured))
}

#[cfg(feature = "dashboard")]
fn free_bytes(folder: &Path) -> Option<u64> {
    crate::live::watching::free_bytes(folder)
}

#[cfg(not(feature = "dashboard"))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

/// Whether a program on this PC, such as a browser, gets the live page of the campaign.
#[cfg(feature = "dashboard")]
fn live_page(file: &Path) -> Check {
    let begun = Instant::now();
    let fetched = crate::dashboard::Dashboard::of_file(file, 0)
        .map_err(|error| error.to_string())
        .and_then(|page| fetch(&page.url()).map_err(|error| error.to_string()));
    let advice = "a security program may block connections of this PC to itself: permit 127.0.0.1";
    match fetched {
        Err(error) => Check::fails("live page", format!("it cannot be fetched: {error}"), advice),
        Ok(answer) if !answer.starts_with("HTTP/1.1 200 ") || !answer.contains("<html") => {
            let first: String = answer.lines().next().unwrap_or_default().chars().take(80).collect();
            Check::fails("live page", format!("another answer came: `{first}`"), advice)
        }
        Ok(answer) => {
            let seconds = begun.elapsed().as_secs_f64();
            Check::works(
                "live page",
                format!("served on 127.0.0.1, {} kB in {:.0} ms", answer.len() / 1000, seconds * 1e3),
            )
            .with(json!({ "bytes": answer.len(), "seconds": seconds }))
        }
    }
}

/// The answer to a request for a page of this PC.
#[cfg(feature = "dashboard")]
fn fetch(url: &str) -> std::io::Result<String> {
    use std::io::Read;
    const PATIENCE: Duration = Duration::from_secs(10);
    let address = url.trim_start_matches("http://").split('/').next().unwrap_or_default();
    let mut stream = std::net::TcpStream::connect(address)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    write!(stream, "GET / HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

/// Browsers by the names of their programs.
const BROWSERS: [&str; 10] = [
    "firefox",
    "firefox-esr",
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "brave-browser",
    "epiphany",
    "konqueror",
];

/// Where browsers are installed on Windows, in the folders of these environment variables.
const ON_WINDOWS: [(&str, &str); 6] = [
    ("ProgramFiles(x86)", "Microsoft/Edge/Application/msedge.exe"),
    ("ProgramFiles", "Microsoft/Edge/Application/msedge.exe"),
    ("ProgramFiles", "Mozilla Firefox/firefox.exe"),
    ("ProgramFiles", "Google/Chrome/Application/chrome.exe"),
    ("ProgramFiles(x86)", "Google/Chrome/Application/chrome.exe"),
    ("LOCALAPPDATA", "Google/Chrome/Application/chrome.exe"),
];

/// Where browsers are installed on macOS.
const ON_MACOS: [&str; 4] = [
    "/Applications/Safari.app",
    "/System/Volumes/Preboot/Cryptexes/App/System/Applications/Safari.app",
    "/Applications/Firefox.app",
    "/Applications/Google Chrome.app",
];

/// The path of a program that PATH finds.
fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(name)).find(|path| path.is_file())
}

/// Whether there is a browser for the report and the live page.
fn browser() -> Check {
    let found: Option<PathBuf> = if cfg!(windows) {
        let at =
            |(variable, path): (&str, &str)| std::env::var_os(variable).map(|f| PathBuf::from(f).join(path));
        ON_WINDOWS.into_iter().filter_map(at).find(|path| path.is_file())
    } else if cfg!(target_os = "macos") {
        ON_MACOS.into_iter().map(PathBuf::from).find(|path| path.is_dir())
    } else {
        BROWSERS.into_iter().find_map(program)
    };
    let Some(found) = found else {
        return Check::advises(
            "browser",
            "no browser was found".into(),
            "install one (Firefox, Chrome, Edge …), or open report.html on another PC; measuring needs none",
        );
    };
    if cfg!(any(windows, target_os = "macos")) || program("xdg-open").is_some() {
        return Check::works("browser", found.display().to_string());
    }
    Check::advises(
        "browser",
        format!("{}, but no `xdg-open`, so `--open` cannot start it", found.display()),
        "install xdg-utils, or open the printed address yourself",
    )
}

/// Which controllers are attached, and whether they may be opened.
fn controllers() -> Vec<Check> {
    let mut checks = Vec::new();
    match attached() {
        // a virtual machine or a container without USB is good for everything else
        Err(error) => checks.push(Check::advises(
            "usb",
            format!("USB devices cannot be listed: {error}"),
            "a rig at this PC needs USB; analysis, files and `tcp:` devices do not",
        )),
        Ok(list) => checks.extend(list.into_iter().map(|one| {
            let address = one.address();
            // opening claims the interface and sends nothing
            match Usb::open(one.serial.as_deref()) {
                Ok(_) => Check::works("usb", format!("{address} may be opened")),
                Err(error) => Check::fails("usb", error.to_string(), permission_advice()),
            }
        })),
    }
    match ports() {
        Err(error) => checks.push(Check::advises(
            "serial",
            format!("serial ports cannot be listed: {error}"),
            "use `--device usb:`, or name the port: `--device serial:PATH`",
        )),
        Ok(ports) => {
            let ours = ports.into_iter().filter(|port| match &port.port_type {
                SerialPortType::UsbPort(usb) => (usb.vid, usb.pid) == (VENDOR_ID, PRODUCT_ID),
                _ => false,
            });
            checks.extend(ours.map(|port| match Serial::open(Path::new(&port.port_name)) {
                Ok(_) => Check::works("serial", format!("serial:{} may be opened", port.port_name)),
                Err(error) => Check::fails("serial", error.to_string(), permission_advice()),
            }));
        }
    }
    if checks.is_empty() {
        let what = "no controller is attached, so none was opened".to_owned();
        let advice = format!("{}; then plug it in and run this again", permission_advice());
        checks.push(Check::advises("controller", what, advice));
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::stream::Accounts;

    #[test]
    fn the_folder_is_removed_with_everything_in_it_and_a_place_that_is_missing_is_named() {
        let within = tempfile::tempdir().expect("a folder");
        let own = OwnFolder::new(within.path()).expect("made");
        std::fs::write(own.0.join("campaign.jrig"), "x").expect("written");
        let second = OwnFolder::new(within.path()).err().expect("it is in use").to_string();
        assert!(second.contains("jointrig-self-test-"), "{second}");
        drop(own);
        assert_eq!(std::fs::read_dir(within.path()).expect("read").count(), 0);
        let none = OwnFolder::new(&within.path().join("none")).err().expect("no such folder").to_string();
        assert!(none.contains("--folder DIR") && none.contains("make the folder"), "{none}");
    }

    #[test]
    fn a_slow_rate_or_a_lost_sample_fails() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jrig");
        let stop = Arc::default();
        let test = SelfTest { folder: folder.path().into(), quick: true, json: false };
        let summary = test.measure(&path, &stop).expect("measured");
        let store = Store::open_read_only(&path).expect("open");
        let rig_seconds = summary.accounts.received as f64 / 51_200.0;
        for (seconds, expected) in [(rig_seconds * 0.9, State::Works), (rig_seconds * 1.1, State::Failed)] {
            assert_eq!(speed(&store, &summary, seconds).expect("checked").state, expected, "{seconds}");
        }
        assert_eq!(campaign(&store, &summary, 1.0).expect("checked").state, State::Works);
        for worse in [
            Summary { kept: summary.wanted - 1, ..summary.clone() },
            Summary { accounts: Accounts { lost: 1, ..summary.accounts }, ..summary.clone() },
        ] {
            let check = campaign(&store, &worse, 1.0).expect("checked");
            assert_eq!(check.state, State::Failed, "{}", check.what);
        }
        // too few cells for a stiffness: it is stated, not made up
        assert!(stiffness(&store).map_or(true, |check| check.state == State::Failed));
    }

    #[test]
    fn median_and_slowest_time_are_taken_from_the_list() {
        let times = [5, 1, 3].map(Duration::from_secs).to_vec();
        assert_eq!(spread(times), (3.0, 5.0));
    }
}

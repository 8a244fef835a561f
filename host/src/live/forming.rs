//! Runs the analysis of `jointrig analyse` again whenever more data are stored, in a process
//! separate from the measuring one. After the last hit its numbers are those of `results.json`.

use std::io::{self, Read as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::bus::Bus;
use super::message::Message;
use super::numbers::Found;
use crate::campaign::store::Store;

/// The analysis pauses for this many times its own duration, so that it takes at most a sixth of
/// one core from the measurement.
const REST: u32 = 5;
/// Shortest pause; more frequent results could not be read.
const SHORTEST: Duration = Duration::from_secs(2);
/// If nothing new was stored for this long, nothing is being measured that the analysis could
/// disturb.
const QUIET: Duration = Duration::from_secs(4);
/// The hidden subcommand of the analysing process.
pub const COMMAND: &str = "analyse-for-page";
/// Interval between two checks for new data.
const LOOK: Duration = Duration::from_millis(200);

/// The newest analysis.
#[derive(Debug, Default)]
pub struct Formed {
    found: std::sync::Mutex<Arc<Found>>,
}

impl Formed {
    /// Its results.
    pub fn found(&self) -> Arc<Found> {
        self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    fn set(&self, found: Found) {
        *self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Arc::new(found);
    }
}

/// Analyses the file repeatedly while it grows, until `stop`.
pub fn form(path: &Path, bus: &Bus, formed: &Formed, stop: &AtomicBool) {
    let (mut known, mut seen) = (None, None);
    let (mut rest_until, mut changed) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK);
        let newest = match newest(path) {
            Ok(newest) => newest,
            Err(error) => {
                log::debug!("the page's estimate is delayed: {error}");
                continue;
            }
        };
        if seen != Some(newest) {
            (seen, changed) = (Some(newest), Instant::now());
        }
        let rests = Instant::now() < rest_until && changed.elapsed() < QUIET;
        if rests || known == Some(newest) || newest.records == 0 {
            continue;
        }
        known = Some(newest);
        let begun = Instant::now();
        let mut found = analysed_elsewhere(path, newest.last)
            .unwrap_or_else(|why| Found::none(newest.last, format!("no estimate is made: {why}")));
        let took = begun.elapsed();
        found.estimate.took_s = took.as_secs_f64();
        bus.say(Message::Estimate(Box::new(found.estimate.clone())));
        formed.set(found);
        rest_until = Instant::now() + (took * REST).max(SHORTEST);
    }
}

/// Starts this program as a separate process that analyses the file.
fn analysed_elsewhere(path: &Path, last: i64) -> io::Result<Found> {
    // the program that is running, even if its file was replaced meanwhile
    let itself = Path::new("/proc/self/exe");
    let program = if itself.exists() { itself.to_owned() } else { std::env::current_exe()? };
    let mut child = Command::new(program)
        .arg(COMMAND)
        .arg(path)
        .arg(last.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // the child ends when this end of its stdin is closed, which also happens when this process
    // dies
    let alive = child.stdin.take();
    let mut text = String::new();
    let read = child.stdout.take().map_or(Ok(0), |mut out| out.read_to_string(&mut text));
    let status = child.wait()?;
    drop(alive);
    read?;
    if !status.success() {
        return Err(io::Error::other(format!("the analysis ended with {status}")));
    }
    Ok(serde_json::from_str(&text)?)
}

/// Main function of the analysing process: writes the results for the file as JSON, and ends early
/// when its stdin is closed.
///
/// # Errors
/// The result cannot be written.
pub fn analyse_for_another(path: &Path, last: i64, out: &mut impl io::Write) -> io::Result<()> {
    // the other cores are for the measurement
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().map_err(io::Error::other)?;
    std::thread::Builder::new().name("wanted still".into()).spawn(|| {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        std::process::exit(0);
    })?;
    serde_json::to_writer(&mut *out, &Found::of(path, last))?;
    out.flush()
}

/// What an analysis depends on: it is repeated when one of these changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Newest {
    records: usize,
    levels: usize,
    overruled: usize,
    last: i64,
}

fn newest(path: &Path) -> Result<Newest, crate::campaign::store::error::StoreError> {
    let store = Store::open_read_only(path)?;
    let places = store.places()?;
    Ok(Newest {
        records: places.len(),
        levels: store.levels()?.len(),
        overruled: store.overrules()?.len(),
        last: places.iter().map(|place| place.id).max().unwrap_or(0),
    })
}

//! What can be said so far: the very analysis of `jointrig analyse`, run anew on what is stored whenever there is more of it, by a process of
//! its own beside the measuring. When the last hit is in, its numbers are those of `results.json`.

use std::io::{self, Read as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::bus::Bus;
use super::found::Found;
use super::message::Message;
use crate::campaign::store::Store;

/// The analysis rests so many times as long as it took: a sixth of one core is the most that it takes from the measuring.
const REST: u32 = 5;
/// The shortest rest: nobody reads faster.
const SHORTEST: Duration = Duration::from_secs(2);
/// Nothing new for so long: nobody is measuring whom it could disturb.
const QUIET: Duration = Duration::from_secs(4);
/// The hidden subcommand of the process that analyses.
pub const COMMAND: &str = "analyse-for-page";
/// How often it looks whether there is more.
const LOOK: Duration = Duration::from_millis(200);

/// The newest analysis.
#[derive(Debug, Default)]
pub struct Formed {
    found: std::sync::Mutex<Arc<Found>>,
}

impl Formed {
    /// What it found.
    pub fn found(&self) -> Arc<Found> {
        self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    fn set(&self, found: Found) {
        *self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Arc::new(found);
    }
}

/// Has the file analysed as long as it grows, until `stop`.
pub fn form(path: &Path, bus: &Bus, formed: &Formed, stop: &AtomicBool) {
    let (mut known, mut seen) = (None, None);
    let (mut rest_until, mut changed) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK);
        let newest = match newest(path) {
            Ok(newest) => newest,
            Err(error) => {
                log::debug!("the page's estimate waits: {error}");
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

/// Has a process of this very program analyse the file.
fn analysed_elsewhere(path: &Path, last: i64) -> io::Result<Found> {
    // the program as it was started, even if its file was replaced meanwhile
    let itself = Path::new("/proc/self/exe");
    let program = if itself.exists() { itself.to_owned() } else { std::env::current_exe()? };
    let mut child = Command::new(program)
        .arg(COMMAND)
        .arg(path)
        .arg(last.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // it ends when this end of its input is closed: with this process, whatever ends that
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

/// The process that analyses: prints what it found of the file, and ends early when its input is closed.
///
/// # Errors
/// The result cannot be written.
pub fn analyse_for_another(path: &Path, last: i64, out: &mut impl io::Write) -> io::Result<()> {
    // the other cores are for the measuring
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().map_err(io::Error::other)?;
    std::thread::Builder::new().name("wanted still".into()).spawn(|| {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        std::process::exit(0);
    })?;
    serde_json::to_writer(&mut *out, &Found::of(path, last))?;
    out.flush()
}

/// What an analysis depends on: other numbers, other analysis.
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

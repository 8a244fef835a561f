//! What can be said so far: the very analysis of `jointrig analyse`, run anew on what is stored whenever there is more of it, on one thread
//! beside the measuring. When the last hit is in, its numbers are those of `results.json`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::bus::Bus;
use super::message::{Estimate, Message};
use crate::analyse::{AnalyseError, Wanted};
use crate::campaign::store::Store;
use crate::report::figure::Figure;
use crate::report::{self, words::brief};
use crate::results::{Cells, Results};

/// The analysis rests so many times as long as it took: a sixth of one core is the most that it takes from the measuring.
const REST: u32 = 5;
/// The shortest rest: nobody reads faster.
const SHORTEST: Duration = Duration::from_secs(2);
/// Nothing new for so long: nobody is measuring whom it could disturb.
const QUIET: Duration = Duration::from_secs(4);
/// How often it looks whether there is more.
const LOOK: Duration = Duration::from_millis(200);

/// What the newest analysis found, as far as others than the page's estimate ask for it.
#[derive(Debug, Default)]
pub struct Found {
    /// All figures that there is data for.
    pub figures: Vec<Figure>,
    /// How every cell was heard.
    pub cells: Option<Cells>,
}

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

/// Analyses the file as long as it grows, until `stop`.
pub fn form(path: &Path, bus: &Bus, formed: &Formed, stop: &AtomicBool) {
    // what runs side by side in an analysis runs one after the other here: the other cores are for the measuring
    let alone = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(alone) => alone,
        Err(error) => {
            log::error!("the page shows no estimate, because no thread can be had for it: {error}");
            return;
        }
    };
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
        let (estimate, found) = alone.install(|| estimate(path, newest.last));
        let took = begun.elapsed();
        formed.set(found);
        bus.say(Message::Estimate(Box::new(Estimate { took_s: took.as_secs_f64(), ..estimate })));
        rest_until = Instant::now() + (took * REST).max(SHORTEST);
    }
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

fn estimate(path: &Path, last: i64) -> (Estimate, Found) {
    let found = Store::open_read_only(path)
        .map_err(AnalyseError::from)
        .and_then(|store| report::analysed(&store, Wanted::default(), &|_| {}));
    match found {
        Ok(results) => {
            let figures = report::all_figures(&results);
            (of_results(&results, &figures, last), Found { figures, cells: results.cells })
        }
        Err(error) => {
            let missing = vec![error.to_string()];
            let none = Estimate {
                after_record: last,
                hits: 0,
                took_s: 0.0,
                answer: None,
                lines: Vec::new(),
                missing,
                figures: Vec::new(),
            };
            (none, Found::default())
        }
    }
}

fn of_results(results: &Results, figures: &[Figure], last: i64) -> Estimate {
    Estimate {
        after_record: last,
        hits: results.hits.iter().filter(|hit| hit.kept).count(),
        took_s: 0.0,
        answer: results.answer.clone(),
        lines: brief::answer(results).into_iter().map(|line| [line.head, line.text]).collect(),
        missing: results.missing.clone(),
        figures: figures.iter().map(|figure| figure.name).collect(),
    }
}

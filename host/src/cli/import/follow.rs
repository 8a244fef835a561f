//! Imports the files of a folder as they appear there: for systems that write a file for each hit
//! and cannot be read in any other way.
//!
//! The folder is listed several times a second, since this works on every system and on network
//! shares. A file is taken when its size and its times have not changed for a second (`--settle`),
//! so that a file that is being written or copied is left alone; a file that is renamed into place
//! is complete, and waits for the same second. What cannot be imported is named once, and tried
//! again when it changes. Nothing but the campaign file records what was imported: a second run
//! reads all files again, and stores only what is missing.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use super::bad;
use super::folder::{LEFT_OUT, Taken, Wishes, one};
use super::names::{HOW_TO_NAME, Identified, NamedFile, Table, files, identified, is_readable};
use super::records::{Brought, length_notice};
use crate::campaign::plan::{Plan, configuration_name};
use crate::campaign::run::progress;
use crate::campaign::run::tally::Tally;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::verdict::Judgement;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::untrusted_input;
use crate::untrusted_text::tell_line;

/// Time between two looks at the folder.
const LOOK: Duration = Duration::from_millis(200);
/// The pause between two looks is at least this many times as long as a look: listing a large
/// folder on a network share is slow.
const PART: u32 = 5;

/// What changes when a file is written or replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    changed: Option<SystemTime>,
    /// Another file that was renamed into place has another one.
    made: Option<SystemTime>,
}

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let there = std::fs::metadata(path).ok()?;
        Some(Self { bytes: there.len(), changed: there.modified().ok(), made: there.created().ok() })
    }
}

/// What has become of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Standing {
    /// It changed a short time ago, or could not be opened.
    Waiting,
    /// Its content is in the campaign file.
    Taken,
    /// It was not imported, for this reason.
    Refused(String),
    /// It is no file of measurements.
    LeftOut,
}

/// A file of the folder.
#[derive(Clone, Debug)]
struct Seen {
    stamp: Stamp,
    /// Since when it has had this stamp.
    since: Instant,
    standing: Standing,
    /// Whether an earlier content was imported in this run.
    before: bool,
    /// Whether it was said that it cannot be opened.
    said: bool,
}

/// The files of the folder.
#[derive(Default)]
struct Files {
    seen: BTreeMap<PathBuf, Seen>,
    /// Time for which a complete file does not change.
    settle: Duration,
}

impl Files {
    /// Compares the files with those of the last look; returns the complete ones that were not
    /// tried yet, the oldest first.
    fn look(&mut self, there: Vec<(PathBuf, Stamp)>, now: Instant) -> Vec<PathBuf> {
        let mut seen = BTreeMap::new();
        for (path, stamp) in there {
            let own = match self.seen.remove(&path) {
                Some(own) if own.stamp == stamp => own,
                earlier => Seen {
                    stamp,
                    since: now,
                    standing: Standing::Waiting,
                    before: earlier.is_some_and(|own| own.before || own.standing == Standing::Taken),
                    said: false,
                },
            };
            seen.insert(path, own);
        }
        self.seen = seen;
        let is_complete = |own: &Seen| {
            own.standing == Standing::Waiting
                && own.stamp.bytes > 0
                && now.saturating_duration_since(own.since) >= self.settle
        };
        let mut ready: Vec<(Option<SystemTime>, &PathBuf)> = (self.seen.iter())
            .filter(|(_, own)| is_complete(own))
            .map(|(path, own)| (own.stamp.changed, path))
            .collect();
        ready.sort();
        ready.into_iter().map(|(_, path)| path.clone()).collect()
    }

    fn put(&mut self, path: &Path, standing: Standing) {
        if let Some(own) = self.seen.get_mut(path) {
            own.standing = standing;
        }
    }

    /// Tries a file again after another interval; returns whether this is to be said.
    fn defer(&mut self, path: &Path, now: Instant) -> bool {
        self.seen.get_mut(path).is_some_and(|own| {
            own.since = now;
            !std::mem::replace(&mut own.said, true)
        })
    }

    /// Tries what was refused again.
    fn reconsider(&mut self, now: Instant) {
        for own in self.seen.values_mut() {
            if matches!(own.standing, Standing::Refused(_)) {
                (own.standing, own.since) = (Standing::Waiting, now);
            }
        }
    }

    /// The files that may still become complete.
    fn pending(&self) -> impl Iterator<Item = &PathBuf> {
        let is_pending = |path: &Path, own: &Seen| {
            own.standing == Standing::Waiting && own.stamp.bytes > 0 && is_readable(path)
        };
        self.seen.iter().filter(move |(path, own)| is_pending(path, own)).map(|(path, _)| path)
    }
}

/// An import of a folder as it is filled.
struct Following<'f> {
    folder: &'f Path,
    wishes: &'f Wishes<'f>,
    store: Store,
    plan: Plan,
    files: Files,
    /// The stamp of the table of names.
    table: Option<Stamp>,
    /// Summaries of what was used of each file.
    taken: Taken,
    all: Brought,
    /// Files whose hits were stored in this run.
    stored: usize,
    /// Files that an earlier import had stored.
    already: usize,
    /// The last error of reading the folder.
    unreadable: Option<String>,
}

/// Imports every file that appears in `folder` until the campaign is complete or Ctrl-C is pressed.
///
/// # Errors
/// The campaign file or the table of names cannot be used; stopped before the campaign was
/// complete. Files that cannot be imported are no error.
pub(super) fn follow(
    folder: &Path,
    into: &Path,
    wishes: &Wishes<'_>,
    settle: Duration,
) -> Result<(), CliError> {
    wishes.names.map(Table::read).transpose()?;
    if !folder.is_dir() {
        return Err(CliError::Usage(format!(
            "{}: --follow needs the folder into which the files are written",
            folder.display()
        )));
    }
    let store = Store::open(into)?;
    let plan = store.plan()?;
    let stop = Arc::<AtomicBool>::default();
    output::catch(&stop, "file");
    let mut following = Following {
        folder,
        wishes,
        store,
        plan,
        files: Files { settle, ..Files::default() },
        table: wishes.names.and_then(Stamp::of),
        taken: Taken::default(),
        all: Brought::default(),
        stored: 0,
        already: 0,
        unreadable: None,
    };
    let (kept, wanted) = progress::counts(&following.store)?;
    tell_line!(
        "{}: following; a file is taken when it has not changed for {} s; {kept} of {wanted} good hits so far; Ctrl-C ends",
        folder.display(),
        settle.as_secs_f64()
    );
    let complete = following.run(&stop)?;
    following.end(into, complete)
}

impl Following<'_> {
    /// Imports until the campaign is complete and no file is pending, or `stop` is set; returns
    /// whether the campaign is complete.
    fn run(&mut self, stop: &AtomicBool) -> Result<bool, CliError> {
        let mut complete = is_complete(&self.store)?;
        let mut said = false;
        while !stop.load(Ordering::Relaxed) {
            let begun = Instant::now();
            let there = self.list();
            let ready = there.map(|there| self.files.look(there, begun));
            let looked = begun.elapsed();
            let before = (self.stored, self.already);
            for path in ready.iter().flatten() {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                self.take(path)?;
            }
            if self.already > before.1 {
                tell_line!("{} files were stored by an earlier import", self.already - before.1);
            }
            if before != (self.stored, self.already) {
                complete = is_complete(&self.store)?;
            }
            if complete && ready.is_some() {
                let Some(pending) = self.files.pending().next() else { break };
                if !std::mem::replace(&mut said, true) {
                    tell_line!("the campaign is complete; waiting for {}", pending.display());
                }
            }
            std::thread::sleep(LOOK.max(looked * PART));
        }
        Ok(complete)
    }

    /// The files of the folder; `None` where it cannot be read now, which is said once.
    fn list(&mut self) -> Option<Vec<(PathBuf, Stamp)>> {
        let table = self.wishes.names.and_then(Stamp::of);
        if table != self.table {
            self.table = table;
            self.files.reconsider(Instant::now());
        }
        match files(self.folder) {
            Ok(all) => {
                self.unreadable = None;
                // a file that is renamed meanwhile has no stamp
                let all = all.into_iter().filter(|path| !self.is_own(path));
                Some(all.filter_map(|path| Stamp::of(&path).map(|stamp| (path, stamp))).collect())
            }
            Err(error) => {
                let error = error.to_string();
                if self.unreadable.as_ref() != Some(&error) {
                    tell_line!("{error}; trying again");
                }
                self.unreadable = Some(error);
                None
            }
        }
    }

    /// Whether a file of the folder belongs to this import: the table of names, the campaign file
    /// with SQLite's files beside it, and hidden files.
    fn is_own(&self, path: &Path) -> bool {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let campaign = self.store.path().file_name().unwrap_or_default().to_string_lossy();
        let is_table = || {
            let same = |table: &Path| table.canonicalize().ok() == path.canonicalize().ok();
            self.wishes.names.is_some_and(|table| table.file_name() == path.file_name() && same(table))
        };
        name.starts_with('.') || name.starts_with(&*campaign) || is_table()
    }

    /// Imports a file, or says why not.
    ///
    /// # Errors
    /// Those of the campaign file.
    fn take(&mut self, path: &Path) -> Result<(), CliError> {
        // on Windows, a program that writes a file can keep others from reading it
        match untrusted_input::open(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => {
                self.defer(path, &error);
                return Ok(());
            }
            Ok(_) => {}
        }
        let mut verdicts = Vec::new();
        let known = self.taken.different();
        let imported = match self.identify(path) {
            Ok(Some(source)) => {
                let mut tell = |of: &str, hit: u32, verdict: &Judgement| {
                    verdicts.push(format!("{of}: hit {hit}: {} ({})", verdict.kind, verdict.sentence));
                };
                let (store, plan, taken) = (&mut self.store, &self.plan, &mut self.taken);
                one(store, plan, &source, self.wishes, taken, &mut tell).map(|brought| (source.name, brought))
            }
            Ok(None) => {
                tell_line!("{}: {LEFT_OUT}", path.display());
                self.files.put(path, Standing::LeftOut);
                return Ok(());
            }
            Err(error) => Err(error),
        };
        match imported {
            Ok((_, Some(brought))) if brought.already == brought.hits => self.already += 1,
            Ok((name, brought)) => {
                self.taken.tell_from(known);
                for verdict in &verdicts {
                    tell_line!("{verdict}");
                }
                self.stored += 1;
                let (kept, wanted) = progress::counts(&self.store)?;
                if let Some(brought) = brought {
                    tell_line!(
                        "{name}: {} hits, {} good; {kept} of {wanted} good hits in the campaign",
                        brought.hits,
                        brought.kept
                    );
                    self.all.add(&brought);
                }
            }
            Err(CliError::Bad(what) | CliError::Usage(what)) => {
                self.refuse(path, what);
                return Ok(());
            }
            Err(CliError::Read { source, .. }) => {
                self.defer(path, &source);
                return Ok(());
            }
            Err(other) => return Err(other),
        }
        self.files.put(path, Standing::Taken);
        Ok(())
    }

    /// What a file holds; `None` for one that is left out.
    fn identify(&self, path: &Path) -> Result<Option<NamedFile>, CliError> {
        if let Some(table) = self.wishes.names {
            let found = Table::read(table)?.file(self.folder, path)?;
            return found.map(Some).ok_or_else(|| {
                bad(format!("{}: not in {}: add a line for it", path.display(), table.display()))
            });
        }
        let Wishes { configuration, pattern, .. } = *self.wishes;
        match identified(path.into(), self.folder, &self.plan, configuration, pattern)? {
            Identified::Named(source) => Ok(Some(source)),
            Identified::LeftOut => Ok(None),
            Identified::Unnamed => {
                Err(bad(format!("{}: it is not clear what it holds: {HOW_TO_NAME}", path.display())))
            }
        }
    }

    /// Keeps a file aside until it changes, and says why.
    fn refuse(&mut self, path: &Path, what: String) {
        let changed = self.files.seen.get(path).is_some_and(|own| own.before);
        let named = if what.contains(&*path.display().to_string()) {
            what
        } else {
            format!("{}: {what}", path.display())
        };
        let why = if changed {
            format!(
                "{named}\n{}: it has changed after it was imported: raise --settle if it is written with pauses of more than {} s",
                path.display(),
                self.files.settle.as_secs_f64()
            )
        } else {
            named
        };
        tell_line!("{why}");
        tell_line!("{}: not imported; it is tried again when it changes", path.display());
        self.files.put(path, Standing::Refused(why));
    }

    /// Tries a file that cannot be opened again later.
    fn defer(&mut self, path: &Path, error: &std::io::Error) {
        if self.files.defer(path, Instant::now()) {
            tell_line!("{}: {error}; trying again", path.display());
        }
    }

    /// Prints what was done, and closes the campaign file.
    fn end(self, into: &Path, complete: bool) -> Result<(), CliError> {
        for (path, own) in &self.files.seen {
            let why = match &own.standing {
                Standing::Refused(_) => "not imported, for the reason above",
                Standing::Waiting if own.said => "not imported: it could not be opened",
                Standing::Waiting if is_readable(path) => "not imported: it was not complete",
                _ => continue,
            };
            tell_line!("{}: {why}", path.display());
        }
        let (kept, wanted) = progress::counts(&self.store)?;
        self.store.log(&format!(
            "imported {} hits of {} files as they appeared in {}",
            self.all.hits,
            self.stored,
            self.folder.display()
        ))?;
        let length = length_notice(&self.store)?;
        self.store.close()?;
        let there = if self.already > 0 {
            format!("; {} files were stored by an earlier import", self.already)
        } else {
            String::new()
        };
        let mut lines = vec![format!(
            "{}: {} files, {} hits, {} of them good{there}; {kept} of {wanted} good hits in the campaign",
            into.display(),
            self.stored,
            self.all.hits,
            self.all.kept
        )];
        lines.extend(length);
        output::lines(lines)?;
        if complete { Ok(()) } else { Err(bad("stopped before the campaign was complete")) }
    }
}

/// Whether no cell needs more hits; a configuration with imported FRFs needs none.
fn is_complete(store: &Store) -> Result<bool, StoreError> {
    let cells = store.cells()?;
    let tally = Tally::new(&cells, store.rows()?, &store.records()?);
    let frfs = store.frf_rows()?;
    Ok(cells.iter().all(|row| {
        let name = configuration_name(row.cell.configuration);
        !tally.open(row.id) || frfs.iter().any(|frf| frf.configuration == name)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder, looked at every tenth of a second.
    struct Looked {
        files: Files,
        begun: Instant,
    }

    impl Looked {
        fn new() -> Self {
            let files = Files { settle: Duration::from_secs(1), ..Files::default() };
            Self { files, begun: Instant::now() }
        }

        /// Names of the files that are complete at this time, s; each file is a name, its size and
        /// the time of its last change, s.
        fn at(&mut self, time_s: f64, there: &[(&str, u64, u64)]) -> Vec<String> {
            let stamp = |bytes, changed_s| Stamp {
                bytes,
                changed: Some(SystemTime::UNIX_EPOCH + Duration::from_secs(changed_s)),
                made: None,
            };
            let there = there.iter().map(|(name, bytes, changed)| (name.into(), stamp(*bytes, *changed)));
            let now = self.begun + Duration::from_secs_f64(time_s);
            let ready = self.files.look(there.collect(), now);
            ready.iter().map(|path| path.display().to_string()).collect()
        }
    }

    #[test]
    fn a_file_is_complete_when_size_and_time_stay_for_the_interval() {
        let mut folder = Looked::new();
        let none: Vec<String> = Vec::new();
        assert_eq!(folder.at(0.0, &[("a.csv", 10, 1)]), none);
        // it grows, and then only its time changes
        assert_eq!(folder.at(0.9, &[("a.csv", 20, 1)]), none);
        assert_eq!(folder.at(1.8, &[("a.csv", 20, 2)]), none);
        assert_eq!(folder.at(2.7, &[("a.csv", 20, 2), ("empty.csv", 0, 2)]), none);
        assert_eq!(folder.files.pending().count(), 1, "an empty file is nothing to wait for");
        assert_eq!(folder.at(2.8, &[("a.csv", 20, 2), ("empty.csv", 0, 2)]), ["a.csv"]);
        folder.files.put(Path::new("a.csv"), Standing::Taken);
        // once; renamed into place with an old time, it waits as well; the oldest comes first
        let there = [("a.csv", 20, 2), ("b.csv", 9, 1), ("c.csv", 9, 0)];
        assert_eq!(folder.at(9.0, &there), none);
        assert_eq!(folder.at(10.0, &there), ["c.csv", "b.csv"]);
    }

    #[test]
    fn what_was_refused_is_tried_again_when_it_changes() {
        let mut folder = Looked::new();
        folder.at(0.0, &[("a.npz", 10, 1)]);
        assert_eq!(folder.at(1.0, &[("a.npz", 10, 1)]), ["a.npz"]);
        folder.files.put(Path::new("a.npz"), Standing::Refused("cut short".into()));
        assert!(folder.at(5.0, &[("a.npz", 10, 1)]).is_empty());
        assert_eq!(folder.files.pending().count(), 0, "it ends no campaign later");
        assert!(folder.at(6.0, &[("a.npz", 30, 6)]).is_empty());
        assert_eq!(folder.at(7.0, &[("a.npz", 30, 6)]), ["a.npz"]);
        // taken, and written again: that is said
        folder.files.put(Path::new("a.npz"), Standing::Taken);
        folder.at(8.0, &[("a.npz", 40, 8)]);
        assert!(folder.files.seen[Path::new("a.npz")].before);
        // one that cannot be opened is tried after another interval, and named once
        let now = folder.begun + Duration::from_secs(9);
        assert!(folder.files.defer(Path::new("a.npz"), now));
        assert!(!folder.files.defer(Path::new("a.npz"), now));
        assert!(folder.at(9.5, &[("a.npz", 40, 8)]).is_empty());
        assert_eq!(folder.at(10.0, &[("a.npz", 40, 8)]), ["a.npz"]);
        // a file that is gone and comes back is a new one
        folder.at(11.0, &[]);
        assert!(folder.at(12.0, &[("a.npz", 40, 8)]).is_empty());
        // an edited table may name what it did not name before
        folder.files.put(Path::new("a.npz"), Standing::Refused("not in the table".into()));
        folder.files.reconsider(folder.begun + Duration::from_secs(12));
        assert_eq!(folder.at(13.0, &[("a.npz", 40, 8)]), ["a.npz"]);
    }
}

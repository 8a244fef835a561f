//! Hits and levels that were recorded by another system, added to a campaign file: judged like
//! measured ones, and stored with their verdicts under the file's lock, seals and chain.
//!
//! [`add_hits`] takes all channels of the hits of one cell, of any sample type, and [`add_level`]
//! one level of the shaker. Both may be repeated: what an earlier call stored from the same
//! [`Origin`] is not stored again. Where the channels come from is the caller's matter:
//! [`as_recorded`] makes them of force and responses in SI units, [`roles`] finds the role of a
//! channel from its name and the plan.

pub mod as_recorded;
pub mod assign;
pub mod channel_file;
pub mod roles;

use std::collections::HashSet;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::shot::{Phase, Shot};
use sha2::{Digest, Sha256};

use crate::campaign::plan::level::{Held, Level, Moment};
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::campaign::run::shaking::{self, Meter};
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::level_table::{NewLevel, Settled};
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::record_table::{NewRecord, RecordRow};
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::judge::{ByRecord, Judge};
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::channels::ChannelMap;
use crate::device::samples::{SampleType, Samples};
use crate::device::stream::Recording;
use crate::spectra::{Pulse, reversed_peak_n};
use crate::untrusted_input;

/// Why hits or a level were not added. Nothing of the call was stored, except for an error of the
/// campaign file itself.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The plan has no such cell.
    #[error(
        "{} has no cell of configuration `{}`, impact `{}`, response `{}`: `jointrig campaign status --json` lists its cells",
        path.display(), cell[0], cell[1], cell[2]
    )]
    NoCell {
        /// The campaign file.
        path: PathBuf,
        /// Configuration, impact and response.
        cell: [String; 3],
    },
    /// Hits of another file with the same name would count in addition.
    #[error(
        "{}: {hits} good hits of this cell came from another file `{name}` before: --replace drops those and uses these instead",
        path.display()
    )]
    Other {
        /// The campaign file.
        path: PathBuf,
        /// Number of earlier hits that count.
        hits: usize,
        /// The origin's name.
        name: String,
    },
    /// The samples or channels cannot be used.
    #[error("{name}: {what}")]
    Unfit {
        /// The origin's name.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
}

/// Where hits or levels come from: a file, or the arrays of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Its name in the campaign file.
    pub name: String,
    /// Digest of its content, which recognises what was stored before.
    pub digest: String,
}

impl Origin {
    /// A file, which the campaign file will call `name`.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path, name: &str) -> io::Result<Self> {
        Ok(Self { name: name.into(), digest: digest_of_file(path)? })
    }

    /// Content in memory, passed in pieces.
    pub fn of_content<'c>(name: &str, content: impl IntoIterator<Item = &'c [u8]>) -> Self {
        let mut digest = Sha256::new();
        content.into_iter().for_each(|piece| digest.update(piece));
        Self { name: name.into(), digest: written(digest) }
    }

    /// The address of its sessions.
    fn address(&self) -> String {
        format!("file:{}", self.name)
    }

    fn session(&self) -> SessionInfo {
        SessionInfo {
            address: self.address(),
            board: SessionInfo::IMPORTED.into(),
            serial: self.digest.clone(),
            firmware_version: String::new(),
            target: String::new(),
            build: Hex(0),
            schema_hash: Hex(0),
        }
    }

    fn unfit(&self, what: impl Into<String>) -> ImportError {
        ImportError::Unfit { name: self.name.clone(), what: what.into() }
    }
}

fn written(digest: Sha256) -> String {
    format!("sha256:{}", BASE64_STANDARD.encode(digest.finalize()))
}

/// The digest of a file's content, in the form of [`Origin::digest`].
///
/// # Errors
/// The file cannot be read.
pub fn digest_of_file(path: &Path) -> io::Result<String> {
    let (mut file, size) = untrusted_input::open(path)?;
    let (mut digest, mut piece, mut read) = (Sha256::new(), vec![0; 1 << 16], 0u64);
    loop {
        let count = file.read(&mut piece)?;
        read += count as u64;
        if count == 0 || read > size {
            break;
        }
        digest.update(&piece[..count]);
    }
    Ok(written(digest))
}

/// The cell that hits belong to, by the plan's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellName<'n> {
    /// `A`, `B` or `AJB`, or the plan's own name for it.
    pub configuration: &'n str,
    /// The impact's name.
    pub impact: &'n str,
    /// The response location's name.
    pub response: &'n str,
}

/// A hit from elsewhere, with all its channels.
#[derive(Clone, Debug)]
pub struct Hit {
    /// Its number in the origin, which together with the origin's digest identifies it.
    pub number: u32,
    /// The samples of every channel of the map, each of the type in which it came.
    pub samples: Samples,
    /// Index of the scan at which the pulse should begin; the verdict refuses a pulse that begins
    /// elsewhere. `None` takes the beginning of the pulse itself.
    pub trigger_index: Option<usize>,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
    /// Time of the trigger, RFC 3339; `None` where it is unknown, which stores the time of the
    /// import.
    pub utc: Option<String>,
}

impl Hit {
    /// A hit without missing samples, whose time of measurement is unknown.
    pub fn new(number: u32, samples: Samples) -> Self {
        Self { number, samples, trigger_index: None, gaps: Vec::new(), utc: None }
    }
}

/// Result of [`add_hits`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Added {
    /// Hits of the call.
    pub hits: usize,
    /// Good ones among them.
    pub kept: usize,
    /// Those that an earlier call stored already.
    pub already: usize,
    /// Name and sample type of each channel.
    pub types: Vec<String>,
}

/// Judges the hits of one cell like measured ones, and stores those that are not yet present.
///
/// `channels` describes the samples: rate, and for each channel its name, role, quantity, scale
/// (samples in SI units: `units_per_volt` 1, `range_v` 0), delay and bits. There must be a hammer
/// force and the responses of the cell's location in the plan; load cells, specimens, other fixed
/// sensors and auxiliary channels may be there. `replace` drops the good hits that came from
/// another file of the same name. `tell` receives each hit's number and verdict.
///
/// # Errors
/// There is no such cell; channels are missing or do not fit the samples; a value is not a number;
/// a hit has no pulse; the force has the wrong sign in all hits; hits of another file with this
/// name exist and must not be replaced.
pub fn add_hits(
    store: &mut Store,
    origin: &Origin,
    cell: &CellName<'_>,
    channels: &ChannelMap,
    hits: Vec<Hit>,
    replace: bool,
    tell: &mut dyn FnMut(u32, &Judgement),
) -> Result<Added, ImportError> {
    let plan = store.plan()?;
    let (id, cell, attempt) = find(store, cell)?;
    check_channels(&plan, &cell, channels).map_err(|what| origin.unfit(what))?;
    let force = channels.place(Role::HammerForce).ok_or_else(|| origin.unfit(NO_FORCE))?;
    let mut recordings = Vec::new();
    let mut reversed = Vec::new();
    let types = hits.first().map(|hit| hit.samples.types()).unwrap_or_default();
    for hit in hits {
        check_samples(channels, &hit.samples)
            .map_err(|what| origin.unfit(format!("hit {}{what}", hit.number)))?;
        if hit.samples.types() != types {
            return Err(origin.unfit(format!(
                "hit {}: its channels have other sample types than the first hit's: add such hits separately",
                hit.number
            )));
        }
        let force_n = channels.to_si(force, hit.samples.channel(force));
        let pulse = Pulse::locate(&force_n);
        let wrong_way = reversed_peak_n(&force_n);
        if pulse.is_none() && wrong_way.is_none() {
            return Err(origin.unfit(format!("hit {} has no force pulse: remove it", hit.number)));
        }
        reversed.push(wrong_way);
        let utc = hit.utc.clone();
        recordings.push((recording(hit, pulse.as_ref(), channels.fs_hz()), utc));
    }
    if let (Some(peak_n), true) = (reversed.first().copied().flatten(), reversed.iter().all(Option::is_some))
    {
        return Err(origin.unfit(format!(
            "the force's sign is the wrong way round: peak {peak_n:.1} N; a push is positive, so multiply the force by -1"
        )));
    }
    let there = already_there(store, origin, id, replace)?;
    let named = |(channel, of): (&Channel, &SampleType)| format!("{} {}", channel.name, of.name());
    let mut added = Added {
        hits: recordings.len(),
        types: channels.channels.iter().zip(&types).map(named).collect(),
        ..Added::default()
    };
    let mut session = None;
    let mut others = Others::of(plan.response_places(&cell.response, channels).unwrap_or_default());
    let mut next = attempt;
    for (recording, utc) in recordings {
        let number = recording.shot.number;
        let verdict = ByRecord.judge(&cell, &plan, channels, &recording, &others);
        if verdict.kind == Verdict::Good {
            others.learn(&plan, channels, &recording.samples);
            added.kept += 1;
        }
        tell(number, &verdict);
        if there.contains(&number) {
            added.already += 1;
            continue;
        }
        let session = match session {
            Some(session) => session,
            None => *session.insert(session_for(store, origin, channels)?),
        };
        let record = NewRecord {
            cell: id,
            attempt: next,
            session,
            utc: utc.unwrap_or_else(utc_now),
            // the clock behind a stated time is unknown
            utc_error_s: None,
            recording,
            verdict,
        };
        store.insert(&record, &Counters::default())?;
        next += 1;
    }
    Ok(added)
}

/// A level of the shaker from elsewhere.
#[derive(Clone, Debug)]
pub struct NewLevelRecord {
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// Its frequency (or sweep), and the quantity that was held constant with its amplitude.
    pub level: Level,
    /// The samples of every channel of the map, each of the type in which it came.
    pub samples: Samples,
    /// Index of its first sample in the origin, which together with the origin's digest identifies
    /// it.
    pub first_scan: u64,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
}

/// Result of [`add_level`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AddedLevel {
    /// Its id in the campaign file.
    pub id: i64,
    /// Amplitude of the held quantity over the record, m or N; the stated one for a sweep and for a
    /// held drive, whose voltage is no channel.
    pub reached: f64,
    /// Whether an earlier call stored it.
    pub already: bool,
}

/// Stores one level of the shaker if it is not yet present. The amplitude that it reached is
/// measured from its samples; how it settled and the drive's voltage are not known, and stored as
/// 1 (no overshoot), 0 s and 0 V.
///
/// # Errors
/// The channels lack the velocities of both specimens or a load cell along the sliding direction,
/// or do not fit the samples; a value is not a number; the frequency or the amplitude is no
/// positive number.
pub fn add_level(
    store: &mut Store,
    origin: &Origin,
    channels: &ChannelMap,
    new: NewLevelRecord,
) -> Result<AddedLevel, ImportError> {
    let plan = store.plan()?;
    let wrong = |what: String| origin.unfit(format!("level {}: {what}", new.level));
    let level = new.level;
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if ![level.frequency_hz, level.amplitude, level.end_hz.unwrap_or(1.0)].into_iter().all(positive) {
        return Err(wrong("frequency and amplitude must be over 0".into()));
    }
    check_samples(channels, &new.samples).map_err(|what| wrong(format!("record{what}")))?;
    let along = plan.along_sliding(channels.clone());
    shaking::record(&along, &plan.load_cells(&along), &new.samples, &level).map_err(|what| {
        wrong(format!(
            "{what}: a level needs the velocities of both specimens and the load cells; name their channels as the plan does"
        ))
    })?;
    let sessions = store.sessions()?;
    for row in store.levels()?.into_iter().flatten() {
        let own = sessions.iter().any(|(id, info)| *id == row.session && *info == origin.session());
        if own && row.first_scan == new.first_scan && row.level().same(&level) {
            return Ok(AddedLevel { id: row.id, reached: row.reached, already: true });
        }
    }
    let metered = level.end_hz.is_none() && level.held != Held::Drive;
    let reached = if metered {
        Meter::new(&along, level.held, level.frequency_hz).amplitude(&new.samples)
    } else {
        level.amplitude
    };
    let session = session_for(store, origin, channels)?;
    let id = store.insert_level(&NewLevel {
        session,
        moment: new.moment,
        level,
        settled: Settled { reached, overshoot: 1.0, after_s: 0.0, drive_v: 0.0 },
        epoch: 0,
        first_scan: new.first_scan,
        samples: new.samples,
        gaps: new.gaps,
    })?;
    Ok(AddedLevel { id, reached, already: false })
}

/// The cell's id, the cell, and its first free attempt number.
///
/// # Errors
/// [`ImportError::NoCell`], or the file cannot be read.
pub fn find(store: &Store, name: &CellName<'_>) -> Result<(i64, Cell, u32), ImportError> {
    let plan = store.plan()?;
    let configuration =
        plan.configuration(name.configuration).map_or(name.configuration, |own| configuration_name(own));
    let wanted = [configuration, name.impact, name.response];
    let found = store.cells()?.into_iter().find(|row| {
        let Cell { configuration, impact, response, .. } = &row.cell;
        [configuration_name(*configuration), impact, response] == wanted
    });
    let Some(row) = found else {
        return Err(ImportError::NoCell { path: store.path().into(), cell: wanted.map(str::to_owned) });
    };
    let attempts = store.places()?.iter().filter(|r| r.cell == row.id).map(|r| r.attempt + 1).max();
    Ok((row.id, row.cell, attempts.unwrap_or(0)))
}

const NO_FORCE: &str = "no channel is the hammer's force: name it `hammer` or `force`, or state its role";

/// Checks that a cell's hits can be analysed with these channels.
fn check_channels(plan: &Plan, cell: &Cell, channels: &ChannelMap) -> Result<(), String> {
    let mut seen = HashSet::new();
    if let Some(twice) = channels.channels.iter().find(|channel| !seen.insert(channel.name.as_str())) {
        return Err(format!("two channels are called `{}`: rename one", twice.name));
    }
    let rate_hz = channels.fs_hz();
    if !(rate_hz.is_finite() && rate_hz >= 1.0) {
        return Err(format!("the sampling rate is {rate_hz} Hz: 1 Hz or more is needed"));
    }
    if channels.places(Role::HammerForce).len() != 1 {
        return Err(NO_FORCE.into());
    }
    let Some(places) = plan.response_places(&cell.response, channels) else {
        return Err(format!(
            "no channel is a response at `{}`: name them x, y, z, or as the plan names the channels of this location",
            cell.response
        ));
    };
    let axes = plan.response(&cell.response).map_or(3, |point| point.axes().len());
    if places.len() != axes {
        return Err(format!(
            "there are {} responses, and the plan says that the location has {axes} (three axes x, y, z, or `axes` of its own in \
             [[geometry.response]]): change the plan, or average the records with `jointrig frf` and import the FRFs",
            places.len()
        ));
    }
    Ok(())
}

/// Checks that the samples fit the channels, and that all of them are numbers.
fn check_samples(channels: &ChannelMap, samples: &Samples) -> Result<(), String> {
    if samples.channels() != channels.len() {
        return Err(format!(
            " has {} channels, and {} are described: describe each one",
            samples.channels(),
            channels.len()
        ));
    }
    for (channel, own) in channels.channels.iter().zip(samples.each()) {
        if let Some(sample) = own.not_finite() {
            return Err(format!(", {}, sample {sample} is not a number: remove the hit", channel.name));
        }
        if !own.of().units(channel).is_finite() || own.of().units(channel) == 0.0 {
            return Err(format!(
                ", {}: its samples are {} and need a scale (units_per_volt{}) other than 0",
                channel.name,
                own.of().name(),
                if own.of().is_code() { ", range_v" } else { "" }
            ));
        }
    }
    Ok(())
}

/// The session of this origin with these channels; made if it does not exist.
fn session_for(store: &mut Store, origin: &Origin, channels: &ChannelMap) -> Result<i64, StoreError> {
    // the file keeps no id of a map
    let (info, own) = (origin.session(), ChannelMap { id: 0, ..channels.clone() });
    for (id, there) in store.sessions()? {
        if there == info && store.channels_as_measured(id)? == own {
            return Ok(id);
        }
    }
    store.begin_session(&info, channels)
}

/// The hits of exactly this origin that the cell contains; those of another one with the same name
/// are dropped, or refused.
fn already_there(
    store: &Store,
    origin: &Origin,
    cell: i64,
    replace: bool,
) -> Result<HashSet<u32>, ImportError> {
    let sessions = store.sessions()?;
    let imported = |row: &RecordRow| {
        let own = sessions.iter().find(|(id, _)| *id == row.session).map(|(_, info)| info);
        own.filter(|info| info.board == SessionInfo::IMPORTED)
    };
    let rows: Vec<RecordRow> = store.records_of(cell)?.into_iter().flatten().collect();
    let (mut same, mut older) = (HashSet::new(), Vec::new());
    for row in &rows {
        match imported(row) {
            Some(info) if info.serial == origin.digest => {
                same.insert(row.shot.number);
            }
            Some(info) if info.address == origin.address() && row.kept() => older.push(row.id),
            _ => {}
        }
    }
    if !older.is_empty() && !replace {
        return Err(ImportError::Other {
            path: store.path().into(),
            hits: older.len(),
            name: origin.name.clone(),
        });
    }
    for record in older {
        store.overrule(
            record,
            Verdict::Dropped,
            &format!("replaced by {} ({})", origin.name, origin.digest),
        )?;
    }
    Ok(same)
}

fn recording(hit: Hit, pulse: Option<&Pulse>, fs_hz: f64) -> Recording {
    let start = pulse.map_or(0, |pulse| pulse.start);
    let trigger = hit.trigger_index.unwrap_or(start);
    Recording {
        epoch: 0,
        first_scan: 0,
        trigger_index: trigger,
        samples: hit.samples,
        gaps: hit.gaps,
        shot: shot(
            hit.number,
            trigger,
            pulse.map_or(0.0, |pulse| pulse.peak_n),
            pulse.map_or(0.0, |pulse| pulse.width() as f64 / fs_hz),
        ),
    }
}

/// The report on a hit that no controller made: its number, the index of its trigger in the record,
/// its peak, N, and the pulse's width, s. The width determines how much of the record before the
/// trigger is needed.
pub(crate) fn shot(number: u32, trigger_index: usize, peak_n: f64, width_s: f64) -> Shot {
    Shot {
        number,
        phase: Phase::Done,
        fired_at: 0,
        trigger: trigger_index as u64,
        pulse_us: 0,
        peak_n: peak_n as f32,
        width_us: (1e6 * width_s) as f32,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    }
}

//! Impact records in universal files: time responses (function type 1), one hit after another.
//!
//! A function whose ordinate is a force begins a hit; the motions that follow it, up to the next
//! force, are its responses. Labels and data set 164 give the units. A response whose first sample
//! is later than the force's is aligned in time by whole samples; the remainder is stored as its
//! delay.

use super::frf_uff::label;
use super::labelled_frf::Label;
use super::labelled_frf::axis_name;
use super::other_formats::Contents as Wanted;
use super::record_file::{Directions, RecordFile};
use super::record_npz::{MOST_CHANNELS, MOST_HITS, read_records};
use super::uff::{Contents, Dof, Function, Values, kind, quantity};
use super::uff_axes::{
    Places, Sampling, Scale, UnitSystem, force_scale, motion_scale, time_scale, type_name, with_units,
};
use super::units::{Dimension, StatedUnits, Unit, told};
use super::{FrfUffError, NpzError, frf_file, frf_uff};
use crate::spectra::{ImpactRecords, MotionQuantity};
use std::collections::HashMap;
use std::path::Path;

/// Why impact records could not be read from a file.
#[derive(Debug, thiserror::Error)]
pub enum RecordFileError {
    /// The file cannot be read, or has another program's format.
    #[error(transparent)]
    Open(#[from] frf_file::FrfFileError),
    /// It is an npz file without impact records.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// It is not an npz file, and as a universal file it holds no impact records.
    #[error(transparent)]
    Uff(#[from] FrfUffError),
}

/// Reads impact records from an npz or a universal file. `stated` units override the file's.
///
/// # Errors
/// [`RecordFileError`] with the file and what is wrong in it.
pub fn read_record_file(path: &Path, stated: &StatedUnits) -> Result<RecordFile, RecordFileError> {
    if frf_file::is_npz(path)? {
        return Ok(read_records(path, stated)?);
    }
    let contents = record_contents(path)?;
    Ok(from_contents(&contents, stated)
        .map_err(|reason| FrfUffError::Content { path: path.into(), reason })?)
}

/// Reads the functions of a universal file that may hold records.
///
/// # Errors
/// The file cannot be read, or has another program's format.
pub fn record_contents(path: &Path) -> Result<Contents, RecordFileError> {
    frf_file::refuse_other_formats(path, Wanted::Records)?;
    Ok(frf_uff::contents(path)?)
}

/// Records of one impact point and one sensor, with the names from their labels.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledRecords {
    /// The impact point: the force's entity, or its node.
    pub impact: String,
    /// The sensor.
    pub response: String,
    /// The hits.
    pub read: RecordFile,
}

/// A signal of a hit, and the units that its file gives for it.
#[derive(Clone)]
struct Signal<'c> {
    function: &'c Function,
    values: &'c [f64],
    system: Option<UnitSystem>,
}

/// A hit: the force first, then the responses.
type HitFunctions<'c> = Vec<Signal<'c>>;

/// Extracts the impact records from the contents of a universal file.
///
/// # Errors
/// What is wrong, in words.
pub fn from_contents(contents: &Contents, stated: &StatedUnits) -> Result<RecordFile, String> {
    let (hits, notes) = hits(contents)?;
    let read = records(&hits, stated)?;
    Ok(RecordFile { notes: [notes, read.notes].concat(), ..read })
}

/// As [`from_contents`], but separated by impact point and sensor, which the labels name: a hit
/// that several sensors measured goes into one row per sensor. A label is named by its entity if
/// `is_known` accepts it, else by its entity without the axis that it may end with (`1+X`).
///
/// # Errors
/// What is wrong, in words; also a label that names neither entity nor node.
pub fn by_label(
    contents: &Contents,
    stated: &StatedUnits,
    is_known: &dyn Fn(&str) -> bool,
) -> Result<(Vec<LabelledRecords>, Vec<String>), String> {
    let (hits, notes) = hits(contents)?;
    let mut rows: Vec<(String, String, Vec<HitFunctions<'_>>)> = Vec::new();
    let mut row_of: HashMap<(String, String), usize> = HashMap::new();
    let named = |dof: &Dof| {
        name_of(dof).map(|Label { entity, name, .. }| if is_known(&entity) { entity } else { name })
    };
    for (number, hit) in hits.iter().enumerate() {
        let force = &hit[0];
        let impact = named(&force.function.response)
            .ok_or_else(|| format!("the force of hit {number} names neither entity nor node"))?;
        let mut own: Vec<(String, HitFunctions<'_>)> = Vec::new();
        for response in &hit[1..] {
            let name = named(&response.function.response)
                .ok_or_else(|| format!("a response of hit {number} names neither entity nor node"))?;
            match own.iter_mut().find(|(known, _)| *known == name) {
                Some((_, functions)) => functions.push(response.clone()),
                // linear search: a hit has at most as many responses as a rig has sensors
                None => own.push((name, vec![force.clone(), response.clone()])),
            }
        }
        for (response, functions) in own {
            let row = *row_of.entry((impact.clone(), response.clone())).or_insert_with(|| {
                rows.push((impact.clone(), response, Vec::new()));
                rows.len() - 1
            });
            rows[row].2.push(functions);
        }
    }
    let labelled = rows.into_iter().map(|(impact, response, hits)| {
        let read = records(&hits, stated).map_err(|what| format!("{impact} to {response}: {what}"))?;
        Ok(LabelledRecords { impact, response, read })
    });
    Ok((labelled.collect::<Result<_, String>>()?, notes))
}

/// Whether the contents include a force over time, that is impact records and not FRFs.
pub fn holds_records(contents: &Contents) -> bool {
    contents.functions().any(|f| f.kind == kind::TIME && is_force(f))
}

/// Whether a function's ordinate is a force: by its type, or by its unit where the type is unknown.
fn is_force(f: &Function) -> bool {
    let axis = &f.axes[1];
    match axis.quantity {
        quantity::FORCE => true,
        quantity::UNKNOWN => {
            told(&axis.unit).is_some_and(|label| Unit::parse(label, &[Dimension::FORCE]).is_ok())
        }
        _ => false,
    }
}

/// The label of a place; `None` where it names neither entity nor node.
fn name_of(dof: &Dof) -> Option<Label> {
    let own = label(dof);
    (!own.entity.is_empty() || dof.node != 0).then_some(own)
}

fn hits(contents: &Contents) -> Result<(Vec<HitFunctions<'_>>, Vec<String>), String> {
    let notes = frf_uff::left_out(contents);
    let mut hits: Vec<HitFunctions<'_>> = Vec::new();
    let mut before = 0;
    for (function, system) in with_units(contents)? {
        let (kind::TIME, Values::Real(values)) = (function.kind, &function.values) else { continue };
        let full = hits.len() == MOST_HITS;
        let signal = Signal { function, values, system };
        match (is_force(function), hits.last_mut()) {
            (true, _) if full => {
                return Err(format!("it has more than {MOST_HITS} hits: split the file"));
            }
            (_, Some(hit)) if hit.len() > MOST_CHANNELS => {
                return Err(format!(
                    "a force is followed by more than {MOST_CHANNELS} responses: every hit begins with its force"
                ));
            }
            (true, _) => hits.push(vec![signal]),
            (false, Some(hit)) => hit.push(signal),
            (false, None) => before += 1,
        }
    }
    match (hits.is_empty(), before) {
        (false, 0) => Ok((hits, notes)),
        (false, _) => {
            Err("a time response comes before the first force: every hit begins with its force".into())
        }
        (true, 0) => {
            let why = notes.first().map_or_else(String::new, |w| format!(" ({w})"));
            Err(format!(
                "there is no force over time in it (data set 58 of function type 1 with an ordinate of type 13){why}: give an npz of impact records, or a universal file with time responses"
            ))
        }
        (true, signals) => Err(format!(
            "there is no force among its {signals} time responses (an ordinate of type 13): an FRF needs the hammer's force, \
             before the responses of each hit"
        )),
    }
}

/// Combines hits with the same force point and the same responses.
fn records(hits: &[HitFunctions<'_>], stated: &StatedUnits) -> Result<RecordFile, String> {
    let Some(first) = hits.first() else { return Err("there is no hit".into()) };
    let (channels, samples) = (first.len() - 1, first[0].values.len());
    let quantity = motion(hits, stated)?;
    let mut words: Vec<String> = Vec::new();
    let mut add = |word: Option<String>| {
        if let Some(word) = word.filter(|word| words.len() < MOST_WORDS && !words.contains(word)) {
            words.push(word);
        }
    };
    let mut timing = Timing::default();
    let mut scaled = (Vec::new(), Vec::new());
    let struck = |hit: &HitFunctions<'_>| {
        let Label { entity, name, direction } = label(&hit[0].function.response);
        (if entity.is_empty() { name } else { entity }, direction)
    };
    for (number, hit) in hits.iter().enumerate() {
        if struck(hit) != struck(first) {
            let words = |(name, direction): (String, i64)| {
                axis_name(direction).map_or(name.clone(), |axis| format!("{name} along {axis}"))
            };
            return Err(format!(
                "by its label hit {number} is at {}, the first one at {}: split the file, or import its folder, which takes cells from labels",
                words(struck(hit)),
                words(struck(first))
            ));
        }
        if hit.len() - 1 != channels {
            return Err(format!("hit {number} has {} responses, the first one {channels}", hit.len() - 1));
        }
        let hit = in_order_of(first, hit).ok_or_else(|| {
            format!(
                "hit {number} has other sensors or axes than the first one, by its labels: split the file"
            )
        })?;
        for (place, signal) in hit.iter().enumerate() {
            let of = |what: String| format!("hit {number}, {}: {what}", named(place, signal));
            let (factor, word) = time_scale(&signal.function.axes[0], stated).map_err(of)?;
            add(word);
            let sampling =
                Sampling::of(&Places::of(signal.function, factor), signal.values.len()).map_err(of)?;
            if signal.values.len() != samples || !timing.same_rate(&sampling) {
                return Err(format!("hit {number} has another sampling rate or length than the first one"));
            }
            timing.add(place, sampling).map_err(of)?;
        }
        let (force, responses) = (hit[0], &hit[1..]);
        let of = |what: String| format!("hit {number}, the force: {what}");
        let (of_force, unit) = force_scale(force.function, force.system.as_ref(), stated).map_err(of)?;
        let mut own = Vec::new();
        for (place, signal) in responses.iter().enumerate() {
            let of = |what: String| format!("hit {number}, {}: {what}", named(place + 1, signal));
            let Scale { factor, quantity: found, words, .. } =
                motion_scale(signal.function, signal.system.as_ref(), stated).map_err(of)?;
            if found != quantity {
                return Err(of(format!("it is {}, the first response {}", found.name(), quantity.name())));
            }
            add(Some(words));
            own.push((factor, signal.values));
        }
        add(Some(format!("force in {unit}")));
        scaled.0.push((of_force, force.values));
        scaled.1.push(own);
    }
    let (fs_hz, cut, delay_s, note) = timing.in_step(samples)?;
    let signal = |(factor, values): &(f64, &[f64]), from: usize| -> Vec<f64> {
        values[from..from + cut.samples].iter().map(|v| factor * v).collect()
    };
    let records = ImpactRecords {
        fs_hz,
        force_n: scaled.0.iter().map(|own| signal(own, cut.from[0])).collect(),
        response: scaled
            .1
            .iter()
            .map(|hit| hit.iter().zip(&cut.from[1..]).map(|(own, from)| signal(own, *from)).collect())
            .collect(),
        quantity,
    };
    let direction = |signal: &Signal<'_>| label(&signal.function.response).direction;
    let directions =
        Directions { force: direction(&first[0]), responses: first[1..].iter().map(direction).collect() };
    Ok(RecordFile {
        records,
        delay_s,
        directions,
        taken: words.join(", "),
        notes: note.into_iter().collect(),
    })
}

/// Most units listed for one file.
const MOST_WORDS: usize = 8;

fn named(place: usize, signal: &Signal<'_>) -> String {
    match (place, name_of(&signal.function.response)) {
        (0, _) => "the force".into(),
        (_, Some(own)) => {
            format!("the response `{}`", if own.entity.is_empty() { own.name } else { own.entity })
        }
        (_, None) => format!("response {place}"),
    }
}

/// The signals of a hit in the order of the first hit's, by their labels. If the first hit's labels
/// are not distinct, the order is kept. `None` if the first hit has a label that this hit lacks.
fn in_order_of<'h, 'c>(first: &[Signal<'_>], hit: &'h [Signal<'c>]) -> Option<Vec<&'h Signal<'c>>> {
    let place = |signal: &Signal<'_>| signal.function.response.clone();
    let is_own = |i: usize| !first[1..i].iter().any(|before| place(before) == place(&first[i]));
    let is_told = (1..first.len()).all(is_own);
    let same = first.iter().zip(hit).skip(1).all(|(own, other)| place(own) == place(other));
    if same || !is_told {
        return Some(hit.iter().collect());
    }
    let mut order = vec![hit.first()?];
    for own in &first[1..] {
        order.push(hit[1..].iter().find(|other| place(other) == place(own))?);
    }
    Some(order)
}

/// When the signals of all hits were sampled.
#[derive(Default)]
struct Timing {
    /// The sampling of the first hit's signals, the force first.
    first: Vec<Sampling>,
    /// The sampling of the force in the hit being read.
    force: Option<Sampling>,
    /// The sampling with the smallest error of its rate so far.
    rate: Option<Sampling>,
}

/// The samples that are kept of each signal.
struct Cut {
    /// First sample kept of each signal, the force's first.
    from: Vec<usize>,
    samples: usize,
}

/// Rates that differ by less than this, relative and beyond their printed digits, are equal.
const SAME_RATE: f64 = 1e-6;
/// Starts that differ by less than this part of a sample, beyond their printed digits, are equal.
const SAME_START: f64 = 1e-3;

impl Timing {
    fn same_rate(&self, own: &Sampling) -> bool {
        self.rate.is_none_or(|known| {
            (known.fs_hz - own.fs_hz).abs() <= known.fs_error + own.fs_error + SAME_RATE * known.fs_hz
        })
    }

    /// Adds the signal at `place` of a hit; the force has place 0 and is added first.
    fn add(&mut self, place: usize, own: Sampling) -> Result<(), String> {
        if self.rate.is_none_or(|known| own.fs_error < known.fs_error) {
            self.rate = Some(own);
        }
        if place == 0 {
            self.force = Some(own);
        }
        let Some(force) = self.force else { return Ok(()) };
        if self.first.len() <= place {
            self.first.push(own);
            return Ok(());
        }
        let (late, known) = (own.start_s - force.start_s, self.first[place].start_s - self.first[0].start_s);
        let error =
            [own, force, self.first[place], self.first[0]].map(|s| s.start_error_s).iter().sum::<f64>();
        if (late - known).abs() > error + SAME_START / own.fs_hz {
            return Err(format!(
                "it starts {late:e} s after its force, and in the first hit {known:e} s: cut the records alike"
            ));
        }
        Ok(())
    }

    /// The rate, the samples kept of each signal so that all begin together, the remaining delay of
    /// each response, s, and a note if a response started at another time than the force.
    fn in_step(&self, samples: usize) -> Result<(f64, Cut, Vec<f64>, Option<String>), String> {
        let (Some(force), Some(rate)) = (self.first.first(), self.rate) else {
            return Err("there is no hit".into());
        };
        let step_s = 1.0 / rate.fs_hz;
        let late_s: Vec<f64> = self.first[1..]
            .iter()
            .map(|own| {
                let late = own.start_s - force.start_s;
                let is_printed = late.abs() <= own.start_error_s + force.start_error_s;
                if is_printed { 0.0 } else { late }
            })
            .collect();
        let whole: Vec<f64> = late_s.iter().map(|late| (late / step_s).round()).collect();
        // the signal that begins last is used from its first sample on
        let last = whole.iter().copied().fold(0.0, f64::max);
        let cut = |own: f64| last - own;
        let most = whole.iter().copied().map(cut).fold(cut(0.0), f64::max);
        if most >= samples as f64 {
            return Err(format!(
                "a response starts {:e} s from its force, which is longer than the record: they do not belong to one hit",
                most * step_s
            ));
        }
        let from = std::iter::once(0.0).chain(whole.iter().copied()).map(|own| cut(own) as usize).collect();
        // what is left within the printed digits of the two starts and of the step is no delay
        let step_error_s = rate.fs_error * step_s * step_s;
        let delay_s: Vec<f64> = (self.first[1..].iter().zip(&late_s).zip(&whole))
            .map(|((own, late), whole)| {
                let rest = whole * step_s - late;
                let starts = own.start_error_s + force.start_error_s + 1e-9 * step_s;
                let error = starts + whole.abs() * step_error_s;
                if rest.abs() <= error { 0.0 } else { rest }
            })
            .collect();
        let largest = late_s.iter().copied().fold(0.0, |m: f64, v| if v.abs() > m.abs() { v } else { m });
        let note = (largest != 0.0).then(|| {
            format!("a response starts {largest:e} s after the force by its abscissa: it is put in step")
        });
        Ok((rate.fs_hz, Cut { from, samples: samples - most as usize }, delay_s, note))
    }
}

/// The quantity that all responses measure: by their types or, where the type is unknown, by their
/// unit.
fn motion(hits: &[HitFunctions<'_>], stated: &StatedUnits) -> Result<MotionQuantity, String> {
    let mut found: Vec<i64> = Vec::new();
    for signal in hits.iter().flat_map(|hit| &hit[1..]) {
        let axis = &signal.function.axes[1];
        let unit = stated.response.as_deref().or(told(&axis.unit));
        let by_unit = |wanted| unit.is_some_and(|label| Unit::parse(label, &[wanted]).is_ok());
        let quantity = match axis.quantity {
            quantity::UNKNOWN if by_unit(Dimension::ACCELERATION) => quantity::ACCELERATION,
            quantity::UNKNOWN if by_unit(Dimension::VELOCITY) => quantity::VELOCITY,
            quantity::UNKNOWN if by_unit(Dimension::DISPLACEMENT) => quantity::DISPLACEMENT,
            own => own,
        };
        // a few are enough: two different quantities are already an error
        if found.len() < 4 && !found.contains(&quantity) {
            found.push(quantity);
        }
    }
    match found[..] {
        [quantity::DISPLACEMENT] => Ok(MotionQuantity::Displacement),
        [quantity::VELOCITY] => Ok(MotionQuantity::Velocity),
        [quantity::ACCELERATION] => Ok(MotionQuantity::Acceleration),
        [] => Err("no response follows the force".into()),
        [only] => Err(format!(
            "the responses' ordinates are of type {}: 8 (displacement), 11 (velocity) or 12 (acceleration) is needed",
            type_name(only)
        )),
        _ => Err(format!(
            "the responses' ordinates are of type {found:?}: all must be 8 (displacement), 11 (velocity) or 12 (acceleration)"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::super::uff::{Abscissa, Axis, DataSet, read, write};
    use super::super::uff_output::write_records;
    use super::*;

    fn records() -> ImpactRecords {
        let signal = |seed: usize| (0..64).map(|i| ((i * 37 + seed * 11) % 101) as f64 * 1e-3).collect();
        ImpactRecords {
            fs_hz: 51_200.0,
            force_n: (0..3).map(signal).collect(),
            response: (0..3).map(|hit| (0..3).map(|axis| signal(10 * hit + axis + 3)).collect()).collect(),
            quantity: MotionQuantity::Velocity,
        }
    }

    #[test]
    fn what_was_exported_comes_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("cell.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let read = read_record_file(&path, &StatedUnits::default()).expect("read");
        assert_eq!((read.records, read.notes), (records(), Vec::new()));
        assert_eq!((read.delay_s, read.taken.as_str()), (vec![0.0; 3], "velocity in m/s, force in N"));
    }

    #[test]
    fn one_hit_that_two_sensors_heard_fills_two_rows() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("row.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let mut contents = read(&std::fs::read(&path).expect("there"));
        // after each hit's responses, add those of a second sensor that has only a node number
        let mut sets = Vec::new();
        for set in contents.sets.drain(..) {
            let DataSet::Function(function) = set else {
                sets.push(set);
                continue;
            };
            let mut other = function.clone();
            other.response = Dof { entity: String::new(), node: 7, direction: function.response.direction };
            let is_force = function.axes[1].quantity == quantity::FORCE;
            sets.push(DataSet::Function(function));
            if !is_force {
                sets.push(DataSet::Function(other));
            }
        }
        contents.sets = sets;
        assert!(holds_records(&contents));
        let (rows, _) = by_label(&contents, &StatedUnits::default(), &|_| false).expect("read");
        let names: Vec<_> = rows.iter().map(|row| (&*row.impact, &*row.response)).collect();
        assert_eq!(names, [("AZ1", "A1"), ("AZ1", "7")]);
        assert_eq!((&rows[0].read.records, &rows[1].read.records), (&records(), &records()));
    }

    #[test]
    fn axes_are_put_in_order_and_turned_and_what_is_no_record_is_said() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("cell.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let mut contents = read(&std::fs::read(&path).expect("there"));
        let change = |contents: &mut Contents, at: usize, change: &dyn Fn(&mut Function)| {
            let functions = contents.sets.iter_mut().filter_map(|set| match set {
                DataSet::Function(f) => Some(f),
                _ => None,
            });
            functions.skip(at).take(1).for_each(|f| change(f));
        };
        // x and z are exchanged, and one of them has the opposite sign
        for hit in 0..3 {
            change(&mut contents, 4 * hit + 1, &|f| f.response.direction = -3);
            change(&mut contents, 4 * hit + 3, &|f| f.response.direction = 1);
        }
        let from_contents = |contents: &Contents| from_contents(contents, &StatedUnits::default());
        let read = from_contents(&contents).expect("read").along_axes();
        let turned: Vec<f64> = records().response[0][0].iter().map(|v| -v).collect();
        let found = &read.records.response[0];
        assert_eq!((&found[0], &found[2]), (&records().response[0][2], &turned));
        assert!(read.taken.ends_with("response along −z turned"), "{}", read.taken);
        assert!(write(&contents.sets).is_ok());
        change(&mut contents, 2, &|f| {
            f.axes[1] = Axis { quantity: quantity::ACCELERATION, ..Axis::default() }
        });
        assert!(from_contents(&contents).expect_err("two quantities").contains("[11, 12]"));
        change(&mut contents, 2, &|f| f.kind = kind::PSD);
        assert!(from_contents(&contents).expect_err("one response less").contains("hit 1 has 3 responses"));
        change(&mut contents, 0, &|f| f.axes[1].quantity = quantity::VELOCITY);
        assert!(from_contents(&contents).expect_err("no force").contains("before the first force"));
        for force in [4, 8] {
            change(&mut contents, force, &|f| f.axes[1].quantity = quantity::VELOCITY);
        }
        assert!(from_contents(&contents).expect_err("none").contains("there is no force among its 11"));
        assert!(from_contents(&Contents::default()).expect_err("nothing").contains("type 13"));
    }

    /// What was exported, each function changed according to its hit and its place in it.
    fn changed(mut change: impl FnMut(usize, usize, &mut Function)) -> Contents {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("cell.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let mut contents = read(&std::fs::read(&path).expect("there"));
        let mut at = 0;
        for set in &mut contents.sets {
            if let DataSet::Function(function) = set {
                change(at / 4, at % 4, function);
                at += 1;
            }
        }
        contents
    }

    fn taken(contents: &Contents) -> Result<RecordFile, String> {
        from_contents(contents, &StatedUnits::default())
    }

    fn times(f: &mut Function, factor: f64) {
        if let Values::Real(values) = &mut f.values {
            for v in values {
                *v *= factor;
            }
        }
    }

    #[test]
    fn units_of_force_response_and_time_are_applied() {
        let contents = changed(|_, place, f| {
            let (unit, factor) = if place == 0 { ("lbf", 1.0 / 4.448_221_615_260_5) } else { ("mm/s", 1e3) };
            f.axes[1].unit = unit.into();
            times(f, factor);
            f.axes[0].unit = "ms".into();
            f.abscissa = Abscissa::Even { start: 0.0, step: 1e3 / 51_200.0 };
        });
        // the file's data set 164 states SI, which contradicts these labels
        let said = taken(&contents).expect_err("a contradiction");
        assert!(said.contains("`lbf`") && said.contains("data set 164"), "{said}");
        let mut without = contents.clone();
        without.sets.retain(|set| set.number() == 58);
        let read = taken(&without).expect("units");
        assert_eq!(read.taken, "time in ms, velocity in mm/s, force in lbf");
        assert!((read.records.fs_hz / 51_200.0 - 1.0).abs() < 1e-12);
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(&read.records.force_n[1], &records().force_n[1]));
        assert!(near(&read.records.response[2][1], &records().response[2][1]));
        let stated = "response=mm/s,force=lbf,time=ms".parse().expect("units");
        assert_eq!(from_contents(&contents, &stated).expect("stated").records, read.records);
        let volts = changed(|_, place, f| {
            if place == 0 {
                f.axes[1].unit = "mV".into();
            }
        });
        let said = taken(&volts).expect_err("no force");
        assert!(said.contains("`mV`") && said.contains("sensitivity"), "{said}");
    }

    #[test]
    fn a_response_that_starts_later_is_put_in_step_by_samples_and_a_delay() {
        let step = 1.0 / 51_200.0;
        let late = |parts: [f64; 3]| {
            changed(move |_, place, f| {
                if place > 0 {
                    f.abscissa = Abscissa::Even { start: parts[place - 1] * step, step };
                }
            })
        };
        let read = taken(&late([0.25, 0.0, 2.0])).expect("read");
        assert_eq!(read.records.force_n[0], records().force_n[0][2..]);
        assert_eq!(read.records.response[0][0], records().response[0][0][2..]);
        assert_eq!(read.records.response[0][2], records().response[0][2][..62]);
        assert!(
            (read.delay_s[0] + 0.25 * step).abs() < 1e-12 && read.delay_s[1..] == [0.0, 0.0],
            "{:?}",
            read.delay_s
        );
        assert!(read.notes[0].contains("after the force"), "{:?}", read.notes);
        let read = taken(&late([-1.0, -1.0, -1.0])).expect("read");
        assert_eq!(read.records.force_n[0], records().force_n[0][..63]);
        assert_eq!(read.records.response[0][1], records().response[0][1][1..]);
        assert!(taken(&late([64.0, 0.0, 0.0])).expect_err("beyond").contains("longer than the record"));
        // all begin before the trigger: no delay
        let together = changed(|_, _, f| f.abscissa = Abscissa::Even { start: -0.01, step });
        let read = taken(&together).expect("read");
        assert_eq!((read.records, read.delay_s), (records(), vec![0.0; 3]));
        let one_hit = changed(|hit, place, f| {
            if hit == 1 && place == 2 {
                f.abscissa = Abscissa::Even { start: 0.5 * step, step };
            }
        });
        assert!(taken(&one_hit).expect_err("one of three").contains("hit 1, the response `A1`"));
    }

    #[test]
    fn listed_times_and_printed_steps_are_the_rate_they_were() {
        let listed = changed(|hit, _, f| {
            f.abscissa = match hit {
                0 => Abscissa::Uneven((0..64).map(|i| f64::from(i) / 51_200.0).collect()),
                1 => Abscissa::Even { start: 0.0, step: 1.953_12e-5 },
                _ => Abscissa::Uneven(
                    (0..64)
                        .map(|i| format!("{:.5e}", f64::from(i) / 51_200.0).parse().expect("a number"))
                        .collect(),
                ),
            }
        });
        let read = taken(&listed).expect("one rate");
        assert_eq!((read.records, read.delay_s), (records(), vec![0.0; 3]));
        let other = changed(|hit, _, f| {
            if hit == 2 {
                f.abscissa = Abscissa::Even { start: 0.0, step: 1.953_3e-5 };
            }
        });
        assert!(taken(&other).expect_err("another rate").contains("hit 2 has another sampling rate"));
    }

    #[test]
    fn hits_keep_their_sensors_whatever_the_order_of_their_functions() {
        let mut contents = changed(|_, _, _| ());
        let functions = contents.sets.iter().position(|set| set.number() == 58).expect("functions");
        contents.sets.swap(functions + 5, functions + 7);
        assert_eq!(taken(&contents).expect("the labels tell").records, records());
        let elsewhere = changed(|hit, place, f| {
            if (hit, place) == (1, 2) {
                f.response.entity = "A2".into();
            }
        });
        assert!(taken(&elsewhere).expect_err("another sensor").contains("hit 1 has other sensors"));
        let struck = changed(|hit, place, f| {
            if (hit, place) == (2, 0) {
                f.response.entity = "AZ2".into();
            }
        });
        assert!(taken(&struck).expect_err("another place").contains("hit 2 is at AZ2, the first one at AZ1"));
    }
}

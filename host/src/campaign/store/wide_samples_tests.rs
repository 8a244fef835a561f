//! Records of any width: through the file, from a file of version 2, and what 24 bits are worth.

use super::codec::bits;
use super::record_table::NewRecord;
use super::record_table::tests::{self, info, rows};
use super::session_table::Counters;
use super::{Store, codec};
use crate::campaign::plan::SMALL;
use crate::campaign::recheck::recheck;
use crate::campaign::verdict::Verdict;
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, SampleType, Samples};
use crate::device::stream::Recording;
use crate::spectra::{CrossSpectra, Pulse, Summing, Windowing};
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use num_complex::Complex;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// A force and an acceleration with these full scales, of a converter of `bits`.
fn map(full_scale: [f64; 2], bits: u8) -> ChannelMap {
    let channel = |name: &str, role, quantity, full: f64| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity,
        units_per_volt: (full / 10.0) as f32,
        range_v: 10.0,
        delay_ns: 0,
        bits,
    };
    let channels = vec![
        channel("force", Role::HammerForce, Quantity::Force, full_scale[0]),
        channel("z", Role::Response(Axis::Z), Quantity::Acceleration, full_scale[1]),
    ];
    ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels }
}

fn session(store: &mut Store, map: &ChannelMap) -> i64 {
    store.begin_session(&info(), map).expect("noted")
}

/// A good record without gaps.
fn record(attempt: u32, session: i64, samples: Samples) -> NewRecord {
    let mut new = tests::record(1, attempt, session, Verdict::Good);
    new.recording = Recording { trigger_index: 0, samples, gaps: vec![], ..new.recording };
    new
}

fn folder() -> tempfile::TempDir {
    // in memory if there is such a folder: otherwise the transactions wait for a disk
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).expect("a folder")
}

#[test]
fn samples_of_any_types_come_back_from_the_file_and_every_flipped_bit_is_found() {
    let folder = folder();
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let session = session(&mut store, &map([50.0, 30.0], 24));
    let any = (1..60_usize).prop_flat_map(|scans| prop::collection::vec(codec::any_channel(scans), 1..5));
    let (mut runner, mut all) = (TestRunner::deterministic(), Vec::new());
    for attempt in 0..60 {
        let channels = any.new_tree(&mut runner).expect("drawn").current();
        let samples = Samples::new(channels).expect("equally long");
        store.insert(&record(attempt, session, samples.clone()), &Counters::new()).expect("stored");
        all.push(samples);
    }
    store.close().expect("closed");
    let store = Store::open(&path).expect("opened again");
    assert_eq!(store.verify().expect("checked"), []);
    let raw: usize =
        all.iter().map(|own| own.scans() * own.types().iter().map(|of| of.bytes()).sum::<usize>()).sum();
    assert_eq!(store.sample_bytes().expect("measured").1, raw as u64);
    for (row, samples) in rows(&store).iter().zip(&all) {
        let read = store.samples(row).expect("whole");
        assert_eq!((read.types(), bits(&read)), (samples.types(), bits(samples)));
        let (places, mut seen) = ((0..samples.channels()).rev().collect::<Vec<_>>(), 0);
        store
            .each_channel(row, &places, |place, own| {
                assert_eq!(own, samples.channel(place));
                seen += 1;
            })
            .expect("whole");
        assert_eq!(seen, samples.channels());
    }
    let vandals = "DROP TRIGGER records_stay; DROP TRIGGER seals_stay";
    store.connection.execute_batch(vandals).expect("open to everything");
    let before = store.verify().expect("checked").len();
    for (row, turn) in rows(&store).iter().zip(0_usize..) {
        let bytes = store.stored_bytes(row.id).expect("there");
        let mut bad = bytes.clone();
        let at = turn * 7919 % bad.len();
        bad[at] ^= 1 << (turn % 8);
        let set = |bytes: &[u8]| {
            let sql = "UPDATE records SET samples = ?1 WHERE id = ?2";
            store.connection.execute(sql, rusqlite::params![bytes, row.id]).expect("set");
        };
        set(&bad);
        let damage = store.verify().expect("checked");
        assert!(damage.iter().any(|one| one.record == Some(row.id)), "bit {turn} of record {}", row.id);
        set(&bytes);
    }
    assert_eq!(store.verify().expect("checked").len(), before);
    // another type of the same size: a description that its seal does not know
    let changed = "UPDATE seals SET sample_types = replace(sample_types, 'f32', 'i32')";
    store.connection.execute(changed, []).expect("changed");
    assert!(store.verify().expect("checked").len() > before);
}

#[test]
fn what_is_no_number_is_refused_at_the_door() {
    let folder = folder();
    let mut store = Store::create(&folder.path().join("a.jrig"), SMALL, "small.toml").expect("created");
    let session = session(&mut store, &map([50.0, 30.0], 24));
    let samples =
        Samples::new(vec![ChannelSamples::F32(vec![0.0, 1.0]), ChannelSamples::F64(vec![0.0, f64::NAN])]);
    let new = record(0, session, samples.expect("equally long"));
    let said = store.insert(&new, &Counters::new()).expect_err("refused").to_string();
    assert!(said.contains("sample 1 of channel 1"), "{said}");
    assert!(store.records().expect("rows").is_empty());
}

fn old() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign_v2/old.jrig")
}

/// What `tests/data/campaign_v2/old.jrig` contains, written by the last program of version 2: three
/// hits, imported, rounded to 16 bits.
fn check_old(store: &Store) {
    assert_eq!(store.verify().expect("checked"), []);
    let (records, checksums) = (rows(store), [972_728_933, 863_935_319, 3_713_371_248]);
    assert_eq!(records.len(), 3);
    for (row, crc) in records.iter().zip(checksums) {
        let samples = store.samples(row).expect("whole");
        assert_eq!(samples.types(), [SampleType::I16; 4]);
        assert_eq!((samples.scans(), codec::checksum(&samples), row.crc), (1024, crc, crc));
    }
    let map = store.channels(records[0].session).expect("channels");
    let force = map.to_si(0, store.samples(&records[0]).expect("whole").channel(0));
    let peak = force.iter().copied().fold(0.0, f64::max);
    // the largest code is 32 000
    let largest = f64::from(5.322_466_4_f32 * 10.0) * 32_000.0 / 32_768.0;
    assert!((peak / largest - 1.0).abs() < 0.1, "{peak} of {largest}");
    assert_eq!(store.sample_bytes().expect("measured").1, 3 * 4 * 1024 * 2);
    let found = recheck(store, &|_, _| {}).expect("judged again");
    assert_eq!((found.records, found.different), (3, vec![]));
}

#[test]
fn a_file_of_version_2_is_read_as_it_is_and_continued_as_version_3() {
    let folder = folder();
    let path = folder.path().join("old.jrig");
    std::fs::copy(old(), &path).expect("copied");
    let version = |store: &Store| -> i32 {
        store.connection.pragma_query_value(None, "user_version", |row| row.get(0)).expect("a number")
    };
    let before = std::fs::read(&path).expect("read");
    let reader = Store::open_read_only(&path).expect("read");
    assert_eq!(version(&reader), 2);
    check_old(&reader);
    assert!(std::fs::read(&path).expect("read") == before, "reading changes nothing");
    let mut store = Store::open(&path).expect("brought up");
    // a reader that was open meanwhile reads on
    check_old(&reader);
    drop(reader);
    assert_eq!(version(&store), 3);
    check_old(&store);
    let session = session(&mut store, &map([50.0, 30.0], 24));
    let samples =
        Samples::new(vec![ChannelSamples::I32(vec![-1, 1 << 20]), ChannelSamples::F64(vec![0.1, 0.2])])
            .expect("equally long");
    let id = store.insert(&record(9, session, samples.clone()), &Counters::new()).expect("stored");
    store.close().expect("closed");
    let store = Store::open(&path).expect("and again");
    assert_eq!(store.verify().expect("checked"), []);
    assert_eq!(store.samples(&store.record(id).expect("there")).expect("whole"), samples);
    assert_eq!(rows(&store).len(), 4);
}

const HITS: usize = 25;
const SCANS: usize = 8192;

/// A Hann pulse of 0.5 ms, 1 N high, on an oscillator of 1 kg at 1 kHz with 1.25 % of damping, and
/// its acceleration, exact: the sum of the responses to the pulse's three exponentials.
fn hit() -> [Vec<f64>; 2] {
    type C = Complex<f64>;
    let (w, zeta, width_s): (f64, f64, f64) = (TAU * 1000.0, 1.0 / 80.0, 0.5e-3);
    let pole = C::new(-zeta * w, w * (1.0 - zeta * zeta).sqrt());
    let terms = [(0.5, 0.0), (-0.25, TAU / width_s), (-0.25, -TAU / width_s)];
    let at = |scan: usize| {
        let t = (scan as f64 - 200.37) / 51_200.0;
        if t <= 0.0 {
            return [0.0, 0.0];
        }
        let during = t.min(width_s);
        let force = if t < width_s { 0.5 * (1.0 - (TAU * t / width_s).cos()) } else { 0.0 };
        let answer: C = terms
            .iter()
            .map(|(c, turn)| {
                let m = C::new(0.0, *turn);
                ((m * during).exp() - (pole * during).exp()) * *c / (m - pole)
            })
            .sum();
        let answer = answer * (pole * (t - during)).exp() / pole.im;
        let (x, v) = (answer.im, (pole * answer).im);
        [force, force - 2.0 * zeta * w * v - w * w * x]
    };
    let both: Vec<[f64; 2]> = (0..SCANS).map(at).collect();
    [0, 1].map(|place| both.iter().map(|sample| sample[place]).collect())
}

fn spectra(hits: &[[Vec<f64>; 2]]) -> CrossSpectra {
    let window = Windowing { sigma_per_s: 0.0, ..Windowing::default() };
    let mut sums = Summing::new(51_200.0, SCANS, 1, window, [1.0, 5_000.0]);
    for [force, response] in hits {
        let pulse = Pulse::locate(force).expect("a pulse");
        sums.add(force, &[response], &pulse).expect("fits");
    }
    sums.finish(&[]).expect("hits")
}

#[test]
fn a_line_100_db_below_the_peak_is_right_with_24_bits_and_wrong_with_16() {
    let exact = hit();
    let full = exact.each_ref().map(|x| 1.3 * x.iter().fold(0.0f64, |most, v| most.max(v.abs())));
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(4);
    let folder = folder();
    let path = folder.path().join("a.jrig");
    let mut store = Store::create(&path, SMALL, "small.toml").expect("created");
    let own = [session(&mut store, &map(full, 24)), session(&mut store, &map(full, 16))];
    let mut stored = Vec::new();
    for attempt in 0..HITS as u32 {
        // converters of 120 dB: noise of 10⁻⁶ of a full-scale sine
        let noisy = [0, 1].map(|place| -> Vec<f64> {
            let draw = |v: &f64| {
                let noise: f64 = StandardNormal.sample(&mut dice);
                v / full[place] + 0.5f64.sqrt() * 1e-6 * noise
            };
            exact[place].iter().map(draw).collect()
        });
        let wide = noisy
            .each_ref()
            .map(|x| ChannelSamples::I32(x.iter().map(|v| (v * 8_388_608.0).round() as i32).collect()));
        let narrow = noisy
            .each_ref()
            .map(|x| ChannelSamples::I16(x.iter().map(|v| (v * 32_768.0).round() as i16).collect()));
        for (samples, (session, odd)) in [wide, narrow].into_iter().zip(own.into_iter().zip([0, 1])) {
            let samples = Samples::new(samples.into()).expect("equally long");
            let new = record(2 * attempt + odd, session, samples.clone());
            store.insert(&new, &Counters::new()).expect("stored");
            stored.push(samples);
        }
    }
    store.close().expect("closed");
    let store = Store::open_read_only(&path).expect("open");
    assert_eq!(store.verify().expect("checked"), []);
    let mut hits = [Vec::new(), Vec::new()];
    for (row, samples) in rows(&store).iter().zip(&stored) {
        assert!(store.samples(row).expect("whole") == *samples, "stored without loss");
        let map = store.channels(row.session).expect("channels");
        let si = [0, 1].map(|place| map.to_si(place, samples.channel(place)));
        hits[usize::from(row.session == own[1])].push(si);
    }
    let exact = spectra(&[exact]);
    let peak = (0..exact.lines()).map(|line| exact.h1(line, 0).norm()).fold(0.0, f64::max);
    let line = exact.frequency_hz().iter().position(|f| (f - 18.75).abs() < 1e-9).expect("a line");
    let below_db = 20.0 * (exact.h1(line, 0).norm() / peak).log10();
    assert!((-103.0..-100.0).contains(&below_db), "{below_db} dB");
    let [wide, narrow] =
        hits.map(|hits| (spectra(&hits).h1(line, 0) / exact.h1(line, 0) - Complex::ONE).norm());
    assert!(wide < 0.01, "24 bits: {wide}");
    assert!(narrow > 0.2, "16 bits: {narrow}");
}

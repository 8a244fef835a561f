//! Continuous recordings cut into hits by the command: a person strikes the places of a plan, with
//! double and missing hits, repeats and taps.

use jointrig::campaign::plan::configuration_name;
use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::Verdict;
use jointrig::device::samples::SampleType;
use jointrig::exchange::channel_records::{ChannelRecords, write_uff_file};
use jointrig_protocol::channel::Quantity;
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{PI, TAU};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};

/// Samples per second: a twenty-fifth of a rig's, so that forty minutes take seconds.
const FS_HZ: f64 = 2048.0;
/// Frequencies of the modes, Hz, and their damping.
const MODES: [f64; 5] = [37.0, 61.0, 88.0, 131.0, 190.0];
const DAMPING: f64 = 0.015;
/// Duration of a pulse, s.
const PULSE_S: f64 = 6e-3;

fn jointrig(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_jointrig"));
    command.current_dir(folder).args(arguments).output().expect("the command runs")
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let out = jointrig(folder, arguments);
    let (said, told) = (String::from_utf8_lossy(&out.stderr), String::from_utf8_lossy(&out.stdout));
    assert!(out.status.success(), "{arguments:?}: {said}{told}");
    told.into_owned()
}

/// stderr of a command that ends with `code`.
fn refused(folder: &Path, arguments: &[&str], code: i32) -> String {
    let out = jointrig(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(
        out.status.code(),
        Some(code),
        "{arguments:?}: {said}{}",
        String::from_utf8_lossy(&out.stdout)
    );
    said
}

/// A plan of these numbers of impacts and responses.
fn plan(impacts: usize, responses: usize, wanted: usize) -> String {
    let list = |prefix: &str, count: usize, more: &str| -> String {
        (1..=count)
            .map(|i| {
                format!("{{ name = \"{prefix}{i}\", grouping = 1, position_m = [0.0{i}, 0.02, 0.03]{more} }}")
            })
            .collect::<Vec<_>>()
            .join(",\n    ")
    };
    let names = |prefix: &str, count: usize| {
        (1..=count).map(|i| format!("\"{prefix}{i}\"")).collect::<Vec<_>>().join(", ")
    };
    format!(
        r#"version = 1
name = "cut"
[record]
rate_hz = 2048
length_s = 1.5
pre_trigger_scans = 64
[hits]
wanted = {wanted}
minimum = 2
most = 20
[force]
target_n = 50.0
tolerance = 0.05
pulse_us = 3500
pulse_bounds_us = [2500, 6000]
[trigger]
level_n = 3.0
flight_s = 0.05
listen_s = 0.15
hold_off_s = 0.05
[limits]
weak_n = 20.0
strong_n = 100.0
rebound_ratio = 0.02
rebound_after_s = 0.001
noise_ratio = 5.0
[settle]
quiet_relative = 0.003
quiet_floor_m_per_s = 1e-6
window_samples = 128
bound_s = 25.0
[window]
exponential_per_s = 2.3
[[configuration]]
name = "A"
impacts = [{}]
responses = [{}]
[geometry]
virtual_point_m = [0.0, 0.0, 0.0]
response = [
    {}
]
impact = [
    {}
]
"#,
        names("H", impacts),
        names("S", responses),
        list("S", responses, ""),
        list("H", impacts, ", direction = [0, 0, -1]"),
    )
}

/// A hit of a session: when, where (index of the plan's place; `None` elsewhere), how hard, and
/// whether the hammer bounced.
#[derive(Clone, Copy)]
struct Strike {
    at_s: f64,
    place: Option<usize>,
    peak_n: f64,
    double: bool,
}

/// A person at the rig: strikes one place after another.
struct Person {
    dice: Xoshiro256PlusPlus,
    now_s: f64,
    strikes: Vec<Strike>,
}

impl Person {
    fn new(seed: u64) -> Self {
        Self { dice: Xoshiro256PlusPlus::seed_from_u64(seed), now_s: 4.0, strikes: Vec::new() }
    }

    fn strike(&mut self, place: Option<usize>, peak_n: f64, double: bool) {
        self.strikes.push(Strike { at_s: self.now_s, place, peak_n, double });
        self.now_s += self.dice.random_range(4.0..7.0);
    }

    fn good(&mut self, place: usize) {
        let peak_n = self.dice.random_range(40.0..65.0);
        self.strike(Some(place), peak_n, false);
    }

    fn move_on(&mut self) {
        self.now_s += self.dice.random_range(18.0..30.0);
    }
}

/// The signals of force, x, y and z over time, from the modes' shapes at each place.
fn signals(strikes: &[Strike], places: usize, length_s: f64, seed: u64) -> Vec<Vec<f32>> {
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(seed);
    let scans = (length_s * FS_HZ) as usize;
    // products of the shapes at hammer and sensor, for each place, axis and mode; the last is
    // elsewhere
    let mut normal = || -> f64 { StandardNormal.sample(&mut dice) };
    let shapes: Vec<[[f64; 5]; 3]> = (0..=places).map(|_| [0; 3].map(|_| [0; 5].map(|_| normal()))).collect();
    let mut all = vec![vec![0.0; scans]; 4];
    for (i, value) in all[0].iter_mut().enumerate() {
        let t = i as f64 / FS_HZ;
        // the amplifier drifts by 8 N, with mains hum and noise
        *value = 8.0 * (t / length_s) + 0.1 * (TAU * 50.0 * t).sin() + 0.02 * normal();
    }
    for strike in strikes {
        let mut pulses = vec![(strike.at_s, strike.peak_n)];
        if strike.double {
            pulses.push((strike.at_s + 0.06, 0.4 * strike.peak_n));
        }
        let from = (strike.at_s * FS_HZ) as usize;
        let until = (from + (4.0 * FS_HZ) as usize).min(scans);
        let mut state = [Complex::new(0.0, 0.0); 5];
        let poles = MODES.map(|hz| (Complex::new(-DAMPING, 1.0) * (TAU * hz / FS_HZ)).exp());
        // a person hits within a millimetre: the shapes vary by 2 %
        let own = shapes[strike.place.unwrap_or(places)]
            .map(|axis| axis.map(|shape| shape * (1.0 + 0.02 * normal())));
        let (force_signal, axes) = all.split_first_mut().expect("four signals");
        for (scan, value) in force_signal.iter_mut().enumerate().take(until).skip(from) {
            let t = scan as f64 / FS_HZ;
            let force: f64 = pulses
                .iter()
                .map(|(at, peak)| ((t - at) / PULSE_S, peak))
                .filter(|(t, _)| (0.0..1.0).contains(t))
                .map(|(t, peak)| peak * (PI * t).sin())
                .sum();
            *value += force;
            for (mode, pole) in state.iter_mut().zip(poles) {
                *mode = *mode * pole + force * 1e-5;
            }
            for (axis, shapes) in axes.iter_mut().zip(&own) {
                axis[scan] += shapes.iter().zip(&state).map(|(shape, mode)| shape * mode.re).sum::<f64>();
            }
        }
    }
    for axis in &mut all[1..] {
        for value in axis {
            *value += 2e-7 * normal();
        }
    }
    all.into_iter().map(|signal| signal.into_iter().map(|value| value as f32).collect()).collect()
}

/// Writes one array of an npz file.
fn array(zip: &mut zip::ZipWriter<std::fs::File>, name: &str, descr: &str, shape: &str, values: &[u8]) {
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    zip.start_file(format!("{name}.npy"), options).expect("a member");
    let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    zip.write_all(b"\x93NUMPY\x01\x00").expect("written");
    zip.write_all(&(text.len() as u16).to_le_bytes()).expect("written");
    zip.write_all(text.as_bytes()).expect("written");
    zip.write_all(values).expect("written");
}

/// As numpy.savez writes it, channel after channel or scan after scan.
fn write(path: &Path, signals: &[Vec<f32>], by_channel: bool) {
    write_named(path, &["hammer", "x", "y", "z"], &["N", "m/s", "m/s", "m/s"], signals, by_channel);
}

fn write_named(path: &Path, names: &[&str], units: &[&str], signals: &[Vec<f32>], by_channel: bool) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).expect("a file"));
    array(&mut zip, "fs", "<f8", "()", &FS_HZ.to_le_bytes());
    let texts = |all: &[&str]| -> Vec<u8> {
        all.iter().flat_map(|text| format!("{text:\0<10}").into_bytes()).collect()
    };
    let count = signals.len();
    array(&mut zip, "names", "|S10", &format!("({count},)"), &texts(names));
    array(&mut zip, "units", "|S10", &format!("({count},)"), &texts(units));
    let scans = signals[0].len();
    let (shape, values): (String, Vec<u8>) = if by_channel {
        (
            format!("({count}, {scans})"),
            signals.iter().flatten().flat_map(|value| value.to_le_bytes()).collect(),
        )
    } else {
        let scan = |scan: usize| signals.iter().flat_map(move |signal| signal[scan].to_le_bytes());
        (format!("({scans}, {count})"), (0..scans).flat_map(scan).collect())
    };
    array(&mut zip, "signals", "<f4", &shape, &values);
    zip.finish().expect("closed");
}

/// The impact and the response of each place, in the plan's order: the sensor goes there and back.
fn place(number: usize, responses: usize) -> (String, String) {
    let (impact, at) = (number / responses, number % responses);
    let response = if impact % 2 == 0 { at } else { responses - 1 - at };
    (format!("H{}", impact + 1), format!("S{}", response + 1))
}

/// Compares what a campaign holds with where its hits were struck; returns the number of records
/// and of good ones.
fn check(file: &Path, strikes: &[Strike], responses: usize) -> [usize; 2] {
    let store = Store::open_read_only(file).expect("a campaign");
    let cells = store.cells().expect("cells");
    let mut counts = [0; 2];
    for row in store.records().expect("records") {
        let row = row.expect("undamaged");
        let strike = strikes[row.shot.number as usize - 1];
        let cell = &cells.iter().find(|cell| cell.id == row.cell).expect("its cell").cell;
        let own = strike.place.map(|number| place(number, responses));
        assert_eq!(own, Some((cell.impact.clone(), cell.response.clone())), "hit {}", row.shot.number);
        assert_eq!(configuration_name(cell.configuration), "A");
        let wanted = match () {
            () if strike.double => Verdict::DoubleHit,
            () if strike.peak_n < 20.0 => Verdict::Weak,
            () => Verdict::Good,
        };
        assert_eq!(row.verdict, wanted, "hit {}: {}", row.shot.number, row.sentence);
        counts[0] += 1;
        counts[1] += usize::from(row.verdict == Verdict::Good);
    }
    counts
}

#[test]
fn forty_minutes_with_double_missed_and_repeated_hits_are_named_right() {
    const RESPONSES: usize = 2;
    const PLACES: usize = 26;
    const WANTED: usize = 8;
    // 26 places of 8 hits, less 12 missed ones, 3 repeats and a tap: 200 hits; 9 of them are double
    let missed = [1, 3, 3, 6, 8, 9, 12, 14, 17, 20, 22, 25];
    let doubles = [0, 2, 5, 7, 11, 13, 16, 19, 24];
    let repeated = [2, 11, 19];
    let mut person = Person::new(46);
    person.strike(Some(0), 8.0, false);
    for place in 0..PLACES {
        let hits = WANTED - missed.iter().filter(|other| **other == place).count();
        for hit in 0..hits {
            if hit == 3 && doubles.contains(&place) {
                person.strike(Some(place), 50.0, true);
                if repeated.contains(&place) {
                    person.good(place);
                }
            } else {
                person.good(place);
            }
        }
        // one place takes an interruption of a minute between its last hit and the move
        person.now_s += if place == 15 { 60.0 } else { 0.0 };
        person.move_on();
    }
    assert_eq!(person.strikes.len(), 200);
    let length_s = 2400.0;
    assert!(person.now_s < length_s, "{}", person.now_s);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    write(&folder.join("run.npz"), &signals(&person.strikes, PLACES, length_s, 7), true);
    std::fs::write(folder.join("plan.toml"), plan(13, RESPONSES, WANTED)).expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "run.npz", "--into", "c.jrig", "--cut", "--order", "plan"];
    let told = done(folder, &[&cut[..], &["--dry-run"]].concat());
    assert!(told.contains("200 hits: 190 good, 9 double hit, 1 weak"), "{told}");
    assert!(told.contains("A/H1/S1: hits 1-9 (7 good)") && told.contains("nothing is stored"), "{told}");
    let told = done(folder, &cut);
    assert!(told.contains("200 hits, 190 of them good"), "{told}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [200, 190]);
    // the samples are as they came, and a record has the plan's length
    let store = Store::open_read_only(&folder.join("c.jrig")).expect("a campaign");
    let row = store.records().expect("records").into_iter().flatten().next().expect("one");
    let samples = store.samples(&row).expect("undamaged");
    assert_eq!(samples.types(), [SampleType::F32; 4]);
    assert_eq!(samples.scans(), 64 + 3072);
    drop(store);
    assert!(done(folder, &["campaign", "verify", "c.jrig", "--deep"]).contains("200"));
    // the same command again stores nothing twice
    let told = done(folder, &cut);
    assert!(told.contains("200 hits, 190 of them good, 200 were there already"), "{told}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [200, 190]);
}

/// Four good hits at each of six places but the third.
fn who_skips_the_third_place() -> Person {
    let mut person = Person::new(3);
    for place in [0, 1, 3, 4, 5] {
        for _ in 0..4 {
            person.good(place);
        }
        person.move_on();
    }
    person
}

#[test]
fn a_skipped_place_is_asked_about_and_a_table_answers() {
    const RESPONSES: usize = 2;
    let person = who_skips_the_third_place();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let length_s = person.now_s;
    write(&folder.join("run.npz"), &signals(&person.strikes, 6, length_s, 8), false);
    std::fs::write(folder.join("plan.toml"), plan(3, RESPONSES, 4)).expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "run.npz", "--into", "c.jrig", "--cut"];
    let said = refused(folder, &cut, 2);
    assert!(said.contains("--order plan") && said.contains("--table"), "{said}");
    let said = refused(folder, &[&cut[..], &["--order", "plan"]].concat(), 1);
    assert!(said.contains("at 5 places, and the plan's order has 6 here (A/H1/S1 to A/H3/S2)"), "{said}");
    assert!(said.contains("--table") && said.contains("9-12,?,?,?"), "{said}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [0, 0]);
    // the sensor comes back at the second impact: the third place is H2/S2, the fourth H2/S1
    let table = "hit,configuration,impact,response\n5,A,H1,S2\n9-12,A,H2,S1\n";
    std::fs::write(folder.join("places.csv"), table).expect("written");
    let by_table = ["--order", "plan", "--table", "places.csv"];
    let told = done(folder, &[&cut[..], &by_table].concat());
    assert!(told.contains("A/H2/S2: no hits") && told.contains("20 hits, 20 of them good"), "{told}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [20, 20]);
    // another table would put stored hits elsewhere
    std::fs::write(
        folder.join("places.csv"),
        "hit,configuration,impact,response\n5,A,H1,S2\n9-12,A,H2,S2\n13-16,A,H2,S1\n",
    )
    .expect("written");
    let said = refused(folder, &[&cut[..], &["--table", "places.csv"]].concat(), 1);
    assert!(said.contains("is stored at A/") && said.contains("campaign drop"), "{said}");
    // times name places as well, and an unknown place is refused with the plan's
    std::fs::write(folder.join("times.csv"), "time_s;configuration;impact;response\n0;A;H9;S1\n")
        .expect("written");
    let said = refused(folder, &[&cut[..], &["--table", "times.csv"]].concat(), 1);
    assert!(said.contains("line 2") && said.contains("A/H9/S1 is no place"), "{said}");
}

#[test]
fn recordings_that_cannot_be_cut_are_refused_with_the_reason() {
    let mut person = Person::new(9);
    for _ in 0..6 {
        person.good(0);
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let good = signals(&person.strikes, 1, person.now_s, 2);
    std::fs::write(folder.join("plan.toml"), plan(1, 1, 6)).expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "run.npz", "--into", "c.jrig", "--cut", "--order", "plan"];
    let run = folder.join("run.npz");
    let mut turned = good.clone();
    for force in &mut turned[0] {
        *force = -*force;
    }
    write(&run, &turned, true);
    assert!(refused(folder, &cut, 1).contains("multiply the force by -1"));
    let mut silent = good.clone();
    silent[0].fill(0.5);
    write(&run, &silent, true);
    assert!(refused(folder, &cut, 1).contains("0 times"));
    let mut broken = good.clone();
    broken[0][100] = f32::NAN;
    write(&run, &broken, true);
    assert!(refused(folder, &cut, 1).contains("channel `hammer` at 0.0488 s is not a number"));
    std::fs::write(&run, "no archive").expect("written");
    assert!(refused(folder, &cut, 1).contains("numpy.savez"));
    // the last hit is cut off by the recording's end: it is reported and left out
    let end = (person.strikes[5].at_s * FS_HZ) as usize + 500;
    let short: Vec<Vec<f32>> = good.iter().map(|signal| signal[..end].to_vec()).collect();
    write(&run, &short, true);
    let told = done(folder, &cut);
    assert!(told.contains("hit 6") && told.contains("a record of the plan needs"), "{told}");
    assert!(told.contains("5 hits, 5 of them good"), "{told}");
}

#[test]
fn levels_of_a_shaker_are_cut_without_their_transitions() {
    // frequency (Hz), amplitude of the displacement (m), steady time (s); a ramp of half a second
    // before each
    let levels = [(60.0, 1e-6, 4.0), (60.0, 3e-6, 4.0), (95.3, 2e-6, 5.0)];
    let (mut now_s, mut phase, mut before, mut all) = (0.0, 0.0_f64, 0.0, vec![Vec::new(); 5]);
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(12);
    for (hz, amplitude, steady_s) in levels.into_iter().chain([(60.0, 0.0, 1.0)]) {
        let scans = ((steady_s + 0.5) * FS_HZ) as usize;
        for scan in 0..scans {
            let ramp = (scan as f64 / FS_HZ / 0.5).min(1.0);
            let now = before + (amplitude - before) * ramp;
            phase += TAU * hz / FS_HZ;
            let noise: f64 = StandardNormal.sample(&mut dice);
            // a stiffness of 100 N/um; both specimens move, A five times as far
            let velocity = TAU * hz * now * phase.cos();
            let force = 1e8 * now * phase.sin();
            let values =
                [1.25 * velocity, 0.25 * velocity + 1e-9 * noise, force + 1e-3 * noise, force * 1.1, 2.5];
            all.iter_mut().zip(values).for_each(|(own, value)| own.push(value as f32));
        }
        before = amplitude;
        now_s += steady_s + 0.5;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let units = ["m/s", "m/s", "N", "N", "V"];
    let names = ["LDV_A", "LDV_B", "LC1", "excitation", "tacho"];
    write_named(&folder.join("shaker.npz"), &names, &units, &all, true);
    let own = plan(1, 1, 2)
        .replace("[geometry]", "[shaker]\nfrequencies_hz = [60.0]\namplitudes_m = [1e-6, 3e-6]\n[geometry]");
    std::fs::write(folder.join("plan.toml"), own).expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "shaker.npz", "--into", "c.jrig", "--cut", "--levels", "before"];
    let told = done(folder, &cut);
    assert!(told.contains("3 steady parts") && told.contains("c.jrig: 3 levels before the cells"), "{told}");
    assert!(told.contains("stored without a use: tacho;"), "{told}");
    assert!(told.contains("60 Hz, 3 µm") && told.contains("not in the plan"), "{told}");
    let store = Store::open_read_only(&folder.join("c.jrig")).expect("a campaign");
    let rows: Vec<_> = store.levels().expect("levels").into_iter().flatten().collect();
    assert_eq!(rows.len(), 3);
    for (row, (hz, amplitude, _)) in rows.iter().zip(levels) {
        // noise of a ten-thousandth over three seconds
        assert!((row.frequency_hz - hz).abs() < 1e-3, "{}", row.frequency_hz);
        assert!((row.reached / amplitude - 1.0).abs() < 5e-3, "{}", row.reached);
        assert!(row.scans as f64 > 3.0 * FS_HZ, "{}", row.scans);
    }
    assert_eq!((rows[0].frequency_hz, rows[1].amplitude), (60.0, 3e-6));
    drop(store);
    assert!(now_s > 14.0 && done(folder, &cut).contains("3 were there already"));
    // a recording without a sine has no level
    for own in &mut all {
        own.truncate(300);
    }
    write_named(&folder.join("shaker.npz"), &names, &units, &all, true);
    assert!(refused(folder, &cut, 1).contains("channel `excitation` has no part"));
}

/// Writes a WAV file of 24 bits, each signal in parts of its full scale.
fn write_wav(path: &Path, signals: &[Vec<f32>], full_scale: &[f32]) {
    let spec = hound::WavSpec {
        channels: signals.len() as u16,
        sample_rate: FS_HZ as u32,
        bits_per_sample: 24,
        sample_format: hound::SampleFormat::Int,
    };
    let mut out = hound::WavWriter::create(path, spec).expect("a file");
    for scan in 0..signals[0].len() {
        for (signal, full_scale) in signals.iter().zip(full_scale) {
            out.write_sample((signal[scan] / full_scale * 8_388_608.0) as i32).expect("written");
        }
    }
    out.finalize().expect("closed");
}

/// Writes text with volts, 100 N and 0.1 m/s for each.
fn write_volts(path: &Path, signals: &[Vec<f32>]) {
    let mut lines = vec!["time (s);ai0 (V);ai1 (V);ai2 (V);ai3 (V);marker (V)".to_owned()];
    for scan in 0..signals[0].len() {
        let volts: Vec<String> = signals
            .iter()
            .zip([100.0, 0.1, 0.1, 0.1])
            .map(|(own, per)| (own[scan] / per).to_string())
            .collect();
        lines.push(format!("{};{};0", scan as f64 / FS_HZ, volts.join(";")));
    }
    std::fs::write(path, lines.join("\n")).expect("written");
}

fn write_universal(path: &Path, signals: &[Vec<f32>]) {
    let all = ChannelRecords {
        fs_hz: FS_HZ,
        names: ["hammer", "x", "y", "z"].map(String::from).to_vec(),
        quantities: vec![Quantity::Force, Quantity::Velocity, Quantity::Velocity, Quantity::Velocity],
        delay_s: vec![vec![0.0; 4]],
        records: vec![1],
        signals: vec![signals.iter().map(|own| own.iter().map(|v| f64::from(*v)).collect()).collect()],
    };
    write_uff_file(path, &all).expect("written");
}

#[test]
fn text_wav_and_universal_files_are_cut_as_npz_with_stated_sensitivities() {
    let mut person = Person::new(5);
    for _ in 0..5 {
        person.good(0);
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let recorded = signals(&person.strikes, 1, person.now_s, 3);
    std::fs::write(folder.join("plan.toml"), plan(1, 1, 5)).expect("written");
    let most = recorded[1..].iter().flatten().fold(0.0f32, |most, v| most.max(v.abs()));
    write_wav(&folder.join("run.wav"), &recorded, &[100.0, 2.0 * most, 2.0 * most, 2.0 * most]);
    write_volts(&folder.join("run.csv"), &recorded);
    write_universal(&folder.join("run.uff"), &recorded);
    write(&folder.join("run.npz"), &recorded, true);
    let of_wav = ["x", "y", "z"].iter().zip(2..).map(|(axis, n)| format!("{n}={axis}:{} m/s/FS", 2.0 * most));
    let of_wav = std::iter::once("1=hammer:100 N/FS".to_owned()).chain(of_wav).collect::<Vec<_>>().join(",");
    let of_text = "ai0=hammer:10 mV/N,ai1=x:100 mm/s/V,ai2=y:100 mm/s/V,ai3=z:100 mm/s/V";
    let mut peaks = Vec::new();
    for (name, calibrate, of) in [
        ("run.npz", "", SampleType::F32),
        ("run.wav", of_wav.as_str(), SampleType::I32),
        ("run.csv", of_text, SampleType::F64),
        ("run.uff", "", SampleType::F32),
    ] {
        let campaign = format!("{name}.jrig");
        done(folder, &["campaign", "new", &campaign, "--plan", "plan.toml"]);
        let cut = ["import", name, "--into", &campaign, "--cut", "--order", "plan", "--calibrate", calibrate];
        let told = done(folder, &cut);
        assert!(told.contains("5 hits, 5 of them good"), "{name}: {told}");
        assert!(done(folder, &cut).contains("5 were there already"), "{name}");
        assert_eq!(check(&folder.join(&campaign), &person.strikes, 1), [5, 5], "{name}");
        let store = Store::open_read_only(&folder.join(&campaign)).expect("a campaign");
        let row = store.records().expect("records").into_iter().next().expect("a record").expect("undamaged");
        let map = store.channels(row.session).expect("channels");
        let samples = store.samples(&row).expect("samples");
        assert_eq!(samples.types()[0], of, "{name}");
        let greatest = |place: usize| {
            map.to_si(place, samples.channel(place)).into_iter().fold(0.0f64, |most, v| most.max(v.abs()))
        };
        peaks.push([greatest(0), greatest(1)]);
    }
    // scales are kept in single precision, and 24 bits resolve 1e-7 of full scale
    for own in &peaks {
        assert!(own.iter().zip(peaks[0]).all(|(one, npz)| (one / npz - 1.0).abs() < 1e-5), "{peaks:?}");
    }
    let said =
        refused(folder, &["import", "run.csv", "--into", "run.npz.jrig", "--cut", "--order", "plan"], 1);
    assert!(said.contains("no channel is the hammer's force"), "{said}");
    // cut off by a byte
    let whole = std::fs::read(folder.join("run.wav")).expect("readable");
    std::fs::write(folder.join("run.wav"), &whole[..whole.len() - 1]).expect("written");
    let cut =
        ["import", "run.wav", "--into", "run.npz.jrig", "--cut", "--order", "plan", "--calibrate", &of_wav];
    assert!(refused(folder, &cut, 1).contains("not a whole WAV file"));
}

#[test]
fn a_marker_names_the_places_and_what_contradicts_it_is_asked() {
    const RESPONSES: usize = 2;
    let person = who_skips_the_third_place();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mut recorded = signals(&person.strikes, 6, person.now_s, 8);
    // 0.2 V for each place, switched two seconds before the hit
    let marker = |levels: &dyn Fn(usize, &Strike) -> f32| -> Vec<f32> {
        let mut volts = vec![0.0; recorded[0].len()];
        for (number, strike) in person.strikes.iter().enumerate() {
            let from = ((strike.at_s - 2.0) * FS_HZ) as usize;
            volts[from..].fill(levels(number, strike));
        }
        volts
    };
    let own = |strike: &Strike| 0.2 * (strike.place.expect("a place") + 1) as f32;
    let right = marker(&|_, strike| own(strike));
    let wrong = marker(&|number, strike| match number {
        4 => 0.2,
        9 => 0.31,
        _ => own(strike),
    });
    recorded.push(wrong);
    let (names, units) = (["hammer", "x", "y", "z", "place"], ["N", "m/s", "m/s", "m/s", "V"]);
    write_named(&folder.join("run.npz"), &names, &units, &recorded, true);
    std::fs::write(folder.join("plan.toml"), plan(3, RESPONSES, 4)).expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "run.npz", "--into", "c.jrig", "--cut", "--marker"];
    let said = refused(folder, &[&cut[..], &["place:0.2"]].concat(), 1);
    assert!(said.contains("hit 5: the marker says A/H1/S1, and the response is that of A/H1/S2"), "{said}");
    assert!(said.contains("hit 10: the marker stands at 0.3100"), "{said}");
    assert!(!said.contains("hit 6:") && said.contains("5,?,?,?") && said.contains("11-12,A,H2,S1"), "{said}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [0, 0]);
    // the table counts where both name a hit
    std::fs::write(folder.join("places.csv"), "hit,configuration,impact,response\n5,A,H1,S2\n10,A,H2,S1\n")
        .expect("written");
    let told = done(folder, &[&cut[..], &["place:0.2", "--table", "places.csv"]].concat());
    assert!(told.contains("A/H2/S2: no hits") && told.contains("20 hits, 20 of them good"), "{told}");
    assert_eq!(check(&folder.join("c.jrig"), &person.strikes, RESPONSES), [20, 20]);
    assert!(!told.contains("stored without a use"), "{told}");
    recorded[4] = right;
    write_named(&folder.join("run.npz"), &names, &units, &recorded, true);
    done(folder, &["campaign", "new", "d.jrig", "--plan", "plan.toml"]);
    let cut = ["import", "run.npz", "--into", "d.jrig", "--cut", "--marker"];
    done(folder, &[&cut[..], &["place:0.2"]].concat());
    assert_eq!(check(&folder.join("d.jrig"), &person.strikes, RESPONSES), [20, 20]);
    assert!(
        refused(folder, &[&cut[..], &["other:0.2"]].concat(), 1).contains("it has hammer, x, y, z, place")
    );
}

//! One set of FRFs and one set of records, rewritten in random ways that other programs use: units,
//! directions, listed or even abscissa values, digits, order, text or binary, padding, line ends.
//! Every file gives the same numbers to 1e-5, or a refusal that names the cause.
//!
//! `JOINTRIG_REWRITES=10000 cargo test -p jointrig --test it rewrites` tries more of them.

use jointrig::exchange::record_file::PlannedPlace;
use jointrig::exchange::uff::{
    Abscissa, Axis, ByteOrder, DataSet, Dof, Encoding, Function, Precision, Units, Values, kind, quantity,
    read, write,
};
use jointrig::exchange::{StatedUnits, frf_uff, record_uff};
use jointrig::spectra::{FrfSettings, ImpactRecords, MotionQuantity, Windowing, estimate};
use jointrig::substructuring::{Configuration, Grouping, Point};
use num_complex::Complex;
use proptest::prelude::*;
use proptest::sample::select;
use std::f64::consts::TAU;

/// Relative tolerance of every number.
const SAME: f64 = 1e-5;

fn config(seed: u64) -> ProptestConfig {
    let cases = std::env::var("JOINTRIG_REWRITES").ok().and_then(|count| count.parse().ok()).unwrap_or(300);
    let rng_seed = proptest::test_runner::RngSeed::Fixed(seed);
    // failures are printed; nothing is stored next to the tests
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// A unit as a label writes it, and its factor to SI.
type Unit = (&'static str, f64);

const VELOCITIES: [Unit; 9] = [
    ("m/s", 1.0),
    ("mm/s", 1e-3),
    ("MM/S", 1e-3),
    ("mm s^-1", 1e-3),
    ("µm/s", 1e-6),
    ("in/s", 0.0254),
    ("ips", 0.0254),
    ("[cm/sec]", 1e-2),
    ("ft/s", 0.3048),
];
const ACCELERATIONS: [Unit; 8] = [
    ("m/s^2", 1.0),
    ("m/s²", 1.0),
    ("mm/s2", 1e-3),
    ("g", 9.806_65),
    ("G", 9.806_65),
    ("mg", 9.806_65e-3),
    ("in/sec**2", 0.0254),
    ("Gal", 1e-2),
];
const POUND: f64 = 4.448_221_615_260_5;
const FORCES: [Unit; 7] =
    [("N", 1.0), ("mN", 1e-3), ("kN", 1e3), ("lbf", POUND), ("LBF", POUND), ("kgf", 9.806_65), ("dyn", 1e-5)];
const FREQUENCIES: [Unit; 5] =
    [("Hz", 1.0), ("", 1.0), ("kHz", 1e3), ("rad/s", 1.0 / TAU), ("rpm", 1.0 / 60.0)];
const TIMES: [Unit; 4] = [("s", 1.0), ("", 1.0), ("ms", 1e-3), ("µs", 1e-6)];
/// Labels that are not a unit of motion or force, and a word of the refusal.
const WRONG: [(&str, &str); 5] =
    [("mV", "sensitivity"), ("furlong/s", "furlong"), ("EU", "sensitivity"), ("%", "%"), ("kg", "a mass")];

/// Codes of data set 164, with the factors of length and force to its units.
const SYSTEMS: [(i64, f64, f64); 5] = [
    (1, 1.0, 1.0),
    (10, 1e3, 1.0),
    (7, 1.0 / 0.0254, 1.0 / POUND),
    (5, 1e3, 1e3),
    (9, 39.370_078_740_157_5, 1.0),
];

/// How the units are stated.
#[derive(Debug, Clone, Copy)]
enum Told {
    /// Without label or data set: SI.
    Nowhere,
    /// By labels of motion and force.
    Labels,
    /// By a label of motion per force, with or without the force's own.
    Ratio { own: bool },
    /// By data set 164 alone.
    System(usize),
    /// By data set 164 and labels that agree with it.
    Both(usize),
    /// By data set 164 and a label that contradicts it.
    Against(usize),
    /// By a label that is no such unit.
    Wrong(usize),
    /// By the user, whatever the labels are.
    Stated,
}

fn told() -> impl Strategy<Value = Told> {
    prop_oneof![
        2 => Just(Told::Nowhere),
        4 => Just(Told::Labels),
        3 => any::<bool>().prop_map(|own| Told::Ratio { own }),
        2 => (0..SYSTEMS.len()).prop_map(Told::System),
        2 => (0..SYSTEMS.len()).prop_map(Told::Both),
        1 => (0..SYSTEMS.len()).prop_map(Told::Against),
        1 => (0..WRONG.len()).prop_map(Told::Wrong),
        1 => Just(Told::Stated),
    ]
}

/// How a file is written, apart from its units and directions.
#[derive(Debug, Clone)]
struct Form {
    precision: Precision,
    encoding: Encoding,
    listed: bool,
    /// Start and step are printed with six digits, as most programs do.
    six_digits: bool,
    zeros: usize,
    line_end: &'static str,
    before: &'static str,
    between: &'static str,
    shuffle: u64,
}

fn form() -> impl Strategy<Value = Form> {
    let encoding =
        select(vec![Encoding::Ascii, Encoding::Binary(ByteOrder::Little), Encoding::Binary(ByteOrder::Big)]);
    let texts = (
        select(vec!["\n", "\r\n", "\r"]),
        select(vec![
            "",
            "\u{feff}",
            "\n\n",
            "written by a front end\n",
            "written by a front end",
            "\u{feff}a text\r\n",
        ]),
        select(vec!["", "\n", "a remark\n"]),
    );
    let numbers =
        (select(vec![Precision::Single, Precision::Double]), encoding, any::<bool>(), any::<bool>());
    (numbers, 0..6usize, texts, any::<u64>()).prop_map(
        |((precision, encoding, listed, six_digits), zeros, (line_end, before, between), shuffle)| Form {
            precision,
            encoding,
            listed,
            six_digits,
            zeros,
            line_end,
            before,
            between,
            shuffle,
        },
    )
}

/// A number rounded to six digits.
fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().expect("a number")
}

impl Form {
    /// Abscissa values start + i step in a unit of this factor, as written in this form.
    fn abscissa(&self, start: f64, step: f64, count: usize, factor: f64) -> Abscissa {
        let (start, step) = (start / factor, step / factor);
        let print = |value| if self.six_digits { six_digits(value) } else { value };
        if self.listed {
            // abscissa values in text are printed with six digits, whatever the precision of the
            // values
            Abscissa::Uneven((0..count).map(|i| print(start + i as f64 * step)).collect())
        } else {
            Abscissa::Even { start: print(start), step: print(step) }
        }
    }

    /// The bytes of one function.
    fn bytes(&self, mut function: Function) -> Vec<u8> {
        (function.precision, function.encoding) = (self.precision, self.encoding);
        let bytes = write(&[function.into()]).expect("writable");
        let binary = self.encoding != Encoding::Ascii;
        // the line with -1, the line with the number, and eleven of the header
        let head = if binary { 13 } else { usize::MAX };
        let ends: Vec<usize> =
            bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(at, _)| at + 1).take(head).collect();
        let text = ends.last().copied().unwrap_or(0);
        let mut out = String::from_utf8(bytes[..text].to_vec()).expect("text");
        if !binary {
            let last = out.rfind("    -1").expect("an end");
            let zeros = format!("{:>13}", "0.00000e+00").repeat(self.zeros);
            let values = out[..last].trim_end_matches('\n').to_owned();
            out = format!("{values}{}{zeros}\n    -1\n", if zeros.is_empty() { "" } else { "\n" });
        }
        let mut all = out.replace('\n', self.line_end).into_bytes();
        all.extend_from_slice(&bytes[text..]);
        all
    }

    /// A file of these parts in a random order; each group stays together with its first part
    /// first.
    fn file(&self, system: Option<usize>, groups: Vec<Vec<Function>>, keep_first: bool) -> Vec<u8> {
        let mut random = self.shuffle;
        let mut next = |below: usize| {
            // a step of a linear congruential generator; its high bits are used
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as usize % below.max(1)
        };
        let mut file = self.before.as_bytes().to_vec();
        if let Some(system) = system {
            let (code, length, force) = SYSTEMS[system];
            let units = Units { code, length, force, description: "of the test".into(), ..Units::si() };
            file.extend(write(&[DataSet::Units(units)]).expect("writable"));
        }
        let mut groups = groups;
        while !groups.is_empty() {
            let mut group = groups.remove(next(groups.len()));
            while !group.is_empty() {
                let first = keep_first && matches!(group[0].axes[1].quantity, quantity::FORCE);
                let at = if first { 0 } else { next(group.len()) };
                file.extend(self.bytes(group.remove(at)));
                file.extend_from_slice(self.between.as_bytes());
            }
        }
        file
    }
}

/// Units of motion and force: their labels, their factors, the data set, what a user states, and
/// the words of a refusal.
struct ToldUnits {
    motion: (String, f64),
    force: (String, f64),
    system: Option<usize>,
    stated: StatedUnits,
    refusal: Option<Vec<&'static str>>,
}

/// `time_power` is 1 for a velocity, 2 for an acceleration.
fn units(told: Told, motion: Unit, force: Unit, time_power: i32, per_force: bool) -> ToldUnits {
    let own = |unit: Unit| (unit.0.to_owned(), unit.1);
    let silent = (String::new(), 1.0);
    let plain = |motion: (String, f64), force: (String, f64)| ToldUnits {
        motion,
        force,
        system: None,
        stated: StatedUnits::default(),
        refusal: None,
    };
    let of_system = |system: usize| {
        let (_, length, force) = SYSTEMS[system];
        (1.0 / length, 1.0 / force)
    };
    let labels_of = |system: usize| {
        let time = if time_power == 1 { "s" } else { "s^2" };
        let (length, force) = [("m", "N"), ("mm", "N"), ("in", "lbf"), ("mm", "mN"), ("in", "N")][system];
        (format!("{length}/{time}"), force.to_owned())
    };
    match told {
        Told::Nowhere => plain(silent.clone(), silent),
        Told::Ratio { own: with_own } if per_force => {
            let bare = motion.0.trim_matches(['[', ']']);
            let label = format!("({bare})/{}", force.0);
            plain((label, motion.1), (if with_own { force.0.to_owned() } else { String::new() }, force.1))
        }
        Told::Labels | Told::Ratio { .. } => plain(own(motion), own(force)),
        Told::System(system) => {
            let (length, force) = of_system(system);
            ToldUnits { system: Some(system), ..plain((String::new(), length), (String::new(), force)) }
        }
        Told::Both(system) => {
            let ((length, force), labels) = (of_system(system), labels_of(system));
            ToldUnits { system: Some(system), ..plain((labels.0, length), (labels.1, force)) }
        }
        Told::Against(system) => {
            // none of these systems has centimetres or kilonewtons
            let label = if time_power == 1 { "cm/s" } else { "cm/s^2" };
            let refusal = Some(vec![label, "data set 164"]);
            ToldUnits { system: Some(system), refusal, ..plain((label.into(), 1e-2), silent) }
        }
        Told::Wrong(wrong) => {
            let (label, word) = WRONG[wrong];
            ToldUnits { refusal: Some(vec![label, word]), ..plain((label.into(), 1.0), own(force)) }
        }
        Told::Stated => {
            let text = format!("response={},force={}", motion.0, force.0);
            let stated = text.parse().expect("units");
            ToldUnits { stated, ..plain(("mV".into(), motion.1), ("EU".into(), force.1)) }
        }
    }
}

fn axis(quantity: i64, unit: &str) -> Axis {
    Axis { quantity, unit: unit.into(), ..Axis::default() }
}

/// The ordinate types of motion and force, and the exponent of time.
fn ordinate(is_velocity: bool) -> (i64, i32, MotionQuantity) {
    if is_velocity {
        (quantity::VELOCITY, 1, MotionQuantity::Velocity)
    } else {
        (quantity::ACCELERATION, 2, MotionQuantity::Acceleration)
    }
}

// ------------------------------------------------------------------------------------------ FRFs

const LINES: usize = 17;
/// Lines that six digits cannot represent.
const FIRST_HZ: f64 = 300.078_125;
const STEP_HZ: f64 = 19.921_875;

/// (name, label's axis) of the outputs, and (name, axis) of the impacts; the second impact and the
/// last sensor point along negative axes in the geometry.
const OUTPUTS: [(&str, i64); 4] = [("A1", 1), ("A1", 2), ("A1", 3), ("L", -2)];
const INPUTS: [(&str, i64); 2] = [("AX1", 1), ("AZ1", -3)];

fn vector(direction: i64) -> [f64; 3] {
    let at = usize::try_from(direction.abs()).expect("an axis") - 1;
    std::array::from_fn(|i| if i == at { direction.signum() as f64 } else { 0.0 })
}

fn points() -> Configuration {
    let point = |name: &str, description: String, direction| Point {
        name: name.into(),
        description,
        grouping: Grouping::InterfaceA,
        position_m: [0.0; 3],
        direction: vector(direction),
    };
    let channel = |(name, direction): (&str, i64)| {
        let axis = ["x", "y", "z"][usize::try_from(direction.abs()).expect("an axis") - 1];
        point(name, format!("{name}:{axis}"), direction)
    };
    Configuration {
        channels: OUTPUTS.map(channel).to_vec(),
        impacts: INPUTS.map(|(name, direction)| point(name, name.into(), direction)).to_vec(),
    }
}

/// The FRF of an oscillator, in SI along the directions of the geometry.
fn value(line: usize, output: usize, input: usize) -> Complex<f64> {
    let s = Complex::new(0.0, TAU * (FIRST_HZ + STEP_HZ * line as f64));
    let omega = TAU * (350.0 + 40.0 * output as f64 + 13.0 * input as f64);
    (1.0 + 0.3 * output as f64) * s / (s * s + 0.04 * omega * s + omega * omega)
}

/// An error in one of the functions, other than its units.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Its denominator is an acceleration.
    Transmissibility,
    /// Its label has another axis than the geometry.
    OtherAxis,
    /// Its lines are on another grid.
    OtherLines,
    /// It lacks the first two lines, which is not an error: the common lines are used.
    FewerLines,
}

fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        12 => Just(Fault::None),
        1 => Just(Fault::Transmissibility),
        1 => Just(Fault::OtherAxis),
        1 => Just(Fault::OtherLines),
        3 => Just(Fault::FewerLines),
    ]
}

proptest! {
    #![proptest_config(config(45))]

    #[test]
    fn frfs_written_again_are_the_same_or_refused_with_the_cause(
        form in form(), told in told(), is_velocity in any::<bool>(),
        (velocity, acceleration, force) in (select(&VELOCITIES[..]), select(&ACCELERATIONS[..]), select(&FORCES[..])),
        frequency in select(&FREQUENCIES[..]),
        (turned_outputs, turned_inputs) in (any::<[bool; 4]>(), any::<[bool; 2]>()),
        (fault, at) in (fault(), 0..OUTPUTS.len() * INPUTS.len()),
    ) {
        let (kind_of, power, _) = ordinate(is_velocity);
        let unit = units(told, if is_velocity { velocity } else { acceleration }, force, power, true);
        let scale = unit.motion.1 / unit.force.1;
        let mut functions = Vec::new();
        for (output, (name, along)) in OUTPUTS.into_iter().enumerate() {
            for (input, (impact, push)) in INPUTS.into_iter().enumerate() {
                let own = functions.len() == at;
                let fault = if own { fault } else { Fault::None };
                let sides = [turned_outputs[output], turned_inputs[input]].map(|turned| if turned { -1.0 } else { 1.0 });
                let first = if fault == Fault::FewerLines { 2 } else { 0 };
                let moved = if fault == Fault::OtherLines { 0.4 * STEP_HZ } else { 0.0 };
                let values: Vec<Complex<f64>> = (first..LINES)
                    .map(|line| {
                        let of = value(line, output, input) * sides[0] * sides[1];
                        // an acceleration is the derivative of the velocity
                        let s = Complex::new(0.0, TAU * (FIRST_HZ + STEP_HZ * line as f64));
                        (if is_velocity { of } else { of * s }) / scale
                    })
                    .collect();
                let start = FIRST_HZ + STEP_HZ * first as f64 + moved;
                let abscissa = form.abscissa(start, STEP_HZ, values.len(), frequency.1);
                let mut f = Function::new(kind::FRF, abscissa, Values::Complex(values));
                let direction = if fault == Fault::OtherAxis { if along.abs() == 1 { 3 } else { 1 } } else { along };
                let dof = |entity: &str, direction: i64, side: f64| {
                    Dof { entity: entity.into(), node: 7, direction: direction * side as i64 }
                };
                (f.response, f.reference) = (dof(name, direction, sides[0]), dof(impact, push, sides[1]));
                let below = if fault == Fault::Transmissibility { quantity::ACCELERATION } else { quantity::FORCE };
                f.axes = [
                    axis(quantity::FREQUENCY, frequency.0),
                    axis(kind_of, &unit.motion.0),
                    axis(below, &unit.force.0),
                    Axis::default(),
                ];
                functions.push(f);
            }
        }
        let bytes = form.file(unit.system, vec![functions], false);
        let found = frf_uff::from_contents(&read(&bytes), &unit.stated)
            .and_then(|file| { let notes = file.notes.clone(); file.along(&points()).map(|(frf, _)| (frf, notes)) });
        let refusal = match fault {
            // which of the two is found first depends on the order
            fault if unit.refusal.is_some() && !matches!(fault, Fault::None | Fault::FewerLines) => Some(vec![]),
            Fault::Transmissibility => Some(vec!["denominator"]),
            Fault::OtherAxis => Some(vec![]),
            Fault::OtherLines => Some(vec!["frequency axis"]),
            _ => unit.refusal.clone(),
        };
        match (found, refusal) {
            (Ok((frf, notes)), None) => {
                let first = if fault == Fault::FewerLines { 2 } else { 0 };
                prop_assert_eq!(frf.lines().len(), LINES - first, "{:?}", notes);
                prop_assert_eq!(notes.iter().any(|note| note.contains("that all have")), first > 0);
                prop_assert_eq!(notes.iter().any(|note| note.contains("outside the data sets")),
                    form.before.contains("text") || form.before.contains("front end") || !form.between.trim().is_empty());
                for (line, y) in frf.lines().iter().enumerate() {
                    let wanted_hz = FIRST_HZ + STEP_HZ * (line + first) as f64;
                    prop_assert!((frf.frequency_hz()[line] / wanted_hz - 1.0).abs() < SAME);
                    let s = Complex::new(0.0, TAU * wanted_hz);
                    for (output, (name, along)) in OUTPUTS.iter().enumerate() {
                        let axis = ["x", "y", "z"][usize::try_from(along.abs()).expect("an axis") - 1];
                        let called = [format!("{name}:{axis}"), (*name).to_owned()];
                        let row = frf.outputs().iter().position(|own| called.contains(own)).expect("the output");
                        for (input, (impact, _)) in INPUTS.iter().enumerate() {
                            let column = frf.inputs().iter().position(|own| own == impact).expect("the input");
                            let wanted = value(line + first, output, input) * if is_velocity { Complex::from(1.0) } else { s };
                            let got = y[(row, column)];
                            prop_assert!((got - wanted).norm() <= SAME * wanted.norm(), "{} {}: {} for {}", name, impact, got, wanted);
                        }
                    }
                }
            }
            (Err(said), Some(words)) => {
                for word in words {
                    prop_assert!(said.contains(word), "`{}` is not in: {}", word, said);
                }
            }
            (Ok(_), Some(words)) => prop_assert!(false, "it was read, and should be refused for {:?}", words),
            (Err(said), None) => prop_assert!(false, "refused: {}", said),
        }
    }
}

// ------------------------------------------------------------------------------------------
// records

const SAMPLES: usize = 600;
const HITS: usize = 2;
const PARTS: [f64; 3] = [1.0, -0.5, 0.2];

/// Force of a hit (channel 0), or the response of an oscillator of 300 Hz in a channel, in SI along
/// the plan's direction.
fn sample(hit: usize, channel: usize, t: f64) -> f64 {
    let height = 20.0 + 3.0 * hit as f64;
    let local = t - 0.004;
    if channel == 0 {
        let pulse =
            if (0.0..0.0015).contains(&local) { 0.5 * (1.0 - (TAU * local / 0.0015).cos()) } else { 0.0 };
        return height * pulse + 1e-3;
    }
    let ring = if local > 0.0 { (-60.0 * local).exp() * (TAU * 300.0 * local).sin() } else { 0.0 };
    1e-3 * height * PARTS[channel - 1] * (ring + 2e-3)
}

/// Dynamic stiffness, N/m, from one line of the FRF of the first channel: a number to which all
/// samples contribute. It is complex: near the resonance its real part is a small difference of
/// large numbers, which amplifies the rounding of samples in single precision.
fn stiffness(records: &ImpactRecords, delay_s: &[f64]) -> Complex<f64> {
    let windowing = Windowing { sigma_per_s: 2.0, ..Windowing::default() };
    let settings = FrfSettings { windowing, delay_s: delay_s.to_vec(), ..FrfSettings::default() };
    let y = estimate(records, &[true; HITS], &settings).expect("two hits");
    let line = y.frequency_hz().iter().position(|f| *f >= 250.0).expect("a line");
    let s = Complex::new(2.0, TAU * y.frequency_hz()[line]);
    s.powi(records.quantity.order_of_s()) / y.h1(line, 0)
}

proptest! {
    #![proptest_config(config(46))]

    #[test]
    fn records_written_again_are_the_same_or_refused_with_the_cause(
        form in form(), told in told(), is_velocity in any::<bool>(),
        (velocity, acceleration, force) in (select(&VELOCITIES[..]), select(&ACCELERATIONS[..]), select(&FORCES[..])),
        time in select(&TIMES[..]),
        (turned, hammer_turned) in (any::<[bool; 3]>(), any::<bool>()),
        fs_hz in select(vec![51_200.0, 10_240.0, 65_536.0, 44_100.0, 51_200.0 / 3.0, 12_800.5]),
        (start_s, late) in (select(vec![0.0, -0.01, 0.01]), prop_oneof![4 => Just(0usize), 1 => 1..20usize]),
        other_axis in prop_oneof![9 => Just(false), 1 => Just(true)],
    ) {
        let (kind_of, power, motion) = ordinate(is_velocity);
        let unit = units(told, if is_velocity { velocity } else { acceleration }, force, power, false);
        // a start that six digits can represent
        let start_s = if late > 0 { 0.0 } else { start_s };
        let mut groups = Vec::new();
        for hit in 0..HITS {
            let mut group = Vec::new();
            for channel in 0..=PARTS.len() {
                let own_late = if channel > 0 { late } else { 0 };
                let side = match channel {
                    0 => hammer_turned,
                    _ => turned[channel - 1],
                };
                let side = if side { -1.0 } else { 1.0 };
                let scale = if channel == 0 { unit.force.1 } else { unit.motion.1 };
                let values: Vec<f64> = (0..SAMPLES)
                    .map(|i| side * sample(hit, channel, (i + own_late) as f64 / fs_hz) / scale)
                    .collect();
                let start = start_s + own_late as f64 / fs_hz;
                let abscissa = form.abscissa(start, 1.0 / fs_hz, SAMPLES, time.1);
                let mut f = Function::new(kind::TIME, abscissa, Values::Real(values));
                let direction = match channel {
                    0 => -3,
                    1 if other_axis => 2,
                    own => i64::try_from(own).expect("small"),
                };
                let entity = if channel == 0 { "AZ1" } else { "A1" };
                f.response = Dof { entity: entity.into(), node: 3, direction: direction * side as i64 };
                let (of, label) = if channel == 0 { (quantity::FORCE, &unit.force.0) } else { (kind_of, &unit.motion.0) };
                f.axes = [axis(quantity::TIME, time.0), axis(of, label), Axis::default(), Axis::default()];
                group.push(f);
            }
            groups.push(group);
        }
        let bytes = form.file(unit.system, groups, true);
        let axes = [vector(1), vector(2), vector(3)];
        let place = PlannedPlace { impact: "AZ1", push: vector(-3), response: "A1", axes: &axes, own_axes: false };
        let found = record_uff::from_contents(&read(&bytes), &unit.stated).and_then(|file| file.along_plan(&place));
        let refusal = unit.refusal.or(other_axis.then(|| vec!["A1", "the plan has it along"]));
        match (found, refusal) {
            (Ok(file), None) => {
                let records = &file.records;
                prop_assert!((records.fs_hz / fs_hz - 1.0).abs() < SAME, "{} for {}", records.fs_hz, fs_hz);
                prop_assert_eq!(records.quantity, motion);
                prop_assert_eq!(records.force_n[0].len(), SAMPLES - late);
                let step_s = 1.0 / fs_hz;
                prop_assert!(file.delay_s.iter().all(|own| own.abs() < 1e-3 * step_s), "{:?}", file.delay_s);
                prop_assert_eq!(file.notes.iter().any(|note| note.contains("put in step")), late > 0);
                let same = |hit: usize, channel: usize, i: usize, got: f64| {
                    let wanted = sample(hit, channel, (i + late) as f64 * step_s);
                    (got - wanted).abs() <= SAME * wanted.abs() + 1e-12
                };
                // hits in any order: each is identified by its height
                let order = if records.force_n[0].iter().copied().fold(0.0, f64::max) < 21.5 { [0, 1] } else { [1, 0] };
                let mut plain = ImpactRecords { force_n: vec![], response: vec![], ..records.clone() };
                for (at, hit) in order.into_iter().enumerate() {
                    prop_assert!(records.force_n[at].iter().enumerate().all(|(i, v)| same(hit, 0, i, *v)), "force");
                    for channel in 1..=PARTS.len() {
                        let own = &records.response[at][channel - 1];
                        prop_assert!(own.iter().enumerate().all(|(i, v)| same(hit, channel, i, *v)), "channel {}", channel);
                    }
                    let signal = |channel| (late..SAMPLES).map(|i| sample(hit, channel, i as f64 * step_s)).collect::<Vec<_>>();
                    plain.force_n.push(signal(0));
                    plain.response.push((1..=PARTS.len()).map(signal).collect());
                }
                plain.fs_hz = fs_hz;
                let (got, wanted) = (stiffness(records, &file.delay_s), stiffness(&plain, &[]));
                prop_assert!((got - wanted).norm() < SAME * wanted.norm(), "k {} for {}", got, wanted);
            }
            (Err(said), Some(words)) => {
                for word in words {
                    prop_assert!(said.contains(word), "`{}` is not in: {}", word, said);
                }
            }
            (Ok(_), Some(words)) => prop_assert!(false, "it was read, and should be refused for {:?}", words),
            (Err(said), None) => prop_assert!(false, "refused: {}", said),
        }
    }
}

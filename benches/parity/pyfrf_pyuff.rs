//! Comparison with pyFRF and pyuff, in both directions.
//!
//! Spectra: three simulated hits, windowed here, averaged by both. What differs by definition is
//! excluded and stated here: pyFRF subtracts the mean after its windows (without zero padding this
//! affects only 0 Hz), scales by the ratio of its windows' means, and its coherence is |H1/H2|,
//! which is γ² for one input. Its Hv is total least squares for equal noise powers in the given
//! units, which is our Hv with a noise ratio of 1; the responses are scaled so that |H| is about 1,
//! because its formula suffers from cancellation otherwise.

use super::{Outcome, script};
use jointrig::exchange::npz::Array;
use jointrig::exchange::uff::{
    Abscissa, Axis, Beam, ByteOrder, Contents, DataSet, Dof, Element, Encoding, Function, Header, Node,
    Precision, TraceLine, Units, Values, read, write,
};
use jointrig::exchange::{Extra, read_impacts, write_frf, write_impacts};
use jointrig::spectra::{CrossSpectra, ImpactRecords, Pulse, PulseSamples, SpectraAverage, Windowing};
use num_complex::Complex;
use serde_json::Value;
use std::path::Path;

/// Spectra must agree to this fraction of |H| (of its mean where that is larger), coherences
/// absolutely.
const SPECTRA: f64 = 1e-9;
/// pyuff prints 12 digits of a double, 6 of an abscissa value next to it.
const DOUBLE_TEXT: f64 = 5e-12;
const SINGLE: f64 = 5e-6;

/// Function types of the exchange: unknown, time, auto- and cross-spectrum, FRF, coherence, PSD.
const KINDS: [i64; 7] = [0, 1, 2, 3, 4, 6, 9];

pub fn run(python: &str) -> Outcome {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    records(folder)?;
    let ours = sets();
    std::fs::write(folder.join("ours.uff"), write(&ours)?)?;
    script(python, "pyfrf_pyuff.py", &folder.display().to_string())?;
    let answer: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("answer.json"))?)?;
    println!("| against | what | largest difference | allowed |");
    println!("|---|---|---|---|");
    let mut worst = Vec::new();
    for name in ["H1", "H2", "Hv", "coherence"] {
        let difference = answer["spectra"][name].as_f64().unwrap_or(f64::NAN);
        println!("| pyFRF | {name} | {difference:.1e} | {SPECTRA:.0e} |");
        if difference.is_nan() || difference > SPECTRA {
            worst.push(format!("{name} differs by {difference:e}"));
        }
    }
    let there = answer["ours"].as_array().map_or(&[][..], Vec::as_slice);
    println!(
        "| pyuff | {} data sets of ours, read by it | {} | |",
        ours.len(),
        compare(&ours, there, &mut worst)
    );
    let Contents { sets, faults, .. } = read(&std::fs::read(folder.join("theirs.uff"))?);
    worst.extend(faults.iter().map(ToString::to_string));
    let meant = answer["theirs"].as_array().map_or(&[][..], Vec::as_slice);
    println!(
        "| pyuff | {} data sets of its own, read by us | {} | |",
        meant.len(),
        compare(&sets, meant, &mut worst)
    );
    if worst.is_empty() { Ok(()) } else { Err(worst.join("\n  ").into()) }
}

/// Windowed records and our estimates of them.
fn records(folder: &Path) -> Outcome {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../host/tests/data/impacts/good.npz");
    let records = read_impacts(Path::new(path))?;
    let (samples, window) = (records.force_n[0].len(), Windowing::default());
    let decay = window.decay(records.fs_hz, samples);
    let mut windowed = ImpactRecords { force_n: Vec::new(), response: Vec::new(), ..records.clone() };
    let mut average = SpectraAverage::new(records.fs_hz, samples, 1);
    for (force, responses) in records.force_n.iter().zip(&records.response) {
        let pulse = Pulse::locate(force).ok_or("no pulse")?;
        let origin_s = pulse.start as f64 / records.fs_hz;
        let (mut f, mut x) = (vec![0.0; samples], vec![0.0; samples]);
        window.force_into(force, &decay, origin_s, &PulseSamples::of(&pulse, force), &mut f);
        window.of_response(&decay, origin_s).response_into(&responses[0], 0, &mut x);
        for x in &mut x {
            *x *= 1e4;
        }
        average.add(&f, std::slice::from_ref(&x))?;
        windowed.force_n.push(f);
        windowed.response.push(vec![x]);
    }
    write_impacts(&folder.join("records.npz"), &windowed)?;
    let y = average.finish(0.0, &[])?;
    let lines = y.lines();
    let complex = |name: &str, rows: &[Vec<Complex<f64>>]| {
        Extra::Complex(name.into(), Array { shape: vec![lines, 1, 1], values: rows.concat() })
    };
    let coherence = Array { shape: vec![lines, 1], values: y.rows(CrossSpectra::coherence).concat() };
    let extras = [
        complex("h2", &y.rows(CrossSpectra::h2)),
        complex("hv", &y.rows(|y, line, output| y.hv(line, output, Some(1.0)))),
        Extra::Real("coherence".into(), coherence),
    ];
    write_frf(
        &folder.join("ours.npz"),
        &y.to_matrix(records.quantity, vec!["x".into()], "f".into())?,
        &extras,
    )?;
    Ok(())
}

/// Every function type in every form, and all other data sets.
fn sets() -> Vec<DataSet> {
    let mut sets = Vec::new();
    for kind in KINDS {
        for encoding in
            [Encoding::Ascii, Encoding::Binary(ByteOrder::Little), Encoding::Binary(ByteOrder::Big)]
        {
            for precision in [Precision::Single, Precision::Double] {
                for even in [true, false] {
                    for complex in [true, false] {
                        sets.push(DataSet::Function(Box::new(function(
                            kind, encoding, precision, even, complex,
                        ))));
                    }
                }
            }
        }
    }
    let node =
        |label, position| Node { label, definition_system: 0, displacement_system: 1, color: 2, position };
    let nodes = vec![node(1, [0.0, 1e-3, 3.0]), node(30, [-2.25, 2.0, 0.0])];
    sets.push(DataSet::Nodes(nodes.clone()));
    sets.push(DataSet::NodesDouble(nodes));
    let trace =
        TraceLine { number: 3, color: 5, name: "outline".into(), nodes: vec![1, 2, 30, 0, 1, 7, 8, 9, 10] };
    sets.push(DataSet::TraceLine(trace));
    let element = Element {
        label: 1,
        descriptor: 44,
        physical: 1,
        material: 2,
        color: 3,
        beam: None,
        nodes: vec![1, 2, 30, 4],
    };
    let beam = Beam { orientation: 0, first_section: 1, second_section: 1 };
    let rod = Element { label: 2, descriptor: 11, beam: Some(beam), nodes: vec![1, 2], ..element.clone() };
    sets.push(DataSet::Elements(vec![element, rod]));
    sets.push(DataSet::Header(Header {
        model: "model".into(),
        description: "what it is".into(),
        database_program: "app".into(),
        created: ["27-Jan-16".into(), "14:38:15".into()],
        versions: [1, 2],
        file_type: 0,
        saved: ["28-Jan-16".into(), "14:38:16".into()],
        program: "jointrig".into(),
        written: ["29-Jan-16".into(), "14:38:17".into()],
    }));
    sets.push(DataSet::Units(Units { length: 3.280_839_895_013_123, ..Units::si() }));
    sets
}

fn function(kind: i64, encoding: Encoding, precision: Precision, even: bool, complex: bool) -> Function {
    let value = |i: usize| ((7 * i + 3) % 11) as f64 * 10f64.powf((i % 7) as f64 - 5.0) - 2.5;
    let number = |v: f64| if precision == Precision::Single { f64::from(v as f32) } else { v };
    Function {
        id: ["parity".into(), String::new(), String::new(), String::new(), String::new()],
        kind,
        number: 0,
        version: 1,
        load_case: 0,
        response: Dof { entity: "A1".into(), node: 12, direction: -2 },
        reference: Dof { entity: "AZ1".into(), node: 101, direction: 3 },
        precision,
        abscissa: if even {
            Abscissa::Even { start: 5.0, step: 0.25 }
        } else {
            Abscissa::Uneven((0..11).map(|i| number(0.1 * (i * i) as f64)).collect())
        },
        values: if complex {
            Values::Complex((0..11).map(|i| Complex::new(number(value(i)), number(value(i + 20)))).collect())
        } else {
            Values::Real((0..11).map(|i| number(value(i))).collect())
        },
        z: 0.0,
        axes: [
            Axis { quantity: 18, label: "Frequency".into(), unit: "Hz".into(), ..Axis::default() },
            Axis::default(),
            Axis::default(),
            Axis::default(),
        ],
        encoding,
    }
}

/// Compares data sets with pyuff's dictionaries of them; returns the largest relative difference of
/// a value, as text.
fn compare(sets: &[DataSet], there: &[Value], worst: &mut Vec<String>) -> String {
    if sets.len() != there.len() {
        worst.push(format!("{} data sets here and {} there", sets.len(), there.len()));
    }
    let mut largest = 0.0f64;
    for (place, (set, theirs)) in sets.iter().zip(there).enumerate() {
        let mut differ = |what: &str, difference: f64, allowed: f64| {
            largest = largest.max(if allowed == SINGLE { 0.0 } else { difference });
            if difference.is_nan() || difference > allowed {
                worst.push(format!(
                    "data set {} ({}): {what} differs by {difference:e}",
                    place + 1,
                    set.number()
                ));
            }
        };
        for (what, mine, allowed) in figures(set) {
            let found = theirs.get(what.0).map(|v| flat(v, what.1)).unwrap_or_default();
            let difference = if found.len() == mine.len() {
                let scale = mine.iter().fold(0.0f64, |m, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
                // each value separately where it has its own digits
                mine.iter()
                    .zip(&found)
                    .fold(0.0f64, |m, (a, b)| m.max((a - b).abs() / a.abs().max(1e-3 * scale)))
            } else {
                f64::NAN
            };
            differ(what.0, difference, allowed);
        }
    }
    format!("{largest:.1e} (doubles)")
}

/// All numbers in a JSON value, and one part (real or imaginary) of complex ones.
fn flat(value: &Value, part: &str) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(|v| flat(v, part)).collect(),
        Value::Object(map) => map.get(part).map(|v| flat(v, part)).unwrap_or_default(),
        Value::String(text) => {
            text.trim().parse().map_or_else(|_| text.bytes().map(f64::from).collect(), |v| vec![v])
        }
        number => number.as_f64().into_iter().collect(),
    }
}

type Figures = ((&'static str, &'static str), Vec<f64>, f64);

/// A data set's numbers (and texts, as bytes) under pyuff's names, with the difference that the
/// format allows.
fn figures(set: &DataSet) -> Vec<Figures> {
    let exact = |name, values: Vec<f64>| ((name, ""), values, 0.0);
    let text = |name, text: &str| ((name, ""), text.bytes().map(f64::from).collect::<Vec<_>>(), 0.0);
    let of_nodes = |nodes: &[Node], allowed: f64| {
        let axis = |i: usize| nodes.iter().map(|n| n.position[i]).collect::<Vec<_>>();
        vec![
            exact("node_nums", nodes.iter().map(|n| n.label as f64).collect()),
            exact("color", nodes.iter().map(|n| n.color as f64).collect()),
            (("x", ""), axis(0), allowed),
            (("y", ""), axis(1), allowed),
            (("z", ""), axis(2), allowed),
        ]
    };
    match set {
        DataSet::Function(f) => {
            let places: Vec<f64> = (0..f.values.len()).map(|i| f.abscissa.at(i)).collect();
            let ascii = f.encoding == Encoding::Ascii;
            let uneven = matches!(f.abscissa, Abscissa::Uneven(_));
            let single = f.precision == Precision::Single;
            let allowed = match (ascii, single) {
                (false, _) => 0.0,
                (true, false) => DOUBLE_TEXT,
                (true, true) => SINGLE,
            };
            let mut all = vec![
                exact("func_type", vec![f.kind as f64]),
                exact("binary", vec![f64::from(u8::from(!ascii))]),
                text("rsp_ent_name", &f.response.entity),
                exact("rsp_node", vec![f.response.node as f64]),
                exact("rsp_dir", vec![f.response.direction as f64]),
                text("ref_ent_name", &f.reference.entity),
                exact("ref_node", vec![f.reference.node as f64]),
                exact("ref_dir", vec![f.reference.direction as f64]),
                exact("abscissa_spec_data_type", vec![f.axes[0].quantity as f64]),
                text("id1", &f.id[0]),
                (("x", ""), places, if ascii && uneven { SINGLE } else { 1e-15 }),
            ];
            match &f.values {
                Values::Real(v) => all.push((("data", ""), v.clone(), allowed)),
                Values::Complex(v) => {
                    all.push((("data", "re"), v.iter().map(|c| c.re).collect(), allowed));
                    all.push((("data", "im"), v.iter().map(|c| c.im).collect(), allowed));
                }
            }
            all
        }
        DataSet::Nodes(nodes) => of_nodes(nodes, SINGLE),
        DataSet::NodesDouble(nodes) => of_nodes(nodes, 0.0),
        DataSet::TraceLine(line) => vec![
            exact("trace_num", vec![line.number as f64]),
            exact("color", vec![line.color as f64]),
            text("id", &line.name),
            exact("nodes", line.nodes.iter().map(|n| *n as f64).collect()),
        ],
        // grouped by kind in pyuff's dictionary
        DataSet::Elements(elements) => elements
            .iter()
            .filter_map(|e| {
                let name = match e.descriptor {
                    44 => "44",
                    11 => "11",
                    _ => return None,
                };
                Some(((name, "nodes_nums"), e.nodes.iter().map(|n| *n as f64).collect(), 0.0))
            })
            .collect(),
        DataSet::Header(h) => vec![
            text("model_name", &h.model),
            text("description", &h.description),
            text("date_db_created", &h.created[0]),
            text("time_db_saved", &h.saved[1]),
            exact("version_db2", vec![h.versions[1] as f64]),
            text("program", &h.program),
        ],
        DataSet::Units(u) => vec![
            exact("units_code", vec![u.code as f64]),
            (("length", ""), vec![u.length], 1e-15),
            (("force", ""), vec![u.force], 1e-15),
            (("temp_offset", ""), vec![u.temperature_offset], 1e-15),
        ],
        other => panic!("data set {} is not written here", other.number()),
    }
}

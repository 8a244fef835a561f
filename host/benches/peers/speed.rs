//! Quickest of five runs of each job, ours and the peer's, on the same machine in one go.

use super::{Outcome, quickest, script};
use jointrig::exchange::uff::{
    Abscissa, ByteOrder, DataSet, Dof, Encoding, Function, Precision, Values, kind, read, write,
};
use jointrig::spectra::{
    ForceWeighting, FrfSettings, ImpactRecords, MotionQuantity, Origin, Windowing, estimate,
};
use num_complex::Complex;
use serde_json::{Value, json};
use std::hint::black_box;
use std::time::Instant;

const HITS: usize = 100;
const RESPONSES: usize = 10;
const SAMPLES: usize = 102_400;
const FUNCTIONS: usize = 288;
const LINES: usize = 3600;
const RUNS: usize = 5;

/// Job, and how many times as fast as the peer it must be.
const JOBS: [(&str, f64); 5] = [
    ("spectra", 5.0),
    ("binary write", 20.0),
    ("ascii write", 20.0),
    ("ascii read", 10.0),
    ("binary read", 1.0),
];

pub fn run(python: Option<&str>) -> Outcome {
    let ours = ours()?;
    let theirs: Option<Value> = python
        .map(|python| {
            let job = json!({
                "hits": HITS, "responses": RESPONSES, "samples": SAMPLES, "functions": FUNCTIONS, "lines": LINES
            });
            script(python, "speed.py", &job.to_string()).and_then(|text| Ok(serde_json::from_str(&text)?))
        })
        .transpose()?;
    println!("H1 and coherence of {HITS} hits x (1 + {RESPONSES}) x {SAMPLES} samples against pyFRF;");
    println!("UFF58 of {FUNCTIONS} x {LINES} complex lines against pyuff; quickest of {RUNS}.");
    println!("| job | ours, s | peer, s | ratio | wanted |");
    println!("|---|---|---|---|---|");
    let mut short = Vec::new();
    for (job, wanted) in JOBS {
        let mine = quickest(ours.iter().find(|(name, _)| *name == job).map_or(&[], |(_, t)| t));
        let Some(theirs) = &theirs else {
            println!("| {job} | {mine:.4} | | | |");
            continue;
        };
        let times: Vec<f64> = serde_json::from_value(theirs[job].clone())?;
        let peer = quickest(&times);
        let ratio = peer / mine;
        println!("| {job} | {mine:.4} | {peer:.4} | {ratio:.1} | {wanted} |");
        if ratio < wanted {
            short.push(job);
        }
    }
    if short.is_empty() { Ok(()) } else { Err(format!("slower than wanted: {}", short.join(", ")).into()) }
}

fn times(mut job: impl FnMut()) -> Vec<f64> {
    (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            job();
            start.elapsed().as_secs_f64()
        })
        .collect()
}

/// Uniform numbers in −1 … 1, the same in every run.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    (0..count)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
        .collect()
}

/// A job's name and its times, s.
type Times = (&'static str, Vec<f64>);

fn ours() -> Result<Vec<Times>, Box<dyn std::error::Error>> {
    let mut all = Vec::new();
    {
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: (0..HITS).map(|h| numbers(SAMPLES, h as u64)).collect(),
            response: (0..HITS)
                .map(|h| (0..RESPONSES).map(|r| numbers(SAMPLES, (1000 * h + r) as u64)).collect())
                .collect(),
            quantity: MotionQuantity::Velocity,
        };
        // the whole record, as the peer takes it
        let settings = FrfSettings {
            windowing: Windowing {
                force_before_s: 1.0,
                force_after_s: 10.0,
                force_taper_s: 0.0,
                sigma_per_s: 0.0,
                force_weighting: ForceWeighting::Exponential,
            },
            origin: Origin::At(0.0),
            ..FrfSettings::default()
        };
        let used = vec![true; HITS];
        let mut failed = None;
        let spectra = times(|| match estimate(black_box(&records), &used, &settings) {
            Ok(y) => drop(black_box(y)),
            Err(error) => failed = Some(error),
        });
        if let Some(error) = failed {
            return Err(error.into());
        }
        all.push(("spectra", spectra));
    }
    let folder = tempfile::tempdir()?;
    for (encoding, writing, reading) in [
        (Encoding::Ascii, "ascii write", "ascii read"),
        (Encoding::Binary(ByteOrder::Little), "binary write", "binary read"),
    ] {
        let path = folder.path().join("speed.uff");
        let sets: Vec<DataSet> =
            (0..FUNCTIONS).map(|i| DataSet::Function(Box::new(function(i, encoding)))).collect();
        all.push((writing, times(|| std::fs::write(&path, write(&sets).expect("writable")).expect("disk"))));
        all.push((
            reading,
            times(|| {
                let contents = read(&std::fs::read(&path).expect("disk"));
                assert_eq!((contents.sets.len(), contents.faults.len()), (FUNCTIONS, 0));
                black_box(contents);
            }),
        ));
    }
    Ok(all)
}

fn function(i: usize, encoding: Encoding) -> Function {
    let parts = numbers(2 * LINES, i as u64);
    Function {
        id: ["speed".into(), String::new(), String::new(), String::new(), String::new()],
        kind: kind::FRF,
        number: 0,
        version: 0,
        load_case: 0,
        response: Dof { entity: "A1".into(), node: 1, direction: 1 },
        reference: Dof { entity: "AZ1".into(), node: 1, direction: 3 },
        precision: Precision::Double,
        abscissa: Abscissa::Even { start: 0.0, step: 0.25 },
        values: Values::Complex(parts.chunks(2).map(|p| Complex::new(p[0], p[1])).collect()),
        z: 0.0,
        axes: Default::default(),
        encoding,
    }
}

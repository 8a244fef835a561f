//! The command `hysteresis`, as a user runs it: valid and invalid records.
#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig::exchange::npz::NpzOutput;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(record: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_jointrig")).arg("hysteresis").arg(record).args(more).output().unwrap()
}

fn json(record: &Path, more: &[&str]) -> Value {
    let output = run(record, &[&["--json"], more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/hysteresis").join(name).join("record.npz")
}

#[test]
fn one_document_with_raw_loops_and_corrected_ones_where_the_arm_is_stated() {
    let found = json(&case("elliptical"), &["--effective-mass", "1.56", "--parallel-path", "0.0133"]);
    let loops = found["hysteresis"].as_array().unwrap();
    assert_eq!(
        (loops.len(), &loops[0]["force"], &loops[1]["force"]),
        (2, &"raw".into(), &"corrected".into())
    );
    for one in loops {
        assert_eq!((&one["kind"], &one["shape"]), (&"shaker".into(), &"elliptical".into()));
        assert!(one["k_t_n_per_m"].is_null());
        // least squares in addition to peak secant and fundamental, under separate names
        let of = |name: &str| one[name].as_f64().unwrap() * 1e-6;
        assert!((of("k_secant_n_per_m") / 213.0 - 1.0).abs() < 0.05, "{one}");
        assert!((of("k_fundamental_n_per_m") / 213.0 - 1.0).abs() < 0.05, "{one}");
        assert!((one["k_eq_n_per_m"]["mean"].as_f64().unwrap() / 90e6 - 1.0).abs() < 0.05, "{one}");
    }
    assert_eq!(found["source"]["kind"], "record");
    assert_eq!(found["source"]["settings"]["effective_mass_kg"], 1.56);
}

#[test]
fn a_normal_load_gives_the_friction_coefficient() {
    let without = json(&case("jenkins"), &[]);
    assert!(without["hysteresis"][0]["friction_coefficient"].is_null());
    let with = json(&case("jenkins"), &["--normal-load", "250"]);
    assert!((with["hysteresis"][0]["friction_coefficient"].as_f64().unwrap() / 0.6 - 1.0).abs() < 0.02);
}

#[test]
fn an_impact_beside_a_hidden_resonance_has_no_k_t() {
    let found = json(&case("impact"), &[]);
    let one = &found["hysteresis"][0];
    assert_eq!((&one["kind"], &one["k_t_n_per_m"]), (&"impact".into(), &Value::Null));
    assert!((one["k_eq_n_per_m"]["mean"].as_f64().unwrap() / 147.9e6 - 1.0).abs() < 0.15, "{one}");
    assert!(one["decay_cycles"].as_array().unwrap().len() > 4);
}

/// Name, shape and values of each array.
type Arrays = Vec<(&'static str, Vec<usize>, Vec<f64>)>;

/// The error, how it is introduced, and words of its message.
type Change = (&'static str, fn(&mut Arrays), &'static [&'static str]);

/// A shaker record of 20 cycles of 200 Hz at 20 kHz, changed before it is written.
fn written(folder: &Path, change: impl FnOnce(&mut Arrays)) -> PathBuf {
    let n = 2_000;
    let wave = |amplitude: f64| -> Vec<f64> {
        (0..n).map(|i| amplitude * (std::f64::consts::TAU * 200.0 * i as f64 / 20_000.0).cos()).collect()
    };
    let mut arrays = vec![
        ("fs", vec![], vec![20_000.0]),
        ("velocity_a", vec![n], wave(3e-4)),
        ("velocity_b", vec![n], wave(1e-4)),
        ("force", vec![n], (0..n).map(|i| 30.0 * (std::f64::consts::TAU * 0.01 * i as f64).sin()).collect()),
        ("excitation", vec![], vec![200.0]),
    ];
    change(&mut arrays);
    let path = folder.join("my.npz");
    let mut out = NpzOutput::create(&path).unwrap();
    for (name, shape, values) in arrays {
        out.real(name, &shape, &values).unwrap();
    }
    out.finish().unwrap();
    path
}

#[test]
fn other_rates_and_frequencies_do_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let found = json(&written(folder.path(), |_| {}), &[]);
    let one = &found["hysteresis"][0];
    // 30 N over 2e-4 m/s at 200 Hz; the trapezoidal rule with a hundred samples per cycle loses
    // 3e-4
    let stiffness = 30.0 / (2e-4 / (std::f64::consts::TAU * 200.0));
    assert_eq!(one["shape"], "stuck");
    assert!((one["k_t_n_per_m"]["mean"].as_f64().unwrap() / stiffness - 1.0).abs() < 1e-3, "{one}");
    // without a given frequency it is found in the record
    let guessed = json(&written(folder.path(), |arrays| drop(arrays.pop())), &[]);
    assert_eq!(guessed["hysteresis"][0]["kind"], "shaker");
    assert!((guessed["hysteresis"][0]["frequency_hz"].as_f64().unwrap() - 200.0).abs() < 1.0);
}

#[test]
fn what_is_no_record_is_refused_by_name_place_and_remedy() {
    let changes: [Change; 9] = [
        ("NaN", |a| a[2].2[700] = f64::NAN, &["sample 700", "cut"]),
        ("infinite", |a| a[3].2[3] = f64::INFINITY, &["sample 3", "cut"]),
        (
            "unequal",
            |a| a[1] = ("velocity_a", vec![100], vec![0.1; 100]),
            &["velocity_a has 100", "2000", "same number"],
        ),
        (
            "too short",
            |a| {
                for array in &mut a[1..4] {
                    array.1 = vec![20];
                    array.2.truncate(20);
                }
            },
            &["20 samples", "32"],
        ),
        ("less than a cycle", |a| a[4].2[0] = 5.0, &["no whole cycle", "5.0 Hz", "record longer"]),
        ("two axes", |a| a[3].1 = vec![2, 1_000], &["`force`", "[2, 1000]", "(sample)"]),
        ("no force", |a| drop(a.remove(3)), &["load_cells", "`force`"]),
        ("no motion", |a| drop(a.remove(1)), &["velocity_a"]),
        ("rate", |a| a[0].2[0] = 0.0, &["fs", "positive"]),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, change, words) in changes {
        let path = written(folder.path(), change);
        let output = run(&path, &["--json"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{name}: {said}");
        for word in ["my.npz"].iter().chain(words) {
            assert!(said.contains(word), "{name}: `{word}` is not in: {said}");
        }
        assert!(said.lines().count() <= 4, "{said}");
    }
    let gone = run(&folder.path().join("none.npz"), &[]);
    assert_eq!(gone.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&gone.stderr).contains("none.npz"));
}

/// A slider of 100 N/µm and 100 N under ± 5 µm at 25 Hz, its force late by `late` of the 1024
/// samples per cycle.
fn slider(folder: &Path, late: usize, more: Vec<(&'static str, Vec<usize>, Vec<f64>)>) -> PathBuf {
    let (cycle, cycles) = (1_024, 8);
    let x: Vec<f64> =
        (0..cycle * cycles).map(|i| 5e-6 * (std::f64::consts::TAU * i as f64 / cycle as f64).sin()).collect();
    let mut at = 0.0;
    // starts a cycle earlier, which loads it
    let force: Vec<f64> = x[..cycle]
        .iter()
        .chain(&x)
        .map(|x| {
            let carried = (100e6 * (x - at)).clamp(-100.0, 100.0);
            at = x - carried / 100e6;
            carried
        })
        .collect();
    let n = x.len();
    let force = force[cycle - late..][..n].to_vec();
    let path = folder.join(format!("late_{late}.npz"));
    let mut out = NpzOutput::create(&path).unwrap();
    let own = vec![
        ("fs", vec![], vec![25_600.0]),
        ("displacement_a", vec![n], x),
        ("displacement_b", vec![n], vec![0.0; n]),
        ("force", vec![n], force),
        ("excitation", vec![], vec![25.0]),
    ];
    for (name, shape, values) in own.into_iter().chain(more) {
        out.real(name, &shape, &values).unwrap();
    }
    out.finish().unwrap();
    path
}

#[test]
fn the_text_has_every_figure_and_finding_and_calls_the_contacts_own_slope_k_t() {
    let folder = tempfile::tempdir().unwrap();
    let load = || vec![("normal_load", vec![], vec![250.0])];
    let late = slider(folder.path(), 52, load());
    let output = run(&late, &[]);
    let said = String::from_utf8(output.stdout).unwrap();
    for word in [
        "25.0 Hz",
        "± 5.00 µm",
        "gross-slip",
        "k_T: 100 ± 0",
        "k_eq: 14",
        "energy: 1.60 mJ",
        "friction limit μN: 100 N",
        "μ = 0.400",
        "late-force",
        "µs later than the motion",
    ] {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
    assert!(!said.contains("between the spots"), "{said}");
    let in_step = slider(folder.path(), 0, Vec::new());
    let said = String::from_utf8(run(&in_step, &[]).stdout).unwrap();
    assert!(said.contains("--normal-load") && !said.contains("!!"), "{said}");
    // an ellipse has no k_T, and the text gives the reason
    let said = String::from_utf8(run(&case("elliptical"), &[]).stdout).unwrap();
    assert!(said.contains("k_T: none") && said.contains("resonates"), "{said}");
}

#[test]
fn a_force_late_by_any_part_of_the_cycle_is_put_in_step() {
    let folder = tempfile::tempdir().unwrap();
    for late in [13, 26, 77, 130] {
        let found = json(&slider(folder.path(), late, Vec::new()), &[]);
        let one = &found["hysteresis"][0];
        let finding = &one["findings"][0];
        assert_eq!(
            (&finding["finding"], &finding["corrected"]),
            (&"late-force".into(), &true.into()),
            "{one}"
        );
        let by_s = finding["by_s"].as_f64().unwrap();
        // a tenth of a sample: corners lie between samples
        assert!((by_s * 25_600.0 - late as f64).abs() < 0.1, "{late}: {by_s}");
        for (name, right) in [("k_t_n_per_m", 100e6), ("energy_j", 1.6e-3)] {
            let value = one[name]["mean"].as_f64().unwrap();
            assert!((value / right - 1.0).abs() < 0.01, "{late}: {name} {value}");
        }
    }
}

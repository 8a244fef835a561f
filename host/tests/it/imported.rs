//! FRFs and records from other systems in a campaign file: they have access to all analyses of a
//! campaign.

use jointrig::exchange::frf_uff::{to_functions, write_uff};
use jointrig::exchange::uff::Encoding;
use jointrig::exchange::{read_frf, read_impacts, write_frf, write_impacts};
use jointrig::spectra::{ImpactRecords, MotionQuantity};
use jointrig::substructuring::Frf;
use num_complex::Complex;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

fn jointrig(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_jointrig"));
    command.current_dir(folder).args(arguments).output().expect("the command runs")
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let out = jointrig(folder, arguments);
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).expect("text")
}

/// stderr of a command that ends with `code`.
fn refused(folder: &Path, arguments: &[&str], code: i32) -> String {
    let out = jointrig(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    said
}

/// The paper's campaign without hits, and exact FRFs of a rig with a rigid clamp: A as npz, the
/// others as universal files.
fn campaign() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    for name in ["A", "B", "AJB"] {
        let frf = read_frf(&data("frf_rigid").join(name).with_extension("npz")).expect("test data");
        write_frf(&at(&format!("{name}.npz")), &frf, &[]).expect("written");
        let directions = vec![0; frf.inputs().len()];
        let functions = to_functions(&frf, &directions, Encoding::Ascii).expect("functions");
        write_uff(&at(&format!("{name}.uff")), &functions).expect("written");
    }
    done(folder.path(), &["campaign", "new", "c.jrig", "--paper"]);
    folder
}

/// Mean stiffness along z by a method with six IDMs over 300 to 600 Hz, N/m.
fn stiffness(results: &Value, method: &str) -> f64 {
    let joints = results["joint"].as_array().expect("joint");
    let is_meant = |j: &&Value| {
        j["method"] == method && j["idms"] == 6 && j["band_hz"] == serde_json::json!([300.0, 600.0])
    };
    let joint = joints.iter().find(is_meant).unwrap_or_else(|| panic!("{method} in {joints:?}"));
    joint["stiffness_n_per_m"]["z"]["mean"].as_f64().expect("a number")
}

#[test]
fn frfs_from_elsewhere_are_analysed_as_if_measured_here() {
    let folder = campaign();
    let folder = folder.path();
    done(folder, &["import", "A.npz", "--into", "c.jrig", "--configuration", "A"]);
    done(folder, &["import", "B.uff", "--into", "c.jrig", "--configuration", "B"]);
    let told = done(folder, &["import", "AJB.uff", "--into", "c.jrig", "--configuration", "AJB"]);
    assert!(told.contains("AJB: ") && told.contains("no variance"), "{told}");
    assert!(done(folder, &["campaign", "status", "c.jrig"]).contains("FRFs of AJB from AJB.uff"));
    assert!(done(folder, &["campaign", "verify", "c.jrig"]).contains("3 imported FRF matrices"));
    let campaign: Value =
        serde_json::from_str(&done(folder, &["analyse", "c.jrig", "--out", "out", "--json"])).expect("JSON");
    let identify = [
        "identify",
        "--a",
        "A.npz",
        "--b",
        "B.npz",
        "--ajb",
        "AJB.npz",
        "--method",
        "internal",
        "--idms",
        "6",
        "--band",
        "300:600",
        "--json",
        "--geometry",
    ];
    let positions = data("positions/positions.xlsx");
    let alone: Value = serde_json::from_str(&done(
        folder,
        &identify.iter().copied().chain([positions.to_str().expect("text")]).collect::<Vec<_>>(),
    ))
    .expect("JSON");
    let (here, there) = (stiffness(&campaign, "internal"), stiffness(&alone, "internal"));
    // the universal files are text with thirteen digits; the decoupling amplifies errors by some
    // thousand
    assert!((here / there - 1.0).abs() < 1e-7, "{here} {there}");
    assert!((here / 180e6 - 1.0).abs() < 1e-3, "{here}");
    assert_eq!(campaign["source"]["settings"]["imported_frf"]["B"]["file"], "B.uff");
    let missing = campaign["missing"].to_string();
    assert!(!missing.contains("AJB has not been measured"), "{missing}");
    // and exported again, with equal numbers
    done(folder, &["export", "c.jrig", "--format", "npz", "--out", "again"]);
    let (first, again) = (read_frf(&folder.join("A.npz")), read_frf(&folder.join("again/frf/A.npz")));
    assert_eq!(again.expect("exported").without_noise(), first.expect("there"));
}

#[test]
fn what_does_not_belong_to_the_plan_is_refused_by_name() {
    let folder = campaign();
    let folder = folder.path();
    let frf = read_frf(&folder.join("A.npz")).expect("test data");
    let (mut outputs, inputs) = (frf.outputs().to_vec(), frf.inputs().to_vec());
    outputs[0] = "A9:x".into();
    let (axis, lines) = (frf.frequency_hz().to_vec(), frf.lines().to_vec());
    let frf = Frf::new(axis, frf.sigma_per_s(), frf.quantity(), outputs, inputs, lines).expect("all agree");
    write_frf(&folder.join("strange.npz"), &frf, &[]).expect("written");
    let said = refused(folder, &["import", "strange.npz", "--into", "c.jrig", "--configuration", "A"], 1);
    assert!(said.contains("strange.npz") && said.contains("A9:x") && said.contains("rename"), "{said}");
    let said = refused(folder, &["import", "A.npz", "--into", "c.jrig", "--configuration", "C"], 2);
    assert!(said.contains("`C`") && said.contains("A, B or AJB"), "{said}");
    let said = refused(folder, &["import", "A.npz", "--into", "c.jrig"], 2);
    assert!(said.contains("--configuration"), "{said}");
    let cell = ["--into", "c.jrig", "--configuration", "A", "--impact", "AZ1", "--response", "A1"];
    let said = refused(folder, &[&["import", "A.npz"], &cell[..]].concat(), 1);
    assert!(said.contains("A.npz") && said.contains("`fs`"), "FRFs are no records: {said}");
    let said = refused(folder, &[&["import", "A.uff"], &cell[..]].concat(), 1);
    assert!(said.contains("A.uff") && said.contains("function type 1"), "{said}");
    // none of this is stored in the file
    assert!(!done(folder, &["campaign", "status", "c.jrig"]).contains("FRFs of"));
}

#[test]
fn hits_and_frfs_of_one_configuration_do_not_stand_side_by_side() {
    let folder = campaign();
    let folder = folder.path();
    std::fs::copy(data("impacts/good.npz"), folder.join("hits.npz")).expect("test data");
    let cell = ["--into", "c.jrig", "--configuration", "A", "--impact", "AZ1", "--response", "A1"];
    let said = refused(folder, &[&["import", "hits.npz"], &cell[..]].concat(), 1);
    assert!(said.contains("three axes") && said.contains("jointrig frf"), "{said}");
    // the same hits with the one response as all three axes
    let mut records = jointrig::exchange::read_impacts(&folder.join("hits.npz")).expect("test data");
    for hit in &mut records.response {
        *hit = vec![hit[0].clone(); 3];
    }
    jointrig::exchange::uff_output::write_records(&folder.join("hits.uff"), &records, "A1", "AZ1")
        .expect("written");
    let told = done(folder, &[&["import", "hits.uff"], &cell[..]].concat());
    assert!(told.contains("3 of 3 hits are good"), "{told}");
    let said = refused(folder, &["import", "A.npz", "--into", "c.jrig", "--configuration", "A"], 1);
    assert!(said.contains("3 good hits"), "{said}");
    // in the opposite order the hits take precedence, and this is reported
    done(folder, &["import", "AJB.npz", "--into", "c.jrig", "--configuration", "AJB"]);
    let cell = ["--into", "c.jrig", "--configuration", "AJB", "--impact", "AZ1", "--response", "A1"];
    done(folder, &[&["import", "hits.uff"], &cell[..]].concat());
    // two cells give no stiffness, which the exit code indicates
    let out = jointrig(folder, &["analyse", "c.jrig", "--out", "out", "--json"]);
    let results = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(1), "{results}");
    assert!(results.contains("the FRFs imported from AJB.npz are not used"), "{results}");
}

/// A plan with one cell, A/AZ1/A1, whose sensor has one axis.
const ONE_CELL: &str = r#"version = 1
name = "one cell"
[record]
rate_hz = 2048
length_s = 8.0
pre_trigger_scans = 40
[hits]
wanted = 2
minimum = 1
most = 8
[force]
target_n = 25.0
tolerance = 0.05
pulse_us = 3500
pulse_bounds_us = [2500, 6000]
[trigger]
level_n = 3.0
flight_s = 0.05
listen_s = 0.15
hold_off_s = 0.05
[limits]
weak_n = 10.0
strong_n = 40.0
rebound_ratio = 0.02
rebound_after_s = 0.001
noise_ratio = 3.0
[settle]
quiet_relative = 0.003
quiet_floor_m_per_s = 1e-6
window_samples = 128
bound_s = 25.0
[window]
exponential_per_s = 0.0
[[configuration]]
name = "A"
impacts = ["AZ1"]
responses = ["A1"]
[geometry]
virtual_point_m = [0.0, 0.0, 0.0]
response = [{ name = "A1", grouping = 1, position_m = [-0.02, 0.02, 0.03], axes = [[0.0, 0.0, 1.0]] }]
impact = [{ name = "AZ1", grouping = 1, position_m = [-0.015, 0.028, 0.03], direction = [0, 0, -1] }]
"#;

const CELL: [&str; 8] = ["--into", "c.jrig", "--configuration", "A", "--impact", "AZ1", "--response", "A1"];

/// Two hits of a Hann pulse of 24 and 25 N on an oscillator of 1 kg, 20 Hz, 2 %: its exact
/// acceleration.
fn soft_hits(fs_hz: f64, length_s: f64, begin_s: f64, width_s: f64) -> ImpactRecords {
    let (w, zeta) = (40.0 * PI, 0.02);
    let pole = Complex::new(-zeta * w, w * f64::sqrt(1.0 - zeta * zeta));
    let hit = |peak_n: f64| -> (Vec<f64>, Vec<f64>) {
        let sample = |i: usize| {
            let t = i as f64 / fs_hz - begin_s;
            if t <= 0.0 {
                return (0.0, 0.0);
            }
            let during = t.min(width_s);
            let turn = 2.0 * PI / width_s;
            let force = if t < width_s { 0.5 * peak_n * (1.0 - (turn * t).cos()) } else { 0.0 };
            let terms = [(0.5, 0.0), (-0.25, turn), (-0.25, -turn)].map(|(part, turn)| {
                let m = Complex::new(0.0, turn);
                ((m * during).exp() - (pole * during).exp()) * (part * peak_n) / (m - pole)
            });
            let answer = terms.iter().sum::<Complex<f64>>() * (pole * (t - during)).exp() / pole.im;
            (force, force - 2.0 * zeta * w * (pole * answer).im - w * w * answer.im)
        };
        (0..(fs_hz * length_s) as usize).map(sample).unzip()
    };
    let (force_n, response): (Vec<_>, Vec<_>) = [24.0, 25.0].map(hit).into_iter().unzip();
    ImpactRecords {
        fs_hz,
        force_n,
        response: response.into_iter().map(|x| vec![x]).collect(),
        quantity: MotionQuantity::Acceleration,
    }
}

/// Accelerance at 20 Hz by `frf`, and by a campaign and its export.
fn both_ways(records: &ImpactRecords) -> [f64; 2] {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    write_impacts(&folder.join("hits.npz"), records).expect("written");
    std::fs::write(folder.join("plan.toml"), ONE_CELL).expect("written");
    done(folder, &["frf", "hits.npz", "--sigma", "0", "--out", "h.npz"]);
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    done(folder, &[&["import", "hits.npz"], &CELL[..]].concat());
    done(folder, &["export", "c.jrig", "--format", "npz", "--out", "x"]);
    ["h.npz", "x/frf/A.npz"].map(|file| {
        let frf = read_frf(&folder.join(file)).expect("written");
        let line = frf.frequency_hz().iter().position(|f| (f - 20.0).abs() < 1e-6).expect("a line at 20 Hz");
        frf.lines()[line][(0, 0)].norm()
    })
}

#[test]
fn soft_tips_give_the_exact_frf_and_long_records_are_used_whole() {
    // the plan's records are longer, these last 4 s
    for width_s in [2e-3, 4e-3, 10e-3, 25e-3] {
        for found in both_ways(&soft_hits(2048.0, 4.0, 0.05, width_s)) {
            // (2πf)² / (2 ζ ω²) at the resonance
            assert!((found / 25.0 - 1.0).abs() < 5e-3, "{width_s} s: {found}");
        }
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    write_impacts(&folder.join("hits.npz"), &soft_hits(2048.0, 4.0, 0.05, 2e-3)).expect("written");
    std::fs::write(folder.join("plan.toml"), ONE_CELL.replace("length_s = 8.0", "length_s = 1.0"))
        .expect("written");
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let told = done(folder, &[&["import", "hits.npz"], &CELL[..]].concat());
    assert!(told.contains("the plan's length_s is 1 s: they are used in full"), "{told}");
    done(folder, &["export", "c.jrig", "--format", "npz", "--out", "x"]);
    let frf = read_frf(&folder.join("x/frf/A.npz")).expect("exported");
    let most = frf.lines().iter().map(|line| line[(0, 0)].norm()).fold(0.0, f64::max);
    assert!((most / 25.0 - 1.0).abs() < 1e-2, "{most}");
}

#[test]
fn frf_and_import_refuse_the_same_hits_for_the_same_reasons() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    std::fs::write(folder.join("plan.toml"), ONE_CELL).expect("written");
    let both = |name: &str, records: &ImpactRecords| -> [String; 2] {
        let file = format!("{name}.npz");
        write_impacts(&folder.join(&file), records).expect("written");
        let campaign = format!("{name}.jrig");
        done(folder, &["campaign", "new", &campaign, "--plan", "plan.toml"]);
        let into = [&["import", &file, "--into", &campaign], &CELL[2..]].concat();
        [jointrig(folder, &["frf", &file, "--sigma", "0"]), jointrig(folder, &into)].map(|out| {
            format!(
                "{} {}{}",
                out.status.code().unwrap_or(-1),
                String::from_utf8_lossy(&out.stdout),
                String::from_utf8_lossy(&out.stderr)
            )
        })
    };
    for (name, begin_s) in [("half", -1e-3), ("third", -0.7e-3)] {
        for said in both(name, &soft_hits(10_240.0, 2.0, begin_s, 2e-3)) {
            assert!(said.starts_with("1 ") && said.contains("begins within the pulse"), "{said}");
        }
    }
    let mut turned = soft_hits(10_240.0, 2.0, 0.01, 2e-3);
    turned.force_n.iter_mut().flatten().for_each(|f| *f = -*f);
    for said in both("turned", &turned) {
        assert!(
            said.starts_with("1 ") && said.contains("sign is the wrong way round: peak -24.0 N"),
            "{said}"
        );
        assert!(!said.contains("weak"), "{said}");
    }
    // an acceleration that drops out for 10 ms, and returns with a step
    let mut dropout = soft_hits(10_240.0, 2.0, 0.01, 2e-3);
    dropout.response[1][0][2000..2100].fill(0.0);
    dropout.response[1][0][2100..2120].iter_mut().for_each(|v| *v += 30.0);
    for said in both("dropout", &dropout) {
        assert!(said.starts_with("0 ") && said.contains("hit 0: good"), "{said}");
        assert!(said.contains("hit 1: noisy") && said.contains("a dropout or spike"), "{said}");
    }
}

#[test]
fn the_frf_of_imported_records_is_that_of_their_arrays_to_the_last_digit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mut records = soft_hits(2048.0, 4.0, 0.05, 2e-3);
    // hits that differ
    for (hit, x) in records.response.iter_mut().enumerate() {
        x[0].iter_mut().for_each(|v| *v *= 1.0 + 0.1 * hit as f64);
    }
    write_impacts(&folder.join("hits.npz"), &records).expect("written");
    std::fs::write(folder.join("plan.toml"), ONE_CELL).expect("written");
    done(folder, &["frf", "hits.npz", "--sigma", "0", "--out", "h.npz"]);
    done(folder, &["campaign", "new", "c.jrig", "--plan", "plan.toml"]);
    let told = done(folder, &[&["import", "hits.npz"], &CELL[..]].concat());
    assert!(told.contains("stored with every digit: force f64"), "{told}");
    done(folder, &["export", "c.jrig", "--format", "npz", "--out", "x"]);
    let [direct, imported] =
        ["h.npz", "x/frf/A.npz"].map(|file| read_frf(&folder.join(file)).expect("written"));
    let mut compared = 0;
    for (line, f) in imported.frequency_hz().iter().enumerate() {
        let Some(other) = direct.frequency_hz().iter().position(|own| own == f) else { continue };
        assert_eq!(imported.lines()[line][(0, 0)], direct.lines()[other][(0, 0)], "{f} Hz");
        compared += 1;
    }
    assert!(compared > 100, "{compared} lines");
    // and the records come out as they went in
    let back = read_impacts(&folder.join("x/records/A_AZ1_A1.npz")).expect("exported");
    assert_eq!((back.force_n, back.response), (records.force_n, records.response));
}

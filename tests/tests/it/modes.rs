//! `jointrig modes` on FRFs whose poles are known and on a simulated campaign, and the modes in the
//! results.
#![allow(clippy::unwrap_used)]

use jointrig::exchange::frf_npz::write_frf;
use jointrig::exchange::frf_uff::{to_functions, write_uff};
use jointrig::exchange::npz::NpzFile;
use jointrig::exchange::uff::{DataSet, Encoding, read};
use jointrig::frf::{Frf, MotionQuantity};
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use jointrig_tests::own_plan::plan;
use nalgebra::DMatrix;
use num_complex::Complex;
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::Path;

/// Natural frequency, Hz, damping ratio and real shape at A1:z, A2:z, A3:z of each mode.
const TRUE: [(f64, f64, [f64; 3]); 3] =
    [(90.0, 0.002, [1.0, 0.8, 0.5]), (140.0, 0.01, [0.6, -1.0, 0.3]), (260.0, 0.005, [-0.4, 0.5, 1.0])];

/// Mobilities of three outputs from hits at two of them, with a window of 2.3 1/s.
fn frf() -> Frf {
    let frequency_hz: Vec<f64> = (100..=800).map(|k| 0.5 * f64::from(k)).collect();
    let lines = frequency_hz.iter().map(|f| {
        let s = Complex::new(2.3, TAU * f);
        DMatrix::from_fn(3, 2, |o, i| {
            let terms = TRUE.iter().map(|(f, damping, shape)| {
                let omega = TAU * f;
                shape[o] * shape[2 * i] * s / (s * s + 2.0 * damping * omega * s + omega * omega)
            });
            terms.sum::<Complex<f64>>()
        })
    });
    let lines = lines.collect();
    let names = |all: &[&str]| all.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let outputs = names(&["A1:z", "A2:z", "A3:z"]);
    Frf::new(frequency_hz, 2.3, MotionQuantity::Velocity, outputs, names(&["A1", "A3"]), lines).unwrap()
}

fn modes(file: &Path, more: &[&str]) -> Value {
    serde_json::from_str(&done(jointrig().arg("modes").arg(file).arg("--json").args(more))).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Whether these are the modes of [`TRUE`], whose shape at output k over that at output 0 is real.
fn are_true(found: &Value) {
    let rows = found["modes"].as_array().unwrap();
    assert_eq!(rows.len(), TRUE.len(), "{found}");
    for (row, (frequency_hz, damping, shape)) in rows.iter().zip(TRUE) {
        let [found_hz, found_damping] =
            ["frequency_hz", "damping_ratio"].map(|name| number(&row[name]["mean"]));
        // universal files have single precision
        assert!((found_hz / frequency_hz - 1.0).abs() < 1e-6, "{row}");
        assert!((found_damping / damping - 1.0).abs() < 1e-3, "{row}");
        for (k, wanted) in shape.iter().enumerate() {
            let value =
                |k: usize| Complex::new(number(&row["shape"][k]["re"]), number(&row["shape"][k]["im"]));
            assert!((value(k) / value(0) - wanted / shape[0]).norm() < 1e-3, "{row}");
        }
        assert!(number(&row["phase_collinearity"]) > 0.999, "{row}");
    }
}

#[test]
fn frfs_of_either_format_give_their_poles_and_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_frf(&at("y.npz"), &frf(), &[]).unwrap();
    write_uff(&at("y.uff"), &to_functions(&frf(), &[3, 3], Encoding::Ascii).unwrap()).unwrap();
    let of_npz = modes(&at("y.npz"), &["--out", at("modes.npz").to_str().unwrap()]);
    are_true(&of_npz);
    assert_eq!(of_npz["modes"][0]["scaling"], "largest-output-is-one");
    let of_uff = modes(&at("y.uff"), &["--out", at("modes.unv").to_str().unwrap()]);
    are_true(&of_uff);
    // the labels name A1 and A3 as driving points
    assert_eq!(of_uff["modes"][0]["scaling"], "unit-modal-a");

    let mut arrays = NpzFile::open(&at("modes.npz")).unwrap();
    let poles = arrays.complex("pole", "(mode)").unwrap().values;
    assert!((poles[1].norm() / TAU / 140.0 - 1.0).abs() < 1e-6, "{poles:?}");
    assert_eq!(arrays.complex("shape", "(mode, output)").unwrap().shape, [3, 3]);
    assert_eq!(arrays.real("pole_covariance", "(mode, 2, 2)").unwrap().shape, [3, 2, 2]);

    let contents = read(&std::fs::read(at("modes.unv")).unwrap());
    assert_eq!(contents.faults, vec![]);
    let shapes: Vec<_> = contents
        .sets
        .iter()
        .filter_map(|set| if let DataSet::NodalData(mode) = set { Some(mode) } else { None })
        .collect();
    assert_eq!(shapes.len(), 3);
    for ((number, mode), (frequency_hz, _, shape)) in (1..).zip(shapes).zip(TRUE) {
        assert_eq!(mode.mode_number(), Some(number));
        let pole = mode.eigenvalue_per_s().unwrap();
        assert!((pole.norm() / TAU / frequency_hz - 1.0).abs() < 1e-5, "{pole}");
        let along_z = |node: usize| mode.nodes[node].1[2];
        assert!((along_z(1) / along_z(0) - shape[1] / shape[0]).norm() < 1e-3, "{mode:?}");
        assert_eq!(mode.nodes[0].1[0], Complex::default());
    }
}

#[test]
fn what_cannot_be_identified_is_refused_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_frf(&at("y.npz"), &frf(), &[]).unwrap();
    let refused = |arguments: &[&str], code: i32| {
        let out = jointrig().arg("modes").arg(at("y.npz")).args(arguments).output().unwrap();
        assert_eq!(out.status.code(), Some(code), "{arguments:?}");
        String::from_utf8(out.stderr).unwrap()
    };
    assert!(refused(&["--band", "100:104"], 1).contains("at least 16 are needed"));
    assert!(refused(&["--structure", "A"], 2).contains("--structure is for campaign files"));
    assert!(refused(&["--out", "modes.txt"], 2).contains(".npz, .unv or .uff"));
    let unnamed = frf().renamed(["x", "y", "z"].map(String::from).to_vec(), vec!["p".into(), "q".into()]);
    write_frf(&at("y.npz"), &unnamed.unwrap(), &[]).unwrap();
    let out = at("modes.unv");
    assert!(refused(&["--out", out.to_str().unwrap()], 1).contains("output `x` has no direction"));
    // a gap leaves out what it belongs to, and this is said
    let holed = frf().map_lines(|_, mut y| y[(1, 0)] = Complex::new(f64::NAN, 0.0));
    write_frf(&at("y.npz"), &holed, &[]).unwrap();
    let found = modes(&at("y.npz"), &[]);
    let warnings = found["modal"][0]["warnings"].to_string();
    assert!(warnings.contains("A2:z"), "{warnings}");
    assert_eq!(found["modes"].as_array().unwrap().len(), 3);
}

/// A rig of rigid bodies with clamped tips: the command and the results name the same modes, and
/// the report draws them.
#[test]
fn a_campaign_has_modes_in_command_results_and_report() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let toml = include_str!("../../../hil-sim/rigs/clamped-tips.toml");
    std::fs::write(at("rig.toml"), toml).unwrap();
    std::fs::write(at("plan.toml"), plan(&RigConfig::from_toml(toml).unwrap())).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let address = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(at("lab.jrig")));
    let found = modes(&at("lab.jrig"), &["--out", at("shapes.unv").to_str().unwrap()]);
    done(jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")));
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();
    let rows = found["modes"].as_array().unwrap();
    assert!(!rows.is_empty(), "{found}");
    for pair in rows.windows(2) {
        assert!(number(&pair[0]["frequency_hz"]["mean"]) <= number(&pair[1]["frequency_hz"]["mean"]));
    }
    // the command reads the same hits by another path
    let frequencies = |all: &Value| -> Vec<f64> {
        all["modes"].as_array().unwrap().iter().map(|row| number(&row["frequency_hz"]["mean"])).collect()
    };
    for (a, b) in frequencies(&found).iter().zip(frequencies(&results)) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} Hz and {b} Hz");
    }
    assert_eq!(rows.len(), results["modes"].as_array().unwrap().len());
    let written = read(&std::fs::read(at("shapes-AJB.unv")).unwrap());
    assert!(written.sets.iter().any(|set| matches!(set, DataSet::NodesDouble(_))));
    let page = std::fs::read_to_string(at("out/report.html")).unwrap();
    for figure in ["fig-stabilisation", "fig-mode-shapes"] {
        assert!(page.contains(figure), "{figure}");
    }
}

/// The first mode of a short campaign on the assembly alone; the contact's stiffness rises by
/// `drift_per_hit` with each hit.
fn first_mode(drift_per_hit: f64) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let elastic = include_str!("../../../hil-sim/rigs/elastic.toml");
    let rig = format!("{elastic}\n[contact]\ndrift_per_hit = {drift_per_hit:?}\n");
    std::fs::write(at("rig.toml"), rig).unwrap();
    let responses = ["A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4"];
    let cells = jointrig_tests::campaign::plan(2, &[("AJB", &["AZ1", "AY1", "AX1"], &responses)]);
    std::fs::write(at("plan.toml"), cells).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let address = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(at("lab.jrig")));
    // no stiffness follows from the assembly alone, which ends the command with 1
    jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")).output().unwrap();
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();
    results["first_mode"].clone()
}

#[test]
fn a_contact_that_drifts_changes_the_first_mode_and_a_steady_one_does_not() {
    let drifting = first_mode(5e-3);
    assert_eq!(drifting["drifts"], true, "{}", drifting["meaning"]);
    // the contact stiffens by a quarter: the averaged FRFs show modes that no hit has, and neither
    // size nor sign of the change follows from them
    assert_eq!(drifting["change_hz"], Value::Null, "{}", drifting["meaning"]);
    assert!(drifting["meaning"].as_str().unwrap().contains("by how much is not known"));
    assert!(drifting["hits"].as_array().unwrap().len() >= 8);
    assert!(drifting["meaning"].as_str().unwrap().contains("not the same in all hits"));
    let steady = first_mode(0.0);
    assert_ne!(steady["drifts"], true, "{}", steady["meaning"]);
    let [low, high] = [0, 1].map(|end| number(&steady["change_hz"]["ci95"][end]));
    assert!(low < 0.3 && high > -0.3, "{}", steady["meaning"]);
}

//! `jointrig identify` as a script uses it: documents, exit codes, and the reason for every
//! refusal.

use jointrig::exchange::{read_frf, write_frf};
use jointrig::substructuring::Frf;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// The same values on another axis, with other names.
fn relabelled(frf: &Frf, frequency_hz: Vec<f64>, outputs: Vec<String>) -> Frf {
    let (inputs, lines) = (frf.inputs().to_vec(), frf.lines().to_vec());
    Frf::new(frequency_hz, frf.sigma_per_s(), frf.quantity(), outputs, inputs, lines).expect("all agree")
}

/// Three FRF files and a geometry in a separate folder, to be damaged.
struct Files {
    folder: tempfile::TempDir,
    geometry: PathBuf,
}

impl Files {
    fn of(case: &str) -> Files {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for file in ["A.npz", "B.npz", "AJB.npz"] {
            std::fs::copy(data(case).join(file), folder.path().join(file)).expect("copied");
        }
        Files { folder, geometry: data("positions/positions.xlsx") }
    }

    fn change(&self, file: &str, change: impl FnOnce(Frf) -> Frf) {
        let path = self.folder.path().join(file);
        let frf = change(read_frf(&path).expect("test data"));
        write_frf(&path, &frf, &[]).expect("written");
    }

    /// The csv tables without the lines that begin with `name`.
    fn without_sensor(&mut self, name: &str) {
        let folder = self.folder.path().join("geometry");
        std::fs::create_dir(&folder).expect("a folder");
        for entry in std::fs::read_dir(data("positions/csv")).expect("test data") {
            let from = entry.expect("an entry").path();
            let text = std::fs::read_to_string(&from).expect("text");
            let kept: Vec<&str> =
                text.lines().filter(|line| !line.starts_with(&format!("{name},"))).collect();
            std::fs::write(folder.join(from.file_name().expect("a name")), kept.join("\n")).expect("written");
        }
        self.geometry = folder;
    }

    fn identify(&self, further: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_jointrig"));
        command.arg("identify");
        for (flag, file) in [("--a", "A.npz"), ("--b", "B.npz"), ("--ajb", "AJB.npz")] {
            command.arg(flag).arg(self.folder.path().join(file));
        }
        command.arg("--geometry").arg(&self.geometry).args(further).output().expect("the command runs")
    }

    /// Requires exit code 1 and a reason of one to a few lines on stderr.
    fn refused(&self, further: &[&str], parts: &[&str]) {
        let out = self.identify(further);
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(1), "{text}");
        for part in parts {
            assert!(text.contains(part), "`{part}` is not in: {text}");
        }
        assert!(text.lines().count() <= 6, "{text}");
    }
}

#[test]
fn every_method_finds_the_contact_of_a_rigid_clamp() {
    let out = Files::of("frf_rigid").identify(&["--idms", "6", "--band", "300:600", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    assert_eq!(found["version"], 1);
    let rows = found["joint"].as_array().expect("rows");
    for row in rows {
        let z = &row["stiffness_n_per_m"]["z"];
        let mean = z["mean"].as_f64().expect("a number");
        if row["method"] != "internal-printed" {
            // exact data and exact methods; conditioning leaves errors of 1e-8
            assert!((mean / 180e6 - 1.0).abs() < 1e-5, "{row}");
            // the rig's joint is diagonal
            let coupling = row["coupling_si"]["y-z"]["mean"].as_f64().expect("a number");
            assert!(coupling.abs() < 1e3, "{row}");
        }
        assert_eq!(row["lines"], 76);
        assert!(z["ci95"].is_array() && row["warnings"].is_array());
        assert!(row["damping_n_s_per_m"]["z"]["mean"].is_number());
    }
    let best = &found["recommended"][0];
    assert!((best["joint"]["z"]["stiffness"].as_f64().expect("a number") / 180e6 - 1.0).abs() < 1e-3);
    assert_eq!(best["noise_known"], false);
}

/// Two sets of two modes have the same count: the noise of each must be given with its own
/// spectrum.
#[test]
fn the_noise_of_a_line_is_its_own_sets() {
    let files = Files::of("frf_rigid");
    for file in ["A.npz", "B.npz", "AJB.npz"] {
        let path = files.folder.path().join(file);
        let frf = read_frf(&path).expect("test data");
        let variance = frf.lines().iter().map(|y| y.map(|_| 1e-18)).collect();
        let frf = frf.with_variance(variance).expect("one for each value");
        write_frf(&path, &frf, &[]).expect("written");
    }
    let noises = |sets: &[&str]| -> Vec<Value> {
        let mut words = vec!["--method", "inverse", "--band", "300:600", "--json"];
        words.extend(sets.iter().flat_map(|set| ["--idms", *set]));
        let out = files.identify(&words);
        assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
        let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
        for row in found["joint"].as_array().expect("rows") {
            assert!(row["noise_n_per_m"]["z"].as_f64().expect("the variance is known") > 0.0, "{row}");
        }
        let curves = found["joint_spectrum"]["curves"].as_array().expect("curves").clone();
        let along_z = curves.into_iter().filter(|c| c["dof"] == "z");
        along_z.map(|c| c["stiffness_noise_n_per_m"].clone()).collect()
    };
    let (first, second, both) = (noises(&["y,z"]), noises(&["x,z"]), noises(&["y,z", "x,z"]));
    assert_ne!(first, second);
    assert_eq!(both, [first, second].concat());
}

/// Universal files of another program (58b) with names in the DOF labels, compared with an
/// independent implementation's results.
#[test]
fn universal_files_are_read_as_npz_is() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_jointrig"));
    command.arg("identify");
    for (flag, file) in [("--a", "uff/A.uff"), ("--b", "uff/B.uff"), ("--ajb", "uff/AJB.uff")] {
        command.arg(flag).arg(data(file));
    }
    command.arg("--geometry").arg(data("positions/positions.xlsx")).args(["--band", "300:600", "--json"]);
    let out = command.output().expect("the command runs");
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    let text = std::fs::read_to_string(data("uff/expected.json")).expect("test data");
    let expected: Value = serde_json::from_str(&text).expect("JSON");
    for wanted in expected["joint"].as_array().expect("rows") {
        let same = |row: &&Value| row["method"] == wanted["method"] && row["idms"] == wanted["idms"];
        let row = found["joint"].as_array().expect("rows").iter().find(same).expect("the same methods");
        let number = |v: &Value| v.as_f64().expect("a number");
        let (k, truth) = (number(&row["stiffness_n_per_m"]["z"]["mean"]), number(&wanted["mean"]));
        // where the method is exact it is the contact's 180 N/µm; elsewhere the same function of
        // the same data
        assert!((k / truth - 1.0).abs() < number(&wanted["tol"]["mean"]), "{wanted}: {k}");
        assert_eq!(row["lines"], wanted["lines"]);
    }
}

#[test]
fn a_damaged_universal_file_is_refused_with_its_name() {
    let files = Files::of("frf_rigid");
    let path = files.folder.path().join("A.uff");
    std::fs::write(&path, "    -1\n    58\nnothing\n").expect("written");
    let out = files.identify(&["--a", path.to_str().expect("a name")]);
    let text = String::from_utf8_lossy(&out.stderr);
    // a duplicate is a command line error; the option alone is a data error
    assert_eq!(out.status.code(), Some(2), "{text}");
    let out = Command::new(env!("CARGO_BIN_EXE_jointrig"))
        .arg("identify")
        .arg("--a")
        .arg(&path)
        .arg("--b")
        .arg(data("uff/B.uff"))
        .arg("--ajb")
        .arg(data("uff/AJB.uff"))
        .arg("--geometry")
        .arg(&files.geometry)
        .output()
        .expect("the command runs");
    let text = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{text}");
    assert!(text.contains("A.uff") && text.contains("no complex FRF"), "{text}");
}

#[test]
fn modes_are_chosen_by_name() {
    let files = Files::of("frf_rigid");
    let out = files.identify(&["--idms", "x,z,ry", "--idms", "6", "--method", "inverse", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    let row = &found["joint"][0];
    assert_eq!((&row["idms"], &row["modes"]), (&Value::from(3), &serde_json::json!(["x", "z", "ry"])));
    assert!(row["stiffness_n_per_m"]["y"].is_null() && row["stiffness_n_m_per_rad"]["ry"].is_object());
}

#[test]
fn default_bands_are_the_papers() {
    let out = Files::of("frf_default").identify(&["--json", "--method", "inverse", "--idms", "2"]);
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    let bands: Vec<&Value> =
        found["joint"].as_array().expect("rows").iter().map(|row| &row["band_hz"]).collect();
    assert_eq!(
        bands,
        [
            &serde_json::json!([300.0, 600.0]),
            &serde_json::json!([100.0, 800.0]),
            &serde_json::json!([100.0, 300.0])
        ]
    );
}

#[test]
fn a_sensor_set_of_rank_five_is_refused() {
    let mut files = Files::of("frf_rigid");
    files.without_sensor("A3");
    files
        .refused(&["--method", "inverse", "--idms", "6"], &["inverse with 6 IDMs", "5 of 6 motions", "A1:x"]);
    // results that fewer modes allow are still given
    let out = files.identify(&["--method", "inverse", "--idms", "2", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn three_internals_for_six_modes_are_refused() {
    let files = Files::of("frf_rigid");
    files.change("AJB.npz", |frf| {
        let (outputs, inputs): (Vec<String>, Vec<String>) = (
            frf.outputs().iter().filter(|o| o.starts_with("B4")).cloned().collect(),
            frf.inputs().iter().filter(|i| i.starts_with("I_")).cloned().collect(),
        );
        assert_eq!((outputs.len(), inputs.len()), (3, 3));
        frf.select(&outputs, &inputs).expect("they are there")
    });
    files.refused(
        &["--method", "internal", "--idms", "6"],
        &["internal with 6 IDMs", "3 internal impacts and 3 internal responses", "6 interface DoFs"],
    );
    // the printed form gives a result and states its limits
    let out = files.identify(&["--method", "internal-printed", "--idms", "6", "--band", "300:600", "--json"]);
    assert_eq!(out.status.code(), Some(0));
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    let warnings = found["joint"][0]["warnings"].to_string();
    assert!(warnings.contains("Π has rank 3 of 6"), "{warnings}");
}

#[test]
fn lines_that_are_no_numbers_are_refused() {
    let files = Files::of("frf_rigid");
    files.change("B.npz", |frf| {
        frf.map_lines(|line, mut y| {
            if line == 3 {
                y.iter_mut().for_each(|v| v.re = f64::NAN);
            }
        })
    });
    files.refused(
        &["--method", "interface", "--idms", "6"],
        &["interface with 6 IDMs", "B: ", "not a number at 312 Hz"],
    );
}

#[test]
fn files_on_other_lines_are_refused() {
    let files = Files::of("frf_rigid");
    files.change("B.npz", |frf| {
        let moved = frf.frequency_hz().iter().map(|f| f + 0.5).collect();
        relabelled(&frf, moved, frf.outputs().to_vec())
    });
    files.refused(&[], &["B is on other frequency lines than A", "300.5 Hz against 300 Hz"]);
    let files = Files::of("frf_rigid");
    files.change("AJB.npz", |frf| {
        let beyond = frf.frequency_hz().iter().map(|f| f + 400.0).collect();
        relabelled(&frf, beyond, frf.outputs().to_vec())
    });
    files.refused(&[], &["AJB is on other frequency lines than A"]);
}

#[test]
fn files_of_overlapping_bands_are_answered_from_their_common_lines_and_it_is_said() {
    let asked = ["--method", "inverse", "--idms", "6", "--band", "299:501"];
    let joint = |files: &Files| {
        let out = files.identify(&[&asked[..], &["--json"]].concat());
        assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
        let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
        let z = &found["joint"][0]["stiffness_n_per_m"]["z"]["mean"];
        (z.as_f64().expect("a number"), found["joint"][0]["lines"].clone(), found["missing"].to_string())
    };
    let files = Files::of("frf_rigid");
    let (whole, lines, missing) = joint(&files);
    assert_eq!((lines, missing.contains("in common")), (Value::from(51), false));
    files.change("AJB.npz", |frf| frf.band(300.0, 500.0));
    files.change("A.npz", |frf| {
        // as printed with six digits
        let printed = frf.frequency_hz().iter().map(|f| f * (1.0 + 2e-6)).collect();
        relabelled(&frf, printed, frf.outputs().to_vec())
    });
    let (common, lines, missing) = joint(&files);
    assert_eq!(lines, 51);
    assert!(missing.contains("51 lines from 300") && missing.contains("500"), "{missing}");
    // the data and the method are exact
    assert!((common / whole - 1.0).abs() < 1e-4, "{common} {whole}");
    let text = files.identify(&asked);
    assert!(String::from_utf8_lossy(&text.stdout).contains("that A, B and AJB have in common"));
}

#[test]
fn names_that_do_not_meet_are_refused() {
    let files = Files::of("frf_rigid");
    files.change("AJB.npz", |frf| {
        let renamed = frf.outputs().iter().map(|o| format!("_{o}")).collect();
        relabelled(&frf, frf.frequency_hz().to_vec(), renamed)
    });
    files.refused(&["--method", "inverse"], &["AJB has none of its responses", "A1:x", "_A1:x"]);
}

#[test]
fn a_missing_file_and_a_wrong_command_line_differ_in_their_code() {
    let files = Files::of("frf_rigid");
    std::fs::remove_file(files.folder.path().join("B.npz")).expect("removed");
    files.refused(&[], &["B.npz", "check the name"]);
    for wrong in [&["--idms", "3"][..], &["--idms", "x,q"], &["--band", "600:300"], &["--method", "none"]] {
        assert_eq!(files.identify(wrong).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn the_fit_asks_for_the_noise_and_takes_it_stated() {
    let files = Files::of("frf_rigid");
    files.refused(&["--method", "fit", "--idms", "6"], &["fit with 6 IDMs", "`variance`", "--noise"]);
    let out = files.identify(&[
        "--method",
        "fit",
        "--idms",
        "6",
        "--band",
        "300:600",
        "--noise",
        "0.001",
        "--json",
        "--position-error",
        "0",
        "--aim-error",
        "0",
        "--angle-error",
        "0",
    ]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let found: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
    let row = &found["joint"][0];
    assert_eq!((&row["method"], &row["lines"]), (&Value::from("fit"), &Value::from(76)));
    let z = &row["stiffness_n_per_m"]["z"];
    let number = |v: &Value| v.as_f64().expect("a number");
    assert!((number(&z["mean"]) / 180e6 - 1.0).abs() < 0.01, "{z}");
    assert!(number(&z["ci95"][0]) < 180e6 && 180e6 < number(&z["ci95"][1]), "{z}");
}

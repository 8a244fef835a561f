//! FRFs and records from elsewhere in a campaign file: a lab with its own analyser gets all that is behind the file.

use jointrig::exchange::frf_uff::{to_functions, write_uff};
use jointrig::exchange::uff::Encoding;
use jointrig::exchange::{read_frf, write_frf};
use jointrig::substructuring::Frf;
use serde_json::Value;
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

/// What stderr says of a command that ends with `code`.
fn refused(folder: &Path, arguments: &[&str], code: i32) -> String {
    let out = jointrig(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    said
}

/// The paper's campaign without a hit, and the exact FRFs of a rig with a rigid clamp beside it: A as npz, the others as universal files.
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
    assert!(done(folder, &["campaign", "verify", "c.jrig"]).contains("3 FRF matrices"));
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
    // the universal files are text of thirteen digits; the decoupling amplifies by some thousand
    assert!((here / there - 1.0).abs() < 1e-7, "{here} {there}");
    assert!((here / 180e6 - 1.0).abs() < 1e-3, "{here}");
    assert_eq!(campaign["source"]["settings"]["imported_frf"]["B"]["file"], "B.uff");
    let missing = campaign["missing"].to_string();
    assert!(!missing.contains("AJB has not been measured"), "{missing}");
    // and out again, with equal numbers
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
    // nothing of all that is in the file
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
    // the other way round the hits count, and it is said
    done(folder, &["import", "AJB.npz", "--into", "c.jrig", "--configuration", "AJB"]);
    let cell = ["--into", "c.jrig", "--configuration", "AJB", "--impact", "AZ1", "--response", "A1"];
    done(folder, &[&["import", "hits.uff"], &cell[..]].concat());
    // two cells give no stiffness, which the exit code says
    let out = jointrig(folder, &["analyse", "c.jrig", "--out", "out", "--json"]);
    let results = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(1), "{results}");
    assert!(results.contains("the FRFs imported from AJB.npz are not used"), "{results}");
}

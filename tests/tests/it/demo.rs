//! `jointrig demo`, as a user runs it: it recovers the physics of the simulated rig.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use jointrig_tests::campaign::one_second;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};
use serde_json::Value;

/// Runs the demo and returns its results.
fn demo(out: &Path) -> Value {
    let run = jointrig().arg("demo").arg("--out").arg(out).args(["--seed", "7"]).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert!(out.join("report.html").is_file() && out.join("campaign.jrig").is_file());
    serde_json::from_str(&std::fs::read_to_string(out.join("results.json")).unwrap()).unwrap()
}

/// k_z of a method with six IDMs over 300–600 Hz, N/µm.
fn sliding_stiffness(results: &Value, method: &str) -> f64 {
    let rows = results["joint"].as_array().unwrap();
    let wanted = |row: &&Value| {
        row["method"] == method && row["idms"] == 6 && row["band_hz"] == serde_json::json!([300.0, 600.0])
    };
    let row = rows.iter().find(wanted).unwrap_or_else(|| panic!("no row of {method}"));
    row["stiffness_n_per_m"]["z"]["mean"].as_f64().unwrap() * 1e-6
}

/// Clamp (29.4 N/µm with the bending of specimen and arms) and contact are in series on the
/// simulated rig: substructuring should find 25.3 N/µm there for a contact of 180, and the results
/// must state that this is not k_T. The range 22 to 31 allows for position errors of 0.5 mm and 2°.
#[test]
fn the_simulated_rig_shows_clamp_and_contact_in_series() {
    let folder = tempfile::tempdir().unwrap();
    let results = demo(folder.path());
    let k = sliding_stiffness(&results, "internal");
    assert!((22.0..31.0).contains(&k), "{k} N/µm");
    let checks = results["checks"].as_array().unwrap();
    let series = checks.iter().find(|check| check["name"] == "series-compliance").unwrap();
    assert_eq!(series["ok"], false, "{series}");
    let [low, high] =
        ["low", "high"].map(|end| series[format!("series_stiffness_{end}_n_per_m")].as_f64().unwrap());
    assert!(low < 29.4e6 && 29.4e6 < high, "{series}");
    // A and B are coupled only by the contact, and position errors must not be reported as a
    // coupling
    let coupled = checks.iter().find(|check| check["name"] == "back-coupling").unwrap();
    assert_ne!(coupled["ok"], false, "{coupled}");
    // the specimen with a clamp is the one that moves relative to its arm
    let hidden = checks.iter().find(|check| check["name"] == "hidden-resonance").unwrap();
    assert!(hidden["meaning"].as_str().unwrap().contains("specimen A that moves in its clamp"), "{hidden}");
}

/// With a rigid clamp and no position errors, substructuring finds the contact itself: 180 N/µm
/// within 5 %. The plan is the demo's, with shorter records.
#[test]
fn the_rigid_clamp_shows_the_contact() {
    let (folder, file) = campaign(&one_second(include_str!("../../../docs/plans/demo.toml")));
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../hil-sim/rigs/rigid-clamp.toml");
    let device = format!("sim:{}", rig.display());
    done(jointrig().args(["campaign", "run", "--yes", "--seed", "7", "--device", &device]).arg(&file));
    done(jointrig().arg("analyse").arg(&file).arg("--out").arg(folder.path()));
    let results: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("results.json")).unwrap()).unwrap();
    let k = sliding_stiffness(&results, "internal");
    assert!((k / 180.0 - 1.0).abs() < 0.05, "{k} N/µm");
    // only noise changes these lines, and its size is the noise reported for each: the median of
    // the absolute value of a normal distribution is 0.674 σ; three hits determine a variance to
    // some tens of per cent
    let spectrum = &results["joint_spectrum"];
    let curves = spectrum["curves"].as_array().unwrap();
    let internal = |c: &&Value| c["method"] == "internal" && c["idms"] == 6 && c["dof"] == "z";
    let curve = curves.iter().find(internal).unwrap();
    let numbers = |values: &Value| -> Vec<f64> {
        values.as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let lines = numbers(&spectrum["frequency_hz"]);
    let (k, noise) = (numbers(&curve["stiffness_n_per_m"]), numbers(&curve["stiffness_noise_n_per_m"]));
    let mut off: Vec<f64> = (0..lines.len())
        .filter(|&l| (300.0..=600.0).contains(&lines[l]))
        .map(|l| (k[l] - 180e6).abs() / noise[l])
        .collect();
    off.sort_by(f64::total_cmp);
    let in_sigmas = off[off.len() / 2] / 0.674;
    assert!((0.7..1.4).contains(&in_sigmas), "{in_sigmas}");
}

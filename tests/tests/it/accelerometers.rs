//! A laboratory without lasers: accelerometers on both specimens, a hammer by hand, and a front end
//! of 16 channels with one load cell or none.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use serde_json::Value;
use std::path::Path;

const RIG: &str = include_str!("../../../hil-sim/rigs/accelerometers.toml");
/// k_T of the default rig, N/m.
const TRUTH: f64 = 180e6;

/// Writes a template, checks it, and measures it on this rig into `lab.jrig`; returns what `plan
/// check` said.
fn measured(folder: &Path, template: &str, rig: &str) -> String {
    let at = |name: &str| folder.join(name);
    std::fs::write(at("rig.toml"), rig).unwrap();
    done(jointrig().args(["plan", "new", "--template", template]).arg(at("plan.toml")));
    let told = done(jointrig().args(["plan", "check", "--no-picture"]).arg(at("plan.toml")));
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let address = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(at("lab.jrig")));
    told
}

#[test]
fn the_contacts_stiffness_is_found_with_accelerometers_and_a_hammer_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let told = measured(folder.path(), "contact-by-hand", RIG);
    assert!(told.contains("k_T of the contact: yes") && told.contains("130 good hits wanted"), "{told}");
    let said = done(jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")));
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();
    let contact = &results["answer"]["contact"];
    let [low, high] = [0, 1].map(|end| contact["k_t_n_per_m"]["ci95"][end].as_f64().unwrap());
    println!("{said}\n{contact}");
    // positions to 0.2 mm, and specimens of which nothing is stated, leave 15 % either way
    assert!(low < TRUTH && TRUTH < high && high < 1.45 * low, "{contact}");
    // the masses are told, and change nothing: all sensors on B stay
    let checks = results["checks"].as_array().unwrap();
    let masses = checks.iter().find(|check| check["name"] == "sensor-masses").unwrap();
    assert_eq!(masses["ok"], true, "{masses}");
    assert!(masses["meaning"].as_str().unwrap().contains("2.80 g to A's side and 2.80 g to B's"), "{masses}");
    // what the plan let expect is what came out
    let line = told.lines().find(|line| line.contains("a contact of 180 N/µm: ± ")).unwrap();
    let (_, rest) = line.split_once("± ").unwrap();
    let expected = rest.split_once(" %").unwrap().0.parse::<f64>().unwrap();
    let half = 50.0 * (high - low) / contact["k_t_n_per_m"]["mean"].as_f64().unwrap();
    // another draw of noise and errors; the interval itself scatters by a tenth
    assert!((half / expected - 1.0).abs() < 0.3, "{half} and {expected}");
}

#[test]
fn frfs_alone_need_no_load_cell() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig = RIG.replace("\"lc_2\"", "\"lc_1\", \"lc_2\"");
    let told = measured(folder.path(), "frf-only", &rig);
    assert!(told.contains("k_T of the contact: no"), "{told}");
    done(jointrig().arg("export").arg(at("lab.jrig")).args(["--format", "uff58", "--out"]).arg(at("uff")));
    let status = jointrig().args(["campaign", "status", "--json"]).arg(at("lab.jrig")).output().unwrap();
    let status: Value = serde_json::from_slice(&status.stdout).unwrap();
    assert_eq!((status["complete"].as_bool(), status["kept"].as_u64()), (Some(true), Some(15)), "{status}");
}

//! A plan without any of the paper's names, measured on a simulated rig with a user-defined
//! structure.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use jointrig_tests::own_plan::plan;
use serde_json::Value;

const RIG: &str = include_str!("../../../hil-sim/rigs/clamped-tips.toml");

/// Clamps and contact act at one point along the same axes: stiffnesses in series, N/m.
fn in_series() -> f64 {
    1.0 / (1.0 / 90e6 + 1.0 / 120e6 + 1.0 / 200e6)
}

#[test]
fn a_rig_with_bodies_of_its_own_gives_its_joint_within_the_interval() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig = RigConfig::from_toml(RIG).unwrap();
    std::fs::write(at("rig.toml"), RIG).unwrap();
    std::fs::write(at("plan.toml"), plan(&rig)).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let address = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(at("lab.jrig")));
    let said = done(jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")));
    println!("{said}");
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let truth = in_series();
    let between = &results["answer"]["between_arms"]["k_n_per_m"];
    let [low, high] = [0, 1].map(|end| number(&between["ci95"][end]));
    assert!(low < truth && truth < high && high < 1.3 * low, "{between}, and {truth} is true");
    let told = number(&results["answer"]["truth"]["between_arms_k_n_per_m"]);
    assert!((told / truth - 1.0).abs() < 1e-6, "{told}");
    assert_eq!(number(&results["answer"]["truth"]["contact_k_t_n_per_m"]), 120e6);
    assert!(said.contains("A is frame, B is base, AJB is both"), "{said}");
}

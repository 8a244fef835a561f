//! A load cell that is mounted in the opposite direction, a vibrometer that looks in the opposite
//! direction, and a plan that states it.
#![allow(clippy::unwrap_used)]

use jointrig_tests::campaign::short_contact_plan;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use serde_json::Value;
use std::path::Path;

const LC3: &str = "{ name = \"LC3\", position_m = [0.0, -0.065, -0.15], direction = [0, 0, 1] }";

const LDV_A: &str = "{ name = \"LDV_A\", position_m = [0.0006, 0.0005, 0.0], direction = [0, 0, 1] }";

/// Forty-two hits of one second, with the third cell measuring along `direction`.
fn plan(direction: &str) -> String {
    with_direction(LC3, direction)
}

/// Forty-two hits of one second, with this sensor measuring along `direction`.
fn with_direction(sensor: &str, direction: &str) -> String {
    let text = short_contact_plan();
    assert!(text.contains(sensor));
    text.replace(sensor, &sensor.replace("[0, 0, 1]", direction))
}

/// Results on a rig with this plan, and the report of the channels' signs.
fn found(folder: &Path, rig: &str, plan: &str) -> (Value, String) {
    let at = |name: &str| folder.join(name);
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(at("rig.toml"), rig).unwrap();
    std::fs::write(at("plan.toml"), plan).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let address = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(at("lab.jrig")));
    done(jointrig().arg("shaker").arg(at("lab.jrig")).args([
        "--yes",
        "--device",
        &address,
        "--freq",
        "250",
        "--amplitude",
        "1e-7",
    ]));
    done(jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")));
    let signs = String::from_utf8(
        jointrig().args(["campaign", "check"]).arg(at("lab.jrig")).output().unwrap().stdout,
    )
    .unwrap();
    (serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap(), signs)
}

fn k_t(results: &Value) -> Option<f64> {
    results["answer"]["contact"]["k_t_n_per_m"]["mean"].as_f64()
}

/// Slope of the shaker's loop with the raw force.
fn slope(results: &Value) -> f64 {
    let rows = results["hysteresis"].as_array().unwrap();
    let level = rows.iter().find(|row| row["kind"] == "shaker" && row["force"] == "raw");
    level.unwrap()["k_eq_n_per_m"]["mean"].as_f64().unwrap()
}

#[test]
fn a_cell_that_is_mounted_the_other_way_round_changes_nothing_if_the_plan_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let turned = "[errors.volts]\nlc_3 = -1.0\n";
    let (usual, _) = found(&folder.path().join("usual"), "", &plan("[0, 0, 1]"));
    let (said, signs) = found(&folder.path().join("said"), turned, &plan("[0, 0, -1]"));
    let (unsaid, complaint) = found(&folder.path().join("unsaid"), turned, &plan("[0, 0, 1]"));
    // the sign of the cell's noise does not change with it
    let k = k_t(&usual).unwrap();
    assert!((k_t(&said).unwrap() / k - 1.0).abs() < 0.003, "{:?} and {k}", k_t(&said));
    // the slope's own interval is ±0.1 % (eight levels of this kind scatter by 0.03 %), and no two
    // shaker runs give the same record
    assert!((slope(&said) / slope(&usual) - 1.0).abs() < 5e-3, "{} and {}", slope(&said), slope(&usual));
    // effect of the direction: a third of the force has the wrong sign. The contact's own k_T
    // calibrates the sum with hits on B alone and is not affected
    assert!((slope(&unsaid) / slope(&usual) - 1.0).abs() > 0.2, "{}", slope(&unsaid));
    let about = |text: &str| text.lines().find(|line| line.contains("lc_3")).unwrap_or_default().to_owned();
    assert!(about(&signs).contains("right"), "{signs}");
    assert!(about(&complaint).contains("TURNED"), "{complaint}");
}

#[test]
fn a_vibrometer_that_looks_the_other_way_changes_nothing_if_the_plan_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let turned = "[errors.volts]\nldv_a = -1.0\n";
    let (usual, _) = found(&folder.path().join("usual"), "", &with_direction(LDV_A, "[0, 0, 1]"));
    let (said, signs) = found(&folder.path().join("said"), turned, &with_direction(LDV_A, "[0, 0, -1]"));
    // the sign of the sensor's noise does not change with it: two seeds differ by 0.7 and 4.4 %,
    // and the half width of the interval of so few hits is 6 to 7 %
    let k = k_t(&usual).unwrap();
    assert!((k_t(&said).unwrap() / k - 1.0).abs() < 0.06, "{:?} and {k}", k_t(&said));
    // as for the load cell; the device controls the displacement between the specimens, which would
    // be a sum with the wrong sign
    assert!((slope(&said) / slope(&usual) - 1.0).abs() < 5e-3, "{} and {}", slope(&said), slope(&usual));
    assert!(signs.lines().any(|line| line.starts_with("ldv_a") && line.contains("right")), "{signs}");
}

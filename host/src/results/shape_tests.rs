//! The format of `results.json`, field by field as scripts read it.

use super::*;
use serde_json::Value;

fn document() -> Value {
    serde_json::from_str(&example_tests::results().to_json().expect("serialises")).expect("json")
}

fn numbers(value: &Value, names: &[&str]) {
    for name in names {
        assert!(value[name].is_number(), "{name} in {value}");
    }
}

#[test]
fn the_document_has_its_parts() {
    let v = document();
    assert_eq!(v["version"], 1);
    assert!(v["source"]["software"]["version"].is_string());
    assert!(v["source"]["records"]["AJB"][0][1].is_i64());
    assert!(v["joint_spectrum"]["frequency_hz"][0].is_number());
    for part in ["joint", "hysteresis", "checks"] {
        assert!(v[part].is_array(), "{part}");
    }
    // also if they are empty
    let empty: Value = serde_json::to_value(Results::new(Source::default())).expect("serialises");
    for part in ["joint", "hysteresis", "checks"] {
        assert!(empty[part].is_array(), "{part}");
    }
}

#[test]
fn a_joint_has_its_fields() {
    for joint in document()["joint"].as_array().expect("a list") {
        assert!(joint["method"].is_string() && joint["idms"].is_u64() && joint["lines"].is_u64());
        assert!(joint["band_hz"][0].is_number() && joint["band_hz"][1].is_number());
        for quantity in ["stiffness_n_per_m", "damping_n_s_per_m"] {
            for dof in ["y", "z"] {
                numbers(&joint[quantity][dof], &["mean", "std", "median"]);
                assert_eq!(joint[quantity][dof]["ci95"].as_array().map(Vec::len), Some(2));
            }
        }
        assert!(joint["warnings"].is_array());
    }
}

#[test]
fn a_loop_has_its_fields_and_null_for_the_unknown() {
    let v = document();
    for (row, force) in v["hysteresis"].as_array().expect("a list").iter().zip(["raw", "corrected"]) {
        assert_eq!(row["force"], force);
        assert_eq!((&row["kind"], &row["shape"]), (&Value::from("impact"), &Value::from("stuck")));
        numbers(row, &["frequency_hz", "amplitude_m", "phase_deg"]);
        for quantity in ["k_eq_n_per_m", "energy_j"] {
            numbers(&row[quantity], &["mean", "std", "cycles"]);
        }
        // the example has a hidden resonance, so no impact gives k_T
        assert!(row.get("k_t_n_per_m").is_some_and(Value::is_null));
        assert!(row.get("friction_coefficient").is_some_and(Value::is_null));
    }
    let levels: Vec<&Value> =
        v["hysteresis"].as_array().expect("a list").iter().filter(|row| row["kind"] == "shaker").collect();
    assert!(levels.len() > 3);
    for row in levels {
        assert!(row["k_t_n_per_m"].is_null());
        assert_eq!(row.get("slope_between_spots_n_per_m").is_none(), row["shape"] == "elliptical");
        numbers(
            row,
            &["frequency_hz", "amplitude_m", "phase_deg", "k_secant_n_per_m", "k_fundamental_n_per_m"],
        );
        assert_eq!(row["moment"], "before");
    }
    assert_eq!(serde_json::to_value(Shape::GrossSlip).expect("serialises"), "gross-slip");
    assert_eq!(serde_json::to_value(Excitation::Shaker).expect("serialises"), "shaker");
}

#[test]
fn a_check_has_its_fields() {
    let v = document();
    let checks = v["checks"].as_array().expect("a list");
    let named = |name: &str| checks.iter().find(|c| c["name"] == name).expect("there");
    assert_eq!(named("hidden-resonance")["ok"], false);
    assert_eq!(named("hidden-resonance")["frequency_hz"], 192.1);
    assert!(named("series-compliance")["series_stiffness_n_per_m"].is_number());
    assert!(named("reciprocity")["ok"].is_null());
    assert!(checks.iter().all(|c| c["meaning"].is_string()));
}

#[test]
fn no_value_is_other_than_a_number_and_the_file_stays_small() {
    let text = example_tests::results().to_json().expect("serialises");
    assert!(!text.contains("NaN") && !text.contains("Infinity"));
    assert!(text.len() < 5_000_000, "{} bytes", text.len());
    let check = Check::new("x", None, "y").with("a", f64::NAN).with("b", 1.0);
    assert_eq!(check.values.len(), 1);
}

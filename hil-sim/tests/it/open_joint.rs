//! The assembly with its joint open: both sides in place, nothing touches.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::RigConfig;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Rig, RigError};

/// Largest motion of A along z (m/s) and largest sum of the load cells (N) within 20 ms of a hit,
/// after a hit on the closed joint, which must leave nothing behind.
fn largest(config: &RigConfig) -> [f64; 2] {
    let mut rig = Rig::new(config, 1).unwrap();
    rig.stage(Configuration::Ajb, "AZ3", "A3", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    rig.scan(&mut codes);
    assert!(rig.joint().is_some());
    rig.stage(Configuration::Ajb, "OPEN", "OPEN", 0).unwrap();
    rig.fire(3.5e-3);
    let mut largest: [f64; 2] = [0.0; 2];
    for _ in 0..1024 {
        rig.scan(&mut codes);
        let truth = rig.truth();
        let load_cells: f64 = truth[6..9].iter().sum();
        largest = [largest[0].max(truth[3].abs()), largest[1].max(load_cells.abs())];
    }
    largest
}

#[test]
fn nothing_reaches_b_but_by_another_path() {
    let mut config = RigConfig::elastic();
    config.errors.none = true;
    let [moves, carries] = largest(&config);
    assert!(moves > 1e-3, "{moves}");
    assert!(carries < 1e-12, "{carries}");
    let cable = "[[paths]]\nbetween = [\"arm_a\", \"arm_b\"]\nin = [\"AJB\"]\n\
                 position_m = [0.0, 0.03, 0.02]\nstiffness_n_per_m = [0.0, 0.0, 3e6]\n\
                 rotation_nm_per_rad = [0.0, 0.0, 0.0]\ndamping_s = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n";
    config.paths = RigConfig::from_toml(cable).unwrap().paths;
    let [moves, carries] = largest(&config);
    assert!(moves > 1e-3 && carries > 1.0, "{moves} {carries}");
}

#[test]
fn a_contact_that_drifts_and_slips_is_open_too_and_closes_again() {
    let mut config = RigConfig::elastic();
    config.contact.drift_per_hit = 1e-3;
    config.contact.law = jointrig_hil_sim::rig::config::ContactLaw::Jenkins;
    config.errors.none = true;
    assert!(largest(&config)[1] < 1e-12);
    let mut rig = Rig::new(&config, 1).unwrap();
    rig.stage(Configuration::Ajb, "OPEN", "OPEN", 0).unwrap();
    rig.stage(Configuration::Ajb, "AZ3", "A3", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let mut largest: f64 = 0.0;
    for _ in 0..1024 {
        rig.scan(&mut codes);
        largest = largest.max(rig.truth()[6..9].iter().sum::<f64>().abs());
    }
    assert!(largest > 1.0, "{largest}");
}

#[test]
fn hammer_and_vibrometer_go_to_it_together_and_only_in_the_assembly() {
    let mut rig = Rig::new(&RigConfig::elastic(), 1).unwrap();
    let half = rig.stage(Configuration::Ajb, "OPEN", "A3", 0).unwrap_err();
    assert!(matches!(half, RigError::HalfOpen { .. }), "{half}");
    let elsewhere = rig.stage(Configuration::A, "OPEN", "OPEN", 0).unwrap_err();
    assert!(elsewhere.to_string().contains("no impact point"), "{elsewhere}");
}

#[test]
fn its_points_are_on_side_a_and_have_names_of_their_own() {
    let with = |impact: &str, body: &str| {
        let mut config = RigConfig::elastic();
        let open = config.open_joint.as_mut().unwrap();
        open.impact.name = impact.into();
        open.impact.body = match body {
            "arm_b" => jointrig_hil_sim::rig::config::BodyName::ArmB,
            _ => jointrig_hil_sim::rig::config::BodyName::ArmA,
        };
        config.check().map_err(|error| error.to_string())
    };
    assert_eq!(with("OPEN", "arm_a"), Ok(()));
    assert!(with("AZ1", "arm_a").unwrap_err().contains("is the name of one of the impacts"));
    assert!(with("OPEN", "arm_b").unwrap_err().contains("must be on side A"));
}

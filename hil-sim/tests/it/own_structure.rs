//! Rigs with a user-defined structure.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::{ImpactPoint, ResponsePoint, RigConfig};
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Probe, Quantity, Rig, exact_frf};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::f64::consts::TAU;
use std::fmt::Write;

const TIPS: &str = include_str!("../../rigs/clamped-tips.toml");

/// The paper's rig, with specimen B rigidly attached to its arm, written as a user-defined
/// structure.
fn paper_as_its_own() -> String {
    let default = RigConfig::default();
    let mut text = String::from(
        "[structure]\njoint = [\"tip\", \"base\"]\narms = [\"arm\", \"base\"]\nload_cells_on = \"base\"\n",
    );
    let bodies = &default.bodies;
    for (name, of, body) in [
        ("weight", "A", &bodies.mass),
        ("arm", "A", &bodies.arm_a),
        ("tip", "A", &bodies.specimen_a),
        ("base", "B", &bodies.arm_b),
    ] {
        write!(
            text,
            "[[structure.bodies]]\nname = \"{name}\"\nof = \"{of}\"\n{}",
            toml::to_string(body).unwrap()
        )
        .unwrap();
    }
    let mut spring = |between: [&str; 2], present: &str, bushing| {
        write!(
            text,
            "[[structure.springs]]\nbetween = {between:?}\nin = {present}\n{}",
            toml::to_string(bushing).unwrap()
        )
        .unwrap();
    };
    for leaf in &default.leaf_springs {
        spring(["ground", "weight"], r#"["A", "AJB"]"#, leaf);
    }
    spring(["weight", "arm"], r#"["A", "AJB"]"#, &default.knife_edge);
    spring(["ground", "arm"], r#"["A"]"#, &default.wire.bushing);
    spring(["ground", "arm"], r#"["AJB"]"#, &default.push_rod_a.bushing);
    spring(["arm", "tip"], r#"["A"]"#, &default.clamp.free);
    spring(["arm", "tip"], r#"["AJB"]"#, &default.clamp.loaded);
    spring(["ground", "base"], r#"["B", "AJB"]"#, &default.lower_push_rod);
    let own = |body: &str| match body {
        "mass" => "weight".to_owned(),
        "arm_a" => "arm".to_owned(),
        "specimen_a" => "tip".to_owned(),
        _ => "base".to_owned(),
    };
    for point in &default.responses {
        let mut point = toml::Table::try_from(point).unwrap();
        point["body"] = own(point["body"].as_str().unwrap()).into();
        write!(text, "[[responses]]\n{point}").unwrap();
    }
    for point in &default.impacts {
        let mut point = toml::Table::try_from(point).unwrap();
        point["body"] = own(point["body"].as_str().unwrap()).into();
        write!(text, "[[impacts]]\n{point}").unwrap();
    }
    text + "[spots]\nldv_a.body = \"tip\"\nldv_b.body = \"base\"\n[shaker]\nbody = \"weight\"\n"
}

/// FRFs from an impact on each substructure to a response on each, as far as they are present.
fn frfs(config: &RigConfig, configuration: Configuration) -> Vec<DMatrix<Complex<f64>>> {
    let responses =
        ["A1", "B2", "S3"].into_iter().filter_map(|name| config.response(configuration, name).ok());
    let outputs: Vec<_> = responses.flat_map(ResponsePoint::probes).collect();
    let impacts =
        ["AZ1", "BY2", "I_MZ"].into_iter().filter_map(|name| config.impact(configuration, name).ok());
    let inputs: Vec<_> = impacts.map(ImpactPoint::probe).collect();
    let s: Vec<_> = [60.0, 192.0, 208.0, 450.0, 900.0].map(|hz| Complex::new(2.3, TAU * hz)).to_vec();
    exact_frf(config, configuration, Quantity::Mobility, &s, &outputs, &inputs).unwrap()
}

#[test]
fn the_papers_rig_written_as_a_structure_of_its_own_is_the_papers_rig() {
    let (paper, own) = (RigConfig::default(), RigConfig::from_toml(&paper_as_its_own()).unwrap());
    for configuration in Configuration::ALL {
        for (theirs, ours) in frfs(&paper, configuration).iter().zip(frfs(&own, configuration)) {
            assert!(!theirs.is_empty());
            let off = (theirs - &ours).norm() / theirs.norm();
            // the same sums in a different order
            assert!(off < 1e-9, "{configuration}: {off:e}");
        }
    }
    let (theirs, ours) = (paper.truth(), own.truth());
    assert_eq!(theirs.contact_k_t_n_per_m, ours.contact_k_t_n_per_m);
    assert!((theirs.between_arms_k_n_per_m / ours.between_arms_k_n_per_m - 1.0).abs() < 1e-9, "{ours:?}");
    let clamps = |truth: &jointrig_hil_sim::rig::Truth| truth.clamps_k_n_per_m.unwrap();
    assert!((clamps(&theirs) / clamps(&ours) - 1.0).abs() < 1e-9, "{ours:?}");
    assert_eq!(RigConfig::from_toml(&own.to_toml()).unwrap(), own, "written and read back");
}

#[test]
fn the_truth_of_a_turned_joint_is_that_of_its_springs_in_series() {
    let turned = RigConfig::from_toml(TIPS).unwrap();
    // springs in series at one point along the same axes
    let truth = turned.truth();
    assert!(
        (truth.between_arms_k_n_per_m * (1.0 / 90e6 + 1.0 / 120e6 + 1.0 / 200e6) - 1.0).abs() < 1e-6,
        "{truth:?}"
    );
    assert!((truth.clamps_k_n_per_m.unwrap() * (1.0 / 90e6 + 1.0 / 200e6) - 1.0).abs() < 1e-6, "{truth:?}");
    // the same result along z as from the same springs without rotation
    let mut straight = turned.clone();
    let own = straight.structure.as_mut().unwrap();
    own.springs.iter_mut().for_each(|spring| spring.axes = None);
    straight.contact.axes = None;
    assert!((straight.truth().between_arms_k_n_per_m / truth.between_arms_k_n_per_m - 1.0).abs() < 1e-6);
}

#[test]
fn what_cannot_be_is_refused_with_its_field_and_line() {
    for (old, new, said) in [
        ("joint = [\"tip_a\", \"tip_b\"]", "joint = [\"tip_b\", \"tip_a\"]", "first A's body, then B's"),
        (
            "joint = [\"tip_a\", \"tip_b\"]",
            "joint = [\"tip_a\", \"nose\"]",
            "not a body of [structure]: frame, tip_a, base, tip_b",
        ),
        ("between = [\"ground\", \"frame\"]", "between = [\"frame\", \"frame\"]", "has one body twice"),
        ("between = [\"ground\", \"frame\"]", "between = [\"ground\", \"flame\"]", "names flame"),
        ("name = \"tip_b\"", "name = \"tip_a\"", "is already a body"),
        ("name = \"tip_b\"", "name = \"a name that is far too long for a body\"", "more than 24 bytes"),
        ("mass_kg = 0.012", "mass_kg = -0.012", "greater than zero"),
        ("[contact]", "[clamp]\nrigid = true\n\n[contact]", "remove one of them"),
        (
            "axes = [[0.7071, -0.7071, 0.0]",
            "axes = [[1.0, -0.7071, 0.0]",
            "three unit vectors at right angles",
        ),
        ("ldv_a = { body = \"tip_a\"", "ldv_a = { body = \"specimen_a\"", "names specimen_a"),
    ] {
        assert!(TIPS.contains(old), "{old}");
        let error = RigConfig::from_toml(&TIPS.replacen(old, new, 1)).unwrap_err().to_string();
        assert!(error.contains(said) && error.contains("line"), "{new}: {error}");
    }
}

#[test]
fn spots_and_shaker_go_along_the_sliding_direction() {
    let mut config = RigConfig::from_toml(TIPS).unwrap();
    config.errors.none = true;
    let sliding = config.contact.sliding();
    assert!(sliding[0] > 0.7 && sliding[2] == 0.0, "{sliding:?}");
    let mut rig = Rig::new(&config, 1).unwrap();
    let (impact, response) = (config.impacts[0].name.clone(), config.responses[0].name.clone());
    rig.stage(Configuration::Ajb, &impact, &response, 0).unwrap();
    let mut codes = [0; CHANNELS];
    let mut most = 0.0_f64;
    for scan in 0..2_000 {
        rig.drive((f64::from(scan) * 0.03).sin());
        rig.scan(&mut codes);
        for (place, spot) in [(4, &config.spots.ldv_a), (5, &config.spots.ldv_b)] {
            let moves = rig.motion(&Probe::at(spot, sliding)).unwrap().1;
            // the same state, summed in a different order
            assert!((rig.truth()[place] - moves).abs() < 1e-12, "{moves}");
        }
        let along = rig.motion(&Probe::at(&config.spots.ldv_a, sliding)).unwrap().1;
        let across = rig.motion(&Probe::along_z(&config.spots.ldv_a)).unwrap().1;
        most = most.max(along.abs() / across.abs().max(1e-9));
    }
    assert!(most > 10.0, "the shaker pushes along it: {most}");
}

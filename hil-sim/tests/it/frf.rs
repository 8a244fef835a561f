//! The structure compared with an independent implementation: exact FRFs and eigenfrequencies.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use crate::reference;

use std::f64::consts::PI;

use jointrig_hil_sim::rig::config::BodyName;
use jointrig_hil_sim::rig::modal::StateSpace;
use jointrig_hil_sim::rig::modal::modes;
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Configuration, Probe, Quantity, RigConfig, exact_frf};
use num_complex::Complex;

/// Both implementations solve the same 24 equations in double precision. The worst conditioned case
/// is the free clamp (3e9 N/m) combined with the 27 and 40 Hz modes of A, which costs six of the
/// sixteen digits; elsewhere they agree to 1e-11.
const TOLERANCE: f64 = 1e-9;

const RIGID: &str = include_str!("../../rigs/rigid-clamp.toml");

fn probes(
    config: &RigConfig,
    configuration: Configuration,
    outputs: &[String],
    inputs: &[String],
) -> (Vec<Probe>, Vec<Probe>) {
    let output = |name: &String| {
        let (point, axis) = name.split_once(':').unwrap();
        config.response(configuration, point).unwrap().probes()["xyz".find(axis).unwrap()]
    };
    let input = |name: &String| config.impact(configuration, name).unwrap().probe();
    (outputs.iter().map(output).collect(), inputs.iter().map(input).collect())
}

/// Largest deviation over the largest entry, worst over lines and configurations.
fn deviation(case: &str, config: &RigConfig, quantity: Quantity) -> f64 {
    let mut worst = 0.0_f64;
    for configuration in Configuration::ALL {
        let reference = reference::load(&format!("frf_{case}_{configuration}"));
        let (outputs, inputs) = probes(config, configuration, &reference.outputs, &reference.inputs);
        for (f_hz, expected) in &reference.lines {
            let s = Complex::new(0.0, 2.0 * PI * f_hz);
            let found = &exact_frf(config, configuration, quantity, &[s], &outputs, &inputs).unwrap()[0];
            let largest = expected.iter().map(|v| v.norm()).fold(0.0, f64::max);
            let off = (found - expected).iter().map(|v| v.norm()).fold(0.0, f64::max) / largest;
            println!("{case} {configuration} {f_hz} Hz: {off:.1e}");
            worst = worst.max(off);
        }
    }
    println!("{case}: {worst:.2e}");
    worst
}

#[test]
fn default_rig_is_the_reference() {
    assert!(deviation("default", &RigConfig::default(), Quantity::Receptance) < TOLERANCE);
}

#[test]
fn rigid_clamp_is_the_reference() {
    assert!(deviation("rigid", &RigConfig::from_toml(RIGID).unwrap(), Quantity::Mobility) < TOLERANCE);
}

/// Clamp and support are the same in A and AJB; virtual-point sensors and impacts are on specimen A
/// itself.
fn specimen_rig() -> RigConfig {
    let mut config = RigConfig::default();
    config.clamp.free = config.clamp.loaded.clone();
    config.wire.in_ajb = true;
    config.push_rod_a.in_ajb = false;
    for point in config.responses.iter_mut().filter(|point| ["A1", "A2", "A3"].contains(&point.name.as_str()))
    {
        point.body = BodyName::SpecimenA;
    }
    for point in config.impacts.iter_mut().filter(|point| point.name.starts_with('A')) {
        point.body = BodyName::SpecimenA;
    }
    config
}

#[test]
fn specimen_rig_is_the_reference() {
    assert!(deviation("specimen", &specimen_rig(), Quantity::Receptance) < TOLERANCE);
}

#[test]
fn eigenfrequencies_are_the_reference() {
    // Undamped, printed to 0.001 Hz: tolerance of half a unit of the last digit.
    let cases = vec![
        (
            RigConfig::default(),
            Configuration::A,
            vec![27.282, 39.868, 102.075, 133.711, 381.601, 436.046, 546.719, 553.145],
        ),
        (
            RigConfig::default(),
            Configuration::B,
            vec![514.35, 1195.34, 1307.433, 1355.021, 1578.036, 1614.099],
        ),
        (
            RigConfig::default(),
            Configuration::Ajb,
            vec![116.105, 192.1, 207.948, 301.164, 387.775, 465.209, 547.017, 552.655],
        ),
        (
            RigConfig::from_toml(RIGID).unwrap(),
            Configuration::A,
            vec![27.282, 39.868, 102.075, 133.711, 381.601, 436.05, 546.719, 553.146],
        ),
        (
            RigConfig::from_toml(RIGID).unwrap(),
            Configuration::Ajb,
            vec![116.143, 303.498, 309.165, 417.915, 465.991, 550.264, 552.672, 896.555],
        ),
    ];
    for (config, configuration, expected) in cases {
        let space = StateSpace::new(&Structure::new(&config, configuration)).unwrap();
        let mut found: Vec<f64> = space.undamped_rad_s().iter().map(|omega| omega / (2.0 * PI)).collect();
        found.sort_by(f64::total_cmp);
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 5.1e-4, "{configuration}: {found} Hz for {expected} Hz");
        }
        // Damping is light: each damped mode lies within ζ² of its undamped one, and
        // non-proportional damping does not move it further than that.
        let modes = modes(&space).unwrap();
        for expected in expected {
            let nearest = modes.iter().map(|mode| (mode.lambda.norm() / (2.0 * PI) - expected).abs());
            assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-3 * expected);
        }
    }
}

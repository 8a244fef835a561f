//! A clamp on side B, and the truth that follows from the rig's parameters.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::f64::consts::TAU;

use jointrig_hil_sim::rig::config::{BodyName, Clamp, ContactLaw};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Configuration, Probe, Quantity, Rig, RigConfig, exact_frf};
use num_complex::Complex;

fn with_clamp_b() -> RigConfig {
    RigConfig::from_toml("[clamp_b]\nrigid = false\n").unwrap()
}

fn scaled(clamp: &mut Clamp, factor: f64) {
    for bushing in [&mut clamp.loaded, &mut clamp.free] {
        bushing.stiffness_n_per_m = bushing.stiffness_n_per_m.map(|k| k * factor);
        bushing.rotation_nm_per_rad = bushing.rotation_nm_per_rad.map(|k| k * factor);
        bushing.damping_s = [0.0; 6];
    }
}

fn order(config: &RigConfig) -> [usize; 3] {
    Configuration::ALL.map(|configuration| Structure::new(config, configuration).order())
}

#[test]
fn specimen_b_is_a_body_of_its_own_where_its_clamp_gives() {
    assert_eq!(order(&RigConfig::default()), [18, 6, 24]);
    assert_eq!(order(&with_clamp_b()), [18, 12, 30]);
    let mut both_rigid = RigConfig::default();
    both_rigid.clamp.rigid = true;
    assert_eq!(order(&both_rigid), [12, 6, 18]);
    let rig = Rig::new(&with_clamp_b(), 1).unwrap();
    assert_eq!(rig.fallback(), None);
}

#[test]
fn a_clamp_b_that_hardly_gives_is_a_rigid_one() {
    let mut stiff = with_clamp_b();
    scaled(&mut stiff.clamp_b, 1e4);
    // Yaw is six orders softer than the other directions.
    for bushing in [&mut stiff.clamp_b.loaded, &mut stiff.clamp_b.free] {
        bushing.rotation_nm_per_rad[1] = 1e8;
    }
    let default = RigConfig::default();
    for configuration in [Configuration::B, Configuration::Ajb] {
        let s: Vec<Complex<f64>> = [20.0, 208.0, 550.0].map(|f| Complex::new(2.3, TAU * f)).to_vec();
        let mut outputs = default.response(configuration, "B1").unwrap().probes().to_vec();
        outputs.push(Probe::along_z(&default.spots.ldv_b));
        let inputs = ["BZ1", "BX3", "BY2"].map(|name| default.impact(configuration, name).unwrap().probe());
        let frf =
            |config| exact_frf(config, configuration, Quantity::Mobility, &s, &outputs, &inputs).unwrap();
        for (one, other) in frf(&stiff).iter().zip(frf(&default)) {
            let largest = other.iter().map(|v| v.norm()).fold(0.0, f64::max);
            let off = (one - &other).iter().map(|v| v.norm()).fold(0.0, f64::max);
            // 60 N/µm · 10⁴ compared with the arm's 150: only the arm's own springs deform.
            assert!(off < 1e-3 * largest, "{configuration}: {off} of {largest}");
        }
    }
}

#[test]
fn its_spot_and_its_points_are_on_the_specimen() {
    let mut config = with_clamp_b();
    config.errors.none = true;
    let at = [0.0, -0.008, 0.007];
    let mut point = config.responses[0].clone();
    (point.name, point.body, point.position_m) = ("S7".into(), BodyName::SpecimenB, at);
    config.responses.push(point);
    let mut rig = Rig::new(&config, 1).unwrap();
    for configuration in [Configuration::B, Configuration::Ajb] {
        rig.stage(configuration, "BZ1", "S7", 0).unwrap();
        rig.fire(3.5e-3);
        let mut codes = [0; 10];
        let (mut apart, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..2_000 {
            rig.scan(&mut codes);
            let speed = |body| rig.motion(&Probe { body, ..rig.aim().response[2] }).unwrap().1;
            assert!((rig.truth()[3] - speed(BodyName::SpecimenB)).abs() < 1e-12);
            let spot = rig.motion(&Probe::along_z(&config.spots.ldv_b)).unwrap().1;
            assert!((rig.truth()[5] - spot).abs() < 1e-12);
            apart = apart.max((speed(BodyName::SpecimenB) - speed(BodyName::ArmB)).abs());
            largest = largest.max(rig.truth()[3].abs());
        }
        assert!(apart > 1e-3 * largest, "{configuration}: the clamp gives");
    }
    assert!(rig.stage(Configuration::A, "AZ1", "S7", 0).is_err());
}

#[test]
fn a_specimen_heavier_than_its_arm_is_refused() {
    let error =
        RigConfig::from_toml("[clamp_b]\nrigid = false\n[bodies.specimen_b]\nmass_kg = 2.5\n").unwrap_err();
    assert!(error.to_string().contains("bodies.specimen_b.mass_kg"), "{error}");
}

#[test]
fn the_truth_of_the_default_rig() {
    let truth = RigConfig::default().truth();
    assert_eq!(truth.contact_k_t_n_per_m, 180e6);
    assert!((truth.contact_c_t_n_s_per_m - 2700.0).abs() < 1e-9);
    // 1/60 + 10² mm²/6500 N m/rad, and a lateral offset of 12.5 µm with the soft yaw, which adds a
    // thousandth; that in series with 180.
    let clamp = 1.0 / (1.0 / 60e6 + 1e-4 / 6500.0 + 1.25e-5_f64.powi(2) / 4.95);
    assert!((truth.clamps_k_n_per_m.unwrap() / clamp - 1.0).abs() < 1e-12, "{truth:?}");
    let series = 1.0 / (1.0 / clamp + 1.0 / 180e6);
    assert!((truth.between_arms_k_n_per_m / series - 1.0).abs() < 1e-12, "{truth:?}");
    assert!((truth.between_arms_k_n_per_m - 26.6e6).abs() < 0.05e6, "{truth:?}");
    assert_eq!((truth.law, truth.slip_limit_n), (ContactLaw::Linear, None));
}

#[test]
fn the_truth_of_other_rigs() {
    let rigid = RigConfig::from_toml(include_str!("../../rigs/rigid-clamp.toml")).unwrap().truth();
    assert_eq!(rigid.clamps_k_n_per_m, None);
    assert!((rigid.between_arms_k_n_per_m / 180e6 - 1.0).abs() < 1e-12);
    let slips = RigConfig::from_toml(include_str!("../../rigs/iwan.toml")).unwrap().truth();
    assert_eq!((slips.law, slips.slip_limit_n), (ContactLaw::Iwan, Some(180.0)));
    // Stuck, an Iwan contact is as stiff as all its elements together.
    assert_eq!(slips.contact_k_t_n_per_m, 180e6);
    // The mirrored clamp on B is as compliant as that on A: half the stiffness.
    let (one, two) = (RigConfig::default().truth(), with_clamp_b().truth());
    assert!((two.clamps_k_n_per_m.unwrap() / one.clamps_k_n_per_m.unwrap() - 0.5).abs() < 1e-9, "{two:?}");
    let json = toml::to_string(&two).unwrap();
    assert_eq!(toml::from_str::<jointrig_hil_sim::rig::Truth>(&json).unwrap(), two);
}

/// The truth equals the result of a quasi-static pull: the specimens' arms are held, a force acts
/// between the specimens at the contact.
#[test]
fn the_stiffness_between_the_arms_is_what_a_slow_pull_shows() {
    let mut config = with_clamp_b();
    scaled(&mut config.clamp_b, 0.4);
    config.clamp.loaded.position_m = [0.004, 0.012, 0.003];
    config.contact.position_m = [0.002, 0.001, -0.002];
    // Arms so heavy that they do not move at 200 Hz, without a stiff support.
    for body in [&mut config.bodies.arm_a, &mut config.bodies.arm_b] {
        body.mass_kg = 1e9;
    }
    for body in [&mut config.bodies.specimen_a, &mut config.bodies.specimen_b] {
        body.mass_kg = 1e-6;
        body.inertia_kg_m2 = Some([1e-12; 3]);
    }
    let structure = Structure::new(&config, Configuration::Ajb);
    let s = Complex::new(0.0, TAU * 1.0);
    // Relative motion of the specimens' two sides at the contact, from a force between them.
    let z = [0.0, 0.0, 1.0];
    let at = |body| Probe { body, position_m: [0.0; 3], direction: z };
    let pair = [at(BodyName::SpecimenA), at(BodyName::SpecimenB)];
    let y = structure.frf(s, Quantity::Receptance, &pair, &pair).unwrap();
    // With the contact between them it is in parallel with the clamps; without it, only the clamps
    // remain.
    let mut open = config.clone();
    open.contact.stiffness_n_per_m = [0.0; 3];
    open.contact.rotation_nm_per_rad = [0.0; 3];
    let alone = Structure::new(&open, Configuration::Ajb).frf(s, Quantity::Receptance, &pair, &pair).unwrap();
    let relative = |y: &nalgebra::DMatrix<Complex<f64>>| y[(0, 0)] + y[(1, 1)] - y[(0, 1)] - y[(1, 0)];
    let clamps = 1.0 / relative(&alone).re;
    let truth = config.truth();
    assert!((clamps / truth.clamps_k_n_per_m.unwrap() - 1.0).abs() < 1e-3, "{clamps} {truth:?}");
    assert!(relative(&y).re < relative(&alone).re);
}

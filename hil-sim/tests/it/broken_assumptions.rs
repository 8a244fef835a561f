//! Rigs on which an assumption of the plan is false: each by its effect on exact FRFs or on the
//! signals of a record.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::{BodyName, Patch, RigConfig};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Probe, Quantity, Rig, exact_frf};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::f64::consts::TAU;

/// The default rig without drawn errors, and these.
fn with(text: &str) -> RigConfig {
    let sound = "[errors]\nposition_m = 0.0\naim_m = 0.0\nspecimen_point_m = 0.0\nspot_m = 0.0\n\
                 hammer_angle_rad = 0.0\ngain = 0.0\nskew_s = 0.0\nload_cell_cross_talk = 0.0\n";
    RigConfig::from_toml(&format!("{text}\n{sound}")).unwrap()
}

fn spots() -> [Probe; 2] {
    let z = [0.0, 0.0, 1.0];
    [(BodyName::SpecimenA, 0.0), (BodyName::SpecimenB, 0.0)].map(|(body, y)| Probe {
        body,
        position_m: [0.0, y, 0.0],
        direction: z,
    })
}

fn frf(config: &RigConfig, hz: f64) -> DMatrix<Complex<f64>> {
    let s = [Complex::new(0.0, TAU * hz)];
    let inputs = ["AZ1", "BZ1"].map(|name| config.impact(Configuration::Ajb, name).unwrap().probe());
    exact_frf(config, Configuration::Ajb, Quantity::Receptance, &s, &spots(), &inputs).unwrap().remove(0)
}

/// A staged record of 400 scans after the coil pulse began to matter, read channel by channel from
/// the true signals, and the rig after it.
fn record(config: &RigConfig, mut each: impl FnMut(&Rig)) {
    let mut rig = Rig::new(config, 1).unwrap();
    rig.stage(Configuration::Ajb, "AZ1", "S1", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    for _ in 0..1_000 {
        rig.scan(&mut codes);
        each(&rig);
    }
}

#[test]
fn tilted_axes_read_along_their_true_directions() {
    let config = with(
        "[errors.tilt_rad]\nldv_a = [0.05, 0.0, 0.0]\nvibrometer = [0.0, 0.1, 0.0]\nhammer = [0.0, 0.2, 0.0]",
    );
    let [a, b] = [&config.spots.ldv_a, &config.spots.ldv_b];
    record(&config, |rig| {
        // about x: z becomes (0, −sin, cos)
        let along = [0.0, -(0.05_f64.sin()), 0.05_f64.cos()];
        let expected = rig.motion(&Probe::at(a, along)).unwrap().1;
        assert!((rig.truth()[4] - expected).abs() < 1e-12);
        let straight = rig.motion(&Probe::along_z(b)).unwrap().1;
        assert!((rig.truth()[5] - straight).abs() < 1e-12);
        // about y: x becomes (cos, 0, −sin)
        assert!((rig.aim().response[0].direction[2] + 0.1_f64.sin()).abs() < 1e-12);
        let seen = rig.motion(&rig.aim().response[0]).unwrap().1;
        assert!((rig.truth()[1] - seen).abs() < 1e-12);
        // the impact along −z
        assert!((rig.aim().impact.direction[0] + 0.2_f64.sin()).abs() < 1e-12);
    });
}

#[test]
fn true_positions_are_off_by_what_is_stated() {
    let config =
        with("[errors.offset_m]\nldv_a = [0.0, 2e-4, 0.0]\nS1 = [1e-3, 0.0, 0.0]\nAZ1 = [0.0, 0.0, 2e-3]");
    let mut spot = config.spots.ldv_a.clone();
    spot.position_m[1] += 2e-4;
    record(&config, |rig| {
        assert_eq!(rig.flaws().spots.ldv_a, spot);
        assert!((rig.truth()[4] - rig.motion(&Probe::along_z(&spot)).unwrap().1).abs() < 1e-12);
        assert!((rig.aim().response[0].position_m[0] - 0.01).abs() < 1e-12);
        assert!((rig.aim().impact.position_m[2] - 0.032).abs() < 1e-12);
    });
    // switched off with the others
    let mut none = config.clone();
    none.errors.none = true;
    record(&none, |rig| assert_eq!(rig.flaws().spots, none.spots));
}

#[test]
fn the_contact_is_where_it_truly_is() {
    let stated = with("");
    let offset = with("[errors.offset_m]\ncontact = [0.0, 2e-4, -1e-4]");
    let mut there = stated.clone();
    there.contact.position_m = [0.0, 2e-4, -1e-4];
    for hz in [100.0, 300.0, 700.0] {
        assert_eq!(frf(&offset, hz), frf(&there, hz));
        let change = (frf(&offset, hz) - frf(&stated, hz)).norm() / frf(&stated, hz).norm();
        assert!(change > 1e-4, "{hz} Hz: {change:e}");
    }
    assert_eq!(offset.truth(), there.truth());
    assert_eq!(offset.truth().contact_k_t_n_per_m, stated.truth().contact_k_t_n_per_m);
}

#[test]
fn a_hammer_that_is_off_reads_other_volts() {
    let mut peaks = Vec::new();
    for config in [with(""), with("[errors.volts]\nforce = 1.05")] {
        let mut rig = Rig::new(&config, 1).unwrap();
        rig.stage(Configuration::Ajb, "AZ1", "S1", 0).unwrap();
        rig.fire(3.5e-3);
        let mut codes = [0; CHANNELS];
        let mut largest = 0;
        for _ in 0..1_000 {
            rig.scan(&mut codes);
            largest = largest.max(codes[0]);
        }
        peaks.push(f64::from(largest));
    }
    // a peak of some thousand codes
    assert!((peaks[1] / peaks[0] - 1.05).abs() < 1e-3, "{peaks:?}");
}

#[test]
fn a_contact_in_patches_is_its_parts() {
    let one = with("");
    let mut split = one.clone();
    let patch = |x: f64, share| Patch { offset_m: [x, 0.0, 0.0], share };
    // two halves at the same place are the contact
    split.contact.patches = vec![patch(0.0, 0.3), patch(0.0, 0.7)];
    assert!((frf(&split, 300.0) - frf(&one, 300.0)).norm() < 1e-12 * frf(&one, 300.0).norm());
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
    assert!(close(split.truth().between_arms_k_n_per_m, one.truth().between_arms_k_n_per_m));
    // apart they also resist rotation: as one spring with that rotational stiffness
    split.contact.patches = vec![patch(2.5e-3, 0.5), patch(-2.5e-3, 0.5)];
    let mut stiffer = one.clone();
    let [_, ky, kz] = one.contact.stiffness_n_per_m;
    stiffer.contact.rotation_nm_per_rad[1] += kz * 2.5e-3_f64.powi(2);
    stiffer.contact.rotation_nm_per_rad[2] += ky * 2.5e-3_f64.powi(2);
    for hz in [100.0, 300.0, 700.0] {
        let (found, expected) = (frf(&split, hz), frf(&stiffer, hz));
        assert!((&found - &expected).norm() < 1e-9 * expected.norm(), "{hz}");
        // far above the yaw mode the specimen's inertia resists rotation
        let change = (&found - frf(&one, hz)).norm() / expected.norm();
        assert!(change > if hz < 500.0 { 1e-4 } else { 1e-6 }, "{hz}: {change:e}");
    }
    assert_eq!(split.truth().contact_k_t_n_per_m, one.truth().contact_k_t_n_per_m);
    assert_eq!(RigConfig::from_toml(&split.to_toml()).unwrap(), split);
}

#[test]
fn a_path_beside_the_contact_is_in_its_configurations_only() {
    let text = |between: &str| {
        format!(
            "[[paths]]\nbetween = {between}\nin = [\"AJB\"]\nposition_m = [0.0, 0.0, 0.0]\n\
             stiffness_n_per_m = [0.0, 0.0, 3e6]\nrotation_nm_per_rad = [0.0, 0.0, 0.0]\n\
             damping_s = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
        )
    };
    let sound = with("");
    let cable = with(&text("[\"arm_a\", \"arm_b\"]"));
    let wire = with(&text("[\"arm_b\", \"ground\"]"));
    for path in [&cable, &wire] {
        assert_eq!(RigConfig::from_toml(&path.to_toml()).unwrap(), *path);
        assert_eq!(path.truth(), sound.truth());
        let change = (frf(path, 100.0) - frf(&sound, 100.0)).norm() / frf(&sound, 100.0).norm();
        assert!(change > 1e-3, "{change:e}");
        for configuration in [Configuration::A, Configuration::B] {
            let stiffness = |config| Structure::new(config, configuration).stiffness;
            assert_eq!(stiffness(path), stiffness(&sound));
        }
    }
    // what it adds to K: 3 N/µm between the arms at the origin
    let difference = Structure::new(&cable, Configuration::Ajb).stiffness
        - Structure::new(&sound, Configuration::Ajb).stiffness;
    let probe = |body| Probe { body, position_m: [0.0; 3], direction: [0.0, 0.0, 1.0] };
    let structure = Structure::new(&sound, Configuration::Ajb);
    let between =
        structure.row(&probe(BodyName::ArmA)).unwrap() - structure.row(&probe(BodyName::ArmB)).unwrap();
    assert!((difference - &between * between.transpose() * 3e6).norm() < 1.0);
}

#[test]
fn load_cells_between_two_bodies_read_their_relative_motion() {
    let tips = include_str!("../../rigs/clamped-tips.toml");
    let on = tips.lines().find(|line| line.starts_with("load_cells_on"));
    let text = match on {
        Some(on) => tips.replacen(on, "load_cells_between = [\"frame\", \"base\"]", 1),
        None => {
            tips.replacen("[structure]\n", "[structure]\nload_cells_between = [\"frame\", \"base\"]\n", 1)
        }
    };
    let mut config = RigConfig::from_toml(&text).unwrap();
    config.errors.none = true;
    assert_eq!(RigConfig::from_toml(&config.to_toml()).unwrap(), config);
    let mut rig = Rig::new(&config, 1).unwrap();
    let name = config.impacts.iter().find(|at| config.has(Configuration::A, at.body)).unwrap().name.clone();
    let seen = config.responses.iter().find(|at| config.has(Configuration::A, at.body)).unwrap().name.clone();
    for configuration in [Configuration::Ajb, Configuration::A] {
        rig.stage(configuration, &name, &seen, 0).unwrap();
        rig.fire(3.5e-3);
        let mut codes = [0; CHANNELS];
        let mut most = 0.0_f64;
        for _ in 0..1_000 {
            rig.scan(&mut codes);
            for (index, cell) in config.load_cells.iter().enumerate() {
                let at = |name: &str| {
                    let own = jointrig_hil_sim::rig::config::OwnName::new(name).unwrap();
                    let body = BodyName::Own(own);
                    rig.motion(&Probe { body, position_m: cell.position_m, direction: [0.0, 0.0, 1.0] })
                };
                let relative = at("base").map_or(0.0, |base| base.0 - at("frame").unwrap().0);
                let force_n = cell.stiffness_n_per_m[2] * relative;
                assert!((rig.truth()[6 + index] - force_n).abs() < 1e-9);
                most = most.max(force_n.abs());
            }
        }
        assert_eq!(most > 0.1, configuration == Configuration::Ajb, "{most}");
    }
}

#[test]
fn a_contact_drifts_from_staging_to_staging() {
    let config = with("[contact]\ndrift_per_hit = 0.01\ndrift_per_s = -0.1");
    let mut rig = Rig::new(&config, 1).unwrap();
    let mut codes = [0; CHANNELS];
    for (fires, scans) in [(0, 0), (2, 0), (1, 25_600)] {
        for _ in 0..fires {
            rig.fire(3.5e-3);
        }
        for _ in 0..scans {
            rig.scan(&mut codes);
        }
        rig.stage(Configuration::Ajb, "AZ1", "S1", 0).unwrap();
        rig.fire(3.5e-3);
        for _ in 0..400 {
            rig.scan(&mut codes);
        }
        let joint = rig.joint().unwrap();
        let probe = |body| Probe { body, position_m: [0.0; 3], direction: [0.0, 0.0, 1.0] };
        let [a, b] = [BodyName::SpecimenA, BodyName::SpecimenB].map(|body| rig.motion(&probe(body)).unwrap());
        let hits = match fires {
            0 => 0.0,
            2 => 3.0,
            _ => 5.0,
        };
        let seconds = if scans > 0 {
            (800.0 + 25_600.0) / 51_200.0
        } else if fires == 2 {
            400.0 / 51_200.0
        } else {
            0.0
        };
        let k = 180e6 * (1.0 + 0.01 * hits - 0.1 * seconds);
        let expected = k * (a.0 - b.0 + 1.5e-5 * (a.1 - b.1));
        assert!((joint.force_n / expected - 1.0).abs() < 1e-9, "{fires}: {} for {expected}", joint.force_n);
    }
    // a rig that does not drift gives the same cell whatever was measured before
    assert!(!with("").contact.drifts());
}

#[test]
fn what_cannot_be_is_refused_with_its_field() {
    for (text, said) in [
        ("[errors.offset_m]\nS99 = [0.0, 0.0, 0.0]", "errors.offset_m.S99"),
        ("[errors.offset_m]\nldv_a = [0.2, 0.0, 0.0]", "the unit is m"),
        ("[errors.tilt_rad]\nvib_x = [0.0, 0.0, 0.0]", "is not ldv_a"),
        ("[errors.tilt_rad]\nldv_a = [2.0, 0.0, 0.0]", "the unit is rad"),
        ("[[contact.patches]]\noffset_m = [0.0, 0.0, 0.0]\nshare = 0.5", "sum to 0.5"),
        (
            "[contact]\nlaw = \"iwan\"\n[[contact.patches]]\noffset_m = [0.0, 0.0, 0.0]\nshare = 1.0",
            "must be linear",
        ),
        ("[contact]\ndrift_per_hit = 5.0", "10 %"),
        (
            "[[paths]]\nbetween = [\"arm_a\", \"arm_c\"]\nposition_m = [0.0, 0.0, 0.0]\nstiffness_n_per_m = [0.0, 0.0, 3e6]\n\
             rotation_nm_per_rad = [0.0, 0.0, 0.0]\ndamping_s = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
            "names arm_c",
        ),
    ] {
        let error = RigConfig::from_toml(text).unwrap_err().to_string();
        assert!(error.contains(said) && error.contains("line"), "{text}: {error}");
    }
}

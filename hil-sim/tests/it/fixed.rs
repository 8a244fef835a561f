//! Fixed vibrometers, and an operator who strikes.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::{BodyName, FixedQuantity};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{CHANNELS, Channel, Configuration, Probe, Rig, RigConfig, RigError, Stepping};

const BY_HAND: &str = include_str!("../../rigs/by-hand.toml");
/// With six fixed vibrometers.
const ALL: usize = CHANNELS + 6;

/// The example without errors, noise and delays.
fn exact() -> RigConfig {
    let mut config = RigConfig::from_toml(BY_HAND).unwrap();
    config.errors.none = true;
    config.sensors.vibrometer.floor = 0.0;
    config.sensors.vibrometer.delay_s = [0.0; 3];
    config.sensors.vibrometer.polarity = [1; 3];
    for own in &mut config.sensors.fixed {
        own.floor = 0.0;
        own.delay_s = 0.0;
        own.polarity = 1;
        own.units_per_volt = config.sensors.vibrometer.units_per_volt;
    }
    config
}

fn hit(rig: &mut Rig) -> Vec<[i16; ALL]> {
    rig.fire(3.5e-3);
    (0..4_000)
        .map(|_| {
            let mut codes = [0; ALL];
            rig.scan(&mut codes);
            codes
        })
        .collect()
}

#[test]
fn they_see_what_the_vibrometer_sees_at_their_points() {
    for stepping in [Stepping::Fastest, Stepping::Exponential] {
        let mut rig = Rig::with_stepping(&exact(), 3, stepping).unwrap();
        assert_eq!(rig.channels().len(), ALL);
        for (point, first) in [("A1", CHANNELS), ("B1", CHANNELS + 3)] {
            rig.stage(Configuration::Ajb, "AZ1", point, 0).unwrap();
            let record = hit(&mut rig);
            assert!(record.iter().any(|scan| scan[1..4].iter().any(|code| code.abs() > 100)));
            for scan in &record {
                for axis in 0..3 {
                    let [staged, stays] = [scan[1 + axis], scan[first + axis]].map(i32::from);
                    // both round the same motion; the two sums are evaluated in different order
                    assert!((staged - stays).abs() <= 1, "{point} axis {axis}: {staged} and {stays}");
                }
            }
        }
        rig.stage(Configuration::B, "BZ1", "B2", 0).unwrap();
        let record = hit(&mut rig);
        assert!(record.iter().all(|scan| scan[CHANNELS..CHANNELS + 3] == [0; 3]), "A is not there");
        assert!(record.iter().any(|scan| scan[CHANNELS + 5].abs() > 100), "B is");
    }
}

#[test]
fn their_errors_are_their_own_and_change_nothing_in_the_ten() {
    let config = RigConfig::from_toml(BY_HAND).unwrap();
    let mut without = config.clone();
    without.sensors.fixed.clear();
    without.errors.skew_s = 0.0;
    let mut with = config.clone();
    with.errors.skew_s = 0.0;
    let (mut with, mut without) = (Rig::new(&with, 5).unwrap(), Rig::new(&without, 5).unwrap());
    for rig in [&mut with, &mut without] {
        rig.stage(Configuration::Ajb, "AZ1", "A2", 0).unwrap();
    }
    for (more, ten) in hit(&mut with).iter().zip(hit(&mut without)) {
        assert_eq!(more[..CHANNELS], ten[..CHANNELS]);
    }
    let gains: Vec<f64> = with.flaws().fixed.iter().map(|own| own.gain).collect();
    assert!(
        gains.iter().all(|gain| *gain != 1.0) && gains.windows(2).all(|two| two[0] != two[1]),
        "{gains:?}"
    );
    let probes: Vec<_> = with.flaws().fixed.iter().map(|own| own.probe.position_m).collect();
    assert_eq!(probes[0], probes[2], "one sensor of three channels is at one place");
    assert_ne!(probes[0], config.responses[0].position_m);
}

#[test]
fn a_person_strikes_again_and_again() {
    let mut rig = Rig::new(&RigConfig::from_toml(BY_HAND).unwrap(), 1).unwrap();
    rig.stage(Configuration::Ajb, "AZ1", "A2", 0).unwrap();
    let mut codes = [0; ALL];
    let every = 4 * u64::from(rig.scan_rate_hz());
    let mut struck = Vec::new();
    for scan in 0..3 * every {
        let before = rig.attempt();
        rig.scan(&mut codes);
        if rig.attempt() != before {
            struck.push(scan);
        }
    }
    assert_eq!(struck, [every, 2 * every]);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    for (from, to, field) in [
        ("name = \"a1_y\"", "name = \"a1_x\"", "sensors.fixed[1].name"),
        ("name = \"a1_x\"", "name = \"vib_x\"", "sensors.fixed[0].name"),
        ("response = \"A1\"", "response = \"Z9\"", "sensors.fixed[0].response"),
        ("direction = [1.0, 0.0, 0.0]", "direction = [0.0, 0.0, 0.0]", "sensors.fixed[0].direction"),
        ("every_s = 4.0", "every_s = 0.0", "hammer.hand.every_s"),
    ] {
        let said = RigConfig::from_toml(&BY_HAND.replacen(from, to, 1)).unwrap_err();
        assert!(matches!(&said, RigError::Field { field: own, .. } if own == field), "{said}");
    }
    let seventh = "\n[[sensors.fixed]]\nname = \"more\"\nresponse = \"A2\"\ndirection = [1, 0, 0]\n\
                   units_per_volt = 0.005\nfloor = 0.0\n";
    let said = RigConfig::from_toml(&format!("{BY_HAND}{}", seventh.replace("[1, 0, 0]", "[1.0, 0.0, 0.0]")));
    assert!(said.unwrap_err().to_string().contains("room for 6"));
}

#[test]
fn accelerometers_read_the_derivative_of_the_velocity() {
    // a vibrometer and an accelerometer at the point that is hit, where the hammer's force acts on
    // the reading directly
    let mut config = exact();
    config.sensors.left_out = vec!["vib_x".into(), "excitation".into()];
    config.sensors.fixed.truncate(2);
    for (own, quantity) in
        config.sensors.fixed.iter_mut().zip([FixedQuantity::Velocity, FixedQuantity::Acceleration])
    {
        own.direction = [0.0, 0.0, 1.0];
        own.quantity = quantity;
        own.units_per_volt = if quantity == FixedQuantity::Velocity { 1e-3 } else { 20.0 };
    }
    for stepping in [Stepping::Fastest, Stepping::Exponential] {
        let mut rig = Rig::with_stepping(&config, 3, stepping).unwrap();
        let names: Vec<&str> = rig.channels().iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(
            names,
            ["force", "vib_y", "vib_z", "ldv_a", "ldv_b", "lc_1", "lc_2", "lc_3", "a1_x", "a1_y"]
        );
        let steps: Vec<f64> = rig.channels().iter().map(Channel::step).collect();
        rig.stage(Configuration::Ajb, "AZ1", "A1", 0).unwrap();
        rig.fire(3.5e-3);
        let record: Vec<[f64; 2]> = (0..4_000)
            .map(|_| {
                let mut codes = [0; 10];
                rig.scan(&mut codes);
                [8, 9].map(|place| f64::from(codes[place]) * steps[place])
            })
            .collect();
        // Simpson's rule over two scans, whose error is that of modes above 10 kHz
        let period_s = 1.0 / f64::from(rig.scan_rate_hz());
        let mut left = 0.0_f64;
        let largest = record.iter().map(|[velocity, _]| velocity.abs()).fold(0.0, f64::max);
        for scan in record.windows(3) {
            let gained = (scan[0][1] + 4.0 * scan[1][1] + scan[2][1]) * period_s / 3.0;
            left = left.max((scan[2][0] - scan[0][0] - gained).abs());
        }
        assert!(largest > 1e-3 && left < 0.02 * largest, "{left} of {largest} m/s");
    }
}

#[test]
fn a_sensors_mass_is_part_of_the_structure() {
    let mut config = RigConfig::default();
    let bare = Structure::new(&config, Configuration::Ajb);
    let text = "[[sensors.fixed]]\nname = \"a\"\nresponse = \"S1\"\ndirection = [1.0, 0.0, 0.0]\n\
                units_per_volt = 1.0\nfloor = 0.0\nmass_kg = 0.01\n";
    config.sensors.fixed = RigConfig::from_toml(text).unwrap().sensors.fixed;
    let carrying = Structure::new(&config, Configuration::Ajb);
    let at = Probe { body: BodyName::SpecimenA, position_m: [0.009, 0.002, 0.0], direction: [0.0, 0.0, 1.0] };
    // what its point gains in mass: that of the sensor, for any motion of the body
    let row = bare.row(&at).unwrap();
    let moved = &row / row.norm_squared();
    let gained = moved.dot(&((&carrying.mass - &bare.mass) * &moved));
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        bare.row(&Probe { direction, ..at }).unwrap().dot(&moved)
    });
    assert!((gained - 0.01 * (x * x + y * y + z * z)).abs() < 1e-12, "{gained}");
}

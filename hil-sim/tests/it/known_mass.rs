//! The free body of known mass beside the rig.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::RigConfig;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Rig, RigError};

#[test]
fn all_vibrometers_see_the_hammers_impulse_over_the_mass() {
    let mut config = RigConfig::elastic();
    config.errors.none = true;
    let mass_kg = config.known_mass.as_ref().unwrap().body.mass_kg;
    let mut rig = Rig::new(&config, 1).unwrap();
    rig.stage(Configuration::B, "MASS", "MASS", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let mut impulse = 0.0;
    // 20 ms: the coil's pull, the contact, and a part of the support's period that changes nothing
    for _ in 0..1024 {
        rig.scan(&mut codes);
        impulse += rig.truth()[0] / f64::from(rig.scan_rate_hz());
    }
    let truth = rig.truth();
    assert!(impulse > 0.01, "{impulse}");
    // z of the 3-D vibrometer, then the vibrometers of the spots: the hit is along −z
    for seen in [truth[3], truth[4], truth[5]] {
        assert!((seen / (-impulse / mass_kg) - 1.0).abs() < 0.1, "{truth:?} {impulse}");
    }
    // nothing reaches the load cells
    assert_eq!(truth[6..9], [0.0; 3]);
}

#[test]
fn hammer_and_vibrometer_go_to_it_together_and_only_in_b() {
    let mut rig = Rig::new(&RigConfig::elastic(), 1).unwrap();
    let apart = rig.stage(Configuration::B, "BZ1", "MASS", 0).unwrap_err();
    assert!(matches!(apart, RigError::ApartFromKnownMass { .. }), "{apart}");
    let elsewhere = rig.stage(Configuration::Ajb, "MASS", "MASS", 0).unwrap_err();
    assert!(elsewhere.to_string().contains("no impact point"), "{elsewhere}");
}

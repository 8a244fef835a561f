//! Any text as the description of a simulated rig: an accepted description makes a rig that
//! produces codes for a short time.
#![no_main]

use jointrig_hil_sim::rig::{Rig, config::RigConfig};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(config) = RigConfig::from_toml(text) else { return };
    let Ok(mut rig) = Rig::new(&config, 1) else { return };
    let mut codes = vec![0; rig.channels().len()];
    rig.fire(0.003);
    for _ in 0..50 {
        rig.scan(&mut codes);
    }
    let energy = rig.energy_j();
    assert!(energy.is_finite(), "the rig holds {energy} J");
});

//! Rig files: the default, the shipped variants, and the error messages for an invalid one.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig_hil_sim::rig::config::{ContactLaw, DEFAULT_TOML};
use jointrig_hil_sim::rig::{Rig, RigConfig, RigError};

const SHIPPED: [(&str, &str); 9] = [
    ("default", include_str!("../../rigs/default.toml")),
    ("rigid-clamp", include_str!("../../rigs/rigid-clamp.toml")),
    ("clamp-half", include_str!("../../rigs/clamp-half.toml")),
    ("clamp-double", include_str!("../../rigs/clamp-double.toml")),
    ("noisy", include_str!("../../rigs/noisy.toml")),
    ("contact-120", include_str!("../../rigs/contact-120.toml")),
    ("contact-240", include_str!("../../rigs/contact-240.toml")),
    ("jenkins", include_str!("../../rigs/jenkins.toml")),
    ("iwan", include_str!("../../rigs/iwan.toml")),
];

#[test]
fn the_default_file_is_complete_and_is_the_default() {
    // Parsed alone, without the defaults: no field is missing, none is unknown.
    let alone: RigConfig = toml::from_str(DEFAULT_TOML).unwrap();
    assert_eq!(alone, RigConfig::default());
    assert_eq!(RigConfig::from_toml("").unwrap(), RigConfig::default());
    assert_eq!(RigConfig::from_toml(&alone.to_toml()).unwrap(), alone);
    assert_eq!((alone.responses.len(), alone.impacts.len()), (25, 21));
}

#[test]
fn every_shipped_rig_stands_under_its_name() {
    for (name, text) in SHIPPED {
        let config = RigConfig::from_toml(text).unwrap();
        assert_eq!(config.name, name);
        let rig = Rig::new(&config, 1).unwrap();
        assert_eq!(rig.fallback(), None);
        assert_eq!(rig.channels().len(), 10);
    }
}

#[test]
fn shipped_variants_change_what_they_say_and_nothing_else() {
    let [default, _, half, double, noisy, soft, hard, jenkins, iwan] =
        SHIPPED.map(|(_, text)| RigConfig::from_toml(text).unwrap());
    let loaded =
        |rig: &RigConfig| (rig.clamp.loaded.stiffness_n_per_m[2], rig.clamp.loaded.rotation_nm_per_rad[0]);
    assert_eq!(loaded(&default), (6e7, 6500.0));
    assert_eq!(loaded(&half), (3e7, 3250.0));
    assert_eq!(loaded(&double), (1.2e8, 13000.0));
    assert_eq!(noisy.sensors.vibrometer.floor, 2e-7);
    assert_eq!(soft.contact.stiffness_n_per_m, [1.8e8, 2.6e8, 1.2e8]);
    assert_eq!(hard.contact.stiffness_n_per_m, [1.8e8, 2.6e8, 2.4e8]);
    for (slips, law) in [(jenkins, ContactLaw::Jenkins), (iwan, ContactLaw::Iwan)] {
        assert!(slips.contact.law == law && slips.clamp.rigid);
        assert_eq!(slips.contact.friction_coefficient * slips.contact.normal_load_n, 180.0);
        assert_eq!(slips.contact.stiffness_n_per_m, default.contact.stiffness_n_per_m);
    }
    let mut back = soft;
    back.name.clone_from(&default.name);
    back.contact = default.contact.clone();
    assert_eq!(back, default);
}

#[test]
fn tables_merge_and_lists_replace() {
    let config = RigConfig::from_toml(
        "[bodies.arm_a]\nmass_kg = 2\n[bodies.specimen_a]\nbox_m = [0.01, 0.01, 0.01]\n\
         [[responses]]\nname = \"P\"\nbody = \"arm_b\"\nposition_m = [0, 0, 0]\n",
    )
    .unwrap();
    assert_eq!(config.bodies.arm_a.mass_kg, 2.0);
    assert_eq!(config.bodies.arm_a.box_m, RigConfig::default().bodies.arm_a.box_m);
    // The stated form of the inertia replaces the default's other form.
    assert_eq!(config.bodies.specimen_a.inertia_kg_m2, None);
    assert_eq!(config.responses.len(), 1);
}

fn complaint(text: &str) -> String {
    RigConfig::from_toml(text).unwrap_err().to_string()
}

#[test]
fn wrong_files_are_told_what_and_where() {
    let error = complaint("name = \"x\"\n\n[contact]\nstifness = 3\n");
    assert!(
        error.contains("line 4") && error.contains("stifness") && error.contains("stiffness_n_per_m"),
        "{error}"
    );
    let error = complaint("[bodies.mass]\ncg_m = [0, 0, 0]\nmass_kg = -1.0\n");
    assert!(
        error.contains("bodies.mass.mass_kg") && error.contains("line 3") && error.contains("greater"),
        "{error}"
    );
    let error = complaint("[knife_edge]\nposition_m = [0, nan, 0]\n");
    assert!(
        error.contains("knife_edge.position_m") && error.contains("line 2") && error.contains("NaN"),
        "{error}"
    );
    let error = complaint("[hammer]\ncoil_n = \"strong\"\n");
    assert!(error.contains("line 2") && error.contains("string"), "{error}");
    let error = complaint("a = = 2\n");
    assert!(error.contains("line 1"), "{error}");
    let error = complaint("[contact]\nposition_m = [0, 0]\n");
    assert!(error.contains("line 2"), "{error}");
    let error = complaint("[contact]\nlaw = \"coulomb\"\n");
    assert!(
        error.contains("line 2") && ["linear", "jenkins", "iwan"].iter().all(|law| error.contains(law)),
        "{error}"
    );
    let error = complaint(
        "[[impacts]]\nname = \"P\"\nbody = \"arm_a\"\nposition_m = [0, 0, 0]\ndirection = [0, 0, 0]\n",
    );
    assert!(error.contains("impacts[0].direction") && error.contains("line 5"), "{error}");
    let error = complaint("load_cells = []\n");
    assert!(error.contains("three") && error.contains("line 1"), "{error}");
    let error = complaint("[hammer.mishaps]\nweak = 0.99\n");
    assert!(error.contains("sum to at most 1"), "{error}");
}

#[test]
fn contacts_that_cannot_be_are_refused_with_their_field() {
    for (lines, field, words) in [
        ("normal_load_n = -1.0", "contact.normal_load_n", "negative"),
        ("friction_coefficient = nan", "contact.friction_coefficient", "finite"),
        ("slip_step_s = 0.0", "contact.slip_step_s", "greater than zero"),
        ("slip_step_s = 1e-9", "contact.slip_step_s", "1000 steps"),
        ("iwan.elements = 0", "contact.iwan.elements", "1 to 1000"),
        ("iwan.spread = 1.5", "contact.iwan.spread", "between 0 and 1"),
        ("stiffness_n_per_m = [1e8, 1e8, 0.0]", "contact.stiffness_n_per_m", "kz"),
        ("stiffness_n_per_m = [1e8, 1e8, 180.0]", "contact.stiffness_n_per_m", "180e6 for 180 N/µm"),
    ] {
        let error = complaint(&format!("[contact]\nlaw = \"iwan\"\n{lines}\n"));
        assert!(error.contains(field) && error.contains("line 3") && error.contains(words), "{error}");
    }
    // A light body on a stiff contact with a low scan rate: the step is too long, which is reported
    // when the rig is built.
    let text = "[contact]\nlaw = \"jenkins\"\nslip_step_s = 1.0\n[bodies.specimen_a]\nmass_kg = 1e-4\n";
    let error = Rig::new(&RigConfig::from_toml(text).unwrap(), 1).unwrap_err().to_string();
    assert!(error.contains("contact.slip_step_s") && error.contains("try"), "{error}");
}

#[test]
fn rigs_changed_in_code_are_checked_too() {
    let mut config = RigConfig::default();
    config.bodies.arm_b.mass_kg = f64::INFINITY;
    let error = Rig::new(&config, 1).unwrap_err();
    assert!(matches!(&error, RigError::Field { field, line: None, .. } if field == "bodies.arm_b.mass_kg"));
    assert_eq!(error.to_string(), "rig field bodies.arm_b.mass_kg must be finite, not inf");
}

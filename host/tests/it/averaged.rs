//! The recommended estimate on exact FRFs of a rig with a known joint.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::averaged::{Priors, averaged};
use jointrig::substructuring::{Band, Dof, Frf, Geometry, IdmSet};
use std::path::{Path, PathBuf};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };
const NOWHERE_WRONG: Priors = Priors { position_m: 0.0, aim_m: 0.0, hammer_angle_rad: 0.0 };

fn rigid() -> (Frf, Geometry) {
    (
        read_frf(&data("frf_rigid/AJB.npz")).expect("test data"),
        read_positions(&data("positions/positions.xlsx")).expect("test data").geometry,
    )
}

#[test]
fn exact_data_give_the_contact_exactly() {
    let (ajb, geometry) = rigid();
    let found = averaged(&ajb, &geometry, IdmSet::Six, BAND, &NOWHERE_WRONG).expect("exact data");
    let z = found.joint[&Dof::Z];
    // Y^J of K + sC is averaged over lines and inverted at the mean s: the square of the loss
    // factor, (1.5e-5 · ω)², differs over the band by 1e-3 at most
    assert!((z.stiffness / 180e6 - 1.0).abs() < 1e-3, "{z:?}");
    assert!((found.joint[&Dof::Y].stiffness / 260e6 - 1.0).abs() < 1e-3);
    assert!((found.joint[&Dof::Rx].stiffness / 22.0 - 1.0).abs() < 1e-3);
    assert!((z.damping / (180e6 * 1.5e-5) - 1.0).abs() < 1e-2, "{z:?}");
    assert_eq!(z.std, 0.0);
    assert!(z.identified);
}

#[test]
fn noise_above_the_joint_is_said_and_no_bare_number_given() {
    let (ajb, geometry) = rigid();
    let variance = ajb.lines().iter().map(|y| y.map(|v| 100.0 * v.norm_sqr())).collect();
    let loud = ajb.with_variance(variance).expect("one for each value");
    let found = averaged(&loud, &geometry, IdmSet::Six, BAND, &Priors::default()).expect("answers");
    let z = found.joint[&Dof::Z];
    assert!(!z.identified && z.ci95[1].is_infinite(), "{z:?}");
    assert!(found.statement().expect("z is there").starts_with("not identified"));
}

#[test]
fn what_is_missing_is_refused_by_name() {
    let (ajb, geometry) = rigid();
    let nowhere = Band { low_hz: 2000.0, high_hz: 3000.0 };
    let refuse = |ajb: &Frf, band| {
        averaged(ajb, &geometry, IdmSet::Six, band, &Priors::default()).expect_err("refused").to_string()
    };
    assert!(refuse(&ajb, nowhere).contains("2000–3000 Hz"));
    let another = ajb.clone().with_variance(vec![]).expect_err("refused").to_string();
    assert!(another.contains("0 lines"), "{another}");
    let row = ajb.outputs().iter().position(|o| o == "A1:x").expect("a channel of A");
    let ajb = ajb.map_lines(|line, mut y| {
        if line == 5 {
            y[(row, 0)].re = f64::NAN;
        }
    });
    let text = refuse(&ajb, BAND);
    assert!(text.contains("A1:x") && text.contains("320 Hz"), "{text}");
}

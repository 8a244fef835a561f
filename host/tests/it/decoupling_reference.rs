//! The main analysis function on exact FRFs of a rig with a known joint, compared with an
//! independent implementation's results.
//!
//! `frf_rigid`: rigid clamp, the contact's 180 N/µm are visible. `frf_default`: flexible clamp
//! between the measured points and the contact, so no method with points on the arms may return the
//! contact stiffness. Lines 300…600 Hz, step 4 Hz. `frf_specimen`: the same clamp, but the points
//! are on the specimens, so that the contact is visible again; step 20 Hz.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn data(case: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(case)
}

struct Case {
    a: Frf,
    b: Frf,
    ajb: Frf,
    geometry: Geometry,
    expected: Value,
}

impl Case {
    fn read(name: &str) -> Case {
        let frf = |file: &str| read_frf(&data(name).join(file)).expect("test data");
        let expected = std::fs::read_to_string(data(name).join("expected.json")).expect("test data");
        Case {
            a: frf("A.npz"),
            b: frf("B.npz"),
            ajb: frf("AJB.npz"),
            geometry: read_positions(&data("positions/positions.xlsx")).expect("test data").geometry,
            expected: serde_json::from_str(&expected).expect("test data"),
        }
    }

    fn identify(&self, methods: &[Method], idms: &[IdmSet]) -> Result<Identification, IdentifyError> {
        let band = Band { low_hz: 300.0, high_hz: 600.0 };
        identify(&self.a, &self.b, &self.ajb, &self.geometry, methods, idms, &[band])
    }
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().expect("a number in the test data")
}

fn check_case(name: &str) {
    let case = Case::read(name);
    let result = case.identify(&Method::PAPER, &IdmSet::ALL).expect("files that fit");
    assert!(result.refused.is_empty(), "{:?}", result.refused);
    let rows = case.expected["joint"].as_array().expect("rows");
    assert_eq!(rows.len(), result.joint.len());
    for row in rows {
        let method = row["method"].as_str().expect("a name");
        let got = result
            .joint
            .iter()
            .find(|r| r.method == method && r.idms as f64 == number(row, "idms"))
            .expect("the same methods");
        let z = got.stiffness_n_per_m[&Dof::Z];
        // With 6 IDMs and a rigid clamp the methods are exact: conditioning leaves errors of 1e-8,
        // and 1e-5 is a generous tolerance. Elsewhere both implementations evaluate the same
        // function of the data; 1e-3 (5e-3 for the std) is far above their rounding.
        let tolerance = if row["is_truth"] == true { 1e-5 } else { 1e-3 };
        let close = |what: &str, got: f64, wanted: f64, tolerance: f64| {
            assert!(
                (got - wanted).abs() <= tolerance * wanted.abs(),
                "{name} {method} {}: {what} {got} for {wanted}",
                row["idms"]
            );
        };
        close("mean", z.mean, number(row, "mean"), tolerance);
        close("median", z.median, number(row, "median"), tolerance);
        close("k_y", got.stiffness_n_per_m[&Dof::Y].mean, number(row, "k_y"), tolerance);
        close("c_z", got.damping_n_s_per_m[&Dof::Z].mean, number(row, "c_z"), tolerance);
        if row["is_truth"] == true {
            assert!((z.mean / 180e6 - 1.0).abs() < 1e-5, "the contact's 180 N/µm");
        } else if row["tol"]["std"].is_number() {
            // not where the scatter is only rounding
            close("std", z.std, number(row, "std"), 5e-3);
        }
        assert_eq!(got.lines as f64, number(row, "lines"));
        // Three internals for two, four or six interface DoFs: the printed form always reports
        // it here.
        assert_eq!(method == "internal-printed", got.warnings.iter().any(|w| w.contains("Π has rank")));
    }
    for quality in &result.virtual_points {
        let wanted = &case.expected["consistency"][format!("{}|{}", quality.substructure, quality.idms)];
        // the lines for which the case has reference values
        for line in ["300", "500", "600"].into_iter().filter(|l| wanted["overall_sensor"][l].is_number()) {
            let l = quality.frequency_hz.iter().position(|f| f.to_string() == line).expect("the line");
            // both are projections in double precision
            let sensor = quality.consistency.overall_sensor[l] - number(&wanted["overall_sensor"], line);
            let impact = quality.consistency.overall_impact[l] - number(&wanted["overall_impact"], line);
            assert!(sensor.abs() < 1e-9 && impact.abs() < 1e-9);
        }
        // the rig is a passive, reciprocal structure; with fewer modes than it moves in, the result
        // shows neither exactly
        if quality.idms == 6 {
            assert!(quality.passivity.iter().all(|p| *p == 1.0), "{:?}", quality.passivity);
            assert!(quality.reciprocity > 1.0 - 1e-9, "{}", quality.reciprocity);
        }
        assert!(quality.condition_responses < 50.0 && quality.condition_impacts < 50.0);
    }
}

#[test]
fn rigid_clamp() {
    check_case("frf_rigid");
}

/// There are no reference values for the other three rearrangements of Eq. (1): with six modes and
/// a rigid clamp they are exact.
#[test]
fn the_other_rearrangements_are_exact_too() {
    let case = Case::read("frf_rigid");
    let methods = [Method::InternalAa, Method::InternalAb, Method::InternalBb];
    let result = case.identify(&methods, &[IdmSet::Six]).expect("files that fit");
    assert_eq!(result.joint.len(), 3, "{:?}", result.refused);
    for row in &result.joint {
        // conditioning leaves errors of 1e-8
        assert!((row.stiffness_n_per_m[&Dof::Z].mean / 180e6 - 1.0).abs() < 1e-5, "{row:?}");
    }
}

#[test]
fn flexible_clamp() {
    check_case("frf_default");
}

/// The clamp is as soft as before, but it is not between these points and the contact.
#[test]
fn points_on_the_specimens() {
    check_case("frf_specimen");
}

/// Double precision and condition numbers up to 1e6 leave nine digits of the contact's stiffness,
/// along every motion.
#[test]
fn exact_interface_data_give_the_joint_to_nine_digits() {
    let truth = [
        (Dof::X, 180e6),
        (Dof::Y, 260e6),
        (Dof::Z, 180e6),
        (Dof::Rx, 22.0),
        (Dof::Ry, 10.0),
        (Dof::Rz, 22.0),
    ];
    for name in ["frf_specimen", "frf_rigid"] {
        let exact: Vec<Method> = Method::ALL.into_iter().filter(|m| *m != Method::InternalPrinted).collect();
        let result = Case::read(name).identify(&exact, &[IdmSet::Six]).expect("files that fit");
        assert_eq!(result.joint.len(), exact.len(), "{:?}", result.refused);
        for row in &result.joint {
            for (dof, k) in truth {
                let error = (row.stiffness_n_per_m[&dof].mean / k - 1.0).abs();
                assert!(error < 1e-9, "{name} {} {dof}: {error:e}", row.method);
            }
        }
    }
}

/// A set of modes that the paper does not have is used as named.
#[test]
fn any_named_set_of_modes() {
    let set = IdmSet::of(&[Dof::X, Dof::Z, Dof::Ry]).expect("three modes");
    let result = Case::read("frf_rigid").identify(&[Method::Inverse], &[set]).expect("files that fit");
    let row = &result.joint[0];
    assert_eq!((row.idms, row.modes.as_slice()), (3, [Dof::X, Dof::Z, Dof::Ry].as_slice()));
    assert_eq!(row.stiffness_n_per_m.keys().copied().collect::<Vec<_>>(), [Dof::X, Dof::Z, Dof::Ry]);
    // seven modes with an extension along x: the sensors would suffice, but all impacts along x
    // have the same x coordinate
    let mut modes = Dof::RIGID.to_vec();
    modes.push(Dof::Ex);
    let set = IdmSet::of(&modes).expect("seven modes");
    let result = Case::read("frf_rigid").identify(&[Method::Inverse], &[set]).expect("files that fit");
    let reason = &result.refused[0].reason;
    assert!(reason.contains("the impacts") && reason.contains("6 of 7 motions"), "{reason}");
}

/// The same values as another quantity or with another window; the line `higher`, if given, is 1 Hz
/// higher.
fn relabelled(frf: &Frf, higher: Option<usize>, sigma_per_s: f64, quantity: MotionQuantity) -> Frf {
    let mut frequency_hz = frf.frequency_hz().to_vec();
    if let Some(line) = higher {
        frequency_hz[line] += 1.0;
    }
    let (outputs, inputs) = (frf.outputs().to_vec(), frf.inputs().to_vec());
    Frf::new(frequency_hz, sigma_per_s, quantity, outputs, inputs, frf.lines().to_vec()).expect("all agree")
}

/// The same with NaN in this cell at one line.
fn broken(frf: &Frf, line: usize, row: usize) -> Frf {
    frf.clone().map_lines(|l, mut y| {
        if l == line {
            y[(row, 0)].re = f64::NAN;
        }
    })
}

#[test]
fn files_that_do_not_fit_are_refused_with_the_reason() {
    let one = |change: fn(&mut Case)| {
        let mut case = Case::read("frf_rigid");
        change(&mut case);
        case.identify(&[Method::Inverse], &[IdmSet::Two]).expect_err("no fit").to_string()
    };
    let labelled = |case: &mut Case| case.b = relabelled(&case.b, None, 0.0, MotionQuantity::Displacement);
    assert!(one(labelled).contains("B holds receptance, A holds mobility"));
    let shifted = |case: &mut Case| case.ajb = relabelled(&case.ajb, Some(3), 0.0, MotionQuantity::Velocity);
    assert!(one(shifted).contains("313 Hz against 312 Hz"));
    let windowed = |case: &mut Case| case.ajb = relabelled(&case.ajb, None, 2.3, MotionQuantity::Velocity);
    assert!(one(windowed).contains("s = σ + iω"));
    let case = Case::read("frf_rigid");
    let band = Band { low_hz: 20.0, high_hz: 30.0 };
    let empty =
        identify(&case.a, &case.b, &case.ajb, &case.geometry, &[Method::Inverse], &[IdmSet::Two], &[band]);
    assert!(empty.expect_err("no line").to_string().contains("20–30 Hz"));
}

#[test]
fn missing_and_broken_cells_refuse_only_the_methods_that_need_them() {
    let mut case = Case::read("frf_rigid");
    // A4 is not used, so it may contain anything.
    let spare = case.a.outputs().iter().position(|o| o == "A4:x").expect("the spare");
    case.a = broken(&case.a, 0, spare);
    // An interface cell of the assembly between A's virtual point and A's impacts: `internal` does
    // not use it.
    let row = case.ajb.outputs().iter().position(|o| o == "A1:x").expect("a channel of A");
    case.ajb = broken(&case.ajb, 5, row);
    let result = case.identify(&Method::ALL, &[IdmSet::Six]).expect("most of it works");
    let methods: Vec<&str> = result.joint.iter().map(|r| r.method.as_str()).collect();
    assert_eq!(methods, ["internal", "internal-printed", "internal-ab", "internal-bb"]);
    assert!(
        result.refused[0].reason.contains("AJB")
            && result.refused[0].reason.contains("A1:x")
            && result.refused[0].reason.contains("320 Hz"),
        "{}",
        result.refused[0].reason
    );
    // Five responses on B for six interface DoFs.
    let mut case = Case::read("frf_rigid");
    let few: Vec<String> = case.ajb.outputs().iter().filter(|o| o.as_str() < "B2:z").cloned().collect();
    case.ajb = case.ajb.select(&few, case.ajb.inputs()).expect("named");
    let result = case.identify(&[Method::Internal], &[IdmSet::Six]).expect("readable");
    assert!(result.joint.is_empty());
    assert!(result.refused[0].reason.contains("6 interface DoFs"), "{}", result.refused[0].reason);
}

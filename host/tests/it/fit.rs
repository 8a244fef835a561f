//! The fit of K and C, on exact FRFs of a rig with a known joint.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::averaged::Priors;
use jointrig::substructuring::fit::{FitError, Fitted, FreeEntries, Options, fit};
use jointrig::substructuring::{Band, Dof, Frf, Geometry, IdmSet};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };
const NOWHERE_WRONG: Priors = Priors { position_m: 0.0, aim_m: 0.0, hammer_angle_rad: 0.0 };

struct Case {
    frf: [Frf; 3],
    geometry: Geometry,
}

impl Case {
    /// The rigid clamp's exact FRFs, declared to have this noise relative to each file's mean
    /// magnitude.
    fn rigid(relative: f64) -> Case {
        let frf =
            ["A", "B", "AJB"].map(|f| read_frf(&data(&format!("frf_rigid/{f}.npz"))).expect("test data"));
        let frf = frf.map(|frf| {
            let variance = frf.lines().iter().map(|y| {
                let mean = y.map(|v| v.norm_sqr()).mean();
                DMatrix::from_element(y.nrows(), y.ncols(), relative * relative * mean / 2.0)
            });
            let variance = variance.collect();
            frf.with_variance(variance).expect("one for each value")
        });
        let geometry = read_positions(&data("positions/positions.xlsx")).expect("test data").geometry;
        Case { frf, geometry }
    }

    fn fit(&self, idms: IdmSet, options: &Options) -> Result<Fitted, FitError> {
        let [a, b, ajb] = &self.frf;
        fit(a, b, ajb, &self.geometry, idms, BAND, options)
    }
}

#[test]
fn exact_data_give_the_contact_exactly() {
    let options = Options { priors: NOWHERE_WRONG, mounting: 0.0, ..Options::default() };
    let found = Case::rigid(1e-6).fit(IdmSet::Six, &options).expect("exact data");
    for (dof, stiffness) in
        [(Dof::X, 180e6), (Dof::Y, 260e6), (Dof::Z, 180e6), (Dof::Rx, 22.0), (Dof::Ry, 10.0)]
    {
        let k = found.joint[&dof];
        // the data are exact to 1e-12; the estimate deviates because of the drawn bias of the
        // declared noise
        let tolerance = if dof.is_rotation() { 1e-4 } else { 1e-6 };
        assert!((k.stiffness / stiffness - 1.0).abs() < tolerance, "{dof}: {k:?}");
    }
    let z = found.joint[&Dof::Z];
    assert!((z.damping / (180e6 * 1.5e-5) - 1.0).abs() < 1e-5, "{z:?}");
    assert!(found.converged && z.identified && found.row().warnings.is_empty(), "{:?}", found.warnings());
}

#[test]
fn full_matrices_of_exact_data_are_diagonal() {
    let options =
        Options { priors: NOWHERE_WRONG, mounting: 0.0, shape: FreeEntries::Full, ..Options::default() };
    let found = Case::rigid(1e-6).fit(IdmSet::Six, &options).expect("exact data");
    let z = found.joint[&Dof::Z].stiffness;
    assert!((z / 180e6 - 1.0).abs() < 1e-4, "{z}");
    let [coupling, _] = found.coupling_si["y-z"];
    assert!(coupling.abs() < 1e-3 * z, "{coupling}");
}

/// The paper's three internals on each side: too few for Eq. (3), enough for a model.
#[test]
fn three_internals_are_enough() {
    let mut case = Case::rigid(1e-3);
    let ajb = &case.frf[2];
    let (outputs, inputs): (Vec<String>, Vec<String>) = (
        ajb.outputs().iter().filter(|o| o.starts_with("B4")).cloned().collect(),
        ajb.inputs().iter().filter(|i| i.starts_with("I_")).cloned().collect(),
    );
    assert_eq!((outputs.len(), inputs.len()), (3, 3));
    case.frf[2] = ajb.select(&outputs, &inputs).expect("they are there");
    let options = Options { priors: NOWHERE_WRONG, mounting: 0.0, ..Options::default() };
    let found = case.fit(IdmSet::Six, &options).expect("a model needs no square matrix");
    let z = found.joint[&Dof::Z];
    assert!(z.ci95[0] < 180e6 && 180e6 < z.ci95[1], "{z:?}");
    assert!((z.stiffness / 180e6 - 1.0).abs() < 0.01, "{z:?}");
}

#[test]
fn what_the_model_cannot_describe_gives_no_bare_number() {
    let mut case = Case::rigid(1e-4);
    // an assembly with a wrong scale: no K and C can produce it from these parts
    let [a, b, ajb] = case.frf;
    case.frf = [a, b, ajb.map_lines(|_, mut y| y *= nalgebra::Complex::from(1.5))];
    let options = Options { priors: NOWHERE_WRONG, mounting: 0.0, ..Options::default() };
    let error = case.fit(IdmSet::Six, &options).expect_err("refused").to_string();
    assert!(error.contains("does not fit") || error.contains("not identified"), "{error}");
}

#[test]
fn unknown_noise_is_refused_by_cell() {
    let mut case = Case::rigid(1e-3);
    let row = case.frf[1].outputs().iter().position(|o| o == "B2:y").expect("a channel of B");
    let mut variance = case.frf[1].variance().expect("known").to_vec();
    for v in &mut variance {
        v[(row, 0)] = f64::NAN;
    }
    case.frf[1] = case.frf[1].clone().with_variance(variance).expect("as before");
    let error = case.fit(IdmSet::Six, &Options::default()).expect_err("refused").to_string();
    assert!(error.contains("B2:y") && error.contains("`variance`"), "{error}");
}

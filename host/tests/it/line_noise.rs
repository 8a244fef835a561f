//! The propagated noise of a line, compared with the effect of noise that is actually added.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::joint_over_bands::stiffness_and_damping;
use jointrig::substructuring::{Dof, Frf, Geometry, IdmSet, Method, decouple, line_noise};
use nalgebra::{Complex, DMatrix};
use std::path::{Path, PathBuf};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// A, B and AJB of the rigid clamp on three lines, and a window so strong that K is not the real
/// part.
fn measured() -> ([Frf; 3], Geometry) {
    let files = ["A.npz", "B.npz", "AJB.npz"].map(|file| {
        let frf = read_frf(&data("frf_rigid").join(file)).expect("test data");
        let (outputs, inputs) = (frf.outputs().to_vec(), frf.inputs().to_vec());
        let (frequency_hz, lines) = (frf.frequency_hz()[..3].to_vec(), frf.lines()[..3].to_vec());
        Frf::new(frequency_hz, 300.0, frf.quantity(), outputs, inputs, lines).expect("all agree")
    });
    (files, read_positions(&data("positions/positions.xlsx")).expect("test data").geometry)
}

/// The FRFs with this variance of each cell, the same on all lines.
fn noisy(frf: &Frf, variance: impl Fn(usize, usize) -> f64) -> Frf {
    let matrix = |y: &DMatrix<Complex<f64>>| DMatrix::from_fn(y.nrows(), y.ncols(), &variance);
    frf.clone().with_variance(frf.lines().iter().map(matrix).collect()).expect("one for each value")
}

/// K and C of every degree of freedom at a line, or `None` if the method refuses.
fn joint(
    files: &[Frf; 3],
    geometry: &Geometry,
    method: Method,
    idms: IdmSet,
    l: usize,
) -> Option<Vec<(f64, f64)>> {
    let [a, b, ajb] = files;
    let mut found = decouple(a, b, ajb, geometry, &[method], idms).expect("files that fit");
    let z = found.remove(0).1.ok()?;
    Some((0..idms.count()).map(|d| stiffness_and_damping(z[l][(d, d)], a.s(l))).collect())
}

#[test]
fn every_cell_moves_the_joint_as_propagated() {
    let (files, geometry) = measured();
    let l = 1;
    let mut compared = 0;
    for idms in IdmSet::ALL {
        for method in Method::ALL {
            if joint(&files, &geometry, method, idms, l).is_none() {
                continue;
            }
            for file in 0..3 {
                let (rows, columns) = files[file].lines()[l].shape();
                // about eighty interface and internal cells of all kinds
                for cell in (0..rows * columns).step_by(rows * columns / 29 + 1) {
                    let (o, i) = (cell % rows, cell / rows);
                    let size = 1e-6 * files[file].lines()[l].norm() / ((rows * columns) as f64).sqrt();
                    // central differences with a step in the real, then in the imaginary part
                    let moved = [Complex::new(size, 0.0), Complex::new(0.0, size)].map(|step| {
                        let at = |sign: f64| {
                            let mut files = files.clone();
                            files[file] = files[file].clone().map_lines(|line, mut y| {
                                if line == l {
                                    y[(o, i)] += step * sign;
                                }
                            });
                            joint(&files, &geometry, method, idms, l).expect("as before")
                        };
                        let (up, down) = (at(1.0), at(-1.0));
                        up.iter()
                            .zip(down)
                            .map(|(u, d)| ((u.0 - d.0) / 2.0, (u.1 - d.1) / 2.0))
                            .collect::<Vec<_>>()
                    });
                    // the variance is smoothed over lines, so it is the same on all of them
                    let noisy = [0, 1, 2].map(|f| {
                        noisy(&files[f], |r, c| if (f, r, c) == (file, o, i) { size * size } else { 0.0 })
                    });
                    let noise = line_noise(noisy.each_ref(), &geometry, &[method], idms)
                        .expect("files that fit")
                        .remove(0)
                        .1
                        .expect("as before");
                    for (d, dof) in idms.dofs().iter().enumerate() {
                        let k = moved[0][d].0.hypot(moved[1][d].0);
                        let c = moved[0][d].1.hypot(moved[1][d].1);
                        let (got_k, got_c) =
                            (noise.stiffness_n_per_m[dof][l], noise.damping_n_s_per_m[dof][l]);
                        // steps of 1e-6 move K by up to 1e4 N/m, and rounding by 1e-9 of its 1e8;
                        // rotations are N m
                        let scale = if dof.is_rotation() { 40e-3f64.powi(2) } else { 1.0 };
                        let floor = 0.1 * scale;
                        assert!(
                            (got_k - k).abs() < 2e-3 * k + floor,
                            "{method}, {idms:?}, file {file}, cell {o} {i}, k_{dof}: {got_k:e} for {k:e}"
                        );
                        assert!(
                            (got_c - c).abs() < 2e-3 * c + 1e-3 * floor,
                            "{method}, {idms:?}, file {file}, cell {o} {i}, c_{dof}: {got_c:e} for {c:e}"
                        );
                        compared += usize::from(k > 100.0 * floor);
                    }
                }
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn a_cell_of_unknown_variance_spoils_only_what_uses_it() {
    let (files, geometry) = measured();
    let internal = files[2].outputs().iter().position(|o| o.starts_with("B4")).expect("an internal response");
    let known = [0, 1, 2]
        .map(|f| noisy(&files[f], |row, _| if (f, row) == (2, internal) { f64::NAN } else { 1e-20 }));
    let methods = [Method::Inverse, Method::Internal];
    let found = line_noise(known.each_ref(), &geometry, &methods, IdmSet::Six).expect("files that fit");
    let z = |i: usize| found[i].1.as_ref().expect("both work").stiffness_n_per_m[&Dof::Z][0];
    assert!(z(0) > 0.0 && z(0).is_finite() && z(1).is_nan(), "{} {}", z(0), z(1));
    let of_a = known[0].variance().expect("known").to_vec();
    let error = files[2].clone().with_variance(of_a).expect_err("A's variance for AJB");
    assert!(error.to_string().starts_with("the variance has"), "{error}");
}

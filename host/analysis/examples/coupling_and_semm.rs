//! The forward direction: from parts and a joint to the assembly, and a model corrected by a
//! measurement.
//!
//! ```sh
//! cargo run -p jointrig-analysis --example coupling_and_semm
//! ```
//!
//! A.csv and B.csv are coupled by a joint whose stiffness is 20 % too low, and the result is
//! compared with the measured assembly, AJB.csv. Then SEMM corrects this model with the measurement
//! on A alone, which improves the FRFs on B as well.

mod csv;

use jointrig_analysis::substructuring::Frf;
use jointrig_analysis::substructuring::coupling::{block_diagonal, boolean_difference, couple};
use jointrig_analysis::substructuring::semm::{FULLY_EXTENDED, semm};
use nalgebra::{Complex, DMatrix};

/// The joint along y and z, N/m: 80 % of what the files were computed with.
const JOINT_N_PER_M: [f64; 2] = [0.8 * 260e6, 0.8 * 180e6];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (a, b, measured) = (csv::frf("A.csv")?, csv::frf("B.csv")?, csv::frf("AJB.csv")?);
    let parts = block_diagonal(&[("A", &a), ("B", &b)])?;
    let difference = boolean_difference(2);
    let mut coupled = Vec::new();
    for (line, y) in parts.lines().iter().enumerate() {
        // the joint's mobility, s/k
        let joint =
            DMatrix::from_fn(
                2,
                2,
                |r, c| {
                    if r == c { parts.s(line) / JOINT_N_PER_M[r] } else { Complex::ZERO }
                },
            );
        coupled.push(couple(y, &difference, &difference, Some(&joint))?);
    }
    let model = measured.with_values(coupled)?;
    let on_a = measured.select(&measured.outputs()[..2], &measured.inputs()[..2])?;
    let hybrid = semm(&model, &on_a, FULLY_EXTENDED)?;
    println!("mean error of the driving points along z, against the measured assembly:");
    for (name, at) in [("A1:z, in the overlay", 1), ("B1:z, never measured", 3)] {
        let error = |y: &Frf| {
            let of_line = |(y, m): (&DMatrix<Complex<f64>>, &DMatrix<Complex<f64>>)| {
                (y[(at, at)] - m[(at, at)]).norm() / m[(at, at)].norm()
            };
            100.0 * y.lines().iter().zip(measured.lines()).map(of_line).sum::<f64>() / y.lines().len() as f64
        };
        println!("{name}: coupled {:6.2} %, corrected by SEMM {:6.2} %", error(&model), error(&hybrid));
    }
    Ok(())
}

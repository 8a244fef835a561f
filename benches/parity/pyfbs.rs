//! Comparison with pyFBS: virtual points (T_u, T_f, Y_vp, weights, an extension mode), consistency,
//! SEMM.
//!
//! pyFBS's `fully-extend-svd` is not compared: in 1.0.7 its branch is never reached, and it returns
//! the result of `fully-extend` (which is checked here, so that a repaired version is noticed).
//! Ours is compared with the formula and pyFBS's own truncated inverse.

use super::{Outcome, script};
use jointrig::exchange::npz::NpzFile;
use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::geometry::{Configuration, Geometry, Grouping};
use jointrig::substructuring::quality::consistency;
use jointrig::substructuring::semm::{FULLY_EXTENDED, Form, semm};
use jointrig::substructuring::vpt;
use jointrig::substructuring::vpt::{VirtualPoint, Weights, transform};
use jointrig::substructuring::{Dof, Frf, IdmSet, MotionQuantity};
use nalgebra::{Complex, DMatrix, Vector3};
use serde_json::json;
use std::path::{Path, PathBuf};

/// All must agree to this fraction of the largest entry; consistencies absolutely.
const ALLOWED: f64 = 1e-10;

const SEMM_OUTPUTS: [&str; 4] = ["A1:x", "A1:z", "A2:y", "A3:z"];
const SEMM_INPUTS: [&str; 4] = ["AZ1", "AZ2", "AZ3", "AY3"];
/// Weights of A's nine interface channels, and of its nine impacts.
const WEIGHTS: [f64; 9] = [1.0, 2.0, 0.5, 3.0, 1.5, 0.25, 1.0, 4.0, 0.75];

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/tests/data").join(file)
}

/// The comparisons and their results.
struct Table {
    theirs: NpzFile,
    worst: Vec<String>,
}

impl Table {
    fn row(&mut self, what: &str, difference: f64) {
        println!("| pyFBS | {what} | {difference:.1e} | {ALLOWED:.0e} |");
        if difference.is_nan() || difference > ALLOWED {
            self.worst.push(format!("{what} differs by {difference:e}"));
        }
    }

    /// Compares a complex array of theirs with our lines, relative to the largest entry.
    fn lines(
        &mut self,
        array: &str,
        ours: &[DMatrix<Complex<f64>>],
    ) -> Result<f64, Box<dyn std::error::Error>> {
        let theirs = self.theirs.complex(array, "lines of matrices")?;
        let mine: Vec<Complex<f64>> =
            ours.iter().flat_map(|y| y.transpose().iter().copied().collect::<Vec<_>>()).collect();
        Ok(difference(&mine, &theirs.values, |a, b| (a - b).norm(), Complex::norm))
    }

    fn real(&mut self, array: &str, ours: &[f64]) -> Result<f64, Box<dyn std::error::Error>> {
        let theirs = self.theirs.real(array, "numbers")?;
        Ok(difference(ours, &theirs.values, |a, b| (a - b).abs(), f64::abs))
    }
}

/// Largest difference relative to their largest value; infinite if the numbers of values differ.
fn difference<T: Copy>(
    ours: &[T],
    theirs: &[T],
    distance: impl Fn(T, T) -> f64,
    size: impl Fn(T) -> f64,
) -> f64 {
    if ours.len() != theirs.len() {
        return f64::INFINITY;
    }
    let largest = theirs.iter().map(|b| size(*b)).fold(0.0, f64::max);
    ours.iter().zip(theirs).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max) / largest
}

pub fn run(python: &str) -> Outcome {
    let folder = tempfile::tempdir()?;
    let job = json!({
        "data": data(""), "folder": folder.path(), "weights": WEIGHTS,
        "semm_outputs": SEMM_OUTPUTS, "semm_inputs": SEMM_INPUTS,
    });
    script(python, "pyfbs.py", &job.to_string())?;
    let mut table = Table { theirs: NpzFile::open(&folder.path().join("pyfbs.npz"))?, worst: Vec::new() };
    let geometry = read_positions(&data("positions/positions.xlsx"))?.geometry;
    println!("| against | what | largest difference | allowed |");
    println!("|---|---|---|---|");
    for name in ["A", "B", "AJB"] {
        virtual_points(&mut table, name, &geometry)?;
    }
    other_transformations(&mut table, &geometry)?;
    mixing(&mut table)?;
    if table.worst.is_empty() { Ok(()) } else { Err(table.worst.join("\n  ").into()) }
}

/// The complete transformation of a configuration, reconstructed from its action on a matrix, with
/// the other side unchanged.
struct Whole {
    t_u: DMatrix<Complex<f64>>,
    t_f: DMatrix<Complex<f64>>,
    y: Frf,
}

impl Whole {
    fn of(
        frf: &Frf,
        points: &Configuration,
        plans: &[VirtualPoint],
        weights: &Weights,
    ) -> Result<Whole, Box<dyn std::error::Error>> {
        let unit = |outputs: bool| -> Result<DMatrix<Complex<f64>>, Box<dyn std::error::Error>> {
            let names = if outputs { frf.outputs() } else { frf.inputs() };
            let identity = DMatrix::identity(names.len(), names.len());
            let only = |plan: &VirtualPoint| VirtualPoint {
                outputs: if outputs { plan.outputs.clone() } else { Vec::new() },
                inputs: if outputs { Vec::new() } else { plan.inputs.clone() },
                ..plan.clone()
            };
            let plans: Vec<VirtualPoint> = plans.iter().map(only).collect();
            let weights = if outputs {
                Weights { inputs: Vec::new(), ..weights.clone() }
            } else {
                Weights { outputs: Vec::new(), ..weights.clone() }
            };
            let probe = {
                let (outputs, inputs) = (names.to_vec(), names.to_vec());
                Frf::new(vec![1.0], 0.0, MotionQuantity::Displacement, outputs, inputs, vec![identity])?
            };
            let found = transform(&probe, points, &plans, &weights)?;
            Ok(found.lines().first().cloned().ok_or("no line")?)
        };
        Ok(Whole { t_u: unit(true)?, t_f: unit(false)?, y: transform(frf, points, plans, weights)? })
    }

    fn compare(&self, table: &mut Table, name: &str) -> Outcome {
        for (what, array, ours) in
            [("T_u", "tu", std::slice::from_ref(&self.t_u)), ("T_f", "tf", std::slice::from_ref(&self.t_f))]
        {
            let ours: Vec<f64> =
                ours.iter().flat_map(|t| t.transpose().iter().map(|v| v.re).collect::<Vec<_>>()).collect();
            let found = table.real(&format!("{name}_{array}"), &ours)?;
            table.row(&format!("{what}, {name}"), found);
        }
        let found = table.lines(&format!("{name}_y"), self.y.lines())?;
        table.row(&format!("Y_vp, {name}"), found);
        Ok(())
    }
}

fn virtual_points(table: &mut Table, name: &str, geometry: &Geometry) -> Outcome {
    let frf = read_frf(&data("frf_rigid").join(format!("{name}.npz")))?;
    let points = match name {
        "A" => &geometry.a,
        "B" => &geometry.b,
        _ => &geometry.ajb,
    };
    let groups = [
        (1, Grouping::InterfaceA, geometry.virtual_point_a_m),
        (2, Grouping::InterfaceB, geometry.virtual_point_b_m),
    ];
    let here: Vec<_> =
        groups.into_iter().filter(|(_, g, _)| points.channels.iter().any(|c| c.grouping == *g)).collect();
    let plans: Vec<VirtualPoint> = here
        .iter()
        .map(|(n, grouping, at)| {
            VirtualPoint::of_grouping(&n.to_string(), *at, IdmSet::Six, points, *grouping)
        })
        .collect();
    Whole::of(&frf, points, &plans, &Weights::default())?.compare(table, name)?;
    for ((number, grouping, at), plan) in here.iter().zip(&plans) {
        let own = |points: &[jointrig::substructuring::Point]| {
            points.iter().filter(|p| p.grouping == *grouping).cloned().collect::<Vec<_>>()
        };
        let (channels, impacts) = (own(&points.channels), own(&points.impacts));
        let at = Vector3::from(*at);
        let (u, f) = (
            vpt::responses(&channels, at, IdmSet::Six, None)?,
            vpt::impacts(&impacts, at, IdmSet::Six, None)?,
        );
        let found = consistency(frf.select(&plan.outputs, &plan.inputs)?.lines(), &u, &f);
        let mut worst = 0.0f64;
        for (what, ours) in [
            ("overall_sensor", &found.overall_sensor),
            ("overall_impact", &found.overall_impact),
            ("specific_sensor", &found.specific_sensor),
            ("specific_impact", &found.specific_impact),
        ] {
            worst = worst.max(table.real(&format!("{name}_{number}_{what}"), ours)?);
        }
        table.row(&format!("consistency of point {number}, {name}"), worst);
    }
    Ok(())
}

/// Weights, and seven modes with an extension among them.
fn other_transformations(table: &mut Table, geometry: &Geometry) -> Outcome {
    let frf = read_frf(&data("frf_rigid/A.npz"))?;
    let six = VirtualPoint::of_grouping(
        "1",
        geometry.virtual_point_a_m,
        IdmSet::Six,
        &geometry.a,
        Grouping::InterfaceA,
    );
    let spread = |names: &[String], chosen: &[String]| -> Vec<Vec<f64>> {
        let of = |name: &String| chosen.iter().position(|n| n == name).map_or(1.0, |i| WEIGHTS[i]);
        vec![names.iter().map(of).collect()]
    };
    let weights =
        Weights { outputs: spread(frf.outputs(), &six.outputs), inputs: spread(frf.inputs(), &six.inputs) };
    Whole::of(&frf, &geometry.a, std::slice::from_ref(&six), &weights)?.compare(table, "weighted")?;
    let mut modes = Dof::RIGID.to_vec();
    modes.push(Dof::Ex);
    let seven = IdmSet::of(&modes).ok_or("seven modes")?;
    // the forces keep six: two virtual points at one position, one for motions and one for forces
    let motions = VirtualPoint { idms: seven, inputs: Vec::new(), ..six.clone() };
    let forces = VirtualPoint { outputs: Vec::new(), ..six };
    Whole::of(&frf, &geometry.a, &[motions, forces], &Weights::default())?.compare(table, "flexible")
}

fn mixing(table: &mut Table) -> Outcome {
    let parent = read_frf(&data("frf_rigid/A.npz"))?.to_receptance()?;
    let measured = read_frf(&data("frf_default/A.npz"))?
        .to_receptance()?
        .select(&SEMM_OUTPUTS.map(str::to_owned), &SEMM_INPUTS.map(str::to_owned))?;
    // larger by half, so that the correction is as large as the parent model
    let measured = measured.map_lines(|_, mut y| y *= Complex::from(1.5));
    let truncated = Form::FullyExtended { drop_compatibility: 2, drop_equilibrium: 1 };
    for (what, array, form) in [
        ("SEMM, basic", "semm_basic", Form::Basic),
        ("SEMM, fully extended", "semm_extended", FULLY_EXTENDED),
        ("SEMM, fully extended, truncated (the formula)", "semm_truncated", truncated),
    ] {
        let ours = semm(&parent, &measured, form)?;
        let found = table.lines(array, ours.lines())?;
        table.row(what, found);
    }
    let (same, as_extended) = (
        table.theirs.complex("semm_svd", "lines of matrices")?,
        table.theirs.complex("semm_extended", "lines of matrices")?,
    );
    let truncates = same.values != as_extended.values;
    println!("| pyFBS | its own `fully-extend-svd` truncates | {} | |", if truncates { "yes" } else { "no" });
    Ok(())
}

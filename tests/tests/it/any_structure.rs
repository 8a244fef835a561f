//! A structure other than the paper's, measured by another system: three bodies, two clamps, a
//! contact that slides along x + y, six triaxial accelerometers that record every hit
//! simultaneously, a manual hammer. Universal files with node numbers are read, the joint is
//! identified.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::SMALL;
use jointrig::exchange::frf_uff::write_uff;
use jointrig::exchange::uff::{
    Abscissa, ByteOrder, DataSet, Dof, Encoding, Function, Values, kind, quantity,
};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use nalgebra::{DMatrix, Matrix3, Matrix3x6, Matrix6, Vector3};
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use realfft::RealFftPlanner;
use serde_json::Value;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::fmt::Write;
use std::path::Path;

const RATE_HZ: f64 = 12_800.0;
/// 2 s, plus the samples before the trigger.
const SCANS: usize = 25_600 + 256;
const HITS: usize = 3;

/// The truth: stiffness of the joint along the sliding direction, N/m.
const SLIDING: f64 = 40e6;

const ALONG: [f64; 3] = [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0];
const ACROSS: [f64; 3] = [-FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0];
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// A part of the structure: its bodies, with or without the joint.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Frame,
    Blade,
    Both,
}

/// (node, position, orientation of its sensor): the first three on the frame's arm, the others on
/// the blade.
fn sensors() -> Vec<(i64, Vector3<f64>, Matrix3<f64>)> {
    let straight = Matrix3::identity();
    // rotated about z, and upside down
    let turned = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let over = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
    vec![
        (11, Vector3::new(-0.030, 0.020, 0.035), straight),
        (12, Vector3::new(-0.045, 0.030, -0.030), turned),
        (13, Vector3::new(0.020, 0.050, -0.010), over),
        (21, Vector3::new(0.030, -0.025, 0.030), straight),
        (22, Vector3::new(0.050, -0.020, -0.035), over),
        (23, Vector3::new(-0.015, -0.050, 0.005), turned),
    ]
}

/// (node, position, direction): six on the frame's arm, six on the blade.
fn impacts() -> Vec<(i64, Vector3<f64>, [f64; 3])> {
    let on = |side: f64, first: i64| {
        [
            ([-0.035, 0.035, 0.020], ALONG),
            ([-0.050, 0.015, -0.025], ALONG),
            ([0.010, 0.045, 0.030], ACROSS),
            ([0.025, 0.040, -0.030], ACROSS),
            ([-0.040, 0.010, 0.035], UP),
            ([0.020, 0.055, 0.000], UP),
        ]
        .into_iter()
        .zip(first..)
        .map(move |((at, direction), node)| (node, side * Vector3::from(at), direction.map(|x| side * x)))
    };
    on(1.0, 101).chain(on(-1.0, 201)).collect()
}

/// Velocity of a point of a body from that of its centre of mass: v + ω × r.
fn motion(centre: Vector3<f64>, at: Vector3<f64>) -> Matrix3x6<f64> {
    let r = at - centre;
    let mut out = Matrix3x6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-r.cross_matrix()));
    out
}

/// Six motions at a point: three of the point, three of the body.
fn six(centre: Vector3<f64>, at: Vector3<f64>) -> Matrix6<f64> {
    let mut out = Matrix6::identity();
    out.fixed_view_mut::<3, 6>(0, 0).copy_from(&motion(centre, at));
    out
}

const CENTRES: [[f64; 3]; 3] = [[-0.20, 0.15, 0.05], [-0.05, 0.04, 0.0], [0.06, -0.05, 0.01]];
const MASSES: [f64; 3] = [8.0, 3.0, 4.0];

/// Mass, damping and stiffness of a part.
fn system(part: Part) -> [DMatrix<f64>; 3] {
    let (mut m, mut c, mut k) = (DMatrix::zeros(18, 18), DMatrix::zeros(18, 18), DMatrix::zeros(18, 18));
    for (body, mass) in MASSES.into_iter().enumerate() {
        for i in 0..3 {
            m[(6 * body + i, 6 * body + i)] = mass;
            m[(6 * body + 3 + i, 6 * body + 3 + i)] = mass * [2.1e-3, 3.2e-3, 2.7e-3][i];
        }
    }
    let mut spring = |ends: [Option<usize>; 2], at: [f64; 3], stiffness: Matrix6<f64>| {
        let at = Vector3::from(at);
        for (a, sign_a) in ends.into_iter().zip([1.0, -1.0]) {
            for (b, sign_b) in ends.into_iter().zip([1.0, -1.0]) {
                let (Some(a), Some(b)) = (a, b) else { continue };
                let [own, other] = [a, b].map(|body| six(CENTRES[body].into(), at));
                let block = sign_a * sign_b * own.transpose() * stiffness * other;
                let mut place = k.view_mut((6 * a, 6 * b), (6, 6));
                place += &block;
            }
        }
    };
    let diagonal = |t: [f64; 3], r: f64| Matrix6::from_diagonal(&[t[0], t[1], t[2], r, r, r].into());
    // soft suspension of the frame, the clamp of its arm, the clamp of the blade to the ground
    spring([Some(0), None], [-0.22, 0.15, 0.0], diagonal([2e4, 3e4, 2.5e4], 300.0));
    spring([Some(0), Some(1)], [-0.12, 0.10, 0.01], diagonal([6e7, 9e7, 7e7], 1.5e5));
    spring([Some(2), None], [0.15, -0.12, 0.0], diagonal([4e7, 5e7, 3e7], 9e4));
    if part == Part::Both {
        let axes = Matrix3::from_rows(&[ALONG, ACROSS, UP].map(|axis| Vector3::from(axis).transpose()));
        let mut joint = diagonal([0.0; 3], 4e4);
        let along_axes = Matrix3::from_diagonal(&[SLIDING, 1.1e8, 1.4e8].into());
        joint.fixed_view_mut::<3, 3>(0, 0).copy_from(&(axes.transpose() * along_axes * axes));
        spring([Some(1), Some(2)], [0.0; 3], joint);
    }
    c += 1.2e-5 * &k + 40.0 * &m;
    [m, c, k]
}

/// The bodies of a part.
fn bodies(part: Part) -> &'static [usize] {
    match part {
        Part::Frame => &[0, 1],
        Part::Blade => &[2],
        Part::Both => &[0, 1, 2],
    }
}

/// Spectra of the sensors' channels (m/s² per N) for a unit force at each impact: by impact, by
/// channel, by line.
fn accelerances(
    part: Part,
    sensors: &[(i64, Vector3<f64>, Matrix3<f64>)],
    hits: &[(i64, Vector3<f64>, [f64; 3])],
) -> Vec<Vec<Vec<Complex<f64>>>> {
    let [m, c, k] = system(part);
    let own: Vec<usize> = bodies(part).iter().flat_map(|body| 6 * body..6 * body + 6).collect();
    let pick = |x: &DMatrix<f64>| x.select_rows(&own).select_columns(&own);
    let (m, c, k) = (pick(&m), pick(&c), pick(&k));
    let place = |node: i64| if node % 1000 < 20 || (100..200).contains(&node) { 1 } else { 2 };
    let rows_of = |node: i64, at: Vector3<f64>| {
        let body = place(node);
        let mut rows = DMatrix::zeros(3, own.len());
        let from = own.iter().position(|dof| *dof == 6 * body).unwrap();
        rows.view_mut((0, from), (3, 6)).copy_from(&motion(CENTRES[body].into(), at));
        rows
    };
    let force = DMatrix::from_columns(
        &hits
            .iter()
            .map(|(node, at, d)| {
                (rows_of(*node, *at).transpose() * DMatrix::from_row_slice(3, 1, d)).column(0).into_owned()
            })
            .collect::<Vec<_>>(),
    )
    .map(Complex::from);
    let seen: Vec<DMatrix<Complex<f64>>> = sensors
        .iter()
        .map(|(node, at, mounted)| {
            (DMatrix::from_row_slice(3, 3, mounted.transpose().as_slice()) * rows_of(*node, *at))
                .map(Complex::from)
        })
        .collect();
    let mut out = vec![vec![Vec::new(); 3 * sensors.len()]; hits.len()];
    for line in 0..=SCANS / 2 {
        let omega = TAU * line as f64 * RATE_HZ / SCANS as f64;
        let z = DMatrix::from_fn(own.len(), own.len(), |i, j| {
            Complex::new(k[(i, j)] - omega * omega * m[(i, j)], omega * c[(i, j)])
        });
        let motions = z.lu().solve(&force).unwrap() * Complex::from(-omega * omega);
        for (sensor, rows) in seen.iter().enumerate() {
            let felt = rows * &motions;
            for hit in 0..hits.len() {
                for axis in 0..3 {
                    out[hit][3 * sensor + axis].push(felt[(axis, hit)]);
                }
            }
        }
    }
    out
}

/// Writes the other system's files: one for each impact point, with every hit as its force and 9 or
/// 18 accelerations.
fn measure(part: Part, folder: &Path, rng: &mut Xoshiro256PlusPlus) {
    std::fs::create_dir_all(folder).unwrap();
    let on_part = |node: i64| match part {
        Part::Frame => node < 20 || (100..200).contains(&node),
        Part::Blade => (20..100).contains(&node) || node >= 200,
        Part::Both => true,
    };
    let sensors: Vec<_> = sensors().into_iter().filter(|s| on_part(s.0)).collect();
    let hits: Vec<_> = impacts().into_iter().filter(|i| on_part(i.0)).collect();
    let all = accelerances(part, &sensors, &hits);
    let mut planner = RealFftPlanner::<f64>::new();
    let (there, back) = (planner.plan_fft_forward(SCANS), planner.plan_fft_inverse(SCANS));
    let mut normal = || -> f64 { (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0 };
    for ((node, _, direction), of_channels) in hits.iter().zip(all) {
        let mut sets: Vec<DataSet> = Vec::new();
        for hit in 1..=HITS {
            let peak = 50.0 * (1.0 + 0.002 * normal());
            // a cosine arch of 1.2 ms, starting at the trigger
            let arch = |t: f64| {
                if (0.0..1.2e-3).contains(&t) { 0.5 * (1.0 - (TAU * t / 1.2e-3).cos()) } else { 0.0 }
            };
            let pulse: Vec<f64> = (0..SCANS).map(|i| peak * arch((i as f64 - 254.0) / RATE_HZ)).collect();
            let mut spectrum = there.make_output_vec();
            there.process(&mut pulse.clone(), &mut spectrum).unwrap();
            let mut add = |values: Vec<f64>, dof: Dof, quantity: i64| {
                let places: Vec<f64> = (0..SCANS).map(|i| i as f64 / RATE_HZ).collect();
                let mut function = Function::new(kind::TIME, Abscissa::of(&places), Values::Real(values));
                function.version = i64::try_from(hit).unwrap();
                function.response = dof;
                function.axes[0].quantity = 17;
                function.axes[1].quantity = quantity;
                function.encoding = Encoding::Binary(ByteOrder::Little);
                sets.push(function.into());
            };
            let dof = |node: i64, direction: i64| Dof { entity: "NONE".into(), node, direction };
            let noisy = pulse.iter().map(|f| f + 0.01 * normal()).collect();
            // the label states in which direction along its own axis the hammer pushes
            add(noisy, dof(*node, if direction[2] < 0.0 { -3 } else { 3 }), quantity::FORCE);
            for (channel, h) in of_channels.iter().enumerate() {
                let mut product: Vec<Complex<f64>> =
                    h.iter().zip(&spectrum).map(|(h, f)| h * f / SCANS as f64).collect();
                product[0].im = 0.0;
                product[SCANS / 2].im = 0.0;
                let mut values = back.make_output_vec();
                back.process(&mut product, &mut values).unwrap();
                for value in &mut values {
                    *value += 0.002 * normal();
                }
                let direction = i64::try_from(channel % 3).unwrap() + 1;
                add(values, dof(sensors[channel / 3].0, direction), quantity::ACCELERATION);
            }
        }
        write_uff(&folder.join(format!("Measurement {node}.unv")), &sets).unwrap();
    }
}

fn plan() -> String {
    let head = SMALL.split_once("[[configuration]]").unwrap().0;
    let mut text = head
        .replace("rate_hz = 51200", "rate_hz = 12800")
        .replace("name = \"small\"", "name = \"turbine blade\"")
        .replace("wanted = 2", "wanted = 3");
    let names = "a = \"frame\"\nb = \"blade\"\nassembly = \"frame with blade\"";
    writeln!(text, "[structure]\n{names}\nsliding = {ALONG:?}\n").unwrap();
    let names = |nodes: Vec<i64>| nodes.into_iter().map(|node| node.to_string()).collect::<Vec<_>>();
    let frame = |node: &i64| *node < 20 || (100..200).contains(node);
    let (sensor_nodes, impact_nodes): (Vec<i64>, Vec<i64>) =
        (sensors().iter().map(|s| s.0).collect(), impacts().iter().map(|i| i.0).collect());
    for (name, own) in [("frame", 0), ("blade", 1), ("frame with blade", 2)] {
        let of = |nodes: &[i64]| {
            names(nodes.iter().copied().filter(|node| own == 2 || frame(node) == (own == 0)).collect())
        };
        let (hit, heard) = (of(&impact_nodes), of(&sensor_nodes));
        writeln!(text, "[[configuration]]\nname = {name:?}\nimpacts = {hit:?}\nresponses = {heard:?}\n")
            .unwrap();
    }
    text += "[geometry]\nvirtual_point_m = [0.0, 0.0, 0.0]\n";
    for (node, at, mounted) in sensors() {
        let axes: Vec<[f64; 3]> = mounted.row_iter().map(|row| [row[0], row[1], row[2]]).collect();
        let grouping = if frame(&node) { 1 } else { 2 };
        let at: [f64; 3] = at.into();
        writeln!(text, "[[geometry.response]]\nname = \"{node}\"\ngrouping = {grouping}\nposition_m = {at:?}\naxes = {axes:?}").unwrap();
    }
    for (node, at, direction) in impacts() {
        let grouping = if frame(&node) { 1 } else { 2 };
        let at: [f64; 3] = at.into();
        writeln!(text, "[[geometry.impact]]\nname = \"{node}\"\ngrouping = {grouping}\nposition_m = {at:?}\ndirection = {direction:?}").unwrap();
    }
    text
}

#[test]
fn the_joint_of_another_structure_comes_out_of_another_systems_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2026);
    for (part, name) in [(Part::Frame, "frame"), (Part::Blade, "blade"), (Part::Both, "frame with blade")] {
        measure(part, &at("daq").join(name), &mut rng);
    }
    std::fs::write(at("plan.toml"), plan()).unwrap();
    let checked = done(jointrig().args(["plan", "check"]).arg(at("plan.toml")));
    println!("{checked}");
    done(jointrig().args(["campaign", "new"]).arg(at("lab.jrig")).arg("--plan").arg(at("plan.toml")));
    let told = done(jointrig().arg("import").arg(at("daq")).arg("--into").arg(at("lab.jrig")));
    println!("{told}");
    assert!(told.contains("324 hits in 108 cells, 324 of them good"), "{told}");
    let said = done(jointrig().arg("analyse").arg(at("lab.jrig")).arg("--out").arg(at("out")));
    println!("{said}");
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();

    let number = |v: &Value| v.as_f64().unwrap();
    let between = &results["answer"]["between_arms"]["k_n_per_m"];
    let [low, high] = [0, 1].map(|end| number(&between["ci95"][end]));
    assert!(low < SLIDING && SLIDING < high && high < 1.3 * low, "{between}");
    let inverse = results["joint"].as_array().unwrap().iter().find(|row| {
        row["method"] == "inverse" && row["idms"] == 6 && row["band_hz"] == serde_json::json!([300.0, 600.0])
    });
    let k = number(&inverse.unwrap()["stiffness_n_per_m"]["z"]["mean"]);
    assert!((k / SLIDING - 1.0).abs() < 0.05, "{k}");
    assert!(results["hysteresis"].as_array().unwrap().is_empty());
    let settings = &results["source"]["settings"];
    assert_eq!(settings["sliding_direction"], serde_json::json!(ALONG));
    assert_eq!(settings["structure"], "A is frame, B is blade, AJB is frame with blade");
    assert_eq!(said.matches("load cell").count(), 1, "that there is nothing else is said once: {said}");
    assert!(said.starts_with("From imported records: lab.jrig; A is frame"), "{said}");
    let page = std::fs::read_to_string(at("out/report.html")).unwrap();
    assert!(page.contains("frame with blade"));
}

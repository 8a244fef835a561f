//! Virtual points and the paper's seven methods on 3600 lines, 27 × 24 → 12 × 12, compared with a
//! numpy notebook and with only the inverses that they need; and the bootstrap of 1000 replicates
//! of the paper's campaign.

use super::growth::{Growth, TIMES, measured};
use super::noise::numbers;
use super::peers::{self, Peers};
use super::row::{RUNS, Row, quickest};
use faer::linalg::solvers::DenseSolveCore;
use jointrig::exchange::npz::Array;
use jointrig::exchange::{Extra, read_frf, read_positions, write_frf};
use jointrig::substructuring::averaged::{CellHits, Prepared, Priors};
use jointrig::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use jointrig::substructuring::{Band, BandStatistic, Dof, Frf, IdmSet, Method, decouple, identify, vpt};
use nalgebra::{Complex, DMatrix, SMatrix, Vector3};
use peak_alloc::PeakAlloc;
use rayon::prelude::*;
use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};

const LINES: usize = 3600;
/// Target: how many times as fast as numpy it must be. Computing several lines in one vector gave
/// 13; it took 1400 lines of code, and a user waits 30 ms less for it.
const WANTED: f64 = 4.0;
/// Relative tolerance between the stiffnesses of both.
const SAME: f64 = 1e-6;
const BAND: Band = Band { low_hz: 300.0, high_hz: 3000.0 };

const REPLICATES: usize = 1000;
const HITS: usize = 8;
/// 300–600 Hz with lines every 0.5 Hz.
const MAIN_LINES: usize = 601;
/// Seconds that the bootstrap may take on two cores.
const BOOTSTRAP_S: f64 = 60.0;

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/tests/data").join(file)
}

fn both(a: impl Fn(Grouping) -> bool) -> impl Fn(&Point) -> bool {
    move |p| a(p.grouping)
}

/// One more sensor and three more impacts on A: 27 channels and 24 impacts in the assembly. A is
/// rigid there, so their FRFs follow from the others.
fn widened(frf: &Frf, points: &mut Configuration) -> Result<Frf, Box<dyn Error>> {
    let on_a = both(|g| g == Grouping::InterfaceA);
    let own = |points: &[Point]| points.iter().filter(|p| on_a(p)).cloned().collect::<Vec<Point>>();
    let at = |names: &[String], wanted: &[Point]| -> Vec<usize> {
        names
            .iter()
            .enumerate()
            .filter(|(_, n)| wanted.iter().any(|p| p.description == **n))
            .map(|(i, _)| i)
            .collect()
    };
    let (channels, impacts) = (own(&points.channels), own(&points.impacts));
    let u = vpt::responses(&channels, Vector3::zeros(), IdmSet::Six, None)?;
    let f = vpt::impacts(&impacts, Vector3::zeros(), IdmSet::Six, None)?;
    let moved = |p: &Point, name: &str, description: String| Point {
        name: name.into(),
        description,
        position_m: [p.position_m[0] + 0.007, p.position_m[1] - 0.011, p.position_m[2] + 0.013],
        ..p.clone()
    };
    let more_channels: Vec<Point> = channels[..3]
        .iter()
        .zip(["x", "y", "z"])
        .map(|(p, axis)| moved(p, "A5", format!("A5:{axis}")))
        .collect();
    let more_impacts: Vec<Point> = [0, 3, 6]
        .iter()
        .zip(["AZ4", "AY4", "AX4"])
        .map(|(i, name)| moved(&impacts[*i], name, name.into()))
        .collect();
    let r = |points: &[Point]| {
        DMatrix::from_fn(points.len(), 6, |i, d| {
            Complex::from(Dof::RIGID[d].displacement(points[i].position()).dot(&points[i].direction()))
        })
    };
    let (rows, columns) = (at(frf.outputs(), &channels), at(frf.inputs(), &impacts));
    let (to_rows, to_columns) =
        (r(&more_channels) * u.t.map(Complex::from), f.t.map(Complex::from) * r(&more_impacts).transpose());
    let wide = |y: &DMatrix<Complex<f64>>| {
        let (n, m) = y.shape();
        let mut wide = y.clone().resize(n + 3, m + 3, Complex::default());
        let known = DMatrix::from_fn(rows.len(), m, |i, j| y[(rows[i], j)]);
        wide.view_mut((n, 0), (3, m)).copy_from(&(&to_rows * known));
        let known = DMatrix::from_fn(n + 3, columns.len(), |i, j| wide[(i, columns[j])]);
        wide.view_mut((0, m), (n + 3, 3)).copy_from(&(known * &to_columns));
        wide
    };
    let lines = frf.lines().iter().map(wide).collect();
    let (mut outputs, mut inputs) = (frf.outputs().to_vec(), frf.inputs().to_vec());
    outputs.extend(more_channels.iter().map(|p| p.description.clone()));
    inputs.extend(more_impacts.iter().map(|p| p.name.clone()));
    points.channels.extend(more_channels);
    points.impacts.extend(more_impacts);
    let (frequency_hz, sigma_per_s) = (frf.frequency_hz().to_vec(), frf.sigma_per_s());
    Ok(Frf::new(frequency_hz, sigma_per_s, frf.quantity(), outputs, inputs, lines)?)
}

/// The exact FRFs of a rigid clamp, repeated to give `lines` lines from 300 Hz on.
fn tiled(file: &str, lines: usize) -> Result<Frf, Box<dyn Error>> {
    let exact = read_frf(&data("frf_rigid").join(file))?;
    let step = (BAND.high_hz - BAND.low_hz) / lines as f64;
    let frequency_hz = (0..lines).map(|l| BAND.low_hz + step * l as f64).collect();
    on_axis(&exact, frequency_hz)
}

/// The FRFs repeated until there is a line for each of these frequencies.
fn on_axis(exact: &Frf, frequency_hz: Vec<f64>) -> Result<Frf, Box<dyn Error>> {
    let lines = (0..frequency_hz.len()).map(|l| exact.lines()[l % exact.lines().len()].clone()).collect();
    let (outputs, inputs) = (exact.outputs().to_vec(), exact.inputs().to_vec());
    Ok(Frf::new(frequency_hz, exact.sigma_per_s(), exact.quantity(), outputs, inputs, lines)?)
}

/// The input data of the methods: A, B and AJB with `lines` lines each, and their geometry.
fn case(lines: usize) -> Result<([Frf; 3], Geometry), Box<dyn Error>> {
    let mut geometry = read_positions(&data("positions/positions.xlsx"))?.geometry;
    let a = widened(&tiled("A.npz", lines)?, &mut geometry.a)?;
    let ajb = widened(&tiled("AJB.npz", lines)?, &mut geometry.ajb)?;
    Ok(([a, tiled("B.npz", lines)?, ajb], geometry))
}

/// The rows, and messages about what misses its target in addition.
pub fn rows(all: &Peers) -> Result<(Vec<Row>, Vec<String>), Box<dyn Error>> {
    let ([a, b, ajb], geometry) = case(LINES)?;
    let mut found = stiffness(&a, &b, &ajb, &geometry)?;
    let bare = Inverses::new();
    let [ours, whole, by_nalgebra, by_faer] = quickest(
        RUNS,
        [
            &mut || found = stiffness(black_box(&a), &b, &ajb, &geometry).expect("it did before"),
            &mut || {
                let methods = &Method::PAPER;
                black_box(
                    identify(&a, &b, &ajb, &geometry, methods, &[IdmSet::Six], &[BAND]).expect("exact data"),
                );
            },
            &mut || bare.by_nalgebra(),
            &mut || bare.by_faer(),
        ],
    );
    let mut short = Vec::new();
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("job.npz");
    for_numpy(&file, &a, &b, &ajb, &geometry)?;
    let answer = all.run("substructuring.py", &file.display().to_string())?;
    if let Some(answer) = &answer {
        for (method, k) in &found {
            let (k, other) = (k.mean, answer["k_z"][method.name()].as_f64().unwrap_or(f64::NAN));
            if ((k - other) / k).abs().is_nan() || ((k - other) / k).abs() > SAME {
                short.push(format!("{method}: k_z {k:e} here, {other:e} in numpy"));
            }
        }
    }
    let peer = answer.as_ref().and_then(|answer| peers::quickest(&answer["seconds"]));
    let (name, least) = if by_nalgebra <= by_faer { ("nalgebra", by_nalgebra) } else { ("faer", by_faer) };
    let shape = format!("{LINES} lines, {} × {} → 12 × 12", ajb.outputs().len(), ajb.inputs().len());
    let methods = Method::PAPER.len();
    let seconds = bootstrap()?;
    if seconds > BOOTSTRAP_S {
        short.push(format!("the bootstrap takes {seconds:.1} s, and {BOOTSTRAP_S} s are allowed"));
    }
    let rows = vec![
        Row::of(format!("virtual points, {methods} methods and k_z of {shape}"), ours)
            .beside("numpy", peer, WANTED)
            .against(&format!("the inverses alone, both cores ({name})"), least, None),
        Row::of("the same with consistency, passivity and statistics of all 42 entries (`identify`)", whole)
            .against(&format!("the inverses alone, both cores ({name})"), least, None),
        Row::of(
            format!(
                "bootstrap of {REPLICATES} replicates, {HITS} hits in each of 108 cells, {MAIN_LINES} lines"
            ),
            seconds,
        ),
    ];
    Ok((rows, short))
}

/// Growth with the number of lines.
pub fn growth(heap: PeakAlloc) -> Result<Growth, Box<dyn Error>> {
    let cases = TIMES.map(|times| case(times * LINES / 4).expect("it fits, as that of the rows"));
    let jobs = cases.each_ref().map(|([a, b, ajb], geometry)| {
        move || {
            black_box(stiffness(a, b, ajb, geometry).expect("exact data"));
        }
    });
    Ok(Growth {
        what: format!("virtual points and methods of more lines ({} and up)", LINES / 4),
        steps: measured(heap, jobs),
        flat_memory: false,
    })
}

/// The minimum for every line: one inverse of 12 × 12 and nine of 6 × 6 (two of the nine are
/// pseudo-inverses, which cost more).
struct Inverses {
    large: Vec<[f64; 288]>,
    small: Vec<[f64; 72]>,
}

const SMALL: usize = 9;

impl Inverses {
    fn new() -> Self {
        let mut noise = numbers(288 * LINES + 72 * SMALL * LINES, 7).into_iter();
        let mut next = || noise.next().unwrap_or_default();
        Inverses {
            large: (0..LINES).map(|_| std::array::from_fn(|_| next())).collect(),
            small: (0..SMALL * LINES).map(|_| std::array::from_fn(|_| next())).collect(),
        }
    }

    fn by_nalgebra(&self) {
        self.large.par_iter().for_each(|parts| {
            let m = SMatrix::<Complex<f64>, 12, 12>::from_fn(|i, j| complex(parts, 12 * i + j));
            black_box(m.try_inverse());
        });
        self.small.par_iter().for_each(|parts| {
            let m = SMatrix::<Complex<f64>, 6, 6>::from_fn(|i, j| complex(parts, 6 * i + j));
            black_box(m.try_inverse());
        });
    }

    fn by_faer(&self) {
        self.large.par_iter().for_each(|parts| by_faer(12, parts));
        self.small.par_iter().for_each(|parts| by_faer(6, parts));
    }
}

fn by_faer(size: usize, parts: &[f64]) {
    let m = faer::Mat::from_fn(size, size, |i, j| complex(parts, size * i + j));
    black_box(m.partial_piv_lu().inverse());
}

fn complex(parts: &[f64], place: usize) -> Complex<f64> {
    Complex::new(parts[2 * place], parts[2 * place + 1])
}

/// The same work as the notebook: Z^J by all methods, and mean, scatter and median of k_z.
fn stiffness(
    a: &Frf,
    b: &Frf,
    ajb: &Frf,
    geometry: &Geometry,
) -> Result<Vec<(Method, BandStatistic)>, Box<dyn Error>> {
    let z = 2;
    decouple(a, b, ajb, geometry, &Method::PAPER, IdmSet::Six)?
        .into_iter()
        .map(|(method, lines)| {
            let k: Vec<f64> =
                lines.map_err(|refused| refused.reason)?.iter().map(|line| line[(z, z)].re).collect();
            Ok((method, BandStatistic::of(&k).ok_or("no lines")?))
        })
        .collect()
}

fn for_numpy(file: &Path, a: &Frf, b: &Frf, ajb: &Frf, geometry: &Geometry) -> Result<(), Box<dyn Error>> {
    let complex = |name: &str, y: &Frf| {
        let values =
            y.lines().iter().flat_map(|y| y.transpose().iter().copied().collect::<Vec<_>>()).collect();
        Extra::Complex(
            name.into(),
            Array { shape: vec![y.lines().len(), y.outputs().len(), y.inputs().len()], values },
        )
    };
    let vectors = |name: String, points: &[&Point], of: fn(&Point) -> [f64; 3]| {
        let values = points.iter().flat_map(|p| of(p)).collect();
        Extra::Real(name, Array { shape: vec![points.len(), 3], values })
    };
    let mut extras = Vec::new();
    // the notebook expects the interface first
    let interface_first = |y: &Frf, points: &Configuration, own: Grouping| -> Result<Frf, Box<dyn Error>> {
        let ordered = |points: &[Point], names: Vec<String>| -> Vec<String> {
            let of = |want: bool| {
                points
                    .iter()
                    .zip(&names)
                    .filter(move |(p, _)| (p.grouping == own) == want)
                    .map(|(_, n)| n.clone())
            };
            of(true).chain(of(false)).collect()
        };
        Ok(y.select(
            &ordered(&points.channels, points.output_names()),
            &ordered(&points.impacts, points.input_names()),
        )?)
    };
    let a = interface_first(a, &geometry.a, Grouping::InterfaceA)?;
    // A's spare response is not used as an internal point
    let spare = |name: &String| {
        geometry.a.channels.iter().any(|c| c.description == *name && c.grouping == Grouping::InternalA)
    };
    let used: Vec<String> = a.outputs().iter().filter(|o| !spare(o)).cloned().collect();
    let a = a.select(&used, a.inputs())?;
    let b = interface_first(b, &geometry.b, Grouping::InterfaceB)?;
    extras.extend([complex("a", &a), complex("b", &b), complex("ajb", ajb)]);
    for (side, own, inner) in
        [("a", Grouping::InterfaceA, Grouping::InternalA), ("b", Grouping::InterfaceB, Grouping::InternalB)]
    {
        let channels: Vec<&Point> = geometry.ajb.channels.iter().filter(|p| p.grouping == own).collect();
        let impacts: Vec<&Point> = geometry.ajb.impacts.iter().filter(|p| p.grouping == own).collect();
        for (kind, points) in [("channel", &channels), ("impact", &impacts)] {
            extras.push(vectors(format!("{kind}_{side}_position"), points, |p| p.position_m));
            extras.push(vectors(format!("{kind}_{side}_direction"), points, |p| p.direction));
        }
        let places = |name: String, points: &[&Point], names: &[String]| {
            let place = |p: &&Point| names.iter().position(|n| *n == p.description).map(|i| i as f64);
            let values: Vec<f64> = points.iter().filter_map(place).collect();
            Extra::Real(name, Array { shape: vec![values.len()], values })
        };
        let with_inner = |points: &[Point]| -> Vec<Point> {
            let of = |g: Grouping| points.iter().filter(move |p| p.grouping == g).cloned();
            of(own).chain(of(inner)).collect()
        };
        let (all_out, all_in) = (with_inner(&geometry.ajb.channels), with_inner(&geometry.ajb.impacts));
        extras.push(places(format!("out_{side}"), &channels, ajb.outputs()));
        extras.push(places(format!("in_{side}"), &impacts, ajb.inputs()));
        extras.push(places(format!("all_out_{side}"), &all_out.iter().collect::<Vec<_>>(), ajb.outputs()));
        extras.push(places(format!("all_in_{side}"), &all_in.iter().collect::<Vec<_>>(), ajb.inputs()));
    }
    write_frf(file, ajb, &extras)?;
    Ok(())
}

/// Seconds of the fastest run for all replicates; the hits' spectra are already in memory, as in
/// the analysis.
fn bootstrap() -> Result<f64, Box<dyn Error>> {
    let geometry = read_positions(&data("positions/positions.xlsx"))?.geometry;
    let exact = read_frf(&data("frf_rigid").join("AJB.npz"))?;
    let ajb = on_axis(&exact, (0..MAIN_LINES).map(|l| 300.0 + 0.5 * l as f64).collect())?;
    let band = Band { low_hz: 300.0, high_hz: 600.0 };
    let prepared = Prepared::of(&ajb, &geometry, IdmSet::Six, band, &Priors::default())?;
    let interface = both(|g| matches!(g, Grouping::InterfaceA | Grouping::InterfaceB));
    let mut cells: Vec<CellHits> = Vec::new();
    for impact in geometry.ajb.impacts.iter().filter(|p| interface(p)) {
        let column = ajb.inputs().iter().position(|i| *i == impact.name).ok_or("an impact")?;
        for channels in geometry.ajb.channels.chunks(3).filter(|c| interface(&c[0])) {
            let rows: Vec<usize> = channels
                .iter()
                .filter_map(|c| ajb.outputs().iter().position(|o| *o == c.description))
                .collect();
            let hit = |h: usize| Complex::from(1.0 + 1e-3 * h as f64);
            cells.push(CellHits {
                input: impact.name.clone(),
                outputs: channels.iter().map(|c| c.description.clone()).collect(),
                auto: vec![vec![1.0; HITS]; MAIN_LINES],
                cross: ajb
                    .lines()
                    .iter()
                    .map(|y| {
                        rows.iter().map(|&r| (0..HITS).map(|h| y[(r, column)] * hit(h)).collect()).collect()
                    })
                    .collect(),
            });
        }
    }
    prepared.bootstrap(&cells, REPLICATES, 1)?;
    let mut again = || {
        black_box(prepared.bootstrap(&cells, REPLICATES, 1).expect("it did before"));
    };
    // one run takes seconds, so fifteen seconds contain enough runs
    let [seconds] = quickest(1, [&mut again]);
    Ok(seconds)
}

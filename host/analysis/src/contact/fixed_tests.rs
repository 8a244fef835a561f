//! Accelerometers that stay at their points, without spots: all sensors measure the same hits.

use super::tests::{BESIDE, DAMPING, K, LEVER_M, MASS, NAMES, motion, moved};
use super::*;
use crate::C;
use crate::frf::MotionQuantity;
use crate::spectra::cross_spectra::{CrossSpectra, OutputSums};
use crate::structure::Structure;
use crate::substructuring::geometry::Grouping;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// On each side two triaxial sensors and one along z off the line through them; B's positions are
/// these with y reversed.
const SENSORS: [([f64; 3], &[[f64; 3]]); 3] = [
    ([-0.009, 0.003, 0.006], &[X, Y, Z]),
    ([0.009, 0.012, 0.006], &[X, Y, Z]),
    ([0.008, 0.002, 0.006], &[Z]),
];
/// Sensitivity of every axis to motion across it, in one direction.
const TRANSVERSE: f64 = 0.02;

struct Cell {
    structure: Structure,
    impact: usize,
    sensor: usize,
    on_a: bool,
    /// The hits that all sensors share.
    records: [i64; 4],
    spectra: CrossSpectra,
}

/// Four hits at each place, with this noise of accelerations (m/s² s) and of T (N s); T and its
/// noise are the same in all cells of a place.
fn measured(noise: f64, t_noise: f64, seed: u64) -> Vec<Cell> {
    const HITS: usize = 4;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut scatter = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut draw = move |sigma: f64| {
        let mut part = || -> f64 { StandardNormal.sample(&mut scatter) };
        C::new(part(), part()) * sigma
    };
    let frequency_hz: Vec<f64> = (200..=1200).map(|l| 0.5 * f64::from(l)).collect();
    let mut cells = Vec::new();
    for structure in [Structure::B, Structure::Ajb] {
        for impact in 0..if structure == Structure::B { 6 } else { 3 } {
            let along_z = if impact < 3 { -1.0 } else { 0.0 };
            let drawn: Vec<f64> = (0..24).map(|_| random.random::<f64>()).collect();
            let force = if structure == Structure::B { C::from(along_z) } else { C::from(1.3) };
            let lines: Vec<(C, [C; 6], [C; 6], C)> = frequency_hz
                .iter()
                .map(|f| {
                    let s = C::new(SIGMA_PER_S, TAU * f);
                    let (b, mut a) = motion(&drawn, s);
                    a[2] = b[2] + force / (K + DAMPING * s);
                    let form = b[2] * (BESIDE + MASS * s * s) + b[3] * MASS * LEVER_M * s * s;
                    (s, b, a, force - form)
                })
                .collect();
            let hits: Vec<[C; HITS]> =
                lines.iter().map(|(.., t)| std::array::from_fn(|_| t + draw(t_noise))).collect();
            let sums = |hits: &[[C; HITS]]| OutputSums {
                s_xf: hits.iter().map(|own| own.iter().sum()).collect(),
                s_xx: hits.iter().map(|own| own.iter().map(C::norm_sqr).sum()).collect(),
                ..OutputSums::default()
            };
            for on_a in [false, true].into_iter().take(if structure == Structure::B { 1 } else { 2 }) {
                for (sensor, (_, axes)) in SENSORS.iter().enumerate() {
                    let at = position(sensor, on_a);
                    let mut outputs: Vec<OutputSums> = axes
                        .iter()
                        .map(|axis| {
                            let read = |(s, b, a, _): &(C, [C; 6], [C; 6], C)| -> [C; HITS] {
                                let [x, y, z, tx, ty, tz] = if on_a { *a } else { *b };
                                let seen = moved([x, y, z], [tx, ty, tz], at);
                                // across: the next axis
                                let own: C = (0..3)
                                    .map(|i| seen[i] * (axis[i] + TRANSVERSE * axis[(i + 2) % 3]))
                                    .sum();
                                std::array::from_fn(|_| own * s * s + draw(noise))
                            };
                            sums(&lines.iter().map(read).collect::<Vec<_>>())
                        })
                        .collect();
                    outputs.push(sums(&hits));
                    let s_ff = vec![HITS as f64; frequency_hz.len()];
                    let spectra =
                        CrossSpectra::new(1.0, frequency_hz.clone(), SIGMA_PER_S, HITS, s_ff, outputs)
                            .expect("alike");
                    let first = 100 * impact + if structure == Structure::B { 0 } else { 1000 };
                    let records = [0, 1, 2, 3].map(|hit| i64::try_from(first + hit).expect("small"));
                    cells.push(Cell { structure, impact, sensor, on_a, records, spectra });
                }
            }
        }
    }
    cells
}

fn position(sensor: usize, on_a: bool) -> [f64; 3] {
    let [x, y, z] = SENSORS[sensor].0;
    [x, if on_a { y } else { -y }, z]
}

fn input<'a>(cells: &'a [Cell], keep: impl Fn(&Cell) -> bool) -> Input<'a> {
    let mut priors = ContactPriors { gain: 0.0, hammer_gain: 0.0, skew_s: 0.0, ..ContactPriors::default() };
    priors.positions.position_m = 1e-6;
    priors.specimen_point_m = 1e-6;
    priors.positions.aim_m = 0.0;
    priors.positions.hammer_angle_rad = 0.0;
    let one = |cell: &'a Cell| ContactCell {
        structure: cell.structure,
        impact: NAMES[cell.impact],
        impact_m: [0.0; 3],
        direction: if cell.impact < 3 { [0.0, 0.0, -1.0] } else { [0.0, -1.0, 0.0] },
        impact_grouping: if cell.structure == Structure::B {
            Grouping::InterfaceB
        } else {
            Grouping::InterfaceA
        },
        point: NAMES[cell.sensor + if cell.on_a { 3 } else { 0 }],
        point_m: position(cell.sensor, cell.on_a),
        point_sigma_m: None,
        point_grouping: if cell.on_a { Grouping::SpecimenA } else { Grouping::InterfaceB },
        axes: Axes::new(SENSORS[cell.sensor].1).expect("one to three"),
        fixed: true,
        lasers: false,
        records: &cell.records,
        spectra: &cell.spectra,
        quantity: MotionQuantity::Acceleration,
    };
    let cells = cells.iter().filter(|cell| keep(cell)).map(one).collect();
    Input {
        cells,
        contact_m: [0.0; 3],
        spots_m: None,
        specimens: [Some(Bulk::RIGID); 2],
        parallel_path: None,
        priors,
        known_mass: None,
        band_hz: BAND,
    }
}

#[test]
fn accelerometers_with_tilted_axes_find_the_contact() {
    let cells = measured(1e-4, 1e-4, 1);
    let found = stiffness(&input(&cells, |_| true)).expect("all is there");
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high && high - low < 0.1 * K, "{found:?}");
    assert!(found.doubts.is_empty(), "{:?}", found.diagnosis);
    assert!(!found.budget.contains_key(&Cause::Spots), "{:?}", found.budget);
    // axes that are taken as exact contradict the signals
    let mut exact = input(&cells, |_| true);
    exact.priors.transverse = 0.0;
    let other = stiffness(&exact).expect("a fit, if a bad one");
    let [tilted, exact] = [&found, &other].map(|own| own.diagnosis.specimen_a.chi_square);
    assert!(exact > 10.0 * tilted, "{exact} and {tilted}");
}

#[test]
fn the_force_counts_once_where_sensors_share_hits() {
    // most of the noise is T's, which would count six times if every cell had its own
    let deviations: Vec<f64> = (0..16)
        .map(|seed| {
            let cells = measured(1e-5, 0.03, seed);
            let found = stiffness(&input(&cells, |_| true)).expect("all is there");
            let [low, high] = found.k_t_n_per_m.ci95;
            let sigma = (low.recip() - high.recip()) / (2.0 * 1.96);
            (found.k_t_n_per_m.mean.recip() - K.recip()) / sigma
        })
        .collect();
    let rms = (deviations.iter().map(|z| z * z).sum::<f64>() / deviations.len() as f64).sqrt();
    // the rms of 16 draws scatters by 0.18; three standard deviations either way
    assert!((0.46..1.54).contains(&rms), "{rms}: {deviations:?}");
}

#[test]
fn two_triaxial_sensors_leave_a_rotation_open() {
    let sensors = |count: usize| -> Vec<([f64; 3], [f64; 3])> {
        let own = SENSORS.iter().take(count);
        own.flat_map(|(at, axes)| axes.iter().map(|axis| (*at, *axis))).collect()
    };
    assert!(!determines_motion(&sensors(2)) && determines_motion(&sensors(3)));
    assert!(!determines_motion(&[]));
    let cells = measured(1e-4, 1e-4, 1);
    let without = |on_a| stiffness(&input(&cells, |cell| !(cell.on_a == on_a && cell.sensor == 2)));
    assert_eq!(without(true), Err(ContactError::NoRotation));
    assert_eq!(without(false), Err(ContactError::NoForce));
}

#[test]
fn spots_that_the_plan_does_not_state_are_asked_for() {
    let mut cells = measured(1e-4, 1e-4, 1);
    for cell in &mut cells {
        let axes = SENSORS[cell.sensor].1.len();
        let lines = cell.spectra.lines();
        // v_A and v_B before T
        let order = (0..axes).chain([axes, axes, axes]);
        let outputs = order
            .map(|n| {
                let h1: Vec<C> = (0..lines).map(|l| cell.spectra.h1(l, n)).collect();
                OutputSums {
                    s_xx: h1.iter().map(|h| 2.0 * h.norm_sqr()).collect(),
                    s_xf: h1.iter().map(|h| 2.0 * h).collect(),
                    ..OutputSums::default()
                }
            })
            .collect();
        let frequency_hz = cell.spectra.frequency_hz().to_vec();
        cell.spectra =
            CrossSpectra::new(1.0, frequency_hz, SIGMA_PER_S, 2, vec![2.0; lines], outputs).expect("alike");
    }
    assert_eq!(stiffness(&input(&cells, |_| true)), Err(ContactError::NoSpots));
}

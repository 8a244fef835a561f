//! Signals computed from prescribed motions, without solving a model: the estimate must recover the
//! contact that was put in.

use super::parameters::GAINS;
use super::*;
use crate::C;
use crate::frf::MotionQuantity;
use crate::hysteresis::contact_drift::ContactDrift;
use crate::spectra::cross_spectra::{CrossSpectra, OutputSums};
use crate::structure::Structure;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

pub(super) const K: f64 = 140e6;
pub(super) const DAMPING: f64 = 2000.0;
/// Terms of the force's form: stiffness parallel to the load cells, mass and the lever arm of its
/// centre. No prior contains them.
pub(super) const BESIDE: f64 = 6e6;
pub(super) const MASS: f64 = 2.3;
pub(super) const LEVER_M: f64 = -0.038;
pub(super) const ARM: [[f64; 3]; 3] = [[-0.02, -0.02, 0.03], [0.02, -0.02, 0.03], [0.0, -0.045, 0.03]];
pub(super) const SPECIMEN: [[f64; 3]; 6] = [
    [0.009, 0.002, 0.0],
    [-0.009, 0.002, 0.0],
    [0.009, 0.014, 0.0],
    [-0.009, 0.014, 0.0],
    [0.0, 0.008, 0.007],
    [0.0, 0.008, -0.007],
];
pub(super) const SPOTS: [[f64; 3]; 2] = [[0.0006, 0.0005, 0.0], [0.0006, -0.0005, 0.0]];

/// The contact's stiffnesses along x and y, N/m.
const LATERAL: [f64; 2] = [1.2e8, 3e8];
/// 1/(EA) over 1/(κGA) with Poisson's ratio 0.3.
const AXIAL: f64 = 5.0 / 6.0 / 2.6;

/// The errors that a test introduces.
#[derive(Clone, Copy)]
pub(super) struct World {
    pub(super) noise_m_per_s: f64,
    /// Error of the spot on A, m.
    pub(super) spot_m: f64,
    /// Distance of a point on specimen A from its stated position, m.
    pub(super) misplaced_m: f64,
    /// Frequency of a bending mode that the first point on specimen A takes part in, Hz.
    pub(super) bends_hz: Option<f64>,
    /// Shear and bending compliance of specimen A (1/N, 1/(N m²)), clamped at 12 mm.
    pub(super) bulk: [f64; 2],
    /// Compliance of specimen B against arm B (m/N), and the part of it that is rotation, 1/m.
    pub(super) tip: [f64; 2],
    /// Distance of the contact's centre from its stated place along x, m.
    pub(super) centre_m: f64,
    /// Factor of specimen A's rotations: many times the usual ones if the faces rock on each other.
    pub(super) rocks: f64,
    /// Relative errors of gain of the vibrometers of spots A and B.
    pub(super) gains: [f64; 2],
    /// Whether both are aimed near the third point of arm B while B alone is measured.
    pub(super) together: bool,
    /// Relative error of the hammer's gain.
    pub(super) hammer: f64,
    /// Seed of the noise.
    pub(super) seed: u64,
}

/// Where the two are aimed, relative to the point, m.
const AIMED: [[f64; 3]; 2] = [[2e-4, -1e-4, 0.0], [-1e-4, 2e-4, 0.0]];

pub(super) struct Cell {
    structure: Structure,
    impact: usize,
    point: usize,
    on_specimen: bool,
    lasers: bool,
    spectra: CrossSpectra,
}

/// Six motions of B and six of A at s, from 24 numbers between 0 and 1: their compliances and
/// resonance frequencies.
pub(super) fn motion(draw: &[f64], s: C) -> ([C; 6], [C; 6]) {
    let mode = |n: usize, scale: f64| {
        let w = TAU * (150.0 + 900.0 * draw[n]);
        scale * (0.3 + draw[12 + n]) / (1.0 + s * s / (w * w) + s * 3e-5)
    };
    let b = std::array::from_fn(|n| mode(n, if n < 3 { 6e-9 } else { 1e-7 }));
    let a = std::array::from_fn(|n| mode(6 + n, if n < 3 { 9e-9 } else { 4e-7 }));
    (b, a)
}

pub(super) fn moved(t: [C; 3], turn: [C; 3], r: [f64; 3]) -> [C; 3] {
    [
        t[0] + turn[1] * r[2] - turn[2] * r[1],
        t[1] + turn[2] * r[0] - turn[0] * r[2],
        t[2] + turn[0] * r[1] - turn[1] * r[0],
    ]
}

/// Two hits of every cell.
pub(super) fn measured(world: World) -> Vec<Cell> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut scatter = Xoshiro256PlusPlus::seed_from_u64(world.seed);
    let frequency_hz: Vec<f64> = (200..=1200).map(|l| 0.5 * f64::from(l)).collect();
    let line = |f: f64| C::new(SIGMA_PER_S, TAU * f);
    let mut cells = Vec::new();
    for structure in [Structure::B, Structure::Ajb] {
        for impact in 0..if structure == Structure::B { 6 } else { 3 } {
            let along_z = if impact < 3 { -1.0 } else { 0.0 };
            // compliances and resonance frequencies of six motions of B and six of A
            let draw: Vec<f64> = (0..24).map(|_| random.random::<f64>()).collect();
            let (points, specimens): (usize, usize) = (3, if structure == Structure::Ajb { 6 } else { 0 });
            for point in 0..points + specimens {
                let on_specimen = point >= points;
                let lasers = world.together && structure == Structure::B && point == 2;
                let mut outputs = vec![OutputSums::default(); 6];
                let mut s_ff = Vec::new();
                for &f in &frequency_hz {
                    let s = line(f);
                    let (b, mut a) = motion(&draw, s);
                    a[3..].iter_mut().for_each(|turn| *turn *= world.rocks);
                    let form = b[2] * (BESIDE + MASS * s * s) + b[3] * MASS * LEVER_M * s * s;
                    let force = if structure == Structure::B { C::from(along_z) } else { C::from(1.3) };
                    let t = force - form;
                    // surface of specimen B at the contact, then its material at the spot
                    let [tip, turning] = world.tip;
                    let tip_b = tip * (1.0 + turning * SPOTS[1][1]);
                    let lever = world.centre_m * (a[4] - b[4]);
                    let z_a = b[2] + force * tip + force / (K + DAMPING * s) + lever;
                    let (of_b, turn_b) = ([b[0], b[1], b[2]], [b[3], b[4], b[5]]);
                    let (of_a, turn_a) = ([a[0], a[1], z_a], [a[3], a[4], a[5]]);
                    let mut at = if on_specimen { SPECIMEN[point - points] } else { ARM[point] };
                    if on_specimen && point == points {
                        at[1] += world.misplaced_m;
                    }
                    let mut seen =
                        if on_specimen { moved(of_a, turn_a, at) } else { moved(of_b, turn_b, at) };
                    // bending and shear by the beam's formulas, for a force along z or x, and
                    // lengthening by one along y
                    let bulk = |force: C, y: f64| {
                        let (h, [a, b]) = (y.min(0.012), world.bulk);
                        let along = a * h - b * (h.powi(3) / 6.0 + 0.5 * h * h * (y - h));
                        (force * along, -force * b * 0.5 * h * h)
                    };
                    let assembled = structure == Structure::Ajb;
                    if on_specimen {
                        let [of_x, of_y] = [0, 1].map(|axis| LATERAL[axis] * (of_a[axis] - of_b[axis]));
                        let (z, turn_x) = bulk(force, at[1]);
                        let (x, turn_z) = bulk(of_x, at[1]);
                        seen[0] += x;
                        seen[1] +=
                            of_y * AXIAL * world.bulk[0] * at[1].min(0.012) - turn_x * at[2] - turn_z * at[0];
                        seen[2] += z;
                    }
                    if let Some(bends) = world.bends_hz.filter(|_| on_specimen && point == points) {
                        let w = TAU * bends;
                        // a few per cent of the body's motion well below the mode, and about as
                        // much as the body's motion near it
                        seen[2] -= 0.03 * seen[2] * s * s / (w * w + s * s + 0.02 * w * s);
                    }
                    let mut spot_a = SPOTS[0];
                    spot_a[1] += world.spot_m;
                    let v = |x: C| x * s;
                    let aimed = |of: usize| {
                        let at = std::array::from_fn(|axis| ARM[2][axis] + AIMED[of][axis]);
                        moved(of_b, turn_b, at)[2]
                    };
                    let of_spots = if lasers {
                        [aimed(0), aimed(1)]
                    } else {
                        let beyond = if assembled { force * tip_b } else { C::default() };
                        [
                            moved(of_a, turn_a, spot_a)[2] + bulk(force, spot_a[1]).0,
                            moved(of_b, turn_b, SPOTS[1])[2] + beyond,
                        ]
                    };
                    let exact = [
                        v(seen[0]),
                        v(seen[1]),
                        v(seen[2]),
                        v(of_spots[0]) * (1.0 + world.gains[0]),
                        v(of_spots[1]) * (1.0 + world.gains[1]),
                        t,
                    ]
                    .map(|per_newton| per_newton / (1.0 + world.hammer));
                    s_ff.push(2.0);
                    for (n, (x, sums)) in exact.iter().zip(&mut outputs).enumerate() {
                        let sigma = if n == 5 { 1e-3 } else { world.noise_m_per_s };
                        let mut hit = || {
                            let part = |r: &mut Xoshiro256PlusPlus| -> f64 { StandardNormal.sample(r) };
                            x + C::new(part(&mut scatter), part(&mut scatter)) * sigma
                        };
                        let (one, two) = (hit(), hit());
                        sums.s_xf.push(one + two);
                        sums.s_xx.push(one.norm_sqr() + two.norm_sqr());
                    }
                }
                let spectra = CrossSpectra::new(1.0, frequency_hz.clone(), SIGMA_PER_S, 2, s_ff, outputs)
                    .expect("alike");
                cells.push(Cell { structure, impact, point, on_specimen, lasers, spectra });
            }
        }
    }
    cells
}

/// The same cell with a single hit.
fn single(spectra: &CrossSpectra) -> CrossSpectra {
    let lines = spectra.lines();
    let outputs = (0..spectra.outputs())
        .map(|n| {
            let h1: Vec<C> = (0..lines).map(|l| spectra.h1(l, n)).collect();
            OutputSums { s_xx: h1.iter().map(C::norm_sqr).collect(), s_xf: h1, ..OutputSums::default() }
        })
        .collect();
    let frequency_hz = spectra.frequency_hz().to_vec();
    CrossSpectra::new(1.0, frequency_hz, SIGMA_PER_S, 1, vec![1.0; lines], outputs).expect("alike")
}

pub(super) const NAMES: [&str; 9] = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

fn of(cell: &Cell) -> ContactCell<'_> {
    let across = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0]];
    ContactCell {
        structure: cell.structure,
        impact: NAMES[cell.impact],
        impact_m: [0.0; 3],
        direction: across[usize::from(cell.impact >= 3)],
        impact_grouping: if cell.structure == Structure::B {
            Grouping::InterfaceB
        } else {
            Grouping::InterfaceA
        },
        point: NAMES[cell.point],
        point_m: if cell.on_specimen { SPECIMEN[cell.point - 3] } else { ARM[cell.point] },
        point_sigma_m: None,
        point_grouping: if cell.on_specimen { Grouping::SpecimenA } else { Grouping::InterfaceB },
        spectra: &cell.spectra,
        axes: Axes::XYZ,
        fixed: false,
        lasers: cell.lasers,
        records: &[],
        quantity: MotionQuantity::Velocity,
    }
}

pub(super) fn input(cells: &[Cell]) -> Input<'_> {
    // aims and gains are exact here: the test is of spots, points and noise
    let mut priors = ContactPriors { gain: 0.0, hammer_gain: 0.0, skew_s: 0.0, ..ContactPriors::default() };
    priors.positions.aim_m = 0.0;
    priors.positions.position_m = 1e-5;
    priors.specimen_point_m = 1e-5;
    priors.positions.hammer_angle_rad = 0.0;
    Input {
        cells: cells.iter().map(of).collect(),
        contact_m: [0.0; 3],
        spots_m: Some(SPOTS),
        specimens: [Some(Bulk::RIGID); 2],
        parallel_path: None,
        priors,
        known_mass: None,
        band_hz: BAND,
    }
}

pub(super) const QUIET: World = World {
    noise_m_per_s: 2e-9,
    spot_m: 0.0,
    misplaced_m: 0.0,
    bends_hz: None,
    seed: 1,
    bulk: [0.0; 2],
    tip: [0.0; 2],
    centre_m: 0.0,
    rocks: 1.0,
    gains: [0.0; 2],
    together: false,
    hammer: 0.0,
};

#[test]
fn lasers_together_on_arm_b_compare_their_gains() {
    // A's laser reads 0.8 % too much, B's 0.6 % too little: stated to 0.5 %
    let gains = [8e-3, -6e-3];
    let cells = measured(World { noise_m_per_s: 1e-7, gains, together: true, ..QUIET });
    let mut input = input(&cells);
    input.priors.gain = 5e-3;
    input.priors.positions.aim_m = 2e-4;
    // badly placed points and spots hardly show the gains in the assembly
    (input.priors.specimen_point_m, input.priors.spot_m) = (1e-3, 1e-3);
    let (found, known) = read(&input).expect("all is there");
    assert!(found.contradictions.is_empty() && found.chi_square < 1.2, "{found:?}");
    for (of, stated) in gains.into_iter().enumerate() {
        // relative to the z axis of the 3-D vibrometer
        let row = DVector::from_fn(known.p.len(), |i, _| match i {
            i if i == GAINS + of => 1.0,
            i if i == GAINS + 4 => -1.0,
            _ => 0.0,
        });
        let difference: f64 = row.iter().zip(&known.p).map(|(factor, p)| factor * p).sum();
        let sigma = known.variance(&row).sqrt();
        assert!((difference - stated).abs() < 3.0 * sigma, "{stated}: {difference} ± {sigma}");
        assert!(sigma < 5e-4, "{sigma}");
    }
    // taken for those of the spots, the same signals contradict the other cells
    input.cells.iter_mut().for_each(|cell| cell.lasers = false);
    let taken_for_spots = stiffness(&input).expect("all is there");
    assert!(taken_for_spots.diagnosis.calibration.chi_square > 100.0, "{taken_for_spots:?}");
    assert_eq!(taken_for_spots.doubts, [Doubt::Force]);
}

#[test]
fn a_known_mass_shows_a_hammer_that_is_off() {
    let cells = measured(World { noise_m_per_s: 1e-7, hammer: 0.05, ..QUIET });
    let mut of_hammer = input(&cells);
    (of_hammer.priors.gain, of_hammer.priors.hammer_gain) = (5e-3, 5e-3);
    // every motion per newton of a hammer that shows 5 % too much force is 5 % too small
    let without = stiffness(&of_hammer).expect("all is there").k_t_n_per_m;
    assert!(without.ci95[0] > K, "{without:?}");
    let shows = |ratio: f64| {
        let ratio = Some([ratio, 5e-4]);
        Some(KnownMass { sigma: 2e-3, spots: [ratio; 2], point: ratio, axis: 2 })
    };
    of_hammer.known_mass = shows(1.0 / 1.05);
    let found = stiffness(&of_hammer).expect("all is there");
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high && (high - low) < 0.03 * K, "{found:?}");
    assert_eq!(found.contradictions.len(), 1, "{found:?}");
    assert_eq!(found.contradictions[0].what, HAMMER_GAIN);
    let [off, sigma] = found.contradictions[0].off[0];
    assert!((off - 0.05).abs() < 3.0 * sigma && sigma < 6e-3, "{off} {sigma}");
    // stated as exact, hammer and vibrometers leave only the mass to be off: k_T is then in
    // proportion to either, and its interval contains both values
    let mut exact = input(&cells);
    exact.known_mass = of_hammer.known_mass;
    let either = stiffness(&exact).expect("all is there");
    let [low, high] = either.k_t_n_per_m.ci95;
    assert!(low < K && K < high && low < without.mean && without.mean < high, "{either:?}");
    assert!(either.contradictions.iter().any(|one| one.what == MASS_ERROR), "{either:?}");
    // what is right is confirmed, and the interval is narrower than without the mass
    let cells = measured(World { noise_m_per_s: 1e-7, ..QUIET });
    let mut right = input(&cells);
    right.priors = of_hammer.priors;
    let without = stiffness(&right).expect("all is there").k_t_n_per_m;
    right.known_mass = shows(1.0);
    let confirmed = stiffness(&right).expect("all is there");
    assert!(confirmed.contradictions.is_empty(), "{confirmed:?}");
    let width = |of: Interval| of.ci95[1] - of.ci95[0];
    assert!(width(confirmed.k_t_n_per_m) < width(without), "{confirmed:?}");
}

#[test]
fn without_noise_the_contact_is_found_to_a_thousandth() {
    let cells = measured(QUIET);
    let found = stiffness(&input(&cells)).expect("all is there");
    assert!((found.k_t_n_per_m.mean / K - 1.0).abs() < 1e-3, "{found:?}");
    assert!((found.c_t_n_s_per_m.mean / DAMPING - 1.0).abs() < 0.02, "{found:?}");
    assert!(found.doubts.is_empty(), "{:?}", found.diagnosis);
    let budget: f64 = found.budget.values().map(|share| share * share).sum();
    let [low, high] = found.k_t_n_per_m.ci95;
    let sigma = (low.recip() - high.recip()) / (2.0 * 1.96) * found.k_t_n_per_m.mean;
    // 1.96 instead of the exact quantile
    assert!((sigma / budget.sqrt() - 1.0).abs() < 1e-3, "the budget adds up: {sigma} {budget}");
}

#[test]
fn a_centre_far_from_its_stated_place_is_found_where_the_faces_rock() {
    for centre_m in [-1.7e-3, 1.6e-3] {
        let cells = measured(World { centre_m, rocks: 500.0, ..QUIET });
        let mut input = input(&cells);
        input.priors.contact_across_m = 1e-3;
        let found = stiffness(&input).expect("all is there").k_t_n_per_m;
        assert!((found.mean / K - 1.0).abs() < 0.01, "{centre_m}: {found:?}");
    }
}

#[test]
fn a_spot_that_is_not_where_it_is_said_to_be_is_inside_the_interval() {
    let cells = measured(World { noise_m_per_s: 5e-7, spot_m: 4e-5, ..QUIET });
    let found = stiffness(&input(&cells)).expect("all is there");
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high && high - low < 0.2 * K, "{found:?}");
}

#[test]
fn the_interval_is_what_repeated_measurements_scatter_by() {
    // noise of about a fifth of the motion at each line, so that the motion itself is uncertain
    let deviations: Vec<f64> = (0..24)
        .map(|seed| {
            let cells = measured(World { noise_m_per_s: 2e-6, seed, ..QUIET });
            let mut input = input(&cells);
            input.priors = ContactPriors { spot_m: 1e-7, contact_height_m: 1e-7, ..input.priors };
            let found = stiffness(&input).expect("all is there");
            let [low, high] = found.k_t_n_per_m.ci95;
            let sigma = (low.recip() - high.recip()) / (2.0 * 1.96);
            (found.k_t_n_per_m.mean.recip() - K.recip()) / sigma
        })
        .collect();
    let rms = (deviations.iter().map(|z| z * z).sum::<f64>() / deviations.len() as f64).sqrt();
    // the rms of 24 draws scatters by 0.14; three standard deviations either way
    assert!((0.58..1.42).contains(&rms), "{rms}: {deviations:?}");
}

#[test]
fn specimens_that_bend_keep_the_contact_within_its_interval() {
    // sections of 8 mm: aluminium, then steel; nothing about them is stated
    for (bulk, tip) in [([7e-7, 0.04], [3e-9, 110.0]), ([2.4e-7, 0.014], [1e-9, 60.0]), ([0.0; 2], [0.0; 2])]
    {
        let cells = measured(World { noise_m_per_s: 1e-7, bulk, tip, ..QUIET });
        let input = Input { specimens: [None; 2], ..input(&cells) };
        let found = stiffness(&input).expect("all is there");
        let [low, high] = found.k_t_n_per_m.ci95;
        assert!(low < K && K < high && high - low < 0.15 * K, "{bulk:?}: {found:?}");
        assert!(found.doubts.is_empty(), "{bulk:?}: {:?} {:?}", found.k_t_n_per_m, found.diagnosis);
        assert!(!found.includes_specimen_b);
    }
    // taken for rigid, the first of them is softer by more than its interval
    let cells = measured(World { noise_m_per_s: 1e-7, bulk: [7e-7, 0.04], ..QUIET });
    let rigid = stiffness(&input(&cells)).expect("all is there");
    assert!(rigid.k_t_n_per_m.ci95[1] < K, "{rigid:?}");
}

#[test]
fn a_stated_bulk_that_the_points_contradict_is_doubted() {
    let cells = measured(World { noise_m_per_s: 1e-7, bulk: [2.4e-7, 0.014], ..QUIET });
    // stated ten times too stiff
    let bending = [5.8e4, 0.1];
    let stiff = Bulk { shear_per_n: [2.4e-8, 2.4e-9], bending_per_m2: [bending; 2], clamp_m: [0.012, 0.05] };
    let found = stiffness(&Input { specimens: [Some(stiff), None], ..input(&cells) }).expect("all is there");
    assert!(found.doubts.contains(&Doubt::Stated), "{:?}", found.diagnosis);
}

#[test]
fn a_contact_that_changed_has_an_interval_from_first_to_last() {
    let cells = measured(QUIET);
    let found = stiffness(&input(&cells)).expect("all is there");
    let drift =
        |change, at_the_spots_n_per_m| ContactDrift { change, std: 2e-3, cells: 40, at_the_spots_n_per_m };
    let allowed = |drift: ContactDrift| {
        let mut own = found.clone();
        own.allow_for(&drift);
        own
    };
    // the displacement between the spots is twice the contact's own: the contact changed by 20 %
    let changed = allowed(drift(0.1, 0.5 * found.k_t_n_per_m.mean));
    let [low, high] = changed.k_t_n_per_m.ci95;
    assert!(low < 0.91 * K && high > 1.09 * K && changed.doubts.is_empty(), "{changed:?}");
    let budget: f64 = changed.budget.values().map(|share| share * share).sum();
    let sigma = (low.recip() - high.recip()) / (2.0 * 1.96) * changed.k_t_n_per_m.mean;
    assert!((sigma / budget.sqrt() - 1.0).abs() < 1e-3, "the budget adds up: {sigma} {budget}");
    assert_eq!(changed.contradictions[0].cause, Cause::Drift);
    assert_eq!(allowed(drift(-1.2, found.k_t_n_per_m.mean)).doubts, [Doubt::Drift]);
}

#[test]
fn what_the_search_holds_counts_in_the_interval() {
    let cells = measured(World { noise_m_per_s: 1e-7, bulk: [2.4e-7, 0.014], ..QUIET });
    let input = Input { specimens: [None; 2], ..input(&cells) };
    let Fit { parameters, blocks, solution, .. } =
        Prepared::new(&input).and_then(|own| own.fit(&Changes::default())).expect("all is there");
    let lateral = [parameters::LATERAL, parameters::LATERAL + 1];
    let start = parameters.start();
    let from = Start { held: lateral.map(|at| (at, start[at])).to_vec(), released: false };
    let (_, held) = solver::solve(&blocks, &parameters, &[from], SIGMA_PER_S).expect("a minimum");
    assert!(lateral.iter().all(|at| (held.p[*at] - start[*at]).abs() < 1e-6));
    assert!(lateral.iter().all(|at| (solution.p[*at] - start[*at]).abs() > 0.01));
    // the same search with these parameters known exactly ends at the same place, and knows more
    let mut exact = parameters.clone();
    for at in lateral {
        exact.hold(at, start[at]);
    }
    let (_, known) = solver::solve(&blocks, &exact, &[Start::default()], SIGMA_PER_S).expect("a minimum");
    let compliance = parameters::COMPLIANCE;
    assert!((known.p[compliance] / held.p[compliance] - 1.0).abs() < 1e-9);
    let sigma = |own: &Solution, at: usize| own.certainty.covariance[(at, at)].sqrt();
    assert!(sigma(&held, compliance) > sigma(&known, compliance));
    for at in lateral {
        // of the 0.6 that they may deviate, the data leave some hundredths
        assert!(sigma(&held, at) > 0.01 && sigma(&known, at) < 1e-6, "{}", sigma(&held, at));
    }
}

#[test]
fn a_search_rests_when_all_parameters_do_and_not_the_compliance_alone() {
    let cells = measured(World { noise_m_per_s: 5e-7, ..QUIET });
    let mut input = input(&cells);
    input.priors = ContactPriors { skew_s: 2e-6, gain: 5e-3, ..input.priors };
    let Fit { parameters, blocks, solution, .. } =
        Prepared::new(&input).and_then(|own| own.fit(&Changes::default())).expect("all is there");
    let sigma = |at: usize| solution.certainty.covariance[(at, at)].sqrt();
    // the load cells' gain and delay, and the spot on A
    for at in [parameters::FORM, parameters::FORM + 1, parameters::SPOTS] {
        let mut away = solution.p.clone();
        away[at] += 9.0 * sigma(at);
        let p = solver::refit(&blocks, &parameters, solution.shared, &away).expect("a minimum").p;
        for other in [at, parameters::COMPLIANCE] {
            let left = (p[other] - solution.p[other]).abs() / sigma(other);
            assert!(left < 0.2, "parameter {other} is {left} standard deviations off, from {at} moved");
        }
    }
}

#[test]
fn a_point_that_is_millimetres_off_is_named_and_left_to_the_data() {
    let cells = measured(World { misplaced_m: 4e-3, noise_m_per_s: 1e-8, ..QUIET });
    let mut input = input(&cells);
    input.priors.specimen_point_m = 3e-4;
    let found = stiffness(&input).expect("the other points determine the motion");
    let [one] = &found.contradictions[..] else { panic!("{:?}", found.contradictions) };
    assert_eq!((one.what.as_str(), one.cause), ("point 4", Cause::SpecimenPoints));
    let off = one.off.iter().map(|[off, _]| off * off).sum::<f64>().sqrt();
    assert!((off - 4e-3).abs() < 2e-4, "{one:?}");
    assert!(found.doubts.is_empty(), "{:?}", found.diagnosis);
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high && high - low < 0.2 * K, "{found:?}");
}

#[test]
fn exchanged_points_are_named_and_what_is_stated_truly_is_not() {
    let cells = measured(World { noise_m_per_s: 1e-7, ..QUIET });
    let mut input = input(&cells);
    input.priors.specimen_point_m = 3e-4;
    let found = stiffness(&input).expect("all is there");
    assert!(found.contradictions.is_empty(), "{:?}", found.contradictions);
    for cell in &mut input.cells {
        let at = NAMES.iter().position(|name| *name == cell.point);
        match at {
            Some(4) => cell.point_m = SPECIMEN[4],
            Some(7) => cell.point_m = SPECIMEN[1],
            _ => {}
        }
    }
    let exchanged = stiffness(&input).expect("the signals are the same");
    let [one] = &exchanged.contradictions[..] else { panic!("{:?}", exchanged.contradictions) };
    let mut both = [Some(one.what.clone()), one.exchanged_with.clone()];
    both.sort();
    assert_eq!(both, [NAMES[4], NAMES[7]].map(|name| Some(format!("point {name}"))));
    // the same positions as before
    assert!((exchanged.k_t_n_per_m.mean / found.k_t_n_per_m.mean - 1.0).abs() < 1e-6, "{exchanged:?}");
}

#[test]
fn points_known_worse_than_stated_widen_the_interval() {
    let cells = measured(World { noise_m_per_s: 1e-8, ..QUIET });
    let mut input = input(&cells);
    input.priors.specimen_point_m = 2e-4;
    let sound = stiffness(&input).expect("all is there");
    // all off by three to five standard deviations along each axis
    for cell in input.cells.iter_mut().filter(|cell| cell.point_grouping == Grouping::SpecimenA) {
        let at = NAMES.iter().position(|name| *name == cell.point).expect("one of them");
        let off = |axis: usize| if (at + axis).is_multiple_of(2) { 6e-4 } else { -1e-3 };
        cell.point_m = std::array::from_fn(|axis| cell.point_m[axis] + off(axis + at / 3));
    }
    let found = stiffness(&input).expect("the signals are the same");
    let [one] = &found.contradictions[..] else { panic!("{:?}", found.contradictions) };
    assert_eq!(one.cause, Cause::SpecimenPoints);
    assert!(one.scatter.is_some_and(|times| (2.0..6.0).contains(&times)), "{one:?}");
    let width = |own: &Stiffness| own.k_t_n_per_m.ci95[1] - own.k_t_n_per_m.ci95[0];
    assert!(width(&found) > width(&sound), "{found:?}");
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high, "{found:?}");
}

#[test]
fn where_a_specimen_bends_the_band_ends() {
    let cells = measured(World { noise_m_per_s: 1e-7, bends_hz: Some(620.0), ..QUIET });
    let found = stiffness(&input(&cells)).expect("the lower part of the band is enough");
    let Band { low_hz, high_hz } = found.band_hz;
    assert_eq!(low_hz, BAND.low_hz);
    assert!((350.0..575.0).contains(&high_hz), "{high_hz}");
    assert!(found.doubts.is_empty(), "{:?}", found.diagnosis);
    let [low, high] = found.k_t_n_per_m.ci95;
    assert!(low < K && K < high && high - low < 0.2 * K, "{found:?}");
    // a specimen that does not bend keeps the whole band
    assert_eq!(stiffness(&input(&measured(QUIET))).expect("all is there").band_hz, BAND);
}

#[test]
fn a_cell_with_a_single_hit_is_as_noisy_as_its_neighbours() {
    let mut cells = measured(QUIET);
    let one = single(&cells[0].spectra);
    cells[0].spectra = one;
    let found = stiffness(&input(&cells)).expect("the others tell the noise");
    assert!((found.k_t_n_per_m.mean / K - 1.0).abs() < 2e-3, "{found:?}");
}

#[test]
fn what_is_missing_is_named() {
    let cells = measured(QUIET);
    let only = |keep: &dyn Fn(&Cell) -> bool| {
        let whole = input(&cells);
        let some = whole.cells.iter().zip(&cells).filter(|(_, own)| keep(own)).map(|(cell, _)| *cell);
        stiffness(&Input { cells: some.collect(), ..whole.clone() })
    };
    assert_eq!(only(&|_| false), Err(ContactError::NoCells));
    assert_eq!(only(&|cell| cell.structure == Structure::Ajb), Err(ContactError::NoForce));
    assert_eq!(only(&|cell| !cell.on_specimen), Err(ContactError::NoRotation));
    assert_eq!(only(&|cell| cell.structure == Structure::B), Err(ContactError::NoRotation));
}

#[test]
fn the_gain_of_the_hammer_widens_the_intervals_of_stiffness_and_damping_alike() {
    let cells = measured(QUIET);
    let exact = input(&cells);
    let mut uncertain = input(&cells);
    uncertain.priors.hammer_gain = 0.05;
    let (exact, uncertain) = (stiffness(&exact).expect("found"), stiffness(&uncertain).expect("found"));
    let half = |interval: Interval| 0.5 * (interval.ci95[1] - interval.ci95[0]) / interval.mean;
    let added =
        |of: fn(&Stiffness) -> Interval| (half(of(&uncertain)).powi(2) - half(of(&exact)).powi(2)).sqrt();
    // 95 % interval of a normal distribution with a standard deviation of 5 %
    assert!((added(|found| found.c_t_n_s_per_m) / (1.96 * 0.05) - 1.0).abs() < 1e-3);
    // the interval of k_T is that of the compliance, inverted, so one side is wider
    assert!((added(|found| found.k_t_n_per_m) / (1.96 * 0.05) - 1.0).abs() < 0.02);
}

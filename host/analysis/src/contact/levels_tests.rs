//! Levels computed from the same motions as the hits: each must give the contact that was put in.

use super::tests::{ARM, BESIDE, DAMPING, K, LEVER_M, MASS, NAMES, SPECIMEN, SPOTS};
use super::*;
use crate::C;
use crate::frf::MotionQuantity;
use crate::spectra::cross_spectra::{CrossSpectra, OutputSums};
use crate::structure::Structure;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// Sum of the forces at the contact per newton of any hit on A, N.
const FORCE: f64 = 1.3;
const LIGHT_PER_S: f64 = 2.3;
/// Three hits on A, then one on the moving mass.
const HITS: [([f64; 3], f64, Grouping); 4] = [
    ([-0.015, 0.028, 0.03], -1.0, Grouping::InterfaceA),
    ([0.015, 0.028, 0.03], -1.0, Grouping::InterfaceA),
    ([0.0, 0.05, 0.03], -1.0, Grouping::InterfaceA),
    ([0.0, 0.035, -0.31], 1.0, Grouping::InternalA),
];

/// Prescribed motions of B and A at the contact, without solving a model: z_B is given, T and z_A
/// follow from force and contact.
struct World {
    draw: Vec<f64>,
    /// Distance between the line of action of the hit on the mass and its stated position, m along
    /// x.
    aside_m: f64,
    noise_m_per_s: f64,
    /// Seed of the noise.
    seed: u64,
}

/// T, the motion of B and its rotations, that of A and its rotations.
struct State {
    t: C,
    b: [C; 6],
    a: [C; 6],
}

impl World {
    fn new(aside_m: f64, noise_m_per_s: f64) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        World { draw: (0..144).map(|_| random.random()).collect(), aside_m, noise_m_per_s, seed: 7 }
    }

    fn mode(&self, n: usize, s: C, scale: f64) -> C {
        let w = TAU * (130.0 + 700.0 * self.draw[n]);
        scale * (0.3 + self.draw[72 + n]) / (1.0 + s * s / (w * w) + s * 3e-5)
    }

    /// A push of one newton along z at (x, y) of structure A.
    fn assembly(&self, x: f64, y: f64, s: C) -> State {
        let of = |n: usize, translation: f64, rotation: f64| -> [C; 6] {
            std::array::from_fn(|i| {
                let scale = if i < 3 { translation } else { rotation };
                self.mode(n + i, s, scale)
                    + (x * self.mode(n + 12 + i, s, scale) + y * self.mode(n + 24 + i, s, scale)) / 0.05
            })
        };
        let (b, mut a) = (of(0, 6e-9, 1e-7), of(36, 9e-9, 4e-7));
        a[2] = b[2] + FORCE / (K + DAMPING * s);
        let t = FORCE - b[2] * (BESIDE + MASS * s * s) - b[3] * MASS * LEVER_M * s * s;
        State { t, b, a }
    }

    /// A hit on B alone along z (1, −1) or across.
    fn alone(&self, impact: usize, s: C) -> State {
        let b: [C; 6] =
            std::array::from_fn(|i| self.mode(6 * impact + i, s, if i < 3 { 6e-9 } else { 1e-7 }));
        let force = if impact < 3 { -1.0 } else { 0.0 };
        let t = force - b[2] * (BESIDE + MASS * s * s) - b[3] * MASS * LEVER_M * s * s;
        State { t, b, a: [C::default(); 6] }
    }

    fn hit(&self, structure: Structure, impact: usize, s: C) -> State {
        if structure == Structure::B {
            return self.alone(impact, s);
        }
        let ([x, y, _], sign, grouping) = HITS[impact];
        let aside = if grouping == Grouping::InternalA { self.aside_m } else { 0.0 };
        let State { t, b, a } = self.assembly(x + aside, y, s);
        State { t: sign * t, b: b.map(|v| sign * v), a: a.map(|v| sign * v) }
    }
}

fn at(motion: &[C; 6], r: [f64; 3]) -> [C; 3] {
    let [x, y, z, tx, ty, tz] = *motion;
    [x + ty * r[2] - tz * r[1], y + tz * r[0] - tx * r[2], z + tx * r[1] - ty * r[0]]
}

struct Cell {
    structure: Structure,
    impact: usize,
    point: usize,
    spectra: CrossSpectra,
}

fn measured(world: &World, sigma_per_s: f64) -> Vec<Cell> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(world.seed);
    let frequency_hz: Vec<f64> = (180..=1220).map(|l| 0.5 * f64::from(l)).collect();
    let mut cells = Vec::new();
    for (structure, impacts, points) in [(Structure::B, 6, 3), (Structure::Ajb, 4, 9)] {
        for (impact, point) in (0..impacts).flat_map(|i| (0..points).map(move |p| (i, p))) {
            let mut outputs = vec![OutputSums::default(); 6];
            for &f in &frequency_hz {
                let s = C::new(sigma_per_s, TAU * f);
                let State { t, b, a } = world.hit(structure, impact, s);
                let [x, y, z] = if point < 3 { at(&b, ARM[point]) } else { at(&a, SPECIMEN[point - 3]) };
                let exact = [x * s, y * s, z * s, at(&a, SPOTS[0])[2] * s, at(&b, SPOTS[1])[2] * s, t];
                for (n, (x, sums)) in exact.iter().zip(&mut outputs).enumerate() {
                    let sigma = if n == 5 { 1e-5 } else { world.noise_m_per_s };
                    let mut part = || -> f64 { StandardNormal.sample(&mut random) };
                    let hits = [0, 1].map(|_| x + C::new(part(), part()) * sigma);
                    sums.s_xf.push(hits[0] + hits[1]);
                    sums.s_xx.push(hits[0].norm_sqr() + hits[1].norm_sqr());
                }
            }
            let s_ff = vec![2.0; frequency_hz.len()];
            let spectra = CrossSpectra::new(1.0, frequency_hz.clone(), sigma_per_s, 2, s_ff, outputs);
            cells.push(Cell { structure, impact, point, spectra: spectra.expect("alike") });
        }
    }
    cells
}

fn input(cells: &[Cell], hammer_angle_rad: f64) -> Input<'_> {
    let across = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0]];
    let cell = |cell: &'_ Cell| -> ([f64; 3], [f64; 3], Grouping) {
        if cell.structure == Structure::B {
            return ([0.0; 3], across[usize::from(cell.impact >= 3)], Grouping::InterfaceB);
        }
        let (place, sign, grouping) = HITS[cell.impact];
        (place, [0.0, 0.0, sign], grouping)
    };
    let mut priors = ContactPriors { gain: 0.0, hammer_gain: 0.0, skew_s: 0.0, ..ContactPriors::default() };
    priors.positions.aim_m = 0.0;
    priors.positions.position_m = 1e-5;
    priors.specimen_point_m = 1e-5;
    priors.positions.hammer_angle_rad = hammer_angle_rad;
    let cells = cells.iter().map(|own| {
        let (impact_m, direction, impact_grouping) = cell(own);
        let on_arm = own.point < 3;
        ContactCell {
            structure: own.structure,
            impact: NAMES[own.impact],
            impact_m,
            direction,
            impact_grouping,
            point: NAMES[own.point],
            point_m: if on_arm { ARM[own.point] } else { SPECIMEN[own.point - 3] },
            point_sigma_m: None,
            point_grouping: if on_arm { Grouping::InterfaceB } else { Grouping::SpecimenA },
            spectra: &own.spectra,
            axes: Axes::XYZ,
            fixed: false,
            lasers: false,
            records: &[],
            quantity: MotionQuantity::Velocity,
        }
    });
    Input {
        cells: cells.collect(),
        contact_m: [0.0; 3],
        spots_m: Some(SPOTS),
        specimens: [Some(Bulk::RIGID); 2],
        parallel_path: None,
        priors,
        known_mass: None,
        band_hz: BAND,
    }
}

/// Twenty newtons at the mass, at the stated position of its hit.
fn level(world: &World, frequency_hz: f64) -> SteadyLevel {
    let ([x, y, _], ..) = HITS[3];
    let State { t, b, a } = world.assembly(x, y, C::new(0.0, TAU * frequency_hz));
    let tones = [t, at(&a, SPOTS[0])[2], at(&b, SPOTS[1])[2]].map(|v| v * 20.0);
    let stretch = |n: u32| tones.map(|v| v * (1.0 + 1e-6 * f64::from(n % 3)));
    SteadyLevel { frequency_hz, stretches: (0..6).map(stretch).collect() }
}

fn between_spots(level: &SteadyLevel) -> f64 {
    let [t, a, b] = level.stretches[0];
    (t / (a - b)).re
}

const FREQUENCIES: [f64; 5] = [103.0, 150.0, 260.0, 400.0, 500.0];

#[test]
fn without_noise_every_level_is_the_contact_whatever_lies_between_the_spots() {
    let world = World::new(0.0, 2e-9);
    let (heavy, light) = (measured(&world, SIGMA_PER_S), measured(&world, LIGHT_PER_S));
    let (_, known) = read(&input(&heavy, 0.0)).expect("all is there");
    let levels = FREQUENCIES.map(|f| level(&world, f));
    let found = level_stiffness(&input(&light, 0.0), &known, &levels);
    let mut worst_raw: f64 = 0.0;
    for (level, found) in levels.iter().zip(&found) {
        let found = found.as_ref().expect("inside the band");
        let f = level.frequency_hz;
        let error = (found.k_t_n_per_m.mean / K - 1.0).abs();
        // an almost undamped mode is within the lines around 150 Hz
        assert!(error < if f == 150.0 { 0.02 } else { 5e-3 }, "{f}: {found:?}");
        assert!((found.c_t_n_s_per_m.mean / DAMPING - 1.0).abs() < 0.2, "{f}: {found:?}");
        let [low, high] = found.k_t_n_per_m.ci95;
        assert!(low < K && K < high && high - low < 0.08 * K, "{f}: {found:?}");
        worst_raw = worst_raw.max((between_spots(level) / K - 1.0).abs());
    }
    assert!(worst_raw > 0.05, "between the spots it is another number: {worst_raw}");
}

#[test]
fn hits_and_levels_together_know_more_than_hits_alone_and_no_more_than_is_true() {
    let draws: Vec<(f64, f64)> = (0..24)
        .map(|seed| {
            let world = World { seed, ..World::new(0.0, 1e-6) };
            let (heavy, light) = (measured(&world, SIGMA_PER_S), measured(&world, LIGHT_PER_S));
            let (hits, known) = read(&input(&heavy, 0.0)).expect("all is there");
            let levels = FREQUENCIES.map(|f| level(&world, f));
            let found = level_stiffness(&input(&light, 0.0), &known, &levels);
            let found: Vec<&LevelStiffness> = found.iter().flatten().collect();
            let both = joint(&hits, &known, &found).map_or(hits.k_t_n_per_m, |both| both.k_t_n_per_m);
            let sigma = |k: Interval| (k.ci95[0].recip() - k.ci95[1].recip()) / (2.0 * 1.96);
            ((both.mean.recip() - K.recip()) / sigma(both), sigma(both) / sigma(hits.k_t_n_per_m))
        })
        .collect();
    let rms = (draws.iter().map(|(z, _)| z * z).sum::<f64>() / draws.len() as f64).sqrt();
    // the rms of 24 draws scatters by 0.14; three standard deviations above
    assert!(rms < 1.42, "{rms}: {draws:?}");
    let narrower = draws.iter().map(|(_, narrower)| narrower).sum::<f64>() / draws.len() as f64;
    assert!(narrower < 0.97, "{draws:?}");
}

#[test]
fn a_hammer_that_was_tilted_on_the_mass_is_inside_the_interval() {
    // 6 mm: a tilt of one degree over the distance between mass and contact
    let world = World::new(6e-3, 2e-8);
    let (heavy, light) = (measured(&world, SIGMA_PER_S), measured(&world, LIGHT_PER_S));
    let (_, known) = read(&input(&heavy, 0.02)).expect("all is there");
    let (light, exact) = (input(&light, 0.02), input(&light, 0.0));
    let levels = FREQUENCIES.map(|f| level(&world, f));
    let half = |found: &Result<LevelStiffness, LevelError>| {
        let k = found.as_ref().expect("inside the band").k_t_n_per_m;
        (0.5 * (k.ci95[1] - k.ci95[0]) / K, k.ci95[0] < K && K < k.ci95[1])
    };
    let stated: Vec<(f64, bool)> = level_stiffness(&light, &known, &levels).iter().map(half).collect();
    assert!(stated.iter().all(|(_, covers)| *covers), "{stated:?}");
    // without a stated tilt the same signals give a narrower interval
    let unstated: Vec<(f64, bool)> = level_stiffness(&exact, &known, &levels).iter().map(half).collect();
    assert!(
        stated.iter().zip(&unstated).all(|(with, without)| with.0 > without.0),
        "{stated:?} {unstated:?}"
    );
}

#[test]
fn cells_on_the_mass_that_were_aimed_one_by_one_do_not_count() {
    // every second cell on the mass was hit 1 mm beside the others; only one impact is on the mass,
    // so that nothing shows what that changes
    let straight = measured(&World::new(0.0, 1e-7), SIGMA_PER_S);
    let mixed: Vec<Cell> = (measured(&World::new(0.0, 1e-7), SIGMA_PER_S).into_iter())
        .zip(measured(&World::new(1e-3, 1e-7), SIGMA_PER_S))
        .map(|(straight, aside)| if straight.point % 2 == 0 { straight } else { aside })
        .collect();
    let found = |cells: &[Cell], aim_m: f64, shared: bool| {
        let mut input = input(cells, 0.0);
        input.priors.positions.aim_m = aim_m;
        if shared {
            input.cells.iter_mut().for_each(|cell| cell.records = &[1, 2]);
        }
        stiffness(&input).expect("all is there").k_t_n_per_m.mean
    };
    let aim_m = 2e-4;
    assert_eq!(found(&straight, aim_m, false), found(&mixed, aim_m, false));
    // they count where there is no error of aim, or where all signals are from the same hits
    assert_ne!(found(&straight, 0.0, false), found(&mixed, 0.0, false));
    assert_ne!(found(&straight, aim_m, true), found(&mixed, aim_m, true));
}

#[test]
fn what_a_level_lacks_is_named() {
    let world = World::new(0.0, 2e-9);
    let (heavy, light) = (measured(&world, SIGMA_PER_S), measured(&world, LIGHT_PER_S));
    let one = |keep: fn(&Cell) -> bool, level: SteadyLevel| {
        let [heavy, light] = [&heavy, &light].map(|cells| {
            let whole = input(cells, 0.0);
            let kept = whole.cells.iter().zip(cells).filter(|(_, own)| keep(own)).map(|(cell, _)| *cell);
            Input { cells: kept.collect(), ..whole.clone() }
        });
        let (_, known) = read(&heavy).expect("enough for a fit");
        level_stiffness(&light, &known, &[level]).remove(0).map(|_| ())
    };
    let all = |_: &Cell| true;
    assert_eq!(one(all, level(&world, 90.0)), Err(LevelError::OutOfBand));
    let mut short = level(&world, 200.0);
    short.stretches.truncate(1);
    assert_eq!(one(all, short), Err(LevelError::Short));
    let no_mass = |cell: &Cell| cell.structure == Structure::B || cell.impact < 3;
    assert_eq!(one(no_mass, level(&world, 200.0)), Err(LevelError::NoImpact));
    let mass_alone = |cell: &Cell| cell.structure == Structure::B || cell.impact == 3;
    assert_eq!(one(mass_alone, level(&world, 200.0)), Err(LevelError::NoPlace));
}

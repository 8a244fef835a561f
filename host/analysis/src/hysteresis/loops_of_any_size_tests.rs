//! Loops of any size, from nanometres to centimetres, millinewtons to meganewtons, 0.1 to 500 Hz:
//! the figures found and the effect of faults of the record. The expected values are in closed
//! form.
//!
//!     cargo test --release -p jointrig-analysis any_size -- --ignored --nocapture

use super::loop_bench::between;
use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{PI, TAU};

/// The element that carries the force.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Law {
    /// A spring, and a dashpot that causes this phase, rad.
    Ellipse(f64),
    /// One spring with a slider.
    Slider,
    /// Twenty of them, with limits from 0.05 to 1.95 times their mean.
    Sliders,
}

/// Parameters of a simulated record: sizes, sampling, and faults.
#[derive(Debug, Clone)]
struct Loop {
    law: Law,
    /// N/m.
    stiffness: f64,
    /// m.
    amplitude: f64,
    /// Amplitude over the displacement at which everything slips.
    over: f64,
    frequency_hz: f64,
    points: f64,
    cycles: f64,
    /// Noise of displacement (or velocity) and force, relative to their amplitudes.
    noise: f64,
    velocity: bool,
    /// Fraction of the cycle by which the force is delayed.
    late: f64,
    /// Drift of displacement and force per cycle relative to their amplitudes, and its curvature
    /// over the record.
    drift: [f64; 2],
    bow: f64,
    /// Stated frequency relative to the true one.
    stated: f64,
    /// Play relative to the amplitude.
    play: f64,
    /// Number of cycles over which the amplitude grows to its full size, and over which it fades at
    /// the end.
    grows: f64,
    fades: f64,
    /// Number of cycles at rest before and after that.
    rests: f64,
    /// Whether the frequency is stated.
    states: bool,
}

impl Loop {
    fn any(rng: &mut Xoshiro256PlusPlus) -> Self {
        let amplitude = between(rng, 1e-9, 1e-2);
        let force = between(rng, 1e-3, 1e6);
        let law = match (rng.random::<f64>() * 3.0) as u8 {
            0 => Law::Ellipse(between(rng, 0.001, 0.12)),
            1 => Law::Slider,
            _ => Law::Sliders,
        };
        let over = if law == Law::Sliders { between(rng, 0.3, 6.0) } else { between(rng, 2.5, 8.0) };
        Self {
            law,
            stiffness: force / amplitude,
            amplitude,
            over,
            frequency_hz: between(rng, 0.1, 500.0),
            points: between(rng, 150.0, 1_500.0),
            cycles: between(rng, 4.0, 40.0),
            noise: between(rng, 1e-5, 2e-3),
            velocity: rng.random::<bool>(),
            late: 0.0,
            drift: [0.0; 2],
            bow: 0.0,
            stated: 1.0,
            play: 0.0,
            grows: 0.0,
            fades: 0.0,
            rests: 0.0,
            states: true,
        }
    }

    /// One slider in gross slip, with random sizes.
    fn slider(rng: &mut Xoshiro256PlusPlus) -> Self {
        Self { law: Law::Slider, over: between(rng, 3.0, 8.0), ..Self::any(rng) }
    }

    /// Force while everything slips, N.
    fn limit(&self) -> f64 {
        self.stiffness * self.amplitude / self.over
    }

    /// Area of a steady loop of one slider, J.
    fn energy(&self) -> f64 {
        if let Law::Ellipse(phase) = self.law {
            return PI * self.stiffness * self.amplitude.powi(2) * phase.sin();
        }
        let taken_up = self.limit() / self.stiffness + 0.5 * self.play * self.amplitude;
        4.0 * self.limit() * (self.amplitude - taken_up)
    }

    fn record(&self, rng: &mut Xoshiro256PlusPlus) -> HysteresisRecord {
        let fs_hz = self.frequency_hz * self.points;
        let n = (self.cycles * self.points).floor() as usize;
        // the law is integrated on a finer grid, starting one cycle earlier
        let fine = (2_000.0 / self.points).ceil() as usize;
        let w = TAU / self.points;
        let part = |cycles: f64, over: f64| if over > 0.0 { (cycles / over).clamp(0.0, 1.0) } else { 1.0 };
        let size = |at: f64| {
            let turn = at / self.points;
            part(turn - self.rests, self.grows).min(part(self.cycles - self.rests - turn, self.fades))
        };
        let x = |at: f64| self.amplitude * size(at) * (w * at).sin();
        // second order of a step of 1e-3 samples
        let v = |at: f64| (x(at + 1e-3) - x(at - 1e-3)) / 2e-3 * fs_hz;
        let count = if self.law == Law::Sliders { 20 } else { 1 };
        let own = self.stiffness / f64::from(count);
        let mut sliders = vec![0.0; count as usize];
        let play = self.play * self.amplitude;
        let ahead = if self.grows > 0.0 { 0 } else { (1.3 * self.points).ceil() as usize };
        let late = self.late * self.points;
        let mut force_n = Vec::new();
        for i in 0..(n + ahead) * fine {
            let at = i as f64 / fine as f64 - ahead as f64 - late;
            let here = x(at);
            let force = match self.law {
                Law::Ellipse(phase) => self.stiffness * self.amplitude * (w * at + phase).sin(),
                _ => (0..count)
                    .map(|j| {
                        let part = if count == 1 { 1.0 } else { 0.05 + 0.1 * f64::from(j) };
                        let limit = part * self.limit() / f64::from(count);
                        let slider = &mut sliders[j as usize];
                        let apart = here - *slider;
                        let free = apart.clamp(-0.5 * play, 0.5 * play);
                        let carried = (own * (apart - free)).clamp(-limit, limit);
                        *slider += apart - free - carried / own;
                        carried
                    })
                    .sum(),
            };
            if i % fine == 0 && i >= ahead * fine {
                force_n.push(force);
            }
        }
        let top = force_n.iter().fold(0.0f64, |top, t| top.max(t.abs()));
        let drift = |per_cycle: f64, at: f64| {
            let (turns, all) = (at / self.points, self.cycles);
            per_cycle * (turns + self.bow * turns * turns / all)
        };
        let mut noise = || {
            let own: f64 = StandardNormal.sample(&mut *rng);
            self.noise * own
        };
        for (i, t) in force_n.iter_mut().enumerate() {
            *t += top * (drift(self.drift[1], i as f64) + noise());
        }
        let fastest = self.amplitude * w * fs_hz;
        let a: Vec<f64> = (0..n)
            .map(|i| i as f64)
            .map(|at| {
                if self.velocity {
                    v(at) + fastest * (drift(self.drift[0], at) + noise())
                } else {
                    x(at) + self.amplitude * (drift(self.drift[0], at) + noise())
                }
            })
            .collect();
        let b = vec![0.0; n];
        let motion = if self.velocity {
            RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
        } else {
            RelativeMotion::Displacement { a_m: a, b_m: b }
        };
        HysteresisRecord {
            fs_hz,
            motion,
            force_n,
            excitation_hz: self.states.then_some(self.stated * self.frequency_hz),
            normal_load_n: None,
        }
    }

    fn analysed(&self, rng: &mut Xoshiro256PlusPlus) -> Result<LoopAnalysis, HysteresisError> {
        analyse(&self.record(rng))
    }
}

fn near(found: f64, right: f64, part: f64) -> bool {
    (found / right - 1.0).abs() < part
}

fn energy_of(found: &LoopAnalysis) -> f64 {
    found.energy_j.map_or(f64::NAN, |energy| energy.mean)
}

/// Whether k_T, energy and friction limit of one slider are right within these relative tolerances.
fn slider_is_right(l: &Loop, found: &LoopAnalysis, k: f64, energy: f64) -> bool {
    found.shape == Shape::GrossSlip
        && found.k_t_n_per_m.is_some_and(|found| near(found.mean, l.stiffness, k))
        && near(energy_of(found), l.energy(), energy)
        && found.friction_limit_n.is_some_and(|found| near(found, l.limit(), 0.02))
}

/// Clean loops with a false finding or a wrong figure.
fn false_findings(first_seed: u64, count: u64) -> Vec<String> {
    let one = |seed: u64| -> Option<String> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(first_seed + seed);
        let l = Loop::any(&mut rng);
        let found = match l.analysed(&mut rng) {
            Ok(found) => found,
            Err(error) => return Some(format!("{error} on {l:?}")),
        };
        let right = match l.law {
            Law::Ellipse(_) => near(found.k_eq_n_per_m.mean, l.stiffness, 0.02),
            Law::Slider => slider_is_right(&l, &found, 0.04, 0.02),
            Law::Sliders => found.shape != Shape::Elliptical,
        };
        (!found.findings.is_empty() || !right).then(|| {
            format!(
                "{:?} {:?} {:?} {:?} on {l:?}",
                found.shape,
                found.findings,
                found.k_t_n_per_m.map(|k| k.mean / l.stiffness),
                energy_of(&found) / l.energy()
            )
        })
    };
    (0..count).filter_map(one).collect()
}

/// A fault of the record: its name, how it is made, and whether it was found with the right
/// figures.
type Fault = (&'static str, fn(&mut Xoshiro256PlusPlus) -> Loop, fn(&Loop, &LoopAnalysis) -> bool);

fn signed(rng: &mut Xoshiro256PlusPlus, low: f64, high: f64) -> f64 {
    let size = between(rng, low, high);
    if rng.random::<bool>() { size } else { -size }
}

fn frequency_is_off(l: &Loop, found: &LoopAnalysis) -> bool {
    let said = found.findings.iter().any(
        |f| matches!(f, LoopFinding::FrequencyOff { from_hz, .. } if near(*from_hz, l.frequency_hz, 0.01)),
    );
    said && near(found.frequency_hz, l.frequency_hz, 0.005)
}

const FAULTS: [Fault; 6] = [
    (
        "force late or early by 1 to 15 % of the cycle",
        |rng| Loop { late: signed(rng, 0.01, 0.15), ..Loop::slider(rng) },
        |l, found| {
            let by_s = l.late / l.frequency_hz;
            let said = |f: &LoopFinding| match f {
                LoopFinding::LateForce { by_s: found, corrected: true, .. } => near(*found, by_s, 0.05),
                _ => false,
            };
            found.findings.iter().any(said) && slider_is_right(l, found, 0.03, 0.02)
        },
    ),
    (
        "displacement or velocity and force drift, by up to 5 % of the amplitude per cycle",
        |rng| Loop {
            drift: [signed(rng, 0.005, 0.05), signed(rng, 0.005, 0.05)],
            bow: signed(rng, 0.1, 1.0),
            points: between(rng, 400.0, 1_500.0),
            ..Loop::slider(rng)
        },
        |l, found| near(energy_of(found), l.energy(), 0.003) && near(found.amplitude_m, l.amplitude, 0.005),
    ),
    (
        "frequency stated as a half, twice, 2π times, 0.63 or 1.37 times the true one",
        |rng| Loop {
            stated: [0.5, 2.0, TAU, 0.63, 1.37][(rng.random::<f64>() * 5.0) as usize],
            cycles: between(rng, 6.0, 40.0),
            ..Loop::slider(rng)
        },
        |l, found| frequency_is_off(l, found) && slider_is_right(l, found, 0.04, 0.02),
    ),
    (
        "play of 4 to 40 % of the amplitude",
        |rng| Loop {
            play: between(rng, 0.1, 0.4),
            over: between(rng, 4.0, 12.0),
            points: between(rng, 400.0, 1_500.0),
            ..Loop::slider(rng)
        },
        |l, found| {
            let said = |f: &LoopFinding| match f {
                LoopFinding::Play { size_m, .. } => near(*size_m, l.play * l.amplitude, 0.1),
                _ => false,
            };
            found.findings.iter().any(said) && near(energy_of(found), l.energy(), 0.02)
        },
    ),
    (
        "the first half to two cycles grow",
        |rng| Loop { grows: between(rng, 0.5, 2.0), cycles: between(rng, 5.0, 30.0), ..Loop::slider(rng) },
        |l, found| {
            let said = |f: &LoopFinding| match f {
                LoopFinding::Unsteady { left_out_first, left_out_last, .. } => {
                    *left_out_first as f64 >= l.grows.ceil() - 1.0 && *left_out_last == 0
                }
                _ => false,
            };
            found.findings.iter().any(said) && slider_is_right(l, found, 0.04, 0.02)
        },
    ),
    (
        "from rest to rest (up to 15 cycles each): one to two cycles grow, three to eight are steady, one to two fade",
        |rng| {
            let (grows, fades) = (between(rng, 1.0, 2.0), between(rng, 1.0, 2.0));
            let rests = between(rng, 0.05, 15.0);
            let steady = between(rng, 3.0, 8.0);
            let cycles = 2.0 * rests + grows + steady + fades;
            let states = rng.random::<bool>();
            Loop { cycles, grows, fades, rests, states, ..Loop::slider(rng) }
        },
        |l, found| {
            let said = |f: &LoopFinding| match f {
                LoopFinding::Unsteady { left_out_first, left_out_last, .. } => {
                    *left_out_first > 0 && *left_out_last > 0
                }
                _ => false,
            };
            found.findings.iter().any(said) && slider_is_right(l, found, 0.05, 0.03)
        },
    ),
];

/// The number of `count` loops with each fault that are right, and descriptions of the others.
fn found_of(count: u64) -> Vec<(&'static str, usize, Vec<String>)> {
    let each = |(place, (name, make, right)): (usize, &Fault)| {
        let one = |seed: u64| -> Option<String> {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(80_000 + 1_000 * place as u64 + seed);
            let l = make(&mut rng);
            match l.analysed(&mut rng) {
                Ok(found) if right(&l, &found) => None,
                Ok(found) => Some(format!(
                    "{:?} {:?} k_T {:?} energy {:.4} X {:.4} on {l:?}",
                    found.shape,
                    found.findings,
                    found.k_t_n_per_m.map(|k| k.mean / l.stiffness),
                    energy_of(&found) / l.energy(),
                    found.amplitude_m / l.amplitude
                )),
                Err(error) => Some(format!("{error} on {l:?}")),
            }
        };
        let missed: Vec<String> = (0..count).filter_map(one).collect();
        (*name, count as usize - missed.len(), missed)
    };
    FAULTS.iter().enumerate().map(each).collect()
}

#[test]
fn clean_loops_of_any_size_have_no_findings_and_right_figures() {
    let wrong = false_findings(70_000, 200);
    assert!(wrong.len() <= 4, "{} of 200:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn faults_are_found_in_loops_of_any_size() {
    for (name, found, missed) in found_of(40) {
        assert!(found >= 38, "{name}: {found} of 40; missed:\n{}", missed.join("\n"));
    }
}

#[test]
#[ignore = "200 loops of every kind; a minute"]
fn table_of_loops_of_any_size() {
    let wrong = false_findings(20_000, 200);
    println!("| clean loops with a finding or a wrong figure | {} of 200 |", wrong.len());
    let [silent, misled] = microslip_out_of_step(95_000, 200);
    println!("| microslip, force out of step: wrong k_T without a finding | {} of 200 |", silent.len());
    println!("| microslip, force out of step: put in step wrongly | {} of 200 |", misled.len());
    for one in &silent {
        println!("silent: {one}");
    }
    for one in &misled {
        println!("misled: {one}");
    }
    for (name, found, missed) in found_of(200) {
        println!("| {name} | {found} of 200 |");
        for one in &missed {
            println!("missed: {one}");
        }
    }
    for one in &wrong {
        println!("false: {one}");
    }
}

/// The area of an ellipse does not depend on the number of samples: 16 to 25 per cycle, which need
/// not be a whole number.
#[test]
fn an_ellipse_of_few_samples_has_its_area_and_amplitude() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    for points in [16.0, 17.3, 19.0, 21.7, 23.0, 25.0] {
        for velocity in [false, true] {
            let l = Loop {
                law: Law::Ellipse(PI / 6.0),
                points,
                cycles: 12.2,
                noise: 0.0,
                velocity,
                ..Loop::any(&mut rng)
            };
            let found = l.analysed(&mut rng).expect("a loop");
            // cubic interpolation between 16 samples is accurate to 1e-3
            assert!(
                near(energy_of(&found), l.energy(), 3e-3),
                "{points} {velocity}: {}",
                energy_of(&found) / l.energy()
            );
            assert!(
                near(found.amplitude_m, l.amplitude, 3e-3),
                "{points} {velocity}: {}",
                found.amplitude_m / l.amplitude
            );
        }
    }
}

/// A delay turns a sticking loop into an ellipse, in which it cannot be distinguished from damping.
#[test]
fn a_late_force_without_slip_is_a_lower_bound_and_never_put_right() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    let base = Loop { law: Law::Ellipse(0.02), cycles: 12.0, noise: 1e-4, ..Loop::any(&mut rng) };
    let found = Loop { late: 0.05, ..base.clone() }.analysed(&mut rng).expect("a loop");
    let by_s = 0.05 / base.frequency_hz;
    let said = |f: &LoopFinding| match f {
        LoopFinding::LateForce { by_s: found, at_least: true, corrected: false, .. } => *found <= by_s,
        _ => false,
    };
    assert!(found.findings.iter().any(said), "{:?}", found.findings);
    let early = Loop { late: -0.05, ..base }.analysed(&mut rng).expect("a loop");
    assert_eq!((early.shape, early.k_t_n_per_m), (Shape::Elliptical, None));
    assert!(early.warnings.iter().any(|w| w.contains("out of step")), "{:?}", early.warnings);
}

/// If no two consecutive cycles are alike, there is no steady loop.
#[test]
fn a_record_that_grows_all_along_is_refused() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let l = Loop { grows: 4.0, cycles: 4.01, noise: 1e-4, ..Loop::slider(&mut rng) };
    assert!(matches!(l.analysed(&mut rng), Err(HysteresisError::NotSteady { cycles: 4, .. })));
}

/// Cyclic loading whose amplitude grows by steps of three cycles, as for building parts: the first
/// step is as steady as any, but not what the record is about.
#[test]
fn of_growing_steps_the_last_is_taken_or_none() {
    let points = 400;
    let x: Vec<f64> = (0..24 * points)
        .map(|i| {
            let step = (i / (3 * points)) as f64;
            1e-3 * 1.6f64.powf(step) * (TAU * i as f64 / points as f64).sin()
        })
        .collect();
    let force_n: Vec<f64> = x.iter().map(|x| 1e6 * x).collect();
    for excitation_hz in [None, Some(1.0)] {
        let motion = RelativeMotion::Displacement { a_m: x.clone(), b_m: vec![0.0; x.len()] };
        let fs_hz = points as f64;
        let record =
            HysteresisRecord { fs_hz, motion, force_n: force_n.clone(), excitation_hz, normal_load_n: None };
        let found = analyse(&record);
        let largest = 1e-3 * 1.6f64.powi(7);
        // the last step, which has the largest amplitude, or none
        match found {
            Err(HysteresisError::NotSteady { .. }) => {}
            Ok(found) => assert!(near(found.amplitude_m, largest, 0.01), "{found:?}"),
            Err(error) => panic!("{error}"),
        }
    }
}

/// The decay after a hit stays one with any time before the hit, and an excitation that fades in
/// and out is none.
#[test]
fn time_before_a_hit_does_not_make_its_decay_steady() {
    let points = 200.0;
    for before in [0.0, 3.0, 8.0, 15.0, 22.0, 30.0] {
        for over in [4.0, 12.0, 25.0] {
            // 60 cycles in all; the amplitude falls by a factor of e over `over` of them
            let x: Vec<f64> = (0..12_000)
                .map(|i| f64::from(i) / points - before)
                .map(|turn| if turn < 0.0 { 0.0 } else { 1e-6 * (-turn / over).exp() * (TAU * turn).sin() })
                .collect();
            let force_n = x.iter().map(|x| 1e8 * x).collect();
            let motion = RelativeMotion::Displacement { b_m: vec![0.0; x.len()], a_m: x };
            let fs_hz = 100.0 * points;
            let record =
                HysteresisRecord { fs_hz, motion, force_n, excitation_hz: None, normal_load_n: None };
            let found = analyse(&record).expect("a decay");
            assert_eq!(found.kind, Kind::Impact, "{before} cycles before, falling over {over}");
        }
    }
}

/// Motion to and fro without a frequency of its own, as when a person turns a screw: a frequency is
/// found in it, but no steady cycles.
#[test]
fn a_record_whose_cycles_have_no_common_phase_is_refused() {
    for seed in 0..20 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut x = Vec::new();
        for _ in 0..30 {
            let points = between(&mut rng, 200.0, 600.0).round();
            x.extend((0..points as usize).map(|i| 1e-3 * (TAU * i as f64 / points).sin()));
        }
        let force_n: Vec<f64> = x.iter().map(|x| 1e6 * x).collect();
        let motion = RelativeMotion::Displacement { b_m: vec![0.0; x.len()], a_m: x };
        let record =
            HysteresisRecord { fs_hz: 400.0, motion, force_n, excitation_hz: None, normal_load_n: None };
        let found = analyse(&record);
        // by chance a few of its cycles may have the same length
        let right = match &found {
            Err(HysteresisError::NoSteadyPhase { .. } | HysteresisError::NotSteady { .. }) => true,
            Ok(found) => near(found.k_eq_n_per_m.mean, 1e6, 0.01) && near(found.amplitude_m, 1e-3, 0.06),
            Err(_) => false,
        };
        assert!(right, "seed {seed}: {found:?}");
    }
}

/// Of three cycles, the first grows: the other two form the loop.
#[test]
fn one_growing_cycle_of_three_is_left_out() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
    for velocity in [false, true] {
        let l = Loop {
            grows: 1.0,
            cycles: 3.0,
            points: 1_000.0,
            over: 22.7,
            play: 0.12,
            noise: 1e-3,
            velocity,
            ..Loop::slider(&mut rng)
        };
        let found = l.analysed(&mut rng).expect("a loop");
        let left_out = |f: &LoopFinding| {
            matches!(f, LoopFinding::Unsteady { left_out_first: 1, left_out_last: 0, used: 2, .. })
        };
        let play = |f: &LoopFinding| matches!(f, LoopFinding::Play { size_m, .. } if near(*size_m, 0.12 * l.amplitude, 0.1));
        assert!(
            found.findings.iter().any(left_out) && found.findings.iter().any(play),
            "{:?}",
            found.findings
        );
        assert_eq!(found.shape, Shape::GrossSlip);
        assert!(found.k_t_n_per_m.is_some_and(|k| near(k.mean, l.stiffness, 0.1)), "{:?}", found.k_t_n_per_m);
        assert!(near(energy_of(&found), l.energy(), 0.01), "{}", energy_of(&found) / l.energy());
        assert!(found.friction_limit_n.is_some_and(|limit| near(limit, l.limit(), 0.02)));
    }
}

/// Force and motion at different frequencies, neither of them the stated one, form no loop.
#[test]
fn two_frequencies_beside_the_stated_one_are_refused_with_all_three() {
    let wave = |frequency: f64| -> Vec<f64> {
        (0..8_000).map(|i| (TAU * frequency * f64::from(i) / 8_000.0).sin()).collect()
    };
    let record = HysteresisRecord {
        fs_hz: 8_000.0,
        motion: RelativeMotion::Displacement { a_m: wave(31.0), b_m: vec![0.0; 8_000] },
        force_n: wave(47.0),
        excitation_hz: Some(80.0),
        normal_load_n: None,
    };
    let error = analyse(&record).expect_err("no loop").to_string();
    for word in ["80.0000", "47.0000", "31.0000"] {
        assert!(error.contains(word), "{error}");
    }
}

/// Loops of twenty sliders, some or all of which slip, with a force shifted by 1.5 to 10 % of the
/// cycle. Returns those whose k_T is wrong by more than 15 % without a finding, and those that were
/// corrected wrongly.
fn microslip_out_of_step(first_seed: u64, count: u64) -> [Vec<String>; 2] {
    let (mut silent, mut wrong) = (Vec::new(), Vec::new());
    for seed in 0..count {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(first_seed + seed);
        let over = between(&mut rng, 0.5, 6.0);
        let l = Loop { law: Law::Sliders, over, late: signed(&mut rng, 0.015, 0.1), ..Loop::any(&mut rng) };
        let found = l.analysed(&mut rng).expect("a loop");
        if found.k_t_n_per_m.is_none_or(|k| near(k.mean, l.stiffness, 0.15)) {
            continue;
        }
        let said = |f: &LoopFinding| matches!(f, LoopFinding::LateForce { .. });
        let corrected = |f: &LoopFinding| matches!(f, LoopFinding::LateForce { corrected: true, .. });
        let k = found.k_t_n_per_m.map(|k| k.mean / l.stiffness);
        let text = format!("{:?} {:?} k_T {k:?} on {l:?}", found.shape, found.findings);
        if found.findings.iter().any(corrected) {
            wrong.push(text);
        } else if !found.findings.iter().any(said) {
            silent.push(text);
        }
    }
    [silent, wrong]
}

/// A force that leads by a few per cent of the cycle looks like friction of short reach if the loop
/// has no plateau. A loop alone cannot resolve this, so some of these remain undetected; none may
/// be corrected wrongly.
#[test]
fn a_force_out_of_step_in_microslip_is_said_but_for_a_few() {
    let [silent, wrong] = microslip_out_of_step(90_000, 60);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(silent.len() <= 6, "{} of 60:\n{}", silent.len(), silent.join("\n"));
}

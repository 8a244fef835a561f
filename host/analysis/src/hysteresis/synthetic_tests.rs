//! Comparison with closed forms: Jenkins and Iwan contacts of any amplitude, straight lines, damped
//! ellipses, periods that are not a whole number of samples.

use super::*;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

const FS: f64 = 51_200.0;

/// Parallel Jenkins elements (stiffness N/m, limit N) under Δx = X sin ωt; velocities of A, B at
/// rest.
fn record(elements: &[(f64, f64)], amplitude_m: f64, frequency_hz: f64, damping: f64) -> HysteresisRecord {
    let w = TAU * frequency_hz;
    let n = (8.3 * FS / frequency_hz) as usize;
    let mut sliders = vec![0.0; elements.len()];
    let mut force = Vec::new();
    let mut velocity = Vec::new();
    // start one cycle earlier, so that the record begins in the steady state
    let ahead = (FS / frequency_hz).ceil() as usize;
    for i in 0..ahead + n {
        let t = (i as f64 - ahead as f64) / FS;
        let x = amplitude_m * (w * t).sin();
        let mut total = damping * amplitude_m * w * (w * t).cos();
        for (slider, &(k, limit)) in sliders.iter_mut().zip(elements) {
            let f = (k * (x - *slider)).clamp(-limit, limit);
            *slider = x - f / k;
            total += f;
        }
        if i >= ahead {
            force.push(total);
            velocity.push(amplitude_m * w * (w * t).cos());
        }
    }
    HysteresisRecord {
        fs_hz: FS,
        motion: RelativeMotion::Velocity { b_m_per_s: vec![2e-6; velocity.len()], a_m_per_s: velocity },
        force_n: force,
        excitation_hz: Some(frequency_hz),
        normal_load_n: Some(300.0),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(22), ..ProptestConfig::default() })]

    #[test]
    fn a_jenkins_contact_in_gross_slip(k in 50e6..300e6f64, limit in 60.0..300.0f64, over in 2.0..6.0f64, f in 47.0..130.0f64) {
        let amplitude = over * limit / k;
        let got = analyse(&record(&[(k, limit)], amplitude, f, 0.0)).expect("a loop");
        prop_assert_eq!(got.shape, Shape::GrossSlip);
        // corners fall between samples, of which a cycle has about 400
        let k_t = got.k_t_n_per_m.expect("a stick part").mean;
        prop_assert!((k_t / k - 1.0).abs() < 0.01, "{} for {}", k_t, k);
        let energy = 4.0 * limit * (amplitude - limit / k);
        prop_assert!((got.energy_j.expect("closed").mean / energy - 1.0).abs() < 0.01);
        prop_assert!((got.friction_limit_n.expect("a plateau") / limit - 1.0).abs() < 0.01);
        prop_assert!((got.friction_coefficient.expect("a load") - limit / 300.0).abs() < 0.01);
        prop_assert!((got.k_secant_n_per_m.expect("a swing") / (limit / amplitude) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_spring_and_damper_is_stuck_or_an_ellipse_and_never_slip(k in 50e6..300e6f64, loss in -0.8..0.8f64, f in 47.0..500.0f64) {
        let damping = loss * k / (TAU * f);
        let got = analyse(&record(&[(k, 1e9)], 1e-7, f, damping)).expect("a loop");
        let phase = loss.atan().to_degrees();
        prop_assume!((phase.abs() - 10.0).abs() > 0.5);
        prop_assert_eq!(got.shape, if phase.abs() > 10.0 { Shape::Elliptical } else { Shape::Stuck });
        // the trapezoid rule loses (ω dt)² / 12 at a hundred samples per cycle, interpolation as
        // much again
        prop_assert!((got.k_eq_n_per_m.mean / k - 1.0).abs() < 2e-3);
        prop_assert!((got.phase_deg - phase).abs() < 0.2);
        prop_assert_eq!(got.k_t_n_per_m.is_some(), got.shape == Shape::Stuck);
    }
}

/// An Iwan contact of 40 elements: some slip at small amplitude, all at large amplitude.
#[test]
fn microslip_lies_between_stuck_and_gross_slip() {
    let elements: Vec<(f64, f64)> = (0..40).map(|i| (4e6, 0.25 + 7.0 * i as f64 / 39.0)).collect();
    let k: f64 = elements.iter().map(|e| e.0).sum();
    for (amplitude, shape) in [
        (0.05e-6, Shape::Stuck),
        (0.6e-6, Shape::Microslip),
        (1.2e-6, Shape::Microslip),
        (6e-6, Shape::GrossSlip),
    ] {
        let got = analyse(&record(&elements, amplitude, 80.0, 0.0)).expect("a loop");
        assert_eq!(got.shape, shape, "{amplitude}: {:?}", got.shape_evidence);
        // a fifth of the swing already includes some microslip
        let k_t = got.k_t_n_per_m.expect("a stick part").mean;
        assert!((k_t / k - 1.0).abs() < 0.1, "{amplitude}: {k_t} for {k}");
    }
}

/// When a contact sticks again the structure keeps ringing, and load cells that carry an arm
/// measure its inertia: T + m ẍ_B is the contact's force, T is not. Over a part of the flank no
/// longer than a ringing period this looks like stiffness; over the whole flank it does not.
#[test]
fn a_flank_that_rings_is_read_as_a_whole() {
    let (k, limit, amplitude, frequency) = (180e6, 180.0, 5e-6, 28.0);
    for ring_hz in [270.0, 310.0, 350.0] {
        let (w, ring) = (TAU * frequency, TAU * ring_hz);
        // time since the last reversal, s
        let since = |t: f64| (t - 0.25 / frequency).rem_euclid(0.5 / frequency);
        let sign =
            |t: f64| if ((t - 0.25 / frequency) * frequency).rem_euclid(1.0) < 0.5 { -1.0 } else { 1.0 };
        let rung = |t: f64| -0.1e-6 * sign(t) * (-since(t) / 8e-3).exp() * (ring * since(t)).sin();
        let n = (20.0 * FS / frequency) as usize;
        let (mut slider, mut x_m, mut force_n) = (0.0, Vec::new(), Vec::new());
        for i in 0..2 * n {
            let t = i as f64 / FS;
            let x = amplitude * (w * t).sin() + rung(t);
            let contact = (k * (x - slider)).clamp(-limit, limit);
            slider = x - contact / k;
            if i >= n {
                x_m.push(x);
                // 1.5 kg that move with the ringing as far as the contact yields
                force_n.push(contact + 1.5 * ring * ring * rung(t));
            }
        }
        let motion = RelativeMotion::Displacement { b_m: vec![0.0; n], a_m: x_m };
        let record = HysteresisRecord {
            fs_hz: FS,
            motion,
            force_n,
            excitation_hz: Some(frequency),
            normal_load_n: None,
        };
        let got = analyse(&record).expect("a loop");
        assert_eq!((got.shape, got.stick_part), (Shape::GrossSlip, Some([0.1, 0.9])));
        let k_t = got.k_t_n_per_m.expect("a flank").mean;
        assert!((k_t / k - 1.0).abs() < 0.01, "{ring_hz}: {k_t}");
    }
}

#[test]
fn displacements_serve_as_well_as_velocities_and_a_steady_record_needs_no_frequency() {
    let mut one = record(&[(180e6, 150.0)], 4e-6, 80.0, 0.0);
    let by_velocity = analyse(&one).expect("a loop");
    let x: Vec<f64> =
        (0..one.force_n.len()).map(|i| 4e-6 * (TAU * 80.0 * i as f64 / FS).sin() + 1e-3).collect();
    one.motion = RelativeMotion::Displacement { b_m: vec![0.0; x.len()], a_m: x };
    one.excitation_hz = None;
    let got = analyse(&one).expect("a loop");
    assert_eq!(got.kind, Kind::Shaker);
    // eight cycles determine the frequency to about one part in a thousand
    assert!((got.frequency_hz / 80.0 - 1.0).abs() < 5e-3, "{}", got.frequency_hz);
    assert!((got.k_eq_n_per_m.mean / by_velocity.k_eq_n_per_m.mean - 1.0).abs() < 0.03);
}

#[test]
fn both_forces_at_once_say_what_each_says_alone() {
    let correction = Correction { effective_mass_kg: 1.56, parallel_path: 0.0133 };
    let slipping = record(&[(180e6, 150.0)], 4e-6, 80.0, 0.0);
    let stuck = record(&[(180e6, f64::INFINITY)], 2e-7, 251.3, 3e3);
    let steady_without_frequency = HysteresisRecord { excitation_hz: None, ..slipping.clone() };
    for record in [slipping, stuck, steady_without_frequency] {
        let [raw, corrected] = analyse_both(&record, &correction).expect("loops");
        assert_eq!(raw, analyse(&record).expect("a loop"));
        assert_eq!(corrected, analyse_corrected(&record, &correction).expect("a loop"));
        assert!(raw.k_eq_n_per_m != corrected.k_eq_n_per_m);
    }
}

#[test]
fn broken_records_are_refused_with_the_reason() {
    let good = record(&[(180e6, 150.0)], 4e-6, 80.0, 0.0);
    let refuse = |edit: &dyn Fn(&mut HysteresisRecord)| {
        let mut record = good.clone();
        edit(&mut record);
        analyse(&record).expect_err("broken")
    };
    assert!(matches!(
        refuse(&|r| {
            r.force_n.pop();
        }),
        HysteresisError::Lengths { .. }
    ));
    assert!(matches!(refuse(&|r| r.force_n[7] = f64::NAN), HysteresisError::NotFinite { sample: 7 }));
    assert!(matches!(refuse(&|r| r.excitation_hz = Some(2.0)), HysteresisError::NoCycle { .. }));
    assert!(matches!(refuse(&|r| r.excitation_hz = Some(-2.0)), HysteresisError::Excitation(_)));
    let empty = RelativeMotion::Displacement { a_m: vec![], b_m: vec![] };
    assert!(matches!(
        refuse(&|r| {
            r.motion = empty.clone();
            r.force_n.clear();
            r.excitation_hz = None;
        }),
        HysteresisError::TooShort { samples: 0 }
    ));
    assert!(matches!(refuse(&|r| r.force_n.fill(1.0)), HysteresisError::NoMotion));
    assert!(matches!(
        refuse(&|r| {
            r.force_n.fill(1.0);
            r.excitation_hz = None;
        }),
        HysteresisError::NoMotion
    ));
}

/// The friction of each cycle differs by 1 %, as a contact's does, and the force has noise of 2 %:
/// the interval of the mean over the cycles has the coverage that it states.
#[test]
fn the_interval_of_the_friction_limit_covers_as_stated() {
    let (k, limit, frequency_hz) = (150e6, 180.0, 80.0);
    let per_cycle = (FS / frequency_hz) as usize;
    let mut covered = 0;
    for seed in 0..200 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(70_000 + seed);
        let mut noise = |sigma: f64| {
            let one: f64 = StandardNormal.sample(&mut rng);
            sigma * one
        };
        let mut record = record(&[(k, limit)], 4.0 * limit / k, frequency_hz, 0.0);
        let scales: Vec<f64> = (0..9).map(|_| 1.0 + noise(0.01)).collect();
        for (i, force) in record.force_n.iter_mut().enumerate() {
            *force = *force * scales[i / per_cycle] + noise(0.02 * limit);
        }
        let got = analyse(&record).expect("a loop");
        let [low, high] = got.friction_limit_ci95_n.expect("eight cycles");
        let [mu_low, mu_high] = got.friction_coefficient_ci95.expect("a load");
        assert!((mu_low * 300.0 / low - 1.0).abs() < 1e-12 && (mu_high * 300.0 / high - 1.0).abs() < 1e-12);
        covered += usize::from(low <= limit && limit <= high);
    }
    // 95 % of 200, ± 3 standard deviations
    assert!((181..=199).contains(&covered), "{covered} of 200");
}

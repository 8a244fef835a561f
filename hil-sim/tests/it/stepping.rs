//! The steppers compared with closed forms and with each other.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::f64::consts::PI;

use jointrig_hil_sim::rig::config::BodyName;
use jointrig_hil_sim::rig::force::ForceSegment;
use jointrig_hil_sim::rig::modal::StateSpace;
use jointrig_hil_sim::rig::modal::{ModalError, modes};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Probe, Quantity, Rig, RigConfig, Stepping, exact_frf};
use num_complex::Complex;
use proptest::prelude::*;

const Z: [f64; 3] = [0.0, 0.0, 1.0];

fn no_mishaps() -> RigConfig {
    let mut config = RigConfig::default();
    config.hammer.mishaps.double_hit = 0.0;
    config.hammer.mishaps.weak = 0.0;
    config.hammer.mishaps.overload = 0.0;
    config
}

/// ∫ f e^{−st} dt of a half-sine, textbook closed form.
fn transform(segment: &ForceSegment, s: Complex<f64>) -> Complex<f64> {
    let one = Complex::from(1.0);
    (-s * segment.start_s).exp()
        * (one + (-s * segment.width_s()).exp())
        * (segment.amplitude_n * segment.omega)
        / (s * s + segment.omega * segment.omega)
}

#[test]
fn a_hit_carries_the_exact_frfs() {
    let cells = [
        (Configuration::A, "AZ3", "A3", 8.0),
        (Configuration::A, "I_KX", "A1", 8.0),
        (Configuration::B, "BY1", "B2", 2.0),
        (Configuration::Ajb, "AZ3", "B3", 4.0),
        (Configuration::Ajb, "BX2", "A2", 4.0),
    ];
    let sigma = 5.0;
    let lines: Vec<Complex<f64>> = [20.0, 116.0, 192.0, 208.0, 400.0, 1000.0, 2000.0]
        .map(|f| Complex::new(sigma, 2.0 * PI * f))
        .to_vec();
    for (configuration, impact, response, seconds) in cells {
        let mut rig = Rig::new(&no_mishaps(), 7).unwrap();
        let config = rig.config().clone();
        rig.stage(configuration, impact, response, 0).unwrap();
        rig.fire(3.5e-3);
        let period_s = 1.0 / f64::from(rig.scan_rate_hz());
        let mut sums = vec![[Complex::new(0.0, 0.0); CHANNELS]; lines.len()];
        let mut codes = [0; CHANNELS];
        let turns: Vec<Complex<f64>> = lines.iter().map(|s| (-s * period_s).exp()).collect();
        let mut phasors = vec![Complex::from(period_s); lines.len()];
        for _ in 0..(seconds / period_s) as usize {
            rig.scan(&mut codes);
            for ((sum, phasor), turn) in sums.iter_mut().zip(&mut phasors).zip(&turns) {
                *phasor *= turn;
                for (sum, value) in sum.iter_mut().zip(rig.truth()) {
                    *sum += *phasor * *value;
                }
            }
        }
        let aim = rig.aim();
        let mut outputs = aim.response.to_vec();
        if configuration != Configuration::B {
            outputs.push(Probe::along_z(&rig.flaws().spots.ldv_a));
        }
        let cells: Vec<Probe> = config
            .load_cells
            .iter()
            .map(|cell| Probe { body: BodyName::ArmB, position_m: cell.position_m, direction: Z })
            .collect();
        let structure = Structure::new(&config, configuration);
        let contacts = &rig.last_hit().unwrap().contacts;
        assert_eq!(contacts.len(), 1);
        // A sum at the scans is the transform with its images at multiples of the scan rate
        // (Poisson). Velocity falls as f³ there, so that beyond 32 images 1/2000 of the first is
        // left, which is 1e-3 of a low line in the stiffness-controlled range.
        let folded = |s: Complex<f64>, quantity, outputs: &[Probe]| {
            (-32..=32)
                .map(|image| s + Complex::new(0.0, 2.0 * PI * f64::from(image) / period_s))
                .map(|s| {
                    structure.frf(s, quantity, outputs, &[aim.impact]).unwrap() * transform(&contacts[0], s)
                })
                .reduce(|sum, term| sum + term)
                .unwrap()
        };
        let mut worst = 0.0_f64;
        for (line, s) in lines.iter().enumerate() {
            let exact = folded(*s, Quantity::Mobility, &outputs);
            let largest = exact.iter().map(|v| v.norm()).fold(0.0, f64::max);
            for (output, exact) in exact.iter().enumerate() {
                worst = worst.max((sums[line][1 + output] - exact).norm() / largest);
            }
            // The body is not present: the signal is exactly zero.
            if configuration == Configuration::A {
                assert!(sums[line][5..9].iter().all(|sum| sum.norm() == 0.0));
            } else {
                let forces: Vec<Complex<f64>> = folded(*s, Quantity::Receptance, &cells)
                    .iter()
                    .zip(&config.load_cells)
                    .map(|(receptance, cell)| receptance * cell.stiffness_n_per_m[2])
                    .collect();
                let largest = forces.iter().map(|v| v.norm()).fold(0.0, f64::max);
                for (cell, exact) in forces.iter().enumerate() {
                    worst = worst.max((sums[line][6 + cell] - exact).norm() / largest);
                }
            }
        }
        println!("{configuration} {impact} {response}: {worst:.1e}");
        assert!(worst < 2e-6, "{configuration} {impact} {response}: {worst:.1e}");
        // The force cell is accurate to within its own ringing, g (f / 6 kHz)² with g = 0.15, and
        // to within the error of the area of a half-sine from twenty samples, (Ω T)² / 12 = 0.19 %.
        for (line, f_khz) in [(0, 0.02), (3, 0.208), (5, 1.0)] {
            let seen = sums[line][0] / transform(&contacts[0], lines[line]);
            let tolerance = 2e-3 + 0.15 * f_khz * f_khz / 36.0;
            assert!((seen - 1.0).norm() < tolerance, "{seen} at {f_khz} kHz");
        }
    }
}

#[test]
fn the_shaker_moves_the_structure_as_its_frf_says() {
    // The published slope at 200 Hz is for spots at their nominal positions.
    let mut config = RigConfig::default();
    config.errors.spot_m = 0.0;
    let mut rig = Rig::new(&config, 3).unwrap();
    let period_s = 1.0 / f64::from(rig.scan_rate_hz());
    // 256 scans per cycle: 200 Hz, near the specimen's yaw at 192 Hz.
    let cycle = 256;
    let omega = 2.0 * PI / (f64::from(cycle) * period_s);
    let mut codes = [0; CHANNELS];
    let mut sums = [Complex::new(0.0, 0.0); CHANNELS];
    // The slowest mode (116 Hz, 4 /s) decays to e^{−12} after 3 s.
    let cycles = 600;
    for scan in 0..cycle * (cycles + 20) {
        let volts = 0.5 * (omega * f64::from(scan) * period_s).cos();
        rig.drive(volts);
        rig.scan(&mut codes);
        if scan >= cycle * cycles {
            // The scan holds the drive from `scan` on and samples at its end.
            let phasor = Complex::cis(-omega * f64::from(scan + 1) * period_s);
            for (sum, value) in sums.iter_mut().zip(rig.truth()) {
                *sum += phasor * *value;
            }
        }
    }
    let s = Complex::new(0.0, omega);
    let outputs = [Probe::along_z(&config.spots.ldv_a), Probe::along_z(&config.spots.ldv_b)];
    let input = Probe { body: config.shaker.body, position_m: config.shaker.position_m, direction: Z };
    let exact =
        &exact_frf(&config, Configuration::Ajb, Quantity::Mobility, &[s], &outputs, &[input]).unwrap()[0];
    // Holding delays by half a scan and attenuates by sinc; the excitation channel reads the held
    // value a scan later.
    let held =
        Complex::cis(omega * period_s / 2.0) * ((omega * period_s / 2.0).sin() / (omega * period_s / 2.0));
    for spot in 0..2 {
        let seen = sums[4 + spot] / sums[9] / held;
        // Remaining error: the initial transient, e^{−12}, and the steps' images at 51 kHz,
        // (200/51000)² of the drive.
        assert!((seen / exact[(spot, 0)] - 1.0).norm() < 1e-3, "{seen} for {}", exact[(spot, 0)]);
    }
    // The resulting loop: an ellipse with a slope of 86 N/µm, T ahead of Δx by 65°, not the
    // contact's 180 N/µm.
    let force: Complex<f64> = sums[6..9].iter().sum();
    let k = force / ((sums[4] - sums[5]) / s);
    assert!((k.re / 1e6 - 86.0).abs() < 6.0 && (k.arg().to_degrees().abs() - 65.0).abs() < 3.0, "{k}");
}

#[test]
fn both_steppers_agree() {
    let config = RigConfig::default();
    for (configuration, impact, response) in
        [(Configuration::A, "AX1", "A1"), (Configuration::B, "BY1", "B4"), (Configuration::Ajb, "AZ1", "B1")]
    {
        let mut fast = Rig::new(&config, 5).unwrap();
        let mut slow = Rig::with_stepping(&config, 5, Stepping::Exponential).unwrap();
        assert_eq!(fast.fallback(), None);
        let (mut codes, mut others) = ([0; CHANNELS], [0; CHANNELS]);
        let mut largest = [0.0_f64; CHANNELS];
        let mut off = [0.0_f64; CHANNELS];
        let mut differing = 0;
        for rig in [&mut fast, &mut slow] {
            rig.stage(configuration, impact, response, 0).unwrap();
            // Long enough to strike twice: half-sines and the free motion between them.
            rig.fire(14e-3);
        }
        for scan in 0..2000 {
            if scan == 1200 {
                fast.drive(0.3);
                slow.drive(0.3);
            }
            fast.scan(&mut codes);
            slow.scan(&mut others);
            differing += codes.iter().zip(&others).filter(|(a, b)| a != b).count();
            for channel in 0..CHANNELS {
                let (a, b) = (fast.truth()[channel], slow.truth()[channel]);
                largest[channel] = largest[channel].max(a.abs());
                off[channel] = off[channel].max((a - b).abs());
            }
        }
        let worst =
            (0..CHANNELS).filter(|c| largest[*c] > 0.0).map(|c| off[c] / largest[c]).fold(0.0, f64::max);
        println!("{configuration}: {worst:.1e}");
        // The modes are verified to 1e-8 of the largest transfer function; they are much better.
        assert!(worst < 1e-9, "{configuration}: {worst:.1e}");
        // A code differs only where a relative difference of 1e-9 crosses a rounding threshold.
        assert!(differing <= 1, "{differing}");
    }
}

#[test]
fn overdamped_modes_are_real() {
    // The free clamp holds 60 g at 35 kHz with β = 1.5e-5 s: ζ = β ω / 2 = 1.7.
    let space = StateSpace::new(&Structure::new(&RigConfig::default(), Configuration::A)).unwrap();
    let modes = modes(&space).unwrap();
    let overdamped = modes.iter().filter(|mode| mode.weight == 1.0).count();
    assert!(overdamped >= 2 && modes.iter().all(|mode| (mode.weight == 1.0) == (mode.lambda.im == 0.0)));
    assert_eq!(2 * (modes.len() - overdamped) + overdamped, space.order());
}

#[test]
fn critical_damping_falls_back_to_the_exponential() {
    // Arm B on one bushing at its centre of gravity, critically damped along z: two modes become
    // one.
    let mut config = no_mishaps();
    for cell in &mut config.load_cells {
        cell.stiffness_n_per_m = [0.0; 3];
    }
    config.lower_push_rod.position_m = config.bodies.arm_b.cg_m;
    config.lower_push_rod.rotation_nm_per_rad = [1e4, 2e4, 3e4];
    let omega = (config.lower_push_rod.stiffness_n_per_m[2] / config.bodies.arm_b.mass_kg).sqrt();
    config.lower_push_rod.damping_s[2] = 2.0 / omega;
    config.errors.none = true;
    let mut rig = Rig::new(&config, 1).unwrap();
    rig.stage(Configuration::B, "BZ3", "B3", 0).unwrap();
    assert!(matches!(rig.fallback(), Some(ModalError::Dependent { .. })), "{:?}", rig.fallback());
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    for _ in 0..2000 {
        rig.scan(&mut codes);
    }
    // m u'' + c u' + k u = f with c² = 4 k m: u = (J / m) t e^{−ωt} after an impulse J.
    let hit = rig.last_hit().unwrap().contacts[0];
    let t = 2000.0 / 51200.0 - (hit.start_s + hit.width_s() / 2.0);
    let impulse = hit.amplitude_n * hit.width_s() * 2.0 / PI;
    let expected = -impulse / config.bodies.arm_b.mass_kg * t * (-omega * t).exp();
    let centre = Probe { body: BodyName::ArmB, position_m: config.bodies.arm_b.cg_m, direction: Z };
    let (u, _) = rig.motion(&centre).unwrap();
    // The pulse has a finite duration: (ω w)²/24 = 0.7 % at its centre.
    assert!((u / expected - 1.0).abs() < 0.02, "{u} for {expected}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn energy_only_decays(factors in prop::array::uniform12(0.2_f64..5.0)) {
        let mut config = no_mishaps();
        config.bodies.mass.mass_kg *= factors[0];
        config.bodies.arm_a.mass_kg *= factors[1];
        config.bodies.arm_b.mass_kg *= factors[2];
        config.bodies.specimen_a.mass_kg *= factors[3];
        config.knife_edge.stiffness_n_per_m[0] *= factors[4];
        config.clamp.loaded.stiffness_n_per_m[2] *= factors[5];
        config.clamp.loaded.damping_s[4] *= factors[6];
        config.contact.stiffness_n_per_m[2] *= factors[7];
        config.contact.rotation_nm_per_rad[1] *= factors[8];
        config.contact.damping_s = config.contact.damping_s.map(|beta| beta * factors[9]);
        config.lower_push_rod.stiffness_n_per_m[1] *= factors[10];
        config.leaf_springs[0].stiffness_n_per_m[2] *= factors[11];
        let mut rig = Rig::new(&config, 11).unwrap();
        for (configuration, impact, response) in
            [(Configuration::A, "AZ2", "A2"), (Configuration::B, "BX1", "B1"), (Configuration::Ajb, "I_MZ", "A4")]
        {
            rig.stage(configuration, impact, response, 0).unwrap();
            rig.fire(3.5e-3);
            let mut codes = [0; CHANNELS];
            // Half a second of flight and contact; afterwards no force acts.
            for _ in 0..800 {
                rig.scan(&mut codes);
            }
            let start = rig.energy_j();
            prop_assert!(start > 0.0);
            let mut before = start;
            for _ in 0..100 {
                for _ in 0..16 {
                    rig.scan(&mut codes);
                }
                let now = rig.energy_j();
                // Only the rounding of a sum of squares may increase it.
                prop_assert!(now <= before + 1e-12 * start, "{before} -> {now}");
                before = now;
            }
        }
    }
}

//! The stiffness between the arms on random rigs: its interval must cover the truth, and there must
//! be no answer where the data do not allow one.
//!
//! Contacts of 60 to 600 N/µm, clamps of 0.3 to 3 times the default's or none, the clamp's levers,
//! the specimen's local mode, arms, load cells and the vibrometer's floor vary simultaneously;
//! every fifth rig has a clamp so far from the contact's axis that the specimen's local mode is
//! visible between the arms. The ignored test prints the table of `docs/accuracy.md`:
//!
//!     cargo test --release -p jointrig --test it between_arms -- --ignored --nocapture
#![cfg(feature = "sim")]

use crate::simulated;

use jointrig::substructuring::averaged::{Priors, averaged};
use jointrig::substructuring::between_arms::{BELOW, BetweenArms, NoStiffness, between_arms};
use jointrig::substructuring::fit::{Options, fit};
use jointrig::substructuring::{Band, IdmSet};
use jointrig_hil_sim::rig::RigConfig;
use nalgebra::{Matrix3, Matrix6, Vector6};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use simulated::{campaign, geometry};

/// A rig, its vibrometer's floor, (m/s)/√Hz, and the stiffness between its arms, N/m.
struct Case {
    config: RigConfig,
    floor: f64,
    seed: u64,
    truth: f64,
}

/// 1/C_zz of contact and clamp in series at the virtual points, including levers.
fn truth(config: &RigConfig) -> f64 {
    let compliance = |position_m: [f64; 3], k: [f64; 3], turning: [f64; 3]| {
        let own = Matrix6::from_diagonal(&Vector6::from_iterator(k.iter().chain(&turning).map(|k| 1.0 / k)));
        // motion of the virtual point, the origin, from that of the spring: u = t + θ × (0 − p)
        let r = position_m.map(|v| -v);
        let skew = Matrix3::new(0.0, -r[2], r[1], r[2], 0.0, -r[0], -r[1], r[0], 0.0);
        let mut motion = Matrix6::identity();
        motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew);
        (motion * own * motion.transpose())[(2, 2)]
    };
    let c = &config.contact;
    let mut total = compliance(c.position_m, c.stiffness_n_per_m, c.rotation_nm_per_rad);
    if !config.clamp.rigid {
        let c = &config.clamp.loaded;
        total += compliance(c.position_m, c.stiffness_n_per_m, c.rotation_nm_per_rad);
    }
    1.0 / total
}

impl Case {
    fn random(seed: u64) -> Case {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(stream.random::<f64>());
        let mut config = RigConfig::default();
        let k_t = between(60e6, 600e6);
        config.contact.stiffness_n_per_m = [k_t * between(0.7, 1.4), k_t * between(1.0, 2.0), k_t];
        let floor = between(0.01e-6, 0.2e-6);
        let clamp = between(0.3, 3.0);
        config.clamp.rigid = between(1.0, 2.0) < 1.2;
        let local_mode = between(0.4, 3.0);
        let own = &mut config.clamp.loaded;
        own.stiffness_n_per_m.iter_mut().for_each(|k| *k *= clamp);
        for k in [0, 2] {
            own.rotation_nm_per_rad[k] *= clamp * between(0.6, 1.7);
        }
        own.rotation_nm_per_rad[1] *= local_mode;
        own.position_m[1] *= between(0.5, 1.5);
        let lever = if seed.is_multiple_of(5) { 0.3e-3 } else { 0.03e-3 };
        for axis in [0, 2] {
            own.position_m[axis] = lever * (between(1.0, 7.4).ln() - 1.0);
        }
        let bodies = &mut config.bodies;
        bodies.arm_a.mass_kg *= between(0.7, 1.5);
        bodies.arm_b.mass_kg *= between(0.7, 1.5);
        bodies.mass.mass_kg *= between(0.8, 1.25);
        let cells = between(0.6, 1.6);
        for cell in &mut config.load_cells {
            cell.stiffness_n_per_m.iter_mut().for_each(|k| *k *= cells);
        }
        let truth = truth(&config);
        Case { config, floor, seed, truth }
    }

    fn answer(&self, band: Band) -> Result<BetweenArms, NoStiffness> {
        let c = campaign(&self.config, self.floor, self.seed, [BELOW.low_hz, band.high_hz]);
        let [a, b, ajb] = [&c.a, &c.b, &c.ajb].map(|m| &m.frf);
        let geometry = geometry();
        let recommended = averaged(ajb, &geometry, IdmSet::Six, band, &Priors::default()).expect("data");
        let fitted = |band| fit(a, b, ajb, &geometry, IdmSet::Six, band, &Options::default());
        between_arms(Some(fitted(band).as_ref()), Some(&recommended), || fitted(BELOW))
    }

    fn covered_by(&self, found: &BetweenArms) -> bool {
        (found.ci95[0]..=found.ci95[1]).contains(&self.truth)
    }
}

#[test]
fn the_default_rig_is_26_6_between_its_arms() {
    // 1/180 + 1/60 and the lever of 10 mm on 6500 N m/rad: 0.00556 + 0.01667 + 0.01538 µm/N, and
    // 1.25e-5 m on 4.95 N m/rad
    let series: f64 = 1.0 / (1.0 / 180e6 + 1.0 / 60e6 + 1e-4 / 6500.0 + 1.25e-5f64.powi(2) / 4.95);
    assert!((truth(&RigConfig::default()) / series - 1.0).abs() < 1e-9);
    assert!((series - 26.6e6).abs() < 0.05e6);
}

/// A soft rig, a stiff one and one without a clamp over six of the fit's bands; the table below has
/// many over all bands.
#[test]
fn an_answer_on_random_rigs_covers_the_truth() {
    let band = Band { low_hz: 400.0, high_hz: 490.0 };
    for seed in [31, 36, 3] {
        let case = Case::random(seed);
        let found = case.answer(band).expect("rigs without a local mode between the arms");
        assert!(case.covered_by(&found), "seed {seed}: {found:?} for {:.3e}", case.truth);
        let half = (found.ci95[1] - found.ci95[0]) / 2.0;
        assert!(half < 0.25 * found.stiffness_n_per_m, "seed {seed}: {found:?}");
    }
}

/// Noise floor from which the table has a separate row, (m/s)/√Hz.
const LOUD: f64 = 0.08e-6;

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: between the arms, FRFs of random rigs"]
fn table_of_random_rigs() {
    let band = Band { low_hz: 300.0, high_hz: 600.0 };
    let (mut errors, mut halves, mut covered, mut none) = (Vec::new(), Vec::new(), 0, 0);
    let (mut loud, mut loud_covered, mut loud_none) = (0, 0, 0);
    for seed in 1..=60 {
        let case = Case::random(seed);
        let row = format!("| {seed} | {:.3} | {:.1} |", case.floor * 1e6, case.truth * 1e-6);
        match case.answer(band) {
            Ok(found) => {
                let [k, low, high] = [found.stiffness_n_per_m, found.ci95[0], found.ci95[1]];
                errors.push((k / case.truth - 1.0).powi(2));
                halves.push((high - low) / 2.0 / k);
                let hit = case.covered_by(&found);
                covered += usize::from(hit);
                if case.floor > LOUD {
                    loud += 1;
                    loud_covered += usize::from(hit);
                }
                let [k, low, high] = [k, low, high].map(|k| k * 1e-6);
                let missed = if hit { "" } else { ", missed" };
                println!("{row} {k:.1} | {low:.1}…{high:.1} | {:?}{missed} |", found.basis);
            }
            Err(why) => {
                none += 1;
                loud_none += usize::from(case.floor > LOUD);
                println!("{row} – | {why} | |");
            }
        }
    }
    halves.sort_by(f64::total_cmp);
    let rms = (errors.iter().sum::<f64>() / errors.len() as f64).sqrt();
    let answers = errors.len();
    println!(
        "table: between-arms\n| rigs | answers | covered | half width (median) | rms error | none |\n|---|---|---|---|---|---|\n\
         | all 60 | {answers} | {covered} of {answers} | {:.1} % | {:.1} % | {none} |\n\
         | of them, floor above 0.08 µm/s/√Hz | {loud} | {loud_covered} of {loud} | – | – | {loud_none} |\n",
        100.0 * halves[halves.len() / 2],
        100.0 * rms
    );
    assert!(covered * 100 >= 93 * answers, "{covered} of {answers} covered");
}

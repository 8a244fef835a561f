//! The recommended estimate on twenty simulated campaigns: its interval must contain the true
//! value.
//!
//! The rig has a rigid clamp and the default errors of position, aim and angle, drawn separately
//! for each campaign. The ignored test prints the tables of `docs/accuracy.md`:
//!
//!     cargo test --release -p jointrig --test it accuracy -- --ignored --nocapture
#![cfg(feature = "sim")]

use crate::simulated;

use jointrig::substructuring::averaged::{CellHits, DofEstimate, Prepared, Priors, averaged};
use jointrig::substructuring::fit::{self, FittedDof};
use jointrig::substructuring::geometry::Grouping;
use jointrig::substructuring::{Band, Dof, IdmSet, Method, identify};
use jointrig_hil_sim::rig::Configuration;
use rayon::prelude::*;
use simulated::{campaign, geometry, measure, measure_with_hits, rigid_rig};

const CAMPAIGNS: u64 = 20;
const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };
/// Quiet and noisy vibrometer, (m/s)/√Hz.
const QUIET: f64 = 0.05e-6;
const LOUD: f64 = 0.2e-6;

/// A value and its interval.
struct Value {
    stiffness: f64,
    ci95: [f64; 2],
    identified: bool,
}

impl From<&DofEstimate> for Value {
    fn from(z: &DofEstimate) -> Value {
        Value { stiffness: z.stiffness, ci95: z.ci95, identified: z.identified }
    }
}

impl From<&FittedDof> for Value {
    fn from(z: &FittedDof) -> Value {
        Value { stiffness: z.stiffness, ci95: z.ci95, identified: z.identified }
    }
}

/// Results of all campaigns of one kind.
struct Outcome {
    mean: f64,
    std: f64,
    covered: usize,
    /// Median of the ratio of half width to value; infinite if most are not identified.
    half_width: f64,
    not_identified: usize,
}

impl Outcome {
    fn of(found: &[Value], truth: f64) -> Outcome {
        let n = found.len() as f64;
        let mean = found.iter().map(|z| z.stiffness).sum::<f64>() / n;
        let mut half: Vec<f64> = found.iter().map(|z| (z.ci95[1] - z.ci95[0]) / 2.0 / z.stiffness).collect();
        half.sort_by(f64::total_cmp);
        Outcome {
            mean,
            std: (found.iter().map(|z| (z.stiffness - mean).powi(2)).sum::<f64>() / n).sqrt(),
            covered: found.iter().filter(|z| (z.ci95[0]..=z.ci95[1]).contains(&truth)).count(),
            half_width: half[half.len() / 2],
            not_identified: found.iter().filter(|z| !z.identified).count(),
        }
    }

    fn row(&self, name: &str, truth: f64, floor: f64) -> String {
        format!(
            "| {name} | {:.0} | {:.2} | {:.1} | {:.1} | {} of {CAMPAIGNS} | {:.1} % | {} |",
            truth * 1e-6,
            floor * 1e6,
            self.mean * 1e-6,
            self.std * 1e-6,
            self.covered,
            100.0 * self.half_width,
            self.not_identified
        )
    }
}

/// The recommended estimate on all campaigns.
fn recommended(truth: f64, floor: f64) -> Outcome {
    let (config, geometry) = (rigid_rig(truth), geometry());
    let found: Vec<Value> = (1..=CAMPAIGNS)
        .into_par_iter()
        .map(|seed| {
            let lines = [BAND.low_hz, BAND.high_hz];
            let ajb = measure(&config, Configuration::Ajb, &geometry.ajb, floor, seed, lines);
            let priors = Priors::default();
            let found = averaged(&ajb.frf, &geometry, IdmSet::Six, BAND, &priors).expect("data");
            // the rotational impedance of the contact is a thousandth of that of the arms' inertia
            for dof in [Dof::Rx, Dof::Ry, Dof::Rz] {
                let rotation = &found.joint[&dof];
                assert!(!rotation.identified && rotation.ci95[0] < 22.0, "seed {seed}: {dof} {rotation:?}");
            }
            (&found.joint[&Dof::Z]).into()
        })
        .collect();
    Outcome::of(&found, truth)
}

/// The fit on all campaigns: A, B and AJB. Each must give a result.
fn fitted(truth: f64, floor: f64) -> Outcome {
    let (config, geometry) = (rigid_rig(truth), geometry());
    let found: Vec<Value> = (1..=CAMPAIGNS)
        .map(|seed| {
            let c = campaign(&config, floor, seed, [BAND.low_hz, BAND.high_hz]);
            let [a, b, ajb] = [&c.a, &c.b, &c.ajb].map(|m| &m.frf);
            let found = fit::fit(a, b, ajb, &geometry, IdmSet::Six, BAND, &fit::Options::default());
            let found = found.unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let z = found.joint[&Dof::Z];
            eprintln!(
                "seed {seed}: {:.1} [{:.1}, {:.1}], χ² {:.2} per degree of freedom",
                z.stiffness * 1e-6,
                z.ci95[0] * 1e-6,
                z.ci95[1] * 1e-6,
                found.chi_square_per_dof
            );
            (&z).into()
        })
        .collect();
    Outcome::of(&found, truth)
}

/// Requirements for the estimate at a noise floor.
fn keeps_its_promise(outcome: &Outcome, truth: f64, floor: f64) {
    let case = format!("{:.0} N/µm at {:.2} µm/s/√Hz", truth * 1e-6, floor * 1e6);
    assert!(outcome.covered >= 17, "{case}: {} of {CAMPAIGNS} covered", outcome.covered);
    if floor == QUIET {
        assert!((outcome.mean / truth - 1.0).abs() < 0.02, "{case}: mean {}", outcome.mean);
        assert!(outcome.half_width < 0.08, "{case}: half width {}", outcome.half_width);
        assert_eq!(outcome.not_identified, 0, "{case}");
    } else {
        assert!(outcome.half_width < 0.25, "{case}: half width {}", outcome.half_width);
        assert!(outcome.not_identified <= 5, "{case}: {} not identified", outcome.not_identified);
    }
}

#[test]
fn the_interval_covers_the_contact_of_a_quiet_campaign() {
    keeps_its_promise(&recommended(180e6, QUIET), 180e6, QUIET);
}

#[test]
fn the_interval_covers_the_contact_of_a_loud_campaign() {
    keeps_its_promise(&recommended(180e6, LOUD), 180e6, LOUD);
}

/// The fit over six of its bands; the table below covers all bands.
#[test]
fn the_fit_covers_the_contact_and_describes_the_data() {
    let (config, geometry) = (rigid_rig(180e6), geometry());
    let band = Band { low_hz: 400.0, high_hz: 490.0 };
    for seed in 1..=3 {
        let c = campaign(&config, QUIET, seed, [band.low_hz, band.high_hz]);
        let [a, b, ajb] = [&c.a, &c.b, &c.ajb].map(|m| &m.frf);
        let found =
            fit::fit(a, b, ajb, &geometry, IdmSet::Six, band, &fit::Options::default()).expect("data");
        let z = found.joint[&Dof::Z];
        assert!(z.identified && z.ci95[0] < 180e6 && 180e6 < z.ci95[1], "seed {seed}: {z:?}");
        assert!((z.ci95[1] - z.ci95[0]) / 2.0 < 0.1 * z.stiffness, "seed {seed}: {z:?}");
        // 10 N m/rad is 1/4000 of the impedance of the arms' inertia: it cannot be identified
        assert!(!found.joint[&Dof::Ry].identified, "seed {seed}: {:?}", found.joint[&Dof::Ry]);
        assert!((0.6..1.15).contains(&found.chi_square_per_dof), "seed {seed}: {}", found.chi_square_per_dof);
    }
}

/// The scatter of redrawn hits agrees with the propagated noise, and is the same in every run.
#[test]
fn the_bootstrap_agrees_with_the_propagated_noise() {
    let (config, geometry) = (rigid_rig(180e6), geometry());
    let band = Band { low_hz: 400.0, high_hz: 460.0 };
    let ajb =
        measure_with_hits(&config, Configuration::Ajb, &geometry.ajb, QUIET, 1, [band.low_hz, band.high_hz]);
    let priors = Priors::default();
    let prepared = Prepared::of(&ajb.frf, &geometry, IdmSet::Six, band, &priors).expect("data");
    let interface = |sensor: &str| {
        geometry.ajb.channels.iter().any(|c| {
            c.description == sensor && matches!(c.grouping, Grouping::InterfaceA | Grouping::InterfaceB)
        })
    };
    let hit = |name: &str| {
        geometry
            .ajb
            .impacts
            .iter()
            .any(|p| p.name == name && matches!(p.grouping, Grouping::InterfaceA | Grouping::InterfaceB))
    };
    let cells: Vec<CellHits> =
        ajb.hits.into_iter().filter(|c| hit(&c.input) && interface(&c.outputs[0])).collect();
    let drawn = prepared.bootstrap(&cells, 200, 7).expect("every cell")[&Dof::Z];
    let propagated = prepared.estimate().joint[&Dof::Z].std_noise;
    // eight redrawn hits scatter by √(7/8); 200 replicates determine it to 5 %, eight hits
    // determine the variance to 10 %
    let ratio = drawn.std / propagated;
    assert!((0.7..1.3).contains(&ratio), "bootstrap {:.3e} against {propagated:.3e}", drawn.std);
    assert_eq!(prepared.bootstrap(&cells, 200, 7).expect("every cell")[&Dof::Z], drawn);
    assert!(prepared.bootstrap(&cells[1..], 10, 7).is_err());
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: the recommended estimate"]
fn table_of_the_recommended() {
    println!("table: recommended");
    println!("| estimate | contact | floor | mean | σ | covered | half width (median) | not identified |");
    println!("|---|---|---|---|---|---|---|---|");
    for (truth, floor) in cases() {
        let estimate = recommended(truth, floor);
        println!("{}", estimate.row("recommended", truth, floor));
        keeps_its_promise(&estimate, truth, floor);
    }
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: the fit"]
fn table_of_the_fit() {
    println!("table: fit");
    println!("| estimate | contact | floor | mean | σ | covered | half width (median) | not identified |");
    println!("|---|---|---|---|---|---|---|---|");
    for (truth, floor) in cases() {
        println!("{}", fitted(truth, floor).row("fit", truth, floor));
    }
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: every method"]
fn table_of_every_method() {
    println!("table: methods");
    println!("| method | floor | mean | σ over campaigns | interval of the lines' scatter covers |");
    println!("|---|---|---|---|---|");
    for floor in [QUIET, LOUD] {
        every_method(180e6, floor);
    }
}

/// All combinations of contact and noise floor.
fn cases() -> impl Iterator<Item = (f64, f64)> {
    [95e6, 180e6, 320e6].into_iter().flat_map(|truth| [QUIET, LOUD].map(|floor| (truth, floor)))
}

/// Each method line by line, six modes; its interval only contains the scatter of the lines.
fn every_method(truth: f64, floor: f64) {
    let (config, geometry) = (rigid_rig(truth), geometry());
    let found: Vec<_> = (1..=CAMPAIGNS)
        .into_par_iter()
        .map(|seed| {
            let c = campaign(&config, floor, seed, [BAND.low_hz, BAND.high_hz]);
            identify(&c.a.frf, &c.b.frf, &c.ajb.frf, &geometry, &Method::ALL, &[IdmSet::Six], &[BAND])
                .expect("data")
        })
        .collect();
    for method in Method::ALL {
        let k: Vec<_> = found
            .iter()
            .filter_map(|f| f.joint.iter().find(|row| row.method == method.name()))
            .map(|row| row.stiffness_n_per_m[&Dof::Z])
            .collect();
        let n = k.len() as f64;
        let mean = k.iter().map(|k| k.mean).sum::<f64>() / n;
        let std = (k.iter().map(|k| (k.mean - mean).powi(2)).sum::<f64>() / n).sqrt();
        let covers = |k: &&jointrig::substructuring::BandStatistic| {
            k.ci95.is_some_and(|c| c[0] <= truth && truth <= c[1])
        };
        println!(
            "| `{method}` | {:.2} | {:.0} | {:.0} | {} of {CAMPAIGNS} |",
            floor * 1e6,
            mean * 1e-6,
            std * 1e-6,
            k.iter().filter(covers).count()
        );
    }
}

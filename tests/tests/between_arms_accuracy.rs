//! How well the stiffness between the arms is found, through the whole chain: plan, firmware, rig, records, spectra, virtual points, estimate.
//! The truth is that of the rig's parameters.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::DEMO;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::drawn_campaigns::{campaigns, count};
use jointrig_tests::rigs::{Drawn, with_priors};

/// The paper's cells, three hits each.
fn plan(rig: &RigConfig) -> String {
    with_priors(DEMO, rig)
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: between the arms, whole campaigns"]
fn accuracy_of_the_stiffness_between_the_arms() {
    let (first, rigs, seeds) = (count("FIRST", 700), count("RIGS", 5), count("SEEDS", 1));
    let all = campaigns(first, rigs, seeds, Drawn::default(), |drawn| {
        let truth = drawn.rig().truth().between_arms_k_n_per_m;
        let arms = drawn.results(plan, |_, _, _| {}).answer.unwrap().between_arms;
        let row = format!("| {} | {} | {:.2} |", drawn.number, drawn.seed, 1e-6 * truth);
        let Some(k) = arms.k_n_per_m else {
            println!("{row} – | {} | {} |", arms.why, arms.basis);
            return None;
        };
        let [low, high] = k.ci95;
        let covers = (low..=high).contains(&truth);
        let [mean, low, high] = [k.mean, low, high].map(|k| 1e-6 * k);
        let missed = if covers { "" } else { ", missed" };
        println!("{row} {mean:.2} | {low:.2}…{high:.2}{missed} | {} |", arms.basis);
        Some((mean * 1e6 / truth - 1.0, 0.5 * (high - low) / mean, covers))
    });
    let found: Vec<_> = all.iter().flatten().collect();
    let covered = found.iter().filter(|(.., covers)| *covers).count();
    let rms = (found.iter().map(|(error, ..)| error * error).sum::<f64>() / found.len().max(1) as f64).sqrt();
    let mut half: Vec<f64> = found.iter().map(|(_, half, _)| *half).collect();
    half.sort_by(f64::total_cmp);
    println!(
        "table: between-arms-campaigns\n| campaigns | answers | covered | half width (median) | rms error | none |\n|---|---|---|---|---|---|\n\
         | {} | {} | {covered} of {} | {:.1} % | {:.1} % | {} |\n",
        all.len(),
        found.len(),
        found.len(),
        100.0 * half.get(half.len() / 2).copied().unwrap_or(f64::NAN),
        100.0 * rms,
        all.len() - found.len()
    );
    assert!(100 * covered >= 93 * found.len(), "{covered} of {} covered", found.len());
}

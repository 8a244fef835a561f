//! Accuracy of the stiffness between the arms, through the whole chain: plan, firmware, rig,
//! records, spectra, virtual points, estimate. The truth follows from the rig's parameters.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::DEMO;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::coverage::{Answer, COLUMNS, Coverage, print_table};
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
        let answer = Answer::new(k.mean, k.ci95, truth);
        let [mean, low, high] = [k.mean, k.ci95[0], k.ci95[1]].map(|k| 1e-6 * k);
        let missed = if answer.covers { "" } else { ", missed" };
        println!("{row} {mean:.2} | {low:.2}…{high:.2}{missed} | {} |", arms.basis);
        Some(answer)
    });
    let found = Coverage::of(&all.iter().flatten().copied().collect::<Vec<_>>());
    let row = format!("| {} | {} | {} |", all.len(), found.cells(), all.len() - found.answers);
    print_table("between-arms-campaigns", &format!("campaigns | {COLUMNS} | no answer"), &[row]);
    assert!(100 * found.covered >= 93 * found.answers, "{found:?}");
}

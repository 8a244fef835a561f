//! Accuracy of the contact's own stiffness, through the whole chain: plan, firmware, rig, records,
//! spectra, estimate. The truth follows from the rig's parameters.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::contact::Interval;
use jointrig::results::Results;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::campaign::one_second;
use jointrig_tests::coverage::{Answer, COLUMNS, Coverage, print_table};
use jointrig_tests::drawn_campaigns::{DrawnCampaign, campaigns, count, each_of, found};
use jointrig_tests::rigs::{Drawn, Elastic, by_hand_plan, contact_plan};
use jointrig_tests::slip_truth::slid;
use std::path::Path;

/// A truth, and its estimate.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    truth: f64,
    /// With its interval.
    found: Option<[f64; 3]>,
}

impl Estimate {
    fn new(truth: f64, found: Option<&Interval>) -> Self {
        Estimate { truth, found: found.map(|k| [k.mean, k.ci95[0], k.ci95[1]]) }
    }

    fn answer(&self) -> Option<Answer> {
        self.found.map(|[mean, low, high]| Answer::new(mean, [low, high], self.truth))
    }

    /// Whether the interval covers the truth, or there is no estimate.
    fn covers(&self) -> bool {
        self.answer().is_none_or(|answer| answer.covers)
    }
}

/// The plan for a rig.
type Plan = fn(&RigConfig) -> String;

/// Estimates of one campaign with the truth.
#[derive(Debug, Clone)]
struct Row {
    rig: u64,
    /// k_T, N/m.
    stiffness: Estimate,
    /// c_T, N s/m.
    damping: Estimate,
    why: String,
    /// Whether the analysis reports that the contact slips under the hammer.
    slips: Option<bool>,
}

fn row(campaign: DrawnCampaign, results: Results) -> Row {
    let answer = results.answer.unwrap();
    let contact = answer.contact;
    let truth = campaign.rig().truth();
    Row {
        rig: campaign.number,
        stiffness: Estimate::new(truth.contact_k_t_n_per_m, contact.k_t_n_per_m.as_ref()),
        damping: Estimate::new(truth.contact_c_t_n_s_per_m, contact.c_t_n_s_per_m.as_ref()),
        why: contact.why,
        slips: answer.slip.found,
    }
}

/// Runs a campaign with `contact.toml` and prints its row when it ends.
fn told(campaign: DrawnCampaign) -> Row {
    told_of(campaign, contact_plan)
}

/// Runs a campaign and prints its row when it ends.
fn told_of(campaign: DrawnCampaign, plan: Plan) -> Row {
    let row = row(campaign, campaign.results(plan, |_, _, _| {}));
    let own = row.stiffness;
    let told = match own.found {
        Some([k, low, high]) => format!(
            "{:6.1} [{:6.1}, {:6.1}]  {:+5.1} % {}",
            1e-6 * k,
            1e-6 * low,
            1e-6 * high,
            100.0 * (k / own.truth - 1.0),
            if own.covers() { "" } else { "MISSED" }
        ),
        None => row.why.clone(),
    };
    let (rig, seed, truth) = (campaign.number, campaign.seed, 1e-6 * own.truth);
    println!("rig {rig:2} seed {seed}: truth {truth:6.1}, found {told}");
    row
}

fn coverage(all: impl Iterator<Item = Estimate>) -> Coverage {
    Coverage::of(&all.filter_map(|estimate| estimate.answer()).collect::<Vec<_>>())
}

/// Column headings of a table of estimates, with the heading of its first column.
fn columns(first: &str) -> String {
    format!("{first} | campaigns | {COLUMNS} | no answer")
}

/// The rows of k_T and of c_T.
fn lines(name: &str, rows: &[Row]) -> [String; 2] {
    let line = |name: &str, found: Coverage| {
        format!("| {name} | {} | {} | {} |", rows.len(), found.cells(), rows.len() - found.answers)
    };
    let damping = format!("{name}: c_T");
    [
        line(name, coverage(rows.iter().map(|row| row.stiffness))),
        line(&damping, coverage(rows.iter().map(|row| row.damping))),
    ]
}

/// Removes the known parameters of the simulator from a campaign file.
fn forget_the_truth(file: &Path) {
    assert!(Store::open_read_only(file).unwrap().simulated_truth().unwrap().is_some());
    let database = rusqlite::Connection::open(file).unwrap();
    assert_eq!(database.execute("DELETE FROM meta WHERE key LIKE 'simulated_%'", ()).unwrap(), 2);
    drop(database);
    assert!(Store::open_read_only(file).unwrap().simulated_truth().unwrap().is_none());
}

/// The contact plan with records of one second instead of two, for the tests that always run.
fn short_records(rig: &RigConfig) -> String {
    one_second(&contact_plan(rig))
}

#[test]
fn the_contacts_own_stiffness_is_found_on_rigs_that_nobody_tuned_for() {
    // One rig with a flexible clamp on each side, and one with a clamp on A alone.
    let like = Drawn::default();
    let folder = tempfile::tempdir().unwrap();
    let rows = std::thread::scope(|scope| {
        let one = |number| {
            let campaign = DrawnCampaign { number, seed: 0, like };
            let file = campaign.measured(folder.path(), short_records, |_, _, _| {});
            let results = found(&file);
            forget_the_truth(&file);
            let blind = found(&file);
            assert!(!blind.source.settings.contains_key("rig") && blind.source.simulated);
            // the rig's identity is removed as well; all results must be the same
            let blind = Results { source: results.source.clone(), ..blind };
            assert!(blind == results, "an estimate of rig {number} saw the truth");
            row(campaign, results)
        };
        [30, 31].map(|number| scope.spawn(move || one(number))).map(|thread| thread.join().unwrap())
    });
    let Coverage { answers, covered, rms, half } = coverage(rows.iter().map(|row| row.stiffness));
    assert_eq!((covered, answers), (rows.len(), rows.len()), "{rows:?}");
    // the position errors of spots and points leave 2.5 % rms; the limit allows for the scatter of
    // two draws
    assert!(rms < 0.06 && half < 0.15, "{rows:?}");
}

#[test]
fn the_bulk_of_specimens_that_bend_is_not_taken_for_the_contact() {
    // an aluminium specimen, about which the plan states nothing
    let like = Drawn { elastic: Some(Elastic::SpecimensAndArms), ..Drawn::default() };
    let campaign = DrawnCampaign { number: 1001, seed: 0, like };
    let row = row(campaign, campaign.results(short_records, |_, _, _| {}));
    let Estimate { truth, found } = row.stiffness;
    let [_, low, high] = found.unwrap_or_else(|| panic!("{row:?}"));
    assert!(low <= truth && truth <= high && high - low < 0.4 * truth, "{row:?}");
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: specimens that bend"]
fn contacts_of_specimens_that_bend() {
    let (first, rigs) = (count("FIRST", 2000), count("RIGS", 18));
    let mut rows = Vec::new();
    for (name, which) in
        [("specimens", Elastic::Specimens), ("specimens and arms", Elastic::SpecimensAndArms)]
    {
        println!("{name} bend");
        let like = Drawn { elastic: Some(which), ..Drawn::default() };
        rows.extend(lines(name, &campaigns(first, rigs, 1, like, told)));
    }
    print_table("bending", &columns("what bends"), &rows);
}

/// Hits of about 50 N with a slip limit of 15 N.
const MAY_SLIP: Drawn = Drawn {
    slip_limit_n: Some(15.0),
    stiffest_n_per_m: 300e6,
    errors: 1.0,
    gain: 0.005,
    accelerometers: false,
    elastic: None,
};

/// From rig number `first` on, the first `each` rigs that slip under the hammer, and the first
/// `each` that stick.
fn slipping_and_stuck(first: u64, each: usize) -> [Vec<DrawnCampaign>; 2] {
    let [mut slipping, mut stuck] = [Vec::new(), Vec::new()];
    for number in first.. {
        let campaign = DrawnCampaign { number, seed: 0, like: MAY_SLIP };
        let slid = slid(&campaign);
        let kind = if slid.iter().any(|hit| hit.path > 0.0) { &mut slipping } else { &mut stuck };
        if kind.len() < each {
            kind.push(campaign);
            let paths: Vec<String> = slid.iter().map(|hit| format!("{:.3}", hit.path)).collect();
            println!("rig {number}: slides {} of its elastic travel", paths.join(", "));
        }
        if slipping.len() + stuck.len() == 2 * each {
            break;
        }
    }
    [slipping, stuck]
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: contacts that may slip"]
fn a_contact_that_may_slip_has_its_stuck_stiffness_or_none() {
    let kinds = slipping_and_stuck(count("FIRST", 400), count("EACH", 50) as usize);
    let slipping_rigs: Vec<u64> = kinds[0].iter().map(|campaign| campaign.number).collect();
    let rows = each_of(&kinds.concat(), |campaign| {
        let row = told(campaign);
        println!("rig {}: called {:?}", row.rig, row.slips);
        row
    });
    let (slipping, stuck): (Vec<&Row>, Vec<&Row>) =
        rows.iter().partition(|row| slipping_rigs.contains(&row.rig));
    let mut lines = Vec::new();
    for (name, rows) in [("slip", &slipping), ("stick", &stuck)] {
        let told = |slips| rows.iter().filter(|row| row.slips == slips).count();
        let none = rows.iter().filter(|row| row.stiffness.found.is_none()).count();
        let covered =
            rows.iter().filter(|row| row.stiffness.found.is_some() && row.stiffness.covers()).count();
        lines.push(format!(
            "| {name} | {} | {} | {} | {} | {none} | {covered} | {} |",
            rows.len(),
            told(Some(true)),
            told(Some(false)),
            told(None),
            rows.len() - none - covered
        ));
    }
    let columns = "contacts that | campaigns | called slipping | called stuck | not told | no k_T | the stuck k_T covered | missed";
    print_table("slip", columns, &lines);
    let right = slipping.iter().filter(|row| row.slips == Some(true)).count()
        + stuck.iter().filter(|row| row.slips == Some(false)).count();
    assert!(20 * right >= 19 * rows.len(), "{rows:?}");
    // only the stuck stiffness may be called k_T
    let other = rows.iter().filter(|row| !row.stiffness.covers()).count();
    assert!(20 * other <= rows.len().max(20), "{rows:?}");
}

/// The first `rigs` numbers from `first` on whose rigs have no clamp on side B.
fn without_clamp_b(first: u64, rigs: u64) -> Vec<u64> {
    (first..).filter(|number| !number.is_multiple_of(3)).take(rigs as usize).collect()
}

/// Median of the intervals' half widths relative to the estimates.
fn median_half_width(rows: &[Row]) -> f64 {
    let half = |row: &Row| row.stiffness.found.map(|[mean, low, high]| 0.5 * (high - low) / mean);
    let mut all: Vec<f64> = rows.iter().filter_map(half).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: accelerometers"]
fn accelerometers_in_place_of_lasers() {
    let numbers = without_clamp_b(count("FIRST", 700), count("RIGS", 20));
    let lasers = Drawn::default();
    let like = Drawn { accelerometers: true, ..lasers };
    let kinds: [(&str, Drawn, Plan); 2] = [
        ("accelerometers, hits by hand: `contact-by-hand.toml`", like, by_hand_plan),
        ("lasers on the same rigs: `contact.toml`", lasers, contact_plan),
    ];
    let mut found = Vec::new();
    let kinds = kinds.iter().enumerate().filter(|(n, _)| count("PLAN", *n as u64) == *n as u64);
    for (_, (name, like, plan)) in kinds {
        println!("{name}");
        let like = *like;
        let wanted: Vec<DrawnCampaign> =
            numbers.iter().map(|number| DrawnCampaign { number: *number, seed: 0, like }).collect();
        found.push((name, each_of(&wanted, |campaign| told_of(campaign, *plan))));
    }
    let rows: Vec<String> = found.iter().flat_map(|(name, rows)| lines(name, rows)).collect();
    print_table("accelerometers", &columns("sensors"), &rows);
    let widths: Vec<f64> = found.iter().map(|(_, rows)| median_half_width(rows)).collect();
    println!("median half widths: {widths:?}");
    let missed = found[0].1.iter().filter(|row| !row.stiffness.covers()).count();
    // of 20 intervals of 95 % three or fewer miss with a probability of 98 %
    assert!(missed <= 3, "{:?}", found[0].1);
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: the answer"]
fn accuracy_of_the_contacts_own_stiffness() {
    let drawn = Drawn::default();
    // name, first rig, parameters of the draw, campaigns on each rig
    let mut kinds = vec![
        ("default", 0, drawn, 3),
        ("half of them, gains exact", 100, Drawn { errors: 0.5, gain: 0.0, ..drawn }, 3),
        ("twice as large, gains of 1 %", 300, Drawn { errors: 2.0, gain: 0.01, ..drawn }, 3),
        ("default, gains of 1 %", 500, Drawn { gain: 0.01, ..drawn }, 1),
        ("default, contacts to 600 N/µm", 200, Drawn { stiffest_n_per_m: 600e6, ..drawn }, 1),
    ];
    // FIRST selects one of them by its first rig
    if let Some(only) = std::env::var("FIRST").ok().map(|text| text.parse::<u64>().unwrap()) {
        kinds.retain(|(_, first, ..)| *first == only);
    }
    let mut rows = Vec::new();
    for (name, first, like, seeds) in kinds {
        let told = campaigns(first, count("RIGS", 24), count("SEEDS", seeds), like, told);
        rows.extend(lines(name, &told));
        println!("{}", rows.join("\n"));
    }
    print_table("contact", &columns("errors"), &rows);
}
